//! Effects of a [`Joint`] on the friction of the driven plant.
//!
//! The plant has a contact of its own in the place of the joint's bristles. What the joint adds to the level acts on that
//! contact, and its additive torques act at the output shaft.

use super::around::Around;
use crate::joint::Joint;

/// Time after which a drift ends, s: about that of a session.
pub const DRIFT_S: f64 = 480.0;

/// Effects on the friction of the seal, with their states.
#[derive(Clone, Debug)]
pub(super) struct LevelEffects {
    joint: Joint,
    state: State,
}

/// Slow states of the effects.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    time_s: f64,
    age_s: f64,
    heat_j: f64,
    /// Factor of the level by drift and heat, and level by the age, Nm.
    factor: f64,
    aged_nm: f64,
}

impl Default for State {
    fn default() -> Self {
        Self { time_s: 0.0, age_s: 0.0, heat_j: 0.0, factor: 1.0, aged_nm: 0.0 }
    }
}

/// Change of the seal's friction in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelChange {
    /// Factor of the level, and of the viscous torque.
    pub factor: f64,
    pub viscous_factor: f64,
    /// Addition to the level, Nm.
    pub raised_nm: f64,
    /// Addition to the velocity that shears the contact, rad/s.
    pub sheared_rad_s: f64,
}

impl LevelChange {
    /// No change. Factors of 1 and sums with 0 leave the friction bit for bit the same.
    pub const NONE: Self =
        Self { factor: 1.0, viscous_factor: 1.0, raised_nm: 0.0, sheared_rad_s: 0.0 };
}

impl LevelEffects {
    /// Creates the effects of a joint at the start of its service.
    pub fn of(joint: Joint) -> Self {
        Self { joint, state: State::default() }
    }

    /// Advances the age of the contact by `dt` (s) and returns the change at this velocity (rad/s) and position (rad).
    /// `load_rate` is that of the side load, N/s.
    pub(super) fn step(
        &mut self,
        velocity: f64,
        position: f64,
        around: &Around,
        load_rate: f64,
        dt: f64,
    ) -> LevelChange {
        let Self { joint, state } = self;
        if let Some(dwell) = &joint.dwell {
            let lost = (velocity.abs() * dt / dwell.travel_rad).min(1.0);
            state.age_s = (state.age_s + dt) * (1.0 - lost);
        }
        let ripple = joint.ripple.map_or(0.0, |wave| wave.at(position));
        let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
        let side = 1.0 + joint.asymmetry * direction;
        LevelChange {
            factor: state.factor * (1.0 + ripple) * side,
            viscous_factor: side,
            raised_nm: joint.seal.per_force * around.radial_force_n.abs()
                + joint.seal.per_pressure * around.pressure_diff_pa.max(0.0)
                + state.aged_nm,
            sheared_rad_s: joint.seal.eta3 * load_rate,
        }
    }

    /// Advances the slow states by `dt` (s) with this friction power, W.
    pub(super) fn advance(&mut self, power_w: f64, dt: f64) {
        let Self { joint, state } = self;
        state.time_s = (state.time_s + dt).min(DRIFT_S);
        state.aged_nm = joint.dwell.map_or(0.0, |dwell| dwell.raised_nm(state.age_s));
        state.factor = joint.drift.map_or(1.0, |drift| drift.factor(state.time_s));
        if let Some(warming) = joint.warming {
            state.heat_j += dt * (power_w - state.heat_j / warming.cooling_s);
            state.factor *= warming.factor(state.heat_j);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Drift, Dwell, Warming};
    use crate::friction::Seal;

    const DT: f64 = 1e-3;

    fn level_after(effects: &mut LevelEffects, seconds: f64, velocity: f64, power_w: f64) -> f64 {
        let around = Around::default();
        let mut change = LevelChange::NONE;
        for _ in 0..(seconds / DT) as usize {
            change = effects.step(velocity, 0.0, &around, 0.0, DT);
            effects.advance(power_w, DT);
        }
        change.factor + change.raised_nm
    }

    #[test]
    fn default_effects_change_nothing() {
        let mut effects = LevelEffects::of(Joint::default());
        let around = Around { radial_force_n: 50.0, pressure_diff_pa: 2e5, ..Around::default() };
        assert_eq!(effects.step(-1.0, 0.3, &around, 100.0, DT), LevelChange::NONE);
        effects.advance(5.0, DT);
        assert_eq!(effects.step(1.0, 0.3, &around, -100.0, DT), LevelChange::NONE);
    }

    #[test]
    fn ageing_grows_with_the_logarithm_of_the_rest_and_is_lost_over_its_travel() {
        let dwell = Some(Dwell { gain_nm: 0.2, onset_s: 0.1, travel_rad: 0.01 });
        let mut effects = LevelEffects::of(Joint { dwell, ..Joint::default() });
        let rested = level_after(&mut effects, 10.0, 0.0, 0.0);
        assert!((rested - 1.0 - 0.2 * 101f64.ln()).abs() < 1e-3, "{rested}");
        let moved = level_after(&mut effects, 0.1, 1.0, 0.0);
        // At 1 rad/s the age is the time of the forgetting travel: 10 ms.
        assert!((moved - 1.0 - 0.2 * 1.1f64.ln()).abs() < 2e-3, "{moved}");
    }

    #[test]
    fn drift_and_warming_reach_their_sizes() {
        let drift = Some(Drift::Wear { per_s: -0.4 / DRIFT_S });
        let mut effects = LevelEffects::of(Joint { drift, ..Joint::default() });
        assert!((level_after(&mut effects, 0.5 * DRIFT_S, 1.0, 0.0) - 0.8).abs() < 1e-3);
        assert!((level_after(&mut effects, DRIFT_S, 1.0, 0.0) - 0.6).abs() < 1e-9);
        let warming = Warming { fall: 0.5, energy_j: 10.0, cooling_s: 1e9 };
        let warming = Some(warming);
        let mut effects = LevelEffects::of(Joint { warming, ..Joint::default() });
        let expected = 1.0 - 0.5 * (1.0 - (-2f64).exp());
        assert!((level_after(&mut effects, 10.0, 1.0, 2.0) - expected).abs() < 1e-3);
    }

    #[test]
    fn asymmetry_and_shear_follow_direction_and_load() {
        let seal = Seal { eta3: 1e-5, ..Seal::default() };
        let mut effects = LevelEffects::of(Joint { seal, asymmetry: 0.3, ..Joint::default() });
        let forward = effects.step(1.0, 0.0, &Around::default(), 200.0, DT);
        let backward = effects.step(-1.0, 0.0, &Around::default(), 0.0, DT);
        assert_eq!((forward.factor, backward.factor), (1.3, 0.7));
        assert!((forward.sheared_rad_s - 2e-3).abs() < 1e-12);
    }
}
