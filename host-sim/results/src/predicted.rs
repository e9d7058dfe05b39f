//! The prediction of a log by the parameter file that a command writes, as `predict` computes it from that file.

use crate::ResultError;
use crate::files::Files;
use friction_fit::params;
use friction_fit::prediction::{LogPrediction, PredictionOptions, log_tracks, predict_tracks};
use joint_log::Dataset;
use serde_json::{Value, json};

/// Name of the table of rows.
pub const ROWS_FILE: &str = "rows.parquet";

/// Every row of a log with the model of a parameter file.
pub struct PredictedLog {
    prediction: LogPrediction,
    /// Its errors, for the JSON document.
    pub summary: Value,
}

impl PredictedLog {
    /// Predicts with the text of a parameter file without a network.
    ///
    /// # Errors
    /// One line if the model cannot be applied to the log.
    pub fn of_text(toml: &str, data: &Dataset) -> Result<Self, ResultError> {
        let file = params::parse(toml, &[]).map_err(ResultError::of_model)?;
        let tracks = log_tracks(&file, data).map_err(ResultError::of_model)?;
        Self::new(|options| predict_tracks(&file, data, &tracks, &options))
            .map_err(ResultError::of_model)
    }

    /// Predicts with `predict`, as the model is simulated and as it is exported.
    ///
    /// # Errors
    /// That of `predict`.
    pub fn new<E>(
        predict: impl Fn(PredictionOptions) -> Result<LogPrediction, E>,
    ) -> Result<Self, E> {
        let prediction = predict(PredictionOptions::default())?;
        let as_exported = predict(PredictionOptions::AS_EXPORTED)?;
        let summary = json!({
            "file": ROWS_FILE,
            "rows": prediction.metrics.rows,
            "rmse": prediction.metrics.rmse,
            "as_exported_rmse": as_exported.metrics.rmse,
            "remarks": prediction.remarks,
        });
        Ok(Self { prediction, summary })
    }

    /// Returns the prediction of a result without the table of rows.
    pub fn without_rows(mut self) -> Self {
        self.summary["file"] = Value::Null;
        self
    }

    /// Adds the table of rows to the files of a command.
    ///
    /// # Errors
    /// One line if the table cannot be written.
    pub fn add_rows(&self, data: &Dataset, files: &mut Files) -> Result<(), ResultError> {
        #[cfg(feature = "rows")]
        {
            let table = crate::rows::RowTable::new(data, &self.prediction);
            files.others.push((ROWS_FILE, table.emit(crate::table_file::TableFormat::Parquet)?));
        }
        #[cfg(not(feature = "rows"))]
        let _ = (&self.prediction, data, files);
        Ok(())
    }
}
