//! Prediction: a fitted model on every row of a log.
//!
//! A prediction needs a start. A joint at rest holds any torque up to its static level, and only a measured torque indicates
//! which one. A simulation that starts at zero is wrong until the joint leaves presliding. [`PredictionStart`] gives the
//! choices. A control loop knows only past torques: exported models start from the first one.
//!
//! The simulation takes the step size of the fit, which the parameter file states ([`crate::params::FitRecord`]). Each run
//! is cut at its gaps, and each segment has its own start, as in a fit. A segment of one row has no prediction.
//!
//! A row has a flag for every input that the model was not fitted for: [`compensator_core::Flags`], as a joint driver reports.

mod adapted;

pub use adapted::{AdaptationOptions, AdaptedPrediction, RowAdaptation, predict_adapted};

use crate::dataset_tracks::tracks_with;
use crate::initial_heat::initial_heat;
use crate::initial_state::initial_state;
use crate::linear::LinearModel;
use crate::params::ParameterFile;
use crate::simulate::simulate;
use crate::{Metrics, Resolution, Track, WeighedRow};
use compensator_core::{Flags, ModelState, ParameterError, Parameters, Quantity};
use joint_log::{Dataset, JointKind, Run};
use std::borrow::Cow;

/// State of the model at the start of each segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PredictionStart {
    /// The bristle torque that fits all rows of the segment best, as a fit determines it.
    #[default]
    Fitted,
    /// The bristle torque with which the first step returns the first measured torque, as far as the level permits.
    FirstTorque,
    /// No bristle torque.
    Rest,
}

/// How a log is predicted.
#[derive(Clone, Copy, Debug, Default)]
pub struct PredictionOptions {
    /// State at the start of each segment.
    pub start: PredictionStart,
    /// Step size; `None` for that of the parameter file.
    pub resolution: Option<Resolution>,
    /// The driver's law, also if the file has a model that errs less on a PC.
    pub of_driver: bool,
}

impl PredictionOptions {
    /// One step per row from the first measured torque, as an exported model computes it.
    pub const AS_EXPORTED: Self = Self {
        start: PredictionStart::FirstTorque,
        resolution: Some(Resolution::PLAIN),
        of_driver: true,
    };
}

/// Prediction of one run, one value per row. A row without a prediction has NaN.
#[derive(Clone, Debug, Default)]
pub struct RunPrediction {
    /// Torque of the model, Nm or N.
    pub torque: Vec<f64>,
    /// Bristle torque at the end of the row, Nm or N; 0 for a law without bristles.
    pub bristle_torque: Vec<f64>,
    /// Inputs outside the range that the model was fitted for.
    pub flags: Vec<Flags>,
}

/// Prediction of a log.
#[derive(Clone, Debug)]
pub struct LogPrediction {
    /// Prediction of each run, in the order of the log.
    pub runs: Vec<RunPrediction>,
    /// Errors over all rows with a prediction.
    pub metrics: Metrics,
    /// Remarks for the user, one sentence each.
    pub remarks: Vec<String>,
}

impl LogPrediction {
    /// Returns the errors of each run with a prediction, with its name.
    pub fn run_metrics<'a>(
        &'a self,
        data: &'a Dataset,
    ) -> impl Iterator<Item = (&'a str, Metrics)> {
        data.runs.iter().zip(&self.runs).map(|(run, predicted)| {
            (run.name.as_str(), Metrics::of(compared(run, &predicted.torque)))
        })
    }
}

/// Why a log cannot be predicted. Each message is one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PredictionError {
    /// The log is of another kind of joint.
    #[error("joint: found a log of a {} joint, expected a {} one", kind(*found), kind(*expected))]
    Joint {
        /// Kind of the log.
        found: JointKind,
        /// Kind of the model.
        expected: JointKind,
    },
    /// The log lacks the column that the model follows.
    #[error("{0}: not a column of the log, and the model follows it")]
    MissingColumn(String),
    /// The levels of the model come from a network.
    #[error("a network supplies the levels, expected a model without one")]
    Network,
    /// The log has no period.
    #[error("no two rows of the log belong together")]
    SingleRows,
    /// The core refuses the adaptation.
    #[error("{0}")]
    Adaptation(#[from] ParameterError),
}

fn kind(joint: JointKind) -> &'static str {
    match joint {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    }
}

