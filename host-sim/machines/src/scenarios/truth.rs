//! The truth behind a scenario, in words and in JSON.

use super::kind::Kind;
use crate::friction::Seal;
use serde_json::{Map, Value, json};

/// One hidden effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// Its name in the catalogue of causes.
    pub cause: &'static str,
    /// The columns it follows; none for a constant.
    pub columns: Vec<&'static str>,
    /// By the convention of the cause's term.
    pub size: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// Of a ripple, 1/rad.
    pub order: Option<f64>,
    /// RMS over all rows of the torque with the effect minus the torque without it, without
    /// noise, Nm.
    pub visible_rms_nm: f64,
    /// What else it has, by name.
    pub details: Vec<(&'static str, f64)>,
    /// One sentence.
    pub in_words: String,
}

/// A column that goes nearly with the cause and does nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoy {
    /// Its name.
    pub column: &'static str,
    /// What it goes with.
    pub follows: &'static str,
    /// Their correlation over the rows.
    pub correlation: f64,
}

/// What is true of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioTruth {
    /// What it was drawn by.
    pub seed: u64,
    /// What kind it is.
    pub kind: Kind,
    /// What is hidden, strongest first; nothing in a scenario without.
    pub hidden: Vec<Hidden>,
    /// Causes that explain these data exactly as well as the true one.
    pub confusable_with: Vec<&'static str>,
    /// Columns laid out to mislead.
    pub decoys: Vec<Decoy>,
    /// Columns the log lacks although the hidden effect follows them.
    pub missing_columns: Vec<&'static str>,
    /// The seal without what is hidden.
    pub seal: Seal,
    /// Standard deviation of the torque sensor, Nm.
    pub noise_nm: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Number of runs.
    pub runs: usize,
    /// Length of each, s.
    pub seconds: f64,
    /// Largest shift of a sample's time, in periods.
    pub jitter: f64,
    /// Whether packets were lost.
    pub gaps: bool,
    /// Whether velocity and position have an encoder's errors.
    pub encoder: bool,
    /// One sentence.
    pub description: String,
}

impl ScenarioTruth {
    /// The cause a diagnosis should put first: `none` where nothing is hidden.
    pub fn cause(&self) -> &'static str {
        self.hidden.first().map_or("none", |hidden| hidden.cause)
    }

    /// `truth.json`.
    pub fn json(&self) -> Value {
        let hidden: Vec<Value> = self.hidden.iter().map(Hidden::json).collect();
        let decoys: Vec<Value> = self
            .decoys
            .iter()
            .map(|decoy| {
                let Decoy { column, follows, correlation } = decoy;
                json!({"column": column, "follows": follows, "correlation": correlation})
            })
            .collect();
        let quantity = |value: f64, unit: &str| json!({"value": value, "unit": unit});
        let Seal { k0, k1, k2, coulomb_nm, static_nm, stribeck_rad_s, .. } = self.seal;
        json!({
            "schema": 1,
            "origin": "simulated",
            "scenario": "underwater-joint",
            "seed": self.seed,
            "kind": self.kind.name(),
            "description": self.description,
            "cause": self.cause(),
            "hidden": hidden,
            "confusable_with": self.confusable_with,
            "decoys": decoys,
            "missing_columns": self.missing_columns,
            "recording": {
                "runs": self.runs, "seconds": self.seconds, "rate_hz": self.rate_hz,
                "torque_noise_nm": self.noise_nm, "jitter": self.jitter, "gaps": self.gaps,
                "encoder_errors": self.encoder,
            },
            "parameters": {
                "coulomb_torque": quantity(coulomb_nm, "Nm"),
                "static_torque": quantity(static_nm, "Nm"),
                "stribeck_velocity": quantity(stribeck_rad_s, "rad/s"),
                "bristle_stiffness": quantity(k0, "Nm/rad"),
                "bristle_damping": quantity(k1, "Nm s/rad"),
                "viscous_friction": quantity(k2, "Nm s/rad"),
            },
        })
    }
}

impl Hidden {
    pub(super) fn json(&self) -> Value {
        let mut object = Map::new();
        object.insert("cause".into(), json!(self.cause));
        object.insert("columns".into(), json!(self.columns));
        object.insert("size".into(), json!({"value": self.size, "unit": self.unit}));
        if let Some(order) = self.order {
            object.insert("order".into(), json!(order));
        }
        object.insert("visible_rms_nm".into(), json!(self.visible_rms_nm));
        let details = self.details.iter().map(|(name, value)| ((*name).into(), json!(value)));
        object.insert("details".into(), Value::Object(details.collect()));
        object.insert("in_words".into(), json!(self.in_words));
        Value::Object(object)
    }
}
