//! The differential equation of a [`Seal`], integrated by Runge-Kutta steps over time: the reference of other integrators.
//!
//! A test program includes this file with `#[path]`, in a module that has a `Seal` above it.

use super::Seal;

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

/// Returns `dz/dt`, rad/s.
fn rate(seal: &Seal, z: f64, s: &Surroundings) -> f64 {
    let added = seal.per_pressure * s.pressure + seal.per_force * s.force;
    let ratio = s.velocity / seal.stribeck_rad_s;
    let excess = (seal.static_nm - seal.coulomb_nm) * (-ratio * ratio).exp();
    let level = seal.coulomb_nm + added + excess;
    s.velocity - seal.k0 * s.velocity.abs() * z / level + seal.eta3 * s.force_rate
}

/// Returns the friction torque, Nm.
pub fn torque(seal: &Seal, z: f64, s: &Surroundings) -> f64 {
    seal.k0 * z + seal.k1 * rate(seal, z, s) + seal.k2 * s.velocity
}

/// Integrates `z` by `dt` (s) with the classic fourth-order Runge-Kutta method.
///
/// `at` returns the operating conditions at a time. The method is stable for `k0 |v| dt / g < 2.78`.
pub fn advance(seal: &Seal, z: f64, t: f64, dt: f64, at: impl Fn(f64) -> Surroundings) -> f64 {
    let (begin, middle, end) = (at(t), at(t + 0.5 * dt), at(t + dt));
    let a = rate(seal, z, &begin);
    let b = rate(seal, z + 0.5 * dt * a, &middle);
    let c = rate(seal, z + 0.5 * dt * b, &middle);
    let d = rate(seal, z + dt * c, &end);
    z + dt / 6.0 * (a + 2.0 * (b + c) + d)
}

#[cfg(test)]
mod equation_tests {
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
                z = advance(&SEAL, z, f64::from(step) * 5e-6, 5e-6, |_| s);
            }
            let excess = 0.7 * f64::exp(-(velocity / 0.1_f64).powi(2));
            let expected = (1.5 + 0.3 + 0.2 + excess) * velocity.signum() + 0.05 * velocity;
            assert!((torque(&SEAL, z, &s) - expected).abs() < 1e-9, "{velocity}");
        }
    }

    #[test]
    fn advance_with_half_the_step_gives_the_same_result() {
        let at = |t: f64| steady(0.3 * (20.0 * t).sin());
        let run = |steps: u32| {
            let dt = 0.5 / f64::from(steps);
            (0..steps).fold(0.0, |z, step| advance(&SEAL, z, f64::from(step) * dt, dt, at))
        };
        assert!((SEAL.k0 * (run(50_000) - run(100_000))).abs() < 1e-9);
    }
}