/// Returns the tracks of a log for [`predict_tracks`].
///
/// # Errors
/// One line if the log lacks a column that the model cannot do without, or has another joint kind.
pub fn log_tracks(file: &ParameterFile, data: &Dataset) -> Result<Vec<Track>, PredictionError> {
    if file.joint != data.joint {
        return Err(PredictionError::Joint { found: data.joint, expected: file.joint });
    }
    let auxiliary = file.fit.auxiliary.as_deref();
    if let Some(column) = auxiliary
        && !data.covariates.iter().any(|known| known == column)
    {
        return Err(PredictionError::MissingColumn(column.to_owned()));
    }
    Ok(tracks_with(data, auxiliary))
}

/// Predicts the torque of every row of a log, given its tracks ([`log_tracks`]). So several predictions share them.
///
/// # Errors
/// One line if the model has a network, which the package `friction-network` predicts with.
pub fn predict_tracks(
    file: &ParameterFile,
    data: &Dataset,
    tracks: &[Track],
    options: &PredictionOptions,
) -> Result<LogPrediction, PredictionError> {
    if file.network.is_some() {
        return Err(PredictionError::Network);
    }
    predict_tracks_by(file, data, tracks, options, |track, run| {
        predict_logged(file, data, track, options, run);
        Ok(())
    })
}

/// Predicts as [`predict_tracks`] does, with the torque of each track by `predict`.
///
/// # Errors
/// That of `predict`.
pub fn predict_tracks_by<E>(
    file: &ParameterFile,
    data: &Dataset,
    tracks: &[Track],
    options: &PredictionOptions,
    predict: impl Fn(&Track, &mut RunPrediction) -> Result<(), E>,
) -> Result<LogPrediction, E> {
    let mut runs: Vec<RunPrediction> = data.runs.iter().map(|run| empty(run.len())).collect();
    for track in tracks {
        let run = &mut runs[track.run];
        predict(track, run)?;
        set_flags(file, track, run);
    }
    let linear = file.linear.as_ref().filter(|_| !options.of_driver);
    if let Some(linear) = linear {
        let mut torque = linear.predict(data, &file.measurement).into_iter();
        for predicted in runs.iter_mut().flat_map(|run| &mut run.torque) {
            // A model without a state predicts a row that stands alone too.
            *predicted = torque.next().unwrap_or(f64::NAN);
        }
    }
    let metrics = metrics_of(data, &runs);
    Ok(LogPrediction { metrics, remarks: remarks(file, linear, data, &runs), runs })
}

/// Returns the errors over all rows with a prediction.
fn metrics_of(data: &Dataset, runs: &[RunPrediction]) -> Metrics {
    let all = data.runs.iter().zip(runs);
    Metrics::of(all.flat_map(|(run, predicted)| compared(run, &predicted.torque)))
}

fn empty(rows: usize) -> RunPrediction {
    let missing = vec![f64::NAN; rows];
    RunPrediction {
        torque: missing.clone(),
        bristle_torque: missing,
        flags: vec![Flags::empty(); rows],
    }
}

/// Returns the rows with a prediction and without a spike.
fn compared<'a>(run: &'a Run, predicted: &'a [f64]) -> impl Iterator<Item = WeighedRow> + 'a {
    let both = run.torque.iter().zip(predicted).enumerate();
    both.filter(|(row, (_, predicted))| predicted.is_finite() && !run.is_spike(*row))
        .map(|(_, (&measured, &simulated))| WeighedRow { measured, simulated, weight: 1.0 })
}

/// Predicts the torque of a track as the log has it.
fn predict_logged(
    file: &ParameterFile,
    data: &Dataset,
    track: &Track,
    options: &PredictionOptions,
    run: &mut RunPrediction,
) {
    predict_track(file, &shaft_track(file, data, track), options, run);
    as_logged(file, data, track, run);
}

/// Returns a track as the driver's law was fitted to it.
fn shaft_track<'a>(file: &ParameterFile, data: &Dataset, track: &'a Track) -> Cow<'a, Track> {
    let measurement = file.measurement_of_driver();
    if measurement.is_exact() {
        return Cow::Borrowed(track);
    }
    Cow::Owned(measurement.shaft_track(data, track))
}

/// Makes the logged torque from that at the shaft.
fn as_logged(file: &ParameterFile, data: &Dataset, track: &Track, run: &mut RunPrediction) {
    let measurement = file.measurement_of_driver();
    let torque = &mut run.torque[track.first_row..track.first_row + track.len()];
    for (torque, share) in torque.iter_mut().zip(measurement.shares_along(data, track)) {
        *torque = measurement.torque_sign * *torque + share;
    }
}

