//! Ground truth of a scenario, and its JSON form.

use crate::friction::Seal;
use serde_json::{Map, Value, json};

/// One hidden effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// Name in the catalogue of causes.
    pub cause: &'static str,
    /// Columns that the effect depends on. Empty for a constant.
    pub columns: Vec<&'static str>,
    /// Size, by the convention of the cause in the catalogue.
    pub size: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// Order of a ripple, periods per turn. `None` for other effects.
    pub order: Option<f64>,
    /// RMS over all rows of the noise-free torque difference with and without the effect, Nm.
    pub visible_rms_nm: f64,
    /// Further properties, as name and value.
    pub details: Vec<(&'static str, f64)>,
    /// Description in one sentence.
    pub in_words: String,
}

/// A column that is correlated with the cause but has no effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoy {
    /// Name of the column.
    pub column: &'static str,
    /// Column with which it is correlated.
    pub follows: &'static str,
    /// Correlation of both columns over the rows.
    pub correlation: f64,
}

/// Ground truth of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioTruth {
    /// Seed of the scenario.
    pub seed: u64,
    /// Kind of the scenario, in one word.
    pub kind: &'static str,
    /// Hidden effects, strongest first. Empty if there are none.
    pub hidden: Vec<Hidden>,
    /// Causes that explain these data exactly as well as the true one.
    pub confusable_with: Vec<&'static str>,
    /// Columns that are correlated with the cause but have no effect.
    pub decoys: Vec<Decoy>,
    /// Columns that the hidden effect depends on but that the log does not contain.
    pub missing_columns: Vec<&'static str>,
    /// The seal without the hidden effects.
    pub seal: Seal,
    /// Standard deviation of the torque noise, Nm.
    pub noise_nm: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Number of runs.
    pub runs: usize,
    /// Length of each run, s.
    pub seconds: f64,
    /// Maximum jitter of a sample time, in sample periods.
    pub jitter: f64,
    /// True if packets were lost.
    pub gaps: bool,
    /// True if velocity and position have encoder errors.
    pub encoder: bool,
    /// Description in one sentence.
    pub description: String,
}

impl ScenarioTruth {
    /// Returns the cause that a diagnosis should rank first. It is `none` if no effect is hidden.
    pub fn cause(&self) -> &'static str {
        self.hidden.first().map_or("none", |hidden| hidden.cause)
    }

    /// Returns the content of `truth.json`.
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
        json!({
            "schema": 1,
            "origin": "simulated",
            "scenario": "underwater-joint",
            "seed": self.seed,
            "kind": self.kind,
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
            "parameters": self.seal.json(),
        })
    }
}

impl Hidden {
    /// Returns the JSON form of the effect.
    pub fn json(&self) -> Value {
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
