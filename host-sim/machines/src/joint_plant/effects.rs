//! Effects that a joint can hide from the model of its driver: of the friction level, and torques at the output.
//!
//! [`LevelEffects`] belong to the seal, [`OutputTorque`] to the output shaft. The names and units are those of
//! [`crate::scenarios::HiddenCause`]; the equations are this package's own.

use super::around::Around;

/// A periodic function of the joint angle: `size * sin(order * angle + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Amplitude, in the unit of the effect.
    pub size: f64,
    /// Periods per turn.
    pub order: f64,
    /// Phase at angle 0, rad.
    pub phase_rad: f64,
}

impl Wave {
    fn at(&self, position: f64) -> f64 {
        self.size * (self.order * position + self.phase_rad).sin()
    }
}

/// Growth of the level with the age of the contact: `size * ln(1 + age / onset)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ageing {
    /// Level per e-fold of the age, Nm.
    pub size_nm: f64,
    /// Age from which the level grows, s.
    pub onset_s: f64,
    /// Travel over which the age is lost, rad.
    pub forgetting_rad: f64,
}

/// Change of the level over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Relative change after `duration_s`.
    pub size: f64,
    /// Duration of a linear change, s; the level stays constant afterwards.
    pub duration_s: f64,
}

/// Fall of the level with the stored heat: `1 - fall * (1 - exp(-heat / scale))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warming {
    /// Largest relative fall.
    pub fall: f64,
    /// Heat scale, J.
    pub scale_j: f64,
    /// Time constant of the cooling, s.
    pub cooling_s: f64,
}

/// Effects on the friction of the seal. The default has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelEffects {
    /// Level per side load, Nm/N.
    pub per_force: f64,
    /// Shear of the contact per side load, rad/N.
    pub shear_per_force: f64,
    /// Level per pressure difference, Nm/Pa.
    pub per_pressure: f64,
    /// Relative change of the level with the angle.
    pub ripple: Option<Wave>,
    /// Relative excess of level and viscosity in positive direction; the same deficit in negative direction.
    pub asymmetry: f64,
    /// Growth of the level with the age of the contact.
    pub ageing: Option<Ageing>,
    /// Change of the level over time.
    pub drift: Option<Drift>,
    /// Fall of the level with the stored heat.
    pub warming: Option<Warming>,
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
        let state = &mut self.state;
        if let Some(ageing) = &self.ageing {
            let lost = (velocity.abs() * dt / ageing.forgetting_rad).min(1.0);
            state.age_s = (state.age_s + dt) * (1.0 - lost);
        }
        let ripple = self.ripple.map_or(0.0, |wave| wave.at(position));
        let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
        let side = 1.0 + self.asymmetry * direction;
        LevelChange {
            factor: state.factor * (1.0 + ripple) * side,
            viscous_factor: side,
            raised_nm: self.per_force * around.radial_force_n.abs()
                + self.per_pressure * around.pressure_diff_pa.max(0.0)
                + state.aged_nm,
            sheared_rad_s: self.shear_per_force * load_rate,
        }
    }

    /// Advances the slow states by `dt` (s) with this friction power, W.
    pub(super) fn advance(&mut self, power_w: f64, dt: f64) {
        let state = &mut self.state;
        state.time_s += dt;
        state.aged_nm = self
            .ageing
            .map_or(0.0, |ageing| ageing.size_nm * (state.age_s / ageing.onset_s).ln_1p());
        let drift =
            self.drift.map_or(0.0, |drift| drift.size * (state.time_s / drift.duration_s).min(1.0));
        let warm = self.warming.map_or(0.0, |warming| {
            state.heat_j += dt * (power_w - state.heat_j / warming.cooling_s);
            warming.fall * (1.0 - (-state.heat_j / warming.scale_j).exp())
        });
        state.factor = (1.0 + drift) * (1.0 - warm);
    }
}

/// Torques at the output that the friction does not contain, positive against positive motion. The default has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OutputTorque {
    /// Constant torque, Nm.
    pub offset_nm: f64,
    /// Drag of the water, Nm s^2/rad^2.
    pub drag_nm_s2_per_rad2: f64,
    /// Torques of the angle, Nm: an imbalance of order 1, or a ripple with its harmonics.
    pub waves: Vec<Wave>,
}

impl OutputTorque {
    /// Returns the torque at a position (rad) and velocity (rad/s), Nm.
    pub(super) fn at(&self, position: f64, velocity: f64) -> f64 {
        let waves: f64 = self.waves.iter().map(|wave| wave.at(position)).sum();
        self.offset_nm + self.drag_nm_s2_per_rad2 * velocity * velocity.abs() + waves
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut effects = LevelEffects::default();
        let around = Around { radial_force_n: 50.0, pressure_diff_pa: 2e5, ..Around::default() };
        assert_eq!(effects.step(-1.0, 0.3, &around, 100.0, DT), LevelChange::NONE);
        effects.advance(5.0, DT);
        assert_eq!(effects.step(1.0, 0.3, &around, -100.0, DT), LevelChange::NONE);
        assert_eq!(OutputTorque::default().at(0.7, -2.0), 0.0);
    }

    #[test]
    fn ageing_grows_with_the_logarithm_of_the_rest_and_is_lost_over_its_travel() {
        let ageing = Ageing { size_nm: 0.2, onset_s: 0.1, forgetting_rad: 0.01 };
        let mut effects = LevelEffects { ageing: Some(ageing), ..LevelEffects::default() };
        let rested = level_after(&mut effects, 10.0, 0.0, 0.0);
        assert!((rested - 1.0 - 0.2 * 101f64.ln()).abs() < 1e-3, "{rested}");
        let moved = level_after(&mut effects, 0.1, 1.0, 0.0);
        // At 1 rad/s the age is the time of the forgetting travel: 10 ms.
        assert!((moved - 1.0 - 0.2 * 1.1f64.ln()).abs() < 2e-3, "{moved}");
    }

    #[test]
    fn drift_and_warming_reach_their_sizes() {
        let drift = Drift { size: -0.4, duration_s: 20.0 };
        let mut effects = LevelEffects { drift: Some(drift), ..LevelEffects::default() };
        assert!((level_after(&mut effects, 10.0, 1.0, 0.0) - 0.8).abs() < 1e-3);
        assert!((level_after(&mut effects, 30.0, 1.0, 0.0) - 0.6).abs() < 1e-9);
        let warming = Warming { fall: 0.5, scale_j: 10.0, cooling_s: 1e9 };
        let mut effects = LevelEffects { warming: Some(warming), ..LevelEffects::default() };
        let expected = 1.0 - 0.5 * (1.0 - (-2f64).exp());
        assert!((level_after(&mut effects, 10.0, 1.0, 2.0) - expected).abs() < 1e-3);
    }

    #[test]
    fn asymmetry_and_shear_follow_direction_and_load() {
        let mut effects =
            LevelEffects { asymmetry: 0.3, shear_per_force: 1e-5, ..LevelEffects::default() };
        let forward = effects.step(1.0, 0.0, &Around::default(), 200.0, DT);
        let backward = effects.step(-1.0, 0.0, &Around::default(), 0.0, DT);
        assert_eq!((forward.factor, backward.factor), (1.3, 0.7));
        assert!((forward.sheared_rad_s - 2e-3).abs() < 1e-12);
    }
}
