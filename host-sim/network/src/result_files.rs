//! The result files of `identify --model lugre-lstm`: the document of the law's fit, with the network's own figures.

use crate::{BASE, MODEL, NetworkFile, predict_tracks};
use friction_diagnose::prepare::Prepared;
use friction_fit::prediction::{log_tracks, predict_tracks as predict_law};
use friction_fit::{Measurement, Metrics, Outcome, params};
use friction_results::predicted::PredictedLog;
use friction_results::provenance::parameter_file;
use friction_results::{Files, ResultError, document, pretty};
use serde_json::json;
use std::slice::from_ref;

/// Result of the training.
#[derive(Clone, Debug)]
pub struct TrainingResult {
    /// The network.
    pub file: NetworkFile,
    /// Content of `network.json`.
    pub text: String,
    /// Errors on the training rows.
    pub train: Metrics,
    /// Errors on the test rows.
    pub test: Metrics,
    /// Share of test rows outside the trained ranges, 0 to 1.
    pub outside_share: f64,
    /// Number of passes of the final training.
    pub epochs: usize,
}

impl TrainingResult {
    /// Returns true if the network reduces the held-out error of the law's fit. Only then it is written.
    pub fn gains_on(&self, fit: &Outcome) -> bool {
        self.test.rmse < fit.test.rmse
    }
}

/// Returns the result files: `fit.json`, `params.toml`, `rows.parquet`, and `network.json` if the network gains. `names` are those of the
/// network's inputs.
///
/// # Errors
/// One line, if a value cannot be represented in JSON, or the core rejects the model.
pub fn network_files(
    fit: &Outcome,
    training: &TrainingResult,
    names: &[String],
    input: &Prepared,
) -> Result<Files, ResultError> {
    let mut document = document(input, from_ref(fit));
    let model = &mut document["models"][0];
    model["model"] = json!(MODEL);
    model["base"] = json!({"model": BASE, "train": fit.train, "test": fit.test});
    (model["train"], model["test"]) = (json!(training.train), json!(training.test));
    let gains = training.gains_on(fit);
    model["network"] = json!({
        "file": gains.then_some("network.json"), "inputs": names, "passes": training.epochs,
        "share_of_test_rows_outside": training.outside_share,
    });
    let mut toml = parameter_file("identify", input, fit, None, &Measurement::default());
    let file = params::parse(&toml, &[]).map_err(ResultError::of_model)?;
    let data = &input.data;
    let tracks = log_tracks(&file, data).map_err(ResultError::of_model)?;
    if gains {
        params::emit_network("network.json", &training.text, &mut toml);
    }
    let mut others = vec![("params.toml", toml.into_bytes())];
    let predicted = if gains {
        others.push(("network.json", training.text.clone().into_bytes()));
        let network = &training.file;
        PredictedLog::new(|options| predict_tracks(&file, network, data, &tracks, &options))
            .map_err(ResultError::of_model)?
    } else {
        PredictedLog::new(|options| predict_law(&file, data, &tracks, &options))
            .map_err(ResultError::of_model)?
    };
    document["prediction"] = predicted.summary.clone();
    let mut files = Files { document: ("fit.json", pretty(&document)?), others };
    predicted.add_rows(data, &mut files)?;
    Ok(files)
}
