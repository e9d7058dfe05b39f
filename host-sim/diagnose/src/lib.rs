//! What a simulation gets wrong, why, and what a better model gains.
//!
//! ```text
//! TrainTest      runs to learn from and to judge by, columns that may be blamed    train_test
//!  -> TwoPositions  play between the encoders on both sides of a gear               two_positions
//!  -> Outcome    hypotheses compared on the same rows, all linear                  contest
//!  -> WeighedCause  the evidence for each cause as a probability                   contest_calibration, naming
//!  -> Answer     the best hypotheses fitted with the driver's law, held out        by_contest, finalist, left_out, evaluation
//!  -> Diagnosis  size, sentence, where it shows, what to measure next              extended, finding, evidence, regime, experiment
//! ```
//!
//! What is reported was fitted by the core's own step, all parameters jointly, and evaluated on held-out rows. A stage takes
//! values and returns a value; it does not change those before it. What may be blamed, and how a cause is reported, is in
//! [`cause`]: one table.
//!
//! [`mod@prepare`] reads, checks and splits a log as every front end does.
//!
//! # Example
//!
//! The friction of a joint rises with pressure. The example reads the columns, fits a plain law, and the diagnosis names
//! the missing cause.
//!
//! ```
//! use friction_diagnose::{DiagnosisOptions, diagnose};
//! use friction_fit::{FitOptions, Rows, fit, tracks};
//! use friction_fit::spec::Spec;
//! use joint_log::{Dataset, SplitRule, split};
//!
//! let names = ["time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa"].map(String::from);
//! let run = |index: usize| {
//!     let pressure = 1e5 * index as f64;
//!     let row = |row: usize| {
//!         let velocity = (0.02 * row as f64 + index as f64).sin();
//!         let noise = 0.02 * ((row * 7919 % 1000) as f64 / 1000.0 - 0.5);
//!         let torque = (1.0 + 1e-6 * pressure) * velocity.signum() + 0.3 * velocity + noise;
//!         [0.01 * row as f64, velocity, torque, pressure]
//!     };
//!     (format!("run {index}"), (0..4).map(|c| (0..600).map(|r| row(r)[c]).collect()).collect())
//! };
//! let data = Dataset::from_columns(&names, (0..10).map(run))?;
//!
//! let (spec, tracks) = (Spec::parse("linear")?, tracks(&data));
//! let rows = Rows { tracks: &tracks, decimate: 1 };
//! let solution = fit(&spec, &spec.parameters()?, rows, &FitOptions::default());
//! assert!(solution.converged);
//!
//! let parts = split(&data, &SplitRule::default(), 0)?;
//! let found = diagnose(&data, &parts, &DiagnosisOptions::default(), &|_| {})?;
//! assert_eq!(found.cause(), "pressure-coulomb");
//! assert!(found.gain.value > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

mod by_contest;
mod candidate;
pub mod cause;
mod ceiling;
mod column_likeness;
mod columns;
pub mod contest;
pub mod contest_calibration;
mod error_reduction;
mod evaluation;
mod evidence;
mod experiment;
mod extended;
mod finalist;
mod finding;
mod gravity_load;
pub mod hand_over;
mod late_channel;
mod leading_fault;
mod left_out;
mod model;
mod naming;
pub mod prepare;
mod regime;
mod rigid_body_hint;
mod rules;
mod sensitivities;
pub mod summary;
mod thresholds;
mod train_test;
pub mod two_positions;
mod uncertain_motion;
mod unexplained;
mod unknown_zero;

#[cfg(test)]
mod fixtures;

// The causes and what is handed over.
pub use cause::{Cause, Remedy};
pub use evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
pub use extended::{Size, WaveOrder};
pub use finding::{ConfoundedCause, Finding, probability_in_words};
pub use hand_over::{HandOver, HandedOver};
pub use leading_fault::Corrected;
pub use naming::{NAMED, WeighedCause};
pub use rigid_body_hint::RigidBodyHint;
pub use rules::{Rejection, Rule};

// How well the models do, and where they err.
pub use ceiling::Ceiling;
pub use evaluation::Gain;
pub use left_out::LeftOut;
pub use regime::{ColumnShares, Share};
pub use thresholds::{NEGLIGIBLE, STRUCTURE};
pub use train_test::TrainTest;

use by_contest::Extension;
use compensator_core::term::TORQUE_RIPPLE_PARAMETERS;
use compensator_core::{ParameterId, Parameters, TermKind};
use friction_fit::clock::Instant;
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{Loss, Outcome, Predicted, autocorrelation_time, predict};
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::{Dataset, Split};
use two_positions::TwoPositions;

