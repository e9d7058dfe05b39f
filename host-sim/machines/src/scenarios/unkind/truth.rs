//! The truth behind an unkind world.

use super::super::truth::Hidden;
use super::sensing::SensorKind;
use serde_json::{Value, json};

/// What is true of an unkind world.
#[derive(Clone, Debug)]
pub struct UnkindTruth {
    /// What it was drawn by.
    pub seed: u64,
    /// What its sensors do.
    pub sensor: SensorKind,
    /// `bristles` or `slip-elements`.
    pub plant: &'static str,
    /// What is hidden; nothing in a clean world.
    pub hidden: Option<Hidden>,
    /// Parts of the torque column that are not friction, by their names in `--rigid-body`.
    pub rigid_body: Vec<&'static str>,
    /// Causes that are true of the log whatever is hidden.
    pub true_of_the_log: Vec<&'static str>,
    /// RMS of what is left of the effect beside a refitted plant, over the floor.
    pub effect_in_floors: f64,
    /// What a refit of the true structure gains, in its standard errors.
    pub gain_in_errors: f64,
    /// RMS of what the true plant leaves, driven by the motion as a plain method reads it from the log, Nm.
    pub floor_nm: f64,
    /// The same row by row of the log: logged torque less the true plant's, Nm.
    pub floor_errors: Vec<Vec<f64>>,
    /// The torque of each row without noise, Nm.
    pub torque: Vec<Vec<f64>>,
    /// Standard deviation of the torque's noise before any filter, Nm.
    pub noise_nm: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Presliding travel of the contact, rad.
    pub travel_rad: f64,
    /// Largest correlation covariates were drawn with.
    pub correlation: f64,
    /// One sentence.
    pub description: String,
}

/// From so many standard errors on, an effect is there to be found.
pub const DETECTABLE: f64 = 3.0;

impl UnkindTruth {
    /// The cause a diagnosis should put first: `none` where nothing is hidden.
    pub fn cause(&self) -> &'static str {
        self.hidden.as_ref().map_or("none", |hidden| hidden.cause)
    }

    /// Whether a refit of the true structure gains at least [`DETECTABLE`] standard errors.
    pub fn detectable(&self) -> bool {
        self.gain_in_errors >= DETECTABLE
    }

    /// `truth.json`.
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
            "hidden": self.hidden.iter().map(Hidden::json).collect::<Vec<_>>(),
            "rigid_body": self.rigid_body,
            "true_of_the_log": self.true_of_the_log,
            "effect_in_floors": self.effect_in_floors,
            "gain_in_standard_errors": self.gain_in_errors,
            "detectable": self.detectable(),
            "floor_nm": self.floor_nm,
            "torque_noise_nm": self.noise_nm,
            "rate_hz": self.rate_hz,
            "presliding_travel_rad": self.travel_rad,
            "covariate_correlation": self.correlation,
        })
    }
}