fn predict_track(
    file: &ParameterFile,
    track: &Track,
    options: &PredictionOptions,
    run: &mut RunPrediction,
) {
    let parameters = &file.parameters;
    let resolution = options.resolution.unwrap_or_else(|| file.fit.resolution());
    let held = held_at_start(parameters, track, options.start, resolution);
    simulate(parameters, track, held, resolution, |row, torque, bristle| {
        run.torque[track.first_row + row] = torque;
        run.bristle_torque[track.first_row + row] = bristle;
        true
    });
}

/// Returns the bristle torque at the start of a track, Nm or N; `None` for a law without bristles.
fn held_at_start(
    parameters: &Parameters<f64>,
    track: &Track,
    start: PredictionStart,
    resolution: Resolution,
) -> Option<f64> {
    parameters.law.has_bristles().then(|| match start {
        PredictionStart::Rest => 0.0,
        PredictionStart::Fitted => {
            initial_state(parameters, track, resolution).map_or(0.0, |start| start.held)
        }
        PredictionStart::FirstTorque => {
            let model = parameters.build_unchecked::<f64>(track.period_s);
            let state = ModelState::default().with_heat(initial_heat(parameters, track));
            let start = model.state_for_torque(state, &track.samples[0], track.torque[0]);
            start.bristle_torque_nm
        }
    })
}

/// Sets the flags of the inputs outside the declared range, as a driver does.
fn set_flags(file: &ParameterFile, track: &Track, run: &mut RunPrediction) {
    let used: Vec<Quantity> = std::iter::once(Quantity::Velocity)
        .chain(file.spec.needs().map(|(_, quantity)| quantity))
        .collect();
    for (row, sample) in track.samples.iter().enumerate() {
        for quantity in &used {
            let range = file.parameters.envelope.internal_range(*quantity);
            let value = quantity.value_in(sample);
            if value.is_some_and(|value| !(range[0]..=range[1]).contains(&value)) {
                run.flags[track.first_row + row] |= quantity.info().invalid;
            }
        }
    }
}

/// Returns what a user must know of the prediction: missing columns, rows without a prediction and rows outside the range.
fn remarks(
    file: &ParameterFile,
    linear: Option<&LinearModel>,
    data: &Dataset,
    runs: &[RunPrediction],
) -> Vec<String> {
    let mut remarks = Vec::new();
    let measurement =
        if linear.is_some() { &file.measurement } else { file.measurement_of_driver() };
    let mut missing = linear.map_or_else(Vec::new, |linear| linear.missing_columns(data));
    missing.extend(measurement.missing_columns(data));
    missing.sort_unstable();
    missing.dedup();
    for (_, quantity) in file.spec.needs() {
        let name = quantity.name(data.joint);
        let is_absent = data.runs.iter().all(|run| run.get(quantity).is_none());
        // The acceleration is derived from the velocity if it is not measured.
        let is_derived = matches!(quantity, Quantity::Acceleration | Quantity::Auxiliary);
        if is_absent && !is_derived && !missing.contains(&name) {
            missing.push(name);
        }
    }
    if !missing.is_empty() {
        remarks.push(format!(
            "the model has terms for {}, which the log does not have: they add nothing",
            missing.join(", ")
        ));
    }
    let count = |is: &dyn Fn(&RunPrediction, usize) -> bool| -> usize {
        runs.iter().map(|run| (0..run.torque.len()).filter(|row| is(run, *row)).count()).sum()
    };
    let unpredicted = count(&|run, row| run.torque[row].is_nan());
    if unpredicted > 0 {
        remarks.push(format!(
            "{unpredicted} rows have no prediction: they stand alone between gaps in time"
        ));
    }
    let outside = count(&|run, row| !run.flags[row].is_empty());
    if outside > 0 {
        let (rows, named) = (data.rows, flag_names(runs));
        remarks.push(format!(
            "{outside} of {rows} rows have an input outside the range of the fit: {named}"
        ));
    }
    remarks
}

/// Returns the names of all flags that occur.
fn flag_names(runs: &[RunPrediction]) -> String {
    let all = runs.iter().flat_map(|run| &run.flags).fold(Flags::empty(), |all, one| all | *one);
    flag_text(all)
}

/// Returns the names of flags as they stand in a row: `velocity-invalid,pressure-invalid`; empty without flags.
pub fn flag_text(flags: Flags) -> String {
    let names: Vec<String> =
        flags.iter_names().map(|(name, _)| name.to_lowercase().replace('_', "-")).collect();
    names.join(",")
}

#[cfg(test)]
mod tests;