/// Options of a diagnosis.
#[derive(Clone, Debug, Default)]
pub struct DiagnosisOptions {
    /// The base model, if it is not to be chosen.
    pub model: Option<Spec>,
    /// A model with its values: judged as it is, then its law is fitted and extended.
    pub given: Option<(Spec, Parameters<f64>)>,
    /// Keep one residual in this many, anti-aliased; 0 and 1 keep all.
    pub decimate: usize,
    /// Parts of the torque column that are not friction.
    pub rigid_body: Vec<TermKind>,
    /// For what is drawn at random.
    pub seed: u64,
    /// What is wrong with the log itself ([`joint_log::log_check`]): handed through to the answer.
    pub log_findings: Vec<LogFinding>,
    /// Late channels that are left as they are logged (`late_channel`).
    pub as_logged: Vec<LogFindingKind>,
    /// Loss of the fits.
    pub loss: Loss,
}

/// Result of a diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What is wrong with the log itself.
    pub log_findings: Vec<LogFinding>,
    /// What the correction of a late channel takes.
    pub corrected: Option<Corrected>,
    /// The log as it was looked at, following what the extended model follows.
    pub log: TrainTest,
    /// Error the torque's noise alone would make on the held-out rows, Nm.
    pub noise_floor: f64,
    /// The base model.
    pub baseline: Outcome,
    /// The extended model.
    pub extended: Outcome,
    /// The base model on the held-out rows.
    pub before: Predicted,
    /// The extended one.
    pub after: Predicted,
    /// The causes, strongest first.
    pub findings: Vec<Finding>,
    /// What the extension gains on held-out rows.
    pub gain: Gain,
    /// What is handed over.
    pub hand_over: HandOver,
    /// Rigid-body parts that were not requested and that a part of the error follows.
    pub rigid_body_hint: Option<RigidBodyHint>,
    /// What a flexible model with the same columns leaves.
    pub ceiling: Ceiling,
    /// Where in the motion the base model is wrong, held-out rows.
    pub by_regime: Vec<Share>,
    /// In which direction.
    pub by_direction: Vec<Share>,
    /// By thirds of every column, and by run.
    pub by_column: Vec<ColumnShares>,
    /// The causes of the contest with their probabilities: those of the best hypothesis first.
    pub candidates: Vec<WeighedCause>,
    /// Name of the covariate in the auxiliary column, if the extended model follows one.
    pub auxiliary: Option<String>,
    /// What was left out of the fits that were judged there, where nothing is set apart.
    pub left_out: Option<LeftOut>,
    /// Autocorrelation time of a residual with structure that no column explains, in rows; 0 without such structure.
    pub unexplained_memory_rows: f64,
    /// Time it took, s.
    pub seconds: f64,
}

impl Diagnosis {
    /// The name of the first cause, or `none`.
    pub fn cause(&self) -> &'static str {
        self.findings.first().map_or("none", |finding| finding.cause.name())
    }

    /// Returns the fault of the log that explains most of the error, if one does.
    pub fn leading_fault(&self) -> Option<&LogFinding> {
        let gains = self.findings.iter().map(|finding| finding.gain.value);
        let most = gains.fold(0.0, f64::max);
        leading_fault::leading_fault(&self.log_findings, &self.after.metrics, self.corrected, most)
    }

    /// Adds the finding of structure that no cause explains, if there is no other.
    fn add_unexplained(&mut self, seed: u64) {
        let has_structure =
            self.unexplained_memory_rows > 0.0 && self.after.metrics.nrmse_std > NEGLIGIBLE;
        if self.findings.is_empty() && has_structure {
            let cause = cause::named("unknown");
            self.findings.extend(cause.map(|cause| unexplained::unexplained(cause, self, seed)));
        }
    }

    /// Limits the probabilities of findings beside a fault of the log that explains the error as well.
    fn limit_probabilities(&mut self) {
        if self.leading_fault().is_some_and(|fault| !fault.corrected) {
            for finding in &mut self.findings {
                finding.probability = finding.probability.min(leading_fault::UNDECIDED);
            }
        }
    }

    /// Returns the name of the extended model, or `None` if the base model is not extended.
    pub fn extension(&self) -> Option<String> {
        match self.hand_over.extending() {
            Some(linear) => Some(linear.model.model.name()),
            None if self.extended.spec == self.baseline.spec => None,
            None => Some(self.extended.spec.to_string()),
        }
    }

    /// Returns the column that the driver's model follows besides those that the core knows.
    pub fn auxiliary_of_driver(&self) -> Option<&str> {
        self.auxiliary.as_deref().filter(|_| self.hand_over.in_driver == HandedOver::Extended)
    }

    /// Returns the model for a driver, the one of the driver's models that is handed over. If each run's position was shifted to
    /// a phase of its own (`unknown_zero`), the phase on another log is unknown, and a ripple with a wrong phase is worse than
    /// none. Its amplitudes are then 0, and a verdict reports this.
    pub fn transferable_model(&self) -> Outcome {
        let mut outcome = match self.hand_over.in_driver {
            HandedOver::Plain => self.hand_over.driver_plain.as_ref().unwrap_or(&self.baseline),
            HandedOver::Baseline => &self.baseline,
            HandedOver::Extended | HandedOver::Linear => &self.extended,
        }
        .clone();
        if self.log.aligned_order.is_none() {
            return outcome;
        }
        let waves = TORQUE_RIPPLE_PARAMETERS.iter().flat_map(|[_, sine, cosine]| [*sine, *cosine]);
        let amplitudes: Vec<ParameterId> =
            waves.chain([ParameterId::RippleSine, ParameterId::RippleCosine]).collect();
        for estimate in outcome.estimates.iter_mut().filter(|e| amplitudes.contains(&e.id)) {
            outcome.parameters.set(estimate.id, 0.0);
            (estimate.value, estimate.std_error) = (0.0, None);
        }
        outcome.verdicts.push(
            "the ripple's amplitudes are set to 0: its phase differs from run to run and is unknown until the joint has a \
             homed zero"
                .into(),
        );
        outcome
    }
}

