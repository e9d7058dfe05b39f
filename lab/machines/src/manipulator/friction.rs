//! True friction of the arm's joints. It differs from all models that are fitted to it.
//!
//! Each joint has three parallel elastoplastic elements (Dahl's law with an exponent):
//! `z' = v (1 - sgn(v z) |k z / (w g)|^n)` with shares `w` of the level. The stiffnesses differ widely, so that the
//! joint yields gradually, like a bearing in parallel with a bent rubber muscle.
//!
//! The level `g` falls with speed by a Stribeck curve of exponent 1. It rises with the pull of both muscles, which loads
//! the bearings, and depends on the direction. The viscous friction thins with speed.
//!
//! The viscous coefficients are in the order of the paper's results: about 1.5, 3 and 0.15 Nm s/rad.

/// Number of parallel elements.
pub const ELEMENTS: usize = 3;

/// Friction of a joint, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Level in fast sliding at the pull of 550 kPa in both muscles, Nm.
    pub coulomb_nm: f64,
    /// Level at rest and the same pull, Nm.
    pub static_nm: f64,
    /// Speed at which the difference has fallen to 1/e, rad/s.
    pub stribeck_rad_s: f64,
    /// Viscous coefficient at rest, Nm s/rad.
    pub viscous: f64,
    /// Speed scale of the thinning, rad/s. The coefficient is there 0.84 of that at rest.
    pub thinning_rad_s: f64,
    /// Relative increase of the level in positive direction, and decrease in negative direction.
    pub asymmetry: f64,
    /// Share of the level that is proportional to the pull of the muscles.
    pub by_pull: f64,
    /// Stiffness of each element, Nm/rad.
    pub stiffness: [f64; ELEMENTS],
}

/// Share of each element in the level.
const SHARES: [f64; ELEMENTS] = [0.5, 0.3, 0.2];

/// Exponent of the yielding. 1 is Dahl's law.
const SHARPNESS: i32 = 2;

/// Friction of the three joints.
pub const JOINTS: [Friction; 3] = [
    Friction {
        coulomb_nm: 0.10,
        static_nm: 0.15,
        stribeck_rad_s: 0.06,
        viscous: 1.5,
        thinning_rad_s: 1.5,
        asymmetry: 0.06,
        by_pull: 0.4,
        stiffness: [60.0, 15.0, 4.0],
    },
    Friction {
        coulomb_nm: 0.35,
        static_nm: 0.50,
        stribeck_rad_s: 0.05,
        viscous: 3.2,
        thinning_rad_s: 1.0,
        asymmetry: 0.05,
        by_pull: 0.4,
        stiffness: [300.0, 80.0, 20.0],
    },
    Friction {
        coulomb_nm: 0.06,
        static_nm: 0.09,
        stribeck_rad_s: 0.08,
        viscous: 0.16,
        thinning_rad_s: 1.5,
        asymmetry: 0.08,
        by_pull: 0.4,
        stiffness: [40.0, 10.0, 3.0],
    },
];

impl Friction {
    /// Returns the level, Nm, at a speed (rad/s) and a pull relative to that of 550 kPa in both muscles.
    fn level(&self, velocity: f64, pull: f64) -> f64 {
        let excess =
            (self.static_nm - self.coulomb_nm) * (-velocity.abs() / self.stribeck_rad_s).exp();
        let loaded = 1.0 - self.by_pull + self.by_pull * pull;
        (self.coulomb_nm + excess) * loaded * (1.0 + self.asymmetry * velocity.signum())
    }

    /// Returns the rates of the elements' deflections, rad/s.
    pub fn rates(&self, z: [f64; ELEMENTS], velocity: f64, pull: f64) -> [f64; ELEMENTS] {
        let level = self.level(velocity, pull);
        std::array::from_fn(|i| {
            let share = self.stiffness[i] * z[i] / (SHARES[i] * level);
            let yielding = (velocity * z[i]).signum() * share.abs().powi(SHARPNESS);
            velocity * (1.0 - yielding)
        })
    }

    /// Returns the friction torque, Nm, positive against positive velocity.
    pub fn torque_nm(&self, z: [f64; ELEMENTS], velocity: f64) -> f64 {
        let held: f64 = (0..ELEMENTS).map(|i| self.stiffness[i] * z[i]).sum();
        let thinned = (1.0 + (velocity / self.thinning_rad_s).powi(2)).sqrt().sqrt();
        held + self.viscous * velocity / thinned
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slide(velocity: f64) -> f64 {
        let (mut z, dt) = ([0.0; ELEMENTS], 1e-4);
        for _ in 0..200_000 {
            let rates = JOINTS[1].rates(z, velocity, 1.0);
            z = std::array::from_fn(|i| z[i] + dt * rates[i]);
        }
        JOINTS[1].torque_nm(z, velocity)
    }

    #[test]
    fn torque_in_steady_sliding_is_level_plus_viscous_part() {
        let viscous = |v: f64| 3.2 * v / (1.0 + v * v).powf(0.25);
        let level = |v: f64| {
            (0.35 + 0.15 * (-v.abs() / 0.05_f64).exp()) * (1.0 + 0.05 * v.signum()) * v.signum()
        };
        for velocity in [-0.5, -0.02, 0.02, 0.5] {
            let expected = level(velocity) + viscous(velocity);
            assert!((slide(velocity) - expected).abs() < 1e-6, "{velocity}");
        }
    }

    #[test]
    fn torque_in_small_oscillation_dissipates_energy() {
        let (mut z, mut work, dt) = ([0.0; ELEMENTS], 0.0, 1e-4);
        for step in 0..40_000 {
            let velocity = 0.02 * (f64::from(step) * dt * std::f64::consts::TAU).cos();
            let rates = JOINTS[0].rates(z, velocity, 1.0);
            z = std::array::from_fn(|i| z[i] + dt * rates[i]);
            work += dt * velocity * (JOINTS[0].torque_nm(z, velocity) - 1.5 * velocity);
        }
        assert!(work > 1e-5, "{work}");
    }
}
