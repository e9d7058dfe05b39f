//! What a diagnosis hands over: the model that errs least on rows that its fit has not seen, and of those that err as little the
//! simplest.
//!
//! ```text
//! plain      Coulomb and viscous friction and the rigid-body parts, by least squares
//! baseline   the base law
//! extended   the base law with causes, or, on a PC, the linear model of the contest with all of its causes
//! ```
//!
//! A driver takes the best of the first three. On a PC the linear model competes as well: `params.toml` then has both.

use super::contest::LinearAnswer;
use super::evaluation::paired;
use super::train_test::TrainTest;
use friction_fit::measurement::Measurement;
use friction_fit::predict::Predicted;
use friction_fit::{Outcome, Rows, Track};

/// Difference of the squared errors, in standard errors, within which the simpler of two models is handed over.
const AS_GOOD: f64 = 1.0;

/// Which model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HandedOver {
    /// Coulomb and viscous friction with the rigid-body parts.
    Plain,
    /// The base model.
    #[default]
    Baseline,
    /// The model with causes.
    Extended,
}

impl HandedOver {
    /// Returns the name in a report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Baseline => "baseline",
            Self::Extended => "extended",
        }
    }
}

/// A model of a diagnosis with its errors on held-out rows.
#[derive(Clone, Debug)]
pub struct Judged<M> {
    /// The model.
    pub model: M,
    /// It on held-out rows.
    pub held_out: Predicted,
}

/// The choice of a diagnosis.
#[derive(Clone, Debug)]
pub struct HandOver {
    /// What `predict` computes from `params.toml`.
    pub on_pc: HandedOver,
    /// What a driver gets.
    pub in_driver: HandedOver,
    /// The plain model.
    pub plain: Judged<Outcome>,
    /// The linear model, if there is one; `is_linear` says whether it is handed over.
    pub linear: Option<Judged<LinearAnswer>>,
    /// True if the linear model is the extended one that a PC gets.
    pub is_linear: bool,
    /// What lies between the shaft and the log.
    pub measurement: Measurement,
}

impl HandOver {
    /// Returns the linear model if it is handed over.
    pub fn linear_model(&self) -> Option<&LinearAnswer> {
        self.linear.as_ref().filter(|_| self.is_linear).map(|judged| &judged.model)
    }
}

/// Returns the place of the simplest candidate that errs no more than the best one within a standard error.
pub(super) fn simplest_of_best(candidates: &[&Predicted]) -> usize {
    let error = |at: &usize| candidates[*at].metrics.rmse;
    let best =
        (0..candidates.len()).min_by(|a, b| error(a).total_cmp(&error(b))).unwrap_or_default();
    let is_as_good = |at: &usize| paired(candidates[*at], candidates[best]) < AS_GOOD;
    (0..best).find(is_as_good).unwrap_or(best)
}

/// Returns the linear model on the held-out rows of a log. `original` is the log before its torque was corrected.
pub(super) fn linear_on(
    judged: &TrainTest,
    original: &TrainTest,
    answer: &LinearAnswer,
) -> Predicted {
    let (tracks, residual, firsts) = if judged.leaves_each_out {
        (
            &judged.train_tracks,
            answer.held_out.clone(),
            first_rows(judged.train.runs.iter().map(|run| run.len())),
        )
    } else {
        let data = &original.test;
        let measured = data.runs.iter().flat_map(|run| run.torque.iter());
        let predicted = answer.model.predict(data, &answer.measurement);
        let sign = answer.measurement.torque_sign;
        let residual = measured.zip(predicted).map(|(torque, own)| sign * (torque - own)).collect();
        (&judged.test_tracks, residual, first_rows(data.runs.iter().map(|run| run.len())))
    };
    let torque = |track: &Track| -> Vec<f64> {
        let left = &residual[firsts[track.run] + track.first_row..];
        track.torque.iter().zip(left).map(|(torque, left)| torque - left).collect()
    };
    let torques = tracks.iter().map(torque).collect();
    Predicted::of_torque(Rows { tracks, decimate: judged.decimate }, torques)
}

/// Returns the first row of each run in long columns.
fn first_rows(lengths: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut next = 0;
    lengths
        .map(|length| {
            next += length;
            next - length
        })
        .collect()
}