/// Ratio of the error to the noise floor above which the residual has structure, whatever its autocorrelation time: the
/// autocorrelation of an oscillation cancels half a period later.
const STRUCTURE_FLOOR_RATIO: f64 = 1.5;

/// Minimum autocorrelation time of a residual with structure, in rows.
const MIN_MEMORY_ROWS: f64 = 1.3;

/// Diagnoses a log.
///
/// # Errors
/// If a model has more terms than the core takes.
pub fn diagnose(
    data: &Dataset,
    split: &Split,
    question: &DiagnosisOptions,
    progress: &dyn Fn(&str),
) -> Result<Diagnosis, SpecError> {
    let begin = Instant::now();
    let log = TrainTest::new(data, split, question.decimate, &question.rigid_body);
    let (positions, unfit) = match TwoPositions::of(data) {
        Some(Ok(positions)) => (Some(positions), None),
        Some(Err(note)) => (None, Some(note)),
        None => (None, None),
    };
    let answer = by_contest::answer(&log, question, positions.as_ref(), progress)?;
    let by_contest::Answer { mut baseline, before, extension, .. } = answer;
    let Extension { mut log, outcome: extended, auxiliary, after, gain } = extension;
    baseline.test = before.metrics;
    let coloured = evaluation::coloured_floor(&log.test_tracks, &after);
    let floor = evaluation::noise_floor(&log.test_tracks, log.decimate).max(coloured);
    let mut findings = answer.findings;
    if let Some(positions) = &positions {
        positions.add_to(&mut findings);
        log.notes.extend(positions.note());
    }
    log.notes.extend(unfit.map(|why| why.to_string()));
    progress("fitting a flexible model");
    let ceiling = ceiling_of(&log, answer.left_out, &after, &extended);
    let (tracks, resolution) = (&log.test_tracks, baseline.resolution);
    let at = sensitivities::sensitivities(&baseline.parameters, &[], tracks, resolution);
    let mut found = Diagnosis {
        log_findings: question.log_findings.iter().cloned().chain(answer.log_findings).collect(),
        corrected: answer.corrected,
        noise_floor: evaluation::lower_floor(floor, tracks, &after).max(coloured),
        ceiling,
        by_regime: regime::by_regime(tracks, &at),
        by_direction: regime::by_direction(tracks, &at),
        by_column: regime::by_column(&log, &at),
        candidates: answer.weighed,
        auxiliary,
        left_out: answer.left_out,
        unexplained_memory_rows: unexplained_memory_rows(&after, floor),
        log,
        baseline,
        extended,
        before,
        after,
        findings,
        gain,
        hand_over: answer.hand_over,
        rigid_body_hint: answer.rigid_body_hint,
        seconds: 0.0,
    };
    found.add_unexplained(question.seed);
    found.limit_probabilities();
    found.seconds = begin.elapsed().as_secs_f64();
    Ok(found)
}

/// Returns what a flexible model leaves of the extended model's error.
fn ceiling_of(
    log: &TrainTest,
    left_out: Option<LeftOut>,
    after: &Predicted,
    model: &Outcome,
) -> Ceiling {
    let on_training = || predict(&model.parameters, log.train_rows(), model.resolution);
    let trained = left_out.is_none().then(on_training);
    Ceiling::new(log, left_out, after, trained.as_ref())
}

/// Returns the autocorrelation time of the residual in rows if it is more than noise, else 0.
fn unexplained_memory_rows(after: &Predicted, noise_floor: f64) -> f64 {
    let memory = autocorrelation_time(after.residuals.iter().map(Vec::as_slice));
    let times = after.metrics.rmse / noise_floor.max(f64::MIN_POSITIVE);
    let hangs_together = memory > MIN_MEMORY_ROWS || times > STRUCTURE_FLOOR_RATIO;
    if times > STRUCTURE && hangs_together { memory } else { 0.0 }
}
