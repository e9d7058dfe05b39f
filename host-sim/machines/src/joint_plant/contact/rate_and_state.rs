//! Rate-and-state friction: an elastic contact in series with an interface that strengthens with its age.
//!
//! ```text
//! torque = level * a * asinh(s / (2 V) * exp((1 + b ln(1 + V age / D)) / a))       s: slip rate of the interface
//! d(torque)/dt = stiffness * (velocity - s)
//! d(age)/dt = 1 - |s| age / D
//! ```
//! - Dieterich, "Modeling of rock friction 1", J. Geophys. Res. 84 (1979), and Ruina, "Slip instability and state variable
//!   friction laws", J. Geophys. Res. 88 (1983): the law of rate and state, and its ageing form.
//! - Rice, Lapusta and Ranjith, "Rate and state dependent friction and the stability of sliding between elastically
//!   deformable solids", J. Mech. Phys. Solids 49 (2001): the regularisation by arcsinh, valid through rest and reversal.
//! - Okubo, "Dynamic rupture modeling with laboratory-derived constitutive relations", J. Geophys. Res. 94 (1989): the
//!   cut-off speed, above which the weakening ends.
//!
//! The step is backward Euler in the torque, which is unconditionally stable and dissipative: the interface has the sign
//! of its slip. The age follows exactly for a constant slip rate.

use crate::joint_plant::parameters::Parameters;

/// Share of the direct effect in the effect of the state: below 1, sliding weakens with speed.
const DIRECT_SHARE: f64 = 0.2;
/// Smallest direct effect: the exponent of the law must stay within double precision.
const DIRECT_MIN: f64 = 6e-3;
/// State of a contact of one second, ln(1 + V age / D), about: it has the static level.
const STATE_OF_A_SECOND: f64 = 5.0;
/// Iterations of Newton's method. It converges from above, quadratically.
const ITERATIONS: usize = 12;
/// Relative change at which they end.
const TOLERANCE: f64 = 1e-10;
/// Age at the start, s: a joint that has rested.
const START_AGE_S: f64 = 10.0;

/// The contact and its state.
#[derive(Clone, Debug)]
pub struct RateAndState {
    direct: f64,
    evolution: f64,
    /// Cut-off speed, rad/s, and travel of the state, rad.
    cut_off: f64,
    travel: f64,
    stiffness: f64,
    torque: f64,
    age: f64,
}

impl RateAndState {
    /// Creates a contact at rest.
    pub fn new(p: &Parameters, unit_nm: f64) -> Self {
        let evolution = (p.friction_static / p.friction_kinetic - 1.0) / STATE_OF_A_SECOND;
        Self {
            direct: (DIRECT_SHARE * evolution).max(DIRECT_MIN),
            evolution,
            cut_off: p.stribeck_velocity_rad_s,
            travel: unit_nm * p.friction_kinetic / p.presliding_stiffness_nm_per_rad,
            stiffness: p.presliding_stiffness_nm_per_rad,
            torque: 0.0,
            age: START_AGE_S,
        }
    }

    /// Returns the elastic energy, J.
    #[cfg(test)]
    pub fn energy_j(&self) -> f64 {
        0.5 * self.torque * self.torque / self.stiffness
    }

    /// Integrates by `dt` (s) with this level, Nm, and returns the torque, Nm.
    pub fn step(&mut self, level: f64, velocity: f64, dt: f64) -> f64 {
        let trial = self.torque + self.stiffness * velocity * dt;
        let state = (self.cut_off * self.age / self.travel).ln_1p();
        let strength = (-(1.0 + self.evolution * state) / self.direct).exp();
        // Solves `linear * u + slip * sinh(u) = |trial|` for u = torque / linear.
        let linear = level.max(1e-6) * self.direct;
        let slip = self.stiffness * dt * 2.0 * self.cut_off * strength;
        let (u, sinh) = solve(linear, slip, trial.abs());
        self.torque = (linear * u).copysign(trial);
        let slipped = 2.0 * self.cut_off * strength * sinh * dt / self.travel;
        let grown = if slipped > 1e-6 { -(-slipped).exp_m1() / slipped } else { 1.0 };
        self.age = self.age * (-slipped).exp() + dt * grown;
        self.torque
    }
}

/// Returns the solution of `linear * u + slip * sinh(u) = trial` for positive coefficients, and its sinh.
fn solve(linear: f64, slip: f64, trial: f64) -> (f64, f64) {
    // Each term alone gives an upper bound, from which Newton's method descends: the function is convex.
    let mut u = (trial / linear).min((trial / slip).asinh());
    let mut sinh = 0.0;
    for _ in 0..ITERATIONS {
        let exp = u.exp();
        let (cosh, inverse) = (0.5 * (exp + 1.0 / exp), 1.0 / exp);
        sinh = 0.5 * (exp - inverse);
        let change = (linear * u + slip * sinh - trial) / (linear + slip * cosh);
        u -= change;
        if change.abs() <= TOLERANCE * u {
            break;
        }
    }
    (u, sinh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solve_meets_the_equation_from_stick_to_slip() {
        for linear in [1e-3, 0.02, 0.3] {
            for slip in [1e-120, 1e-30, 1e-6, 1.0] {
                for trial in [0.0, 1e-9, 0.5, 3.0] {
                    let (u, _) = solve(linear, slip, trial);
                    let found = linear * u + slip * u.sinh();
                    assert!(
                        (found - trial).abs() <= 1e-8 * trial + 1e-15,
                        "{linear} {slip} {trial}"
                    );
                }
            }
        }
    }

    #[test]
    fn contact_after_a_longer_rest_breaks_away_later() {
        let p = Parameters::default();
        let breakaway = |rest_s: f64| {
            let mut contact = RateAndState::new(&p, 12.0);
            let dt = 25e-6;
            (0..20_000).for_each(|_| _ = contact.step(1.44, 0.05, dt));
            contact.age += rest_s;
            contact.torque = 0.0;
            (0..2000).map(|_| contact.step(1.44, 0.05, dt)).fold(0.0, f64::max)
        };
        let (short, long) = (breakaway(0.1), breakaway(100.0));
        // Three decades of 2.3 b each.
        let expected = 1.44 * RateAndState::new(&p, 12.0).evolution * 1000f64.ln();
        assert!(((long - short) / expected - 1.0).abs() < 0.2, "{short} {long} {expected}");
    }
}
