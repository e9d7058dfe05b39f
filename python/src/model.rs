//! A friction model that predicts torque with the core's own step.

use crate::computation::compute;
use crate::error::{refused, text_in_keywords, wrong_model};
use crate::log::Log;
use crate::table::Table;
use compensator_core::{ParameterId, Parameters};
use friction_diagnose::prepare::Error;
use friction_fit::params::{self, ParameterFile, ParameterFileErrorKind};
use friction_fit::prediction::{
    AdaptationOptions, LogPrediction, PredictionOptions, PredictionStart, log_tracks,
    predict_adapted, predict_tracks,
};
use friction_fit::spec::Spec;
use friction_fit::{DriverForm, Estimate, Outcome, tracks_with};
use friction_results::export::{ExportFormat, export};
use joint_log::log_check::{Corrections, check};
use joint_log::{Cells, Dataset, JointKind, Quantity, ReadOptions, read_tables};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::collections::BTreeMap;
use toml_edit::{Document, Item, TableLike, TomlError};

/// A covariate with the number of each row, which shows what row of the user's table a prediction belongs to.
const ROW: &str = "friction row number";

/// A model with its values.
#[pyclass(frozen, module = "friction._core")]
pub struct Model {
    spec: Spec,
    parameters: Parameters<f64>,
    joint: JointKind,
    /// Text of params.toml.
    toml: String,
    /// What the fit knows of the parameters, as far as a file states it.
    estimates: Vec<ParameterEstimate>,
    /// The covariate that an auxiliary term follows.
    auxiliary: Option<String>,
    /// True if the model was fitted to the motion as logged.
    is_motion_logged: bool,
    /// Columns that its linear model follows.
    columns: Vec<String>,
}

/// What a fit knows of a parameter.
struct ParameterEstimate {
    id: ParameterId,
    std_error: Option<f64>,
    state: String,
}

