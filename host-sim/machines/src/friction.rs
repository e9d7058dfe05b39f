//! The seal's friction as a differential equation (Ding et al., eq. 16 with the corrections).
//!
//! ```text
//! z' = v - k0 |v| z / g(v) + eta3 dF_L/dt
//! F  = k0 z + k1 z' + k2 v
//! g  = F_C' + (F_S' - F_C') exp(-(v/v_s)^2)
//! ```
//!
//! Side load and pressure raise both levels equally. In the paper, the absolute value is missing and only `F_C` depends
//! on the load.

/// True parameters of the seal, SI units, with the names of the paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seal {
    /// Bristle stiffness, Nm/rad.
    pub k0: f64,
    /// Bristle damping, Nm s/rad.
    pub k1: f64,
    /// Viscous coefficient, Nm s/rad.
    pub k2: f64,
    /// Coulomb torque, Nm.
    pub coulomb_nm: f64,
    /// Static torque, Nm.
    pub static_nm: f64,
    /// Stribeck velocity, rad/s.
    pub stribeck_rad_s: f64,
    /// Levels per pressure difference, Nm/Pa.
    pub per_pressure: f64,
    /// Levels per side load, Nm/N.
    pub per_force: f64,
    /// Bristle travel per side load, rad/N.
    pub eta3: f64,
}

/// Operating conditions of the seal at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Side load, N.
    pub force: f64,
    /// Rate of the side load, N/s.
    pub force_rate: f64,
    /// Pressure difference, Pa.
    pub pressure: f64,
}

impl Seal {
    /// Returns the level `g`, Nm.
    fn level(&self, s: &Surroundings) -> f64 {
        let added = self.per_pressure * s.pressure + self.per_force * s.force;
        let ratio = s.velocity / self.stribeck_rad_s;
        let excess = (self.static_nm - self.coulomb_nm) * (-ratio * ratio).exp();
        self.coulomb_nm + added + excess
    }

    /// Returns `dz/dt`, rad/s.
    pub fn rate(&self, z: f64, s: &Surroundings) -> f64 {
        s.velocity - self.k0 * s.velocity.abs() * z / self.level(s) + self.eta3 * s.force_rate
    }

    /// Returns the friction torque, Nm.
    pub fn torque(&self, z: f64, s: &Surroundings) -> f64 {
        self.k0 * z + self.k1 * self.rate(z, s) + self.k2 * s.velocity
    }

    /// Integrates `z` by `dt` (s) with the classic fourth-order Runge-Kutta method.
    ///
    /// `at` returns the operating conditions at a time. The method is stable for `k0 |v| dt / g < 2.78`.
    pub fn advance(&self, z: f64, t: f64, dt: f64, at: impl Fn(f64) -> Surroundings) -> f64 {
        let (begin, middle, end) = (at(t), at(t + 0.5 * dt), at(t + dt));
        let a = self.rate(z, &begin);
        let b = self.rate(z + 0.5 * dt * a, &middle);
        let c = self.rate(z + 0.5 * dt * b, &middle);
        let d = self.rate(z + dt * c, &end);
        z + dt / 6.0 * (a + 2.0 * (b + c) + d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEAL: Seal = Seal {
        k0: 1e4,
        k1: 20.0,
        k2: 0.05,
        coulomb_nm: 1.5,
        static_nm: 2.2,
        stribeck_rad_s: 0.1,
        per_pressure: 2e-6,
        per_force: 0.01,
        eta3: 1e-6,
    };

    fn steady(velocity: f64) -> Surroundings {
        Surroundings { velocity, force: 30.0, force_rate: 0.0, pressure: 1e5 }
    }

    #[test]
    fn torque_in_steady_sliding_is_level_plus_viscous_part() {
        for velocity in [-3.0, -0.05, 0.02, 1.0] {
            let s = steady(velocity);
            let mut z = 0.0;
            for step in 0..200_000 {
                z = SEAL.advance(z, f64::from(step) * 5e-6, 5e-6, |_| s);
            }
            let excess = 0.7 * f64::exp(-(velocity / 0.1_f64).powi(2));
            let expected = (1.5 + 0.3 + 0.2 + excess) * velocity.signum() + 0.05 * velocity;
            assert!((SEAL.torque(z, &s) - expected).abs() < 1e-9, "{velocity}");
        }
    }

    #[test]
    fn advance_with_half_the_step_gives_the_same_result() {
        let at = |t: f64| steady(0.3 * (20.0 * t).sin());
        let run = |steps: u32| {
            let dt = 0.5 / f64::from(steps);
            (0..steps).fold(0.0, |z, step| SEAL.advance(z, f64::from(step) * dt, dt, at))
        };
        assert!((SEAL.k0 * (run(50_000) - run(100_000))).abs() < 1e-9);
    }
}
