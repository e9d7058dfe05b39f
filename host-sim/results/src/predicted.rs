//! The prediction of a log by the parameter file that a command writes, as `predict` computes it from that file.

use crate::ResultError;
use crate::files::Files;
use friction_fit::params::{self, ParameterFile};
use friction_fit::prediction::{LogPrediction, PredictionOptions, log_tracks, predict_tracks};
use joint_log::Dataset;
use serde_json::{Value, json};

/// Name of the table of rows.
pub const ROWS_FILE: &str = "rows.parquet";

/// Every row of a log with the model of a parameter file.
pub(crate) struct PredictedLog {
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
        Self::of_file(&file, data)
    }

    /// Predicts with a parameter file.
    ///
    /// # Errors
    /// See [`PredictedLog::of_text`].
    pub fn of_file(file: &ParameterFile, data: &Dataset) -> Result<Self, ResultError> {
        let tracks = log_tracks(file, data).map_err(ResultError::of_model)?;
        let with =
            |options| predict_tracks(file, data, &tracks, &options).map_err(ResultError::of_model);
        let prediction = with(PredictionOptions::default())?;
        let as_exported = with(PredictionOptions::AS_EXPORTED)?;
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