#[pymethods]
impl Model {
    /// Returns the model of a parameter file's text.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: String) -> PyResult<Self> {
        let file =
            params::parse(&text, &[]).map_err(|error| wrong_model(py, &error.to_string()))?;
        let estimates = stated(&text).map_err(|error| wrong_model(py, &error.to_string()))?;
        Ok(Self {
            is_motion_logged: file.measurement.is_motion_logged,
            columns: columns(&file),
            spec: file.spec,
            parameters: file.parameters,
            joint: file.joint,
            toml: text,
            estimates,
            auxiliary: file.fit.auxiliary,
        })
    }

    /// Name of the model, with its terms.
    #[getter]
    fn name(&self) -> String {
        self.spec.full_name()
    }

    /// Text of params.toml.
    #[getter]
    fn toml(&self) -> &str {
        &self.toml
    }

    /// Name of the torque column, with its unit.
    #[getter]
    fn torque_column(&self) -> &'static str {
        Quantity::Torque.name(self.joint)
    }

    /// Returns name, value, unit, standard error and state of each parameter.
    #[getter]
    #[expect(clippy::type_complexity, reason = "a row of a table, named in Python")]
    fn parameters(&self) -> Vec<(&'static str, f64, &'static str, Option<f64>, Option<&str>)> {
        let row = |id: ParameterId| {
            let estimate = self.estimates.iter().find(|of| of.id == id);
            let unit = params::unit(id, self.joint);
            let error = estimate.and_then(|of| of.std_error);
            (id.name(), self.parameters.get(id), unit, error, estimate.map(|of| &*of.state))
        };
        self.parameters.active().map(row).collect()
    }

    /// Returns a model in another form as files, each a name and its content, and notes on what the form omits. `compensator` has
    /// settings of a compensator, which replace those of the model.
    #[pyo3(signature = (to, gravity=false, compensator=None))]
    #[expect(clippy::type_complexity, reason = "files, named in Python")]
    fn export<'py>(
        &self,
        py: Python<'py>,
        to: &str,
        gravity: bool,
        compensator: Option<BTreeMap<String, f32>>,
    ) -> PyResult<(Vec<(&'static str, Bound<'py, PyBytes>)>, Vec<String>)> {
        let Some(format) = ExportFormat::parse(to) else {
            let known = ExportFormat::ALL.map(ExportFormat::name).join(", ");
            return Err(refused(py, &format!("to={to:?}: expected one of {known}")));
        };
        let failed = |error: String| refused(py, &error);
        let mut file: ParameterFile =
            params::parse(&self.toml, &[]).map_err(|error| failed(error.to_string()))?;
        file.compensator.gravity |= gravity;
        for (name, value) in compensator.into_iter().flatten() {
            let wrong = |why: ParameterFileErrorKind| {
                refused(py, &format!("compensator={{{name:?}: {value}}}: {why}"))
            };
            file.compensator.set(&name, value).map_err(wrong)?;
        }
        let exported = match format {
            #[cfg(feature = "onnx")]
            ExportFormat::Onnx => {
                friction_onnx::export(&file, "params.toml").map_err(|e| e.to_string())
            }
            format => export(&file, format, "params.toml").map_err(|e| e.to_string()),
        };
        let exported = exported.map_err(|error| failed(with_command(error)))?;
        let further = exported.further_files.iter().map(|(name, content)| (*name, content));
        let files = std::iter::once((format.file_name(&file), &exported.content)).chain(further);
        let files = files.map(|(name, content)| (name, PyBytes::new(py, content))).collect();
        let notes = exported.notes.iter().map(|note| text_in_keywords(note)).collect();
        Ok((files, notes))
    }

    /// Returns the measured and the predicted torque of each row of a log's only table; NaN for rows that cannot be used. A
    /// measured torque that drives the motion is turned, as for a fit. The state at the start of a run follows from its torque
    /// if `has_torque`, and is relaxed otherwise.
    #[pyo3(signature = (log, rows, has_torque, threads=0, progress=None))]
    fn predict_log(
        &self,
        py: Python<'_>,
        log: &Bound<'_, Log>,
        rows: usize,
        has_torque: bool,
        threads: usize,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let log = log.get();
        compute(py, threads, progress, || {
            let data = self.dataset(log)?;
            let predicted = self.predict_runs(&data, has_torque)?;
            let measured = by_row(&data, data.runs.iter().map(|run| &run.torque), rows);
            Ok((measured, by_row(&data, predicted.runs.iter().map(|run| &run.torque), rows)))
        })
    }

    /// Returns the torque of each row of a log's only table, with gains that follow the log; NaN for rows that cannot be used.
    /// `memory`, s of sliding, and `range`, least and largest gain, replace the defaults.
    #[pyo3(signature = (log, rows, memory=None, range=None, threads=0, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
    fn predict_adapted_log(
        &self,
        py: Python<'_>,
        log: &Bound<'_, Log>,
        rows: usize,
        memory: Option<f64>,
        range: Option<[f64; 2]>,
        threads: usize,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<f64>> {
        let log = log.get();
        let adapt = AdaptationOptions { memory_s: memory, range };
        compute(py, threads, progress, || self.predict_adapted(&self.dataset(log)?, rows, &adapt))
    }

    /// Returns the coefficient of determination of a log's torque.
    #[pyo3(signature = (log, threads=0, progress=None))]
    fn score_log(
        &self,
        py: Python<'_>,
        log: &Bound<'_, Log>,
        threads: usize,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<f64> {
        let log = log.get();
        compute(py, threads, progress, || {
            let data = self.dataset(log)?;
            let found = self.predict_runs(&data, true)?;
            let runs = data.runs.iter().zip(&found.runs);
            let rows = runs.flat_map(|(run, predicted)| run.torque.iter().zip(&predicted.torque));
            let pairs: Vec<_> = rows.filter(|(_, predicted)| predicted.is_finite()).collect();
            let sum: f64 = pairs.iter().map(|(measured, _)| *measured).sum();
            let mean = sum / pairs.len() as f64;
            let residual =
                pairs.iter().map(|(measured, predicted)| (*measured - *predicted).powi(2));
            let total = pairs.iter().map(|(measured, _)| (*measured - mean).powi(2));
            Ok(1.0 - residual.sum::<f64>() / total.sum::<f64>())
        })
    }

    /// Returns the torque of evenly spaced samples. The columns include time and velocity.
    fn predict_table(&self, py: Python<'_>, table: &Bound<'_, Table>) -> PyResult<Vec<f64>> {
        let table = &table.get().0;
        compute(py, 1, None, || {
            let data = read_tables(std::slice::from_ref(table), &ReadOptions::default())?;
            let rows = table.columns.first().map_or(0, |(_, cells)| cells.len());
            let predicted = self.predict_runs(&data, false)?;
            Ok(by_row(&data, predicted.runs.iter().map(|run| &run.torque), rows))
        })
    }

    /// Returns the names of the columns that the model reads, beside time and velocity.
    #[getter]
    fn needs(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.spec.needs().map(|(_, quantity)| quantity.name(self.joint).to_owned()).collect();
        names.extend(self.auxiliary.iter().chain(&self.columns).cloned());
        names.sort_unstable();
        names.dedup();
        names
    }
}

impl Model {
    /// Returns the model of a fit, given the text of its parameter file.
    ///
    /// # Errors
    /// If the file cannot be parsed.
    pub fn of_fit(
        py: Python<'_>,
        toml: String,
        outcome: &Outcome,
        auxiliary: Option<String>,
    ) -> PyResult<Self> {
        let DriverForm { parameters, estimates, .. } = outcome.for_driver();
        let known = |&Estimate { id, std_error, state, .. }: &Estimate| ParameterEstimate {
            id,
            std_error,
            state: state.name().to_owned(),
        };
        let estimates = estimates.iter().map(known).collect();
        let spec = outcome.spec.clone();
        Ok(Self { spec, parameters, estimates, auxiliary, ..Self::from_toml(py, toml)? })
    }

    /// Returns name and values, as a diagnosis evaluates a given model.
    pub fn given(&self) -> (Spec, Parameters<f64>) {
        (self.spec.clone(), self.parameters.clone())
    }

    /// Reads a log for a prediction: without leaving out rows, with the motion as the fit used it.
    fn dataset(&self, log: &Log) -> Result<Dataset, Error> {
        let is_reconstructed = log.smooths_motion() && !self.is_motion_logged;
        let correct = Corrections::of_motion(Some(is_reconstructed)).without(&log.as_logged);
        let correct = correct.of_every_row();
        Ok(check(log.dataset()?, correct).data)
    }

    /// Predicts all runs as the command line does: with the linear model, if the file has one.
    fn predict_runs(&self, data: &Dataset, has_torque: bool) -> Result<LogPrediction, Error> {
        if data.joint != self.joint {
            let [model, log] = [self.joint, data.joint].map(|of| Quantity::Torque.name(of));
            return Err(format!("data: found a log with {log}, expected one with {model}").into());
        }
        let file = params::parse(&self.toml, &[])?;
        let start = if has_torque { PredictionStart::Fitted } else { PredictionStart::Rest };
        let options = PredictionOptions { start, ..PredictionOptions::default() };
        let tracks = tracks_with(data, self.auxiliary.as_deref());
        Ok(predict_tracks(&file, data, &tracks, &options)?)
    }

    fn predict_adapted(
        &self,
        data: &Dataset,
        rows: usize,
        adapt: &AdaptationOptions,
    ) -> Result<Vec<f64>, Error> {
        let file = params::parse(&self.toml, &[])?;
        let tracks = log_tracks(&file, data)?;
        let found = predict_adapted(&file, data, &tracks, &PredictionOptions::default(), adapt)?;
        Ok(by_row(data, found.prediction.runs.iter().map(|run| &run.torque), rows))
    }
}

/// Returns the columns that the linear model of a file follows.
fn columns(file: &ParameterFile) -> Vec<String> {
    let linear = file.linear.as_ref();
    linear.into_iter().flat_map(|linear| linear.columns()).map(str::to_owned).collect()
}

/// Returns what a parameter file states of its fit, for people.
fn stated(text: &str) -> Result<Vec<ParameterEstimate>, TomlError> {
    let document = Document::parse(text)?;
    let sections = ["parameters", "rigid_body"].into_iter();
    let sections = sections.filter_map(|name| document.get(name)?.as_table_like());
    let estimate = |(name, item): (&str, &Item)| {
        let id = ParameterId::parse(name)?;
        let state = item.get("state")?.as_str()?.to_owned();
        Some(ParameterEstimate {
            id,
            std_error: item.get("std_error").and_then(Item::as_float),
            state,
        })
    };
    Ok(sections.flat_map(TableLike::iter).filter_map(estimate).collect())
}

/// Returns the torques of all runs by the rows of the user's table; NaN for rows that cannot be used.
fn by_row<'a>(
    data: &Dataset,
    torques: impl Iterator<Item = &'a Vec<f64>>,
    rows: usize,
) -> Vec<f64> {
    let place = data.covariates.iter().position(|name| name == ROW);
    let mut found = vec![f64::NAN; rows];
    for (run, torques) in data.runs.iter().zip(torques) {
        for (row, torque) in torques.iter().enumerate() {
            let user_row = place.map_or(row, |place| run.extra[place][row] as usize);
            if let Some(found) = found.get_mut(user_row) {
                *found = *torque;
            }
        }
    }
    found
}

/// Adds the number of each row to a table.
#[pyfunction]
pub fn with_row_numbers(table: &Bound<'_, Table>) -> Table {
    let table = &table.get().0;
    let rows = table.columns.first().map_or(0, |(_, cells)| cells.len());
    with_column(table, ROW, (0..rows).map(|row| row as f64).collect())
}

/// Adds a column of numbers to a table, or replaces it.
#[pyfunction]
pub fn with_numbers(table: &Bound<'_, Table>, name: &str, values: Vec<f64>) -> Table {
    with_column(&table.get().0, name, values)
}

fn with_column(table: &joint_log::Table, name: &str, values: Vec<f64>) -> Table {
    let mut table = table.clone();
    table.columns.retain(|(known, _)| known != name);
    table.columns.push((name.to_owned(), Cells::Numbers(values)));
    Table(table)
}

/// Adds the command to an error about a feature that this build of the module lacks.
fn with_command(error: String) -> String {
    if error.contains("lacks the feature") {
        return format!("{error}: MATURIN_PEP517_ARGS='--features full' pip install ./python");
    }
    error
}
