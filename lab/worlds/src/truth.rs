//! Ground truth of an adverse world.

use super::sensing::SensorKind;
use serde_json::{Value, json};
use simulated_machines::scenarios::Hidden;

/// A hidden effect and its detectability beside the other effects of its world.
#[derive(Clone, Debug)]
pub struct HiddenEffect {
    /// The effect.
    pub hidden: Hidden,
    /// RMS of the part of the effect that a refitted plant cannot explain, divided by the floor.
    pub effect_in_floors: f64,
    /// Gain of a refit with the true structure, in standard errors.
    pub gain_in_errors: f64,
}

/// Ground truth of an adverse world.
#[derive(Clone, Debug)]
pub struct UnkindTruth {
    /// Seed of the world.
    pub seed: u64,
    /// Sensor kind.
    pub sensor: SensorKind,
    /// `bristles`, `slip-elements` or `lubricated-seal`.
    pub plant: &'static str,
    /// The hidden effects, strongest first; empty in a clean world.
    pub hidden: Vec<HiddenEffect>,
    /// Parts of the torque column that are not friction, named as in `--rigid-body`.
    pub rigid_body: Vec<&'static str>,
    /// Causes that hold for the log whatever effect is hidden.
    pub true_of_the_log: Vec<&'static str>,
    /// RMS error of the true plant with the motion reconstructed from the log, Nm.
    pub floor_nm: f64,
    /// The same error for each row of the log: logged torque minus the torque of the true plant, Nm.
    pub floor_errors: Vec<Vec<f64>>,
    /// Torque of each row without noise, Nm.
    pub torque: Vec<Vec<f64>>,
    /// Standard deviation of the torque noise before any filter, Nm.
    pub noise_nm: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Presliding travel of the contact, rad.
    pub travel_rad: f64,
    /// Largest correlation between covariates that was drawn.
    pub correlation: f64,
    /// Description in one sentence.
    pub description: String,
}

/// Minimum gain of a detectable effect, in standard errors.
pub const MIN_DETECTABLE_GAIN: f64 = 3.0;

impl HiddenEffect {
    /// Returns true if a refit with the true structure gains at least [`MIN_DETECTABLE_GAIN`] standard errors.
    pub fn is_detectable(&self) -> bool {
        self.gain_in_errors >= MIN_DETECTABLE_GAIN
    }

    fn json(&self) -> Value {
        let mut object = self.hidden.json();
        object["effect_in_floors"] = json!(self.effect_in_floors);
        object["gain_in_standard_errors"] = json!(self.gain_in_errors);
        object["detectable"] = json!(self.is_detectable());
        object
    }
}

impl UnkindTruth {
    /// Returns the cause that a diagnosis should rank first. It is `none` if no effect is hidden.
    pub fn cause(&self) -> &'static str {
        self.hidden.first().map_or("none", |effect| effect.hidden.cause)
    }

    /// Returns true if this cause is hidden.
    pub fn is_hidden(&self, cause: &str) -> bool {
        self.hidden.iter().any(|effect| effect.hidden.cause == cause)
    }

    /// Returns true if the strongest effect is detectable.
    pub fn is_detectable(&self) -> bool {
        self.hidden.first().is_some_and(HiddenEffect::is_detectable)
    }

    /// Returns [`HiddenEffect::effect_in_floors`] of the strongest effect, or 0.
    pub fn effect_in_floors(&self) -> f64 {
        self.hidden.first().map_or(0.0, |effect| effect.effect_in_floors)
    }

    /// Returns [`HiddenEffect::gain_in_errors`] of the strongest effect, or 0.
    pub fn gain_in_errors(&self) -> f64 {
        self.hidden.first().map_or(0.0, |effect| effect.gain_in_errors)
    }

    /// Returns the content of `truth.json`.
    pub fn json(&self) -> Value {
        json!({
            "schema": 1,
            "origin": "simulated",
            "scenario": "unkind",
            "seed": self.seed,
            "sensor": self.sensor.name(),
            "plant": self.plant,
            "description": self.description,
            "cause": self.cause(),
            "hidden": self.hidden.iter().map(HiddenEffect::json).collect::<Vec<_>>(),
            "rigid_body": self.rigid_body,
            "true_of_the_log": self.true_of_the_log,
            "effect_in_floors": self.effect_in_floors(),
            "gain_in_standard_errors": self.gain_in_errors(),
            "detectable": self.is_detectable(),
            "floor_nm": self.floor_nm,
            "torque_noise_nm": self.noise_nm,
            "rate_hz": self.rate_hz,
            "presliding_travel_rad": self.travel_rad,
            "covariate_correlation": self.correlation,
        })
    }
}
