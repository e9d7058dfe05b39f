//! What a simulation gets wrong, why, and what a better model gains.
//!
//! ```text
//! TrainTest      runs to learn from and to judge by, columns that may be blamed    train_test
//!  -> CorrectedLog  late channels, uncertain motion, unknown zero, base model       corrected_log, late_channel, uncertain_motion,
//!                                                                                   unknown_zero, baseline
//!  -> Round         all candidates beside a model, in one linear fit                round, sensitivities, cause, survey, gram_blocks
//!  -> Selection     causes added one by one, each reviewed beside all others        select, review, rules, other_laws
//!       evidence    figures of each cause, weighed to a probability                 cause_evidence, calibration
//!  -> Proposal      fitted anew with every run left out once                        proposal, left_out, evaluation
//!  -> Decision      repeated until the evaluation withdraws nothing                 decision
//!  -> Diagnosis     size, sentence, where it shows, what to measure next            extended, finding, evidence, regime, experiment
//! ```
//!
//! The linear fit ([`gram_blocks`]) only decides which candidates are fitted. What is reported was fitted by the core's own
//! step, all parameters jointly, and evaluated on held-out runs. A stage takes values and returns a value; it does not change
//! those before it. What may be blamed, and what each cause needs to be found and reported, is in [`cause`]: a file for each
//! cause, and one list.
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

pub mod accepted_cause;
pub mod baseline;
pub mod block_errors;
pub mod by_contest;
pub mod calibration;
pub mod candidate;
pub mod cause;
pub mod cause_evidence;
pub mod ceiling;
pub mod columns;
pub mod contest;
pub mod contest_calibration;
pub mod corrected_log;
pub mod decision;
pub mod error_reduction;
pub mod evaluation;
pub mod evidence;
pub mod experiment;
pub mod extended;
pub mod finalist;
pub mod finding;
pub mod gram_blocks;
pub mod harmonics;
pub mod hysteresis;
mod improvement;
pub mod late_channel;
pub mod leading_fault;
pub mod left_out;
pub mod model;
pub mod naming;
pub mod order;
pub mod other_laws;
pub mod prepare;
pub mod proposal;
pub mod regime;
pub mod review;
pub mod round;
pub mod rules;
pub mod search;
pub mod select;
pub mod sensitivities;
pub mod summary;
pub mod survey;
pub mod thresholds;
pub mod train_test;
pub mod uncertain_motion;
pub mod unknown_zero;

#[cfg(test)]
mod fixtures;

pub use cause::{Cause, Remedy};
pub use evaluation::Gain;
pub use extended::Size;
pub use finding::{ConfoundedCause, Finding};
pub use regime::Share;
pub use round::CandidateScore;
pub use train_test::TrainTest;

use accepted_cause::AcceptedCause;
use ceiling::Ceiling;
use compensator_core::term::TORQUE_RIPPLE_PARAMETERS;
use compensator_core::{ParameterId, Parameters, TermKind};
use corrected_log::CorrectedLog;
use decision::Decision;
use extended::{Observation, Unexplained};
use friction_fit::clock::Instant;
use friction_fit::predict::predict;
use friction_fit::spec::{Spec, SpecError};
use friction_fit::statistics::autocorrelation_time;
use friction_fit::{FitOptions, Loss, Outcome, State};
use friction_fit::{Predicted, identify};
use gram_blocks::LeftOut;
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::{Dataset, Split};
use model::FittedModel;
use rules::RuleDecision;
use stochastic_extension::Certificate;
use thresholds::{NEGLIGIBLE, STRUCTURE};

/// How causes are searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Engine {
    /// One cause after the other beside a fitted model.
    Search,
    /// A contest of whole hypotheses.
    #[default]
    Contest,
}

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
    /// Late channels that are left as they are logged ([`late_channel`]).
    pub as_logged: Vec<LogFindingKind>,
    /// Loss of the fits.
    pub loss: Loss,
    /// If true, evidence is weighed for the calibration, and no extension is proposed.
    pub only_weighs: bool,
    /// How causes are searched for.
    pub engine: Engine,
}

/// Result of a diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What is wrong with the log itself.
    pub log_findings: Vec<LogFinding>,
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
    /// What a flexible model with the same columns leaves.
    pub ceiling: Ceiling,
    /// Where in the motion the base model is wrong, held-out rows.
    pub by_regime: Vec<Share>,
    /// In which direction.
    pub by_direction: Vec<Share>,
    /// By thirds of every column, and by run.
    pub by_column: Vec<(String, Vec<Share>)>,
    /// Every candidate beside the base law, best first.
    pub scores: Vec<CandidateScore>,
    /// Accepted causes as the calibration last weighed them, with those below its threshold.
    pub weighed: Vec<AcceptedCause>,
    /// Causes that a rule rejected after their fit.
    pub decisions: Vec<RuleDecision>,
    /// The paper's stochastic extension before and after, and where its verdict and this one part.
    pub certificates: Certificates,
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
        leading_fault::leading_fault(&self.log_findings, &self.after.metrics)
    }

    /// Returns the extended model for use on other logs and in a driver. If each run's position was shifted to a phase of its
    /// own ([`unknown_zero`]), the phase on another log is unknown, and a ripple with a wrong phase is worse than none.
    /// Its amplitudes are then 0, and a verdict reports this.
    pub fn transferable_model(&self) -> Outcome {
        let mut outcome = self.extended.clone();
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

/// The paper's method beside ours.
#[derive(Clone, Debug)]
pub struct Certificates {
    /// Of the base model.
    pub before: Certificate,
    /// Of the extended one.
    pub after: Certificate,
    /// Where the verdicts part, and why.
    pub reading: String,
}

/// Ratio of the error to the noise floor above which the residual has structure, whatever its autocorrelation time: the
/// autocorrelation of an oscillation cancels half a period later.
const STRUCTURE_FLOOR_RATIO: f64 = 1.5;

/// Minimum autocorrelation time of a residual with structure, in rows.
const MIN_MEMORY_ROWS: f64 = 1.3;

/// Diagnoses a log.
///
/// # Errors
/// If the base model already has as many terms as the core takes.
pub fn diagnose(
    data: &Dataset,
    split: &Split,
    question: &DiagnosisOptions,
    progress: &dyn Fn(&str),
) -> Result<Diagnosis, SpecError> {
    if question.engine == Engine::Contest {
        return diagnose_by_contest(data, split, question, progress);
    }
    let begin = Instant::now();
    let log = TrainTest::new(data, split, question.decimate, &question.rigid_body);
    let corrected = CorrectedLog::new(log, data.joint, question, progress)?;
    let decision = decision::decide(&corrected, question, progress)?;
    let log = reported_log(&corrected.whole, &decision);
    let models = models(&log, question, &decision)?;
    let (before, after) = (decision.proposal.before, decision.proposal.after);
    let Floors { noise_floor, coloured } = floors(&log, &after);
    let unexplained_memory_rows = unexplained_memory_rows(&after, noise_floor);
    let noise_floor = evaluation::lower_floor(noise_floor, &log.test_tracks, &after).max(coloured);
    let found = decision.proposal.extension.found.iter();
    let mut findings: Vec<Finding> =
        found.map(|found| found.finding(&models.extended, &log)).collect();
    findings.extend(observed(|cause| cause.in_log(&log)));
    if findings.is_empty() && unexplained_memory_rows > 0.0 && after.metrics.nrmse_std > NEGLIGIBLE
    {
        let (after, log, seed) = (&after, &log, question.seed);
        let rest = Unexplained { after, noise_floor, times_floor: STRUCTURE, log, seed };
        findings.extend(observed(|cause| cause.in_rest(&rest)));
    }
    limit_probabilities(&mut findings, &corrected.findings, &after);
    progress("fitting a flexible model");
    let left_out = decision.proposal.left_out;
    let ceiling = ceiling_of(&log, left_out, &after, &models.extended);
    progress("certifying");
    let certificates = certificates(&log, &models, &findings, question.seed);
    let Models { baseline, extended } = models;
    let (tracks, resolution) = (&log.test_tracks, baseline.resolution);
    let at = sensitivities::sensitivities(&baseline.parameters, &[], tracks, resolution);
    let follows = decision.proposal.extension.model.follows.as_ref().filter(|own| own.extra);
    Ok(Diagnosis {
        log_findings: corrected.findings,
        noise_floor,
        ceiling,
        by_regime: regime::by_regime(&log.test_tracks, &at),
        by_direction: regime::by_direction(&log.test_tracks, &at),
        by_column: regime::by_column(&log, &at),
        scores: decision.scores,
        weighed: decision.weighed,
        decisions: decision.decisions,
        certificates,
        auxiliary: follows.map(|follows| follows.column.clone()),
        left_out,
        log,
        baseline,
        extended,
        before,
        after,
        findings,
        gain: decision.proposal.gain,
        unexplained_memory_rows,
        seconds: begin.elapsed().as_secs_f64(),
    })
}

/// Diagnoses a log by a contest of hypotheses.
fn diagnose_by_contest(
    data: &Dataset,
    split: &Split,
    question: &DiagnosisOptions,
    progress: &dyn Fn(&str),
) -> Result<Diagnosis, SpecError> {
    let begin = Instant::now();
    let log = TrainTest::new(data, split, question.decimate, &question.rigid_body);
    let answer = by_contest::answer(log, question, progress)?;
    let by_contest::Answer { log, mut baseline, mut extended, before, after, .. } = answer;
    baseline.test = before.metrics;
    extended.test = after.metrics;
    let Floors { noise_floor, coloured } = floors(&log, &after);
    let unexplained_memory_rows = unexplained_memory_rows(&after, noise_floor);
    let noise_floor = evaluation::lower_floor(noise_floor, &log.test_tracks, &after).max(coloured);
    let mut findings = answer.findings;
    findings.extend(observed(|cause| cause.in_log(&log)));
    if findings.is_empty() && unexplained_memory_rows > 0.0 && after.metrics.nrmse_std > NEGLIGIBLE
    {
        let (after, log, seed) = (&after, &log, question.seed);
        let rest = Unexplained { after, noise_floor, times_floor: STRUCTURE, log, seed };
        findings.extend(observed(|cause| cause.in_rest(&rest)));
    }
    let log_findings: Vec<LogFinding> =
        question.log_findings.iter().cloned().chain(answer.log_findings).collect();
    limit_probabilities(&mut findings, &log_findings, &after);
    progress("fitting a flexible model");
    let ceiling = ceiling_of(&log, answer.left_out, &after, &extended);
    progress("certifying");
    let models = Models { baseline, extended };
    let certificates = certificates(&log, &models, &findings, question.seed);
    let Models { baseline, extended } = models;
    let (tracks, resolution) = (&log.test_tracks, baseline.resolution);
    let at = sensitivities::sensitivities(&baseline.parameters, &[], tracks, resolution);
    Ok(Diagnosis {
        log_findings,
        noise_floor,
        ceiling,
        by_regime: regime::by_regime(&log.test_tracks, &at),
        by_direction: regime::by_direction(&log.test_tracks, &at),
        by_column: regime::by_column(&log, &at),
        scores: by_contest::scores(&answer.weighed),
        weighed: Vec::new(),
        decisions: Vec::new(),
        certificates,
        auxiliary: answer.auxiliary,
        left_out: answer.left_out,
        log,
        baseline,
        extended,
        before,
        after,
        findings,
        gain: answer.gain,
        unexplained_memory_rows,
        seconds: begin.elapsed().as_secs_f64(),
    })
}

/// Limits the probabilities of findings beside a fault of the log that explains the error as well.
fn limit_probabilities(findings: &mut [Finding], log: &[LogFinding], after: &Predicted) {
    let fault = leading_fault::leading_fault(log, &after.metrics);
    if fault.is_some_and(|fault| !fault.corrected) {
        for finding in findings {
            finding.probability = finding.probability.min(leading_fault::UNDECIDED);
        }
    }
}

/// Returns the log as the extended model sees it, with the notes of the decision.
fn reported_log(whole: &TrainTest, decision: &Decision) -> TrainTest {
    let follows = decision.proposal.extension.model.follows.as_ref();
    let mut log = whole.following(follows.filter(|follows| follows.extra)).into_owned();
    let rejected = decision.decisions.iter().map(RuleDecision::in_words);
    let mut notes: Vec<String> = decision.notes.iter().cloned().chain(rejected).collect();
    notes.sort_unstable();
    notes.dedup();
    log.notes.extend(notes);
    log
}

/// Base and extended model, fitted to the whole log and evaluated on held-out rows.
struct Models {
    baseline: Outcome,
    extended: Outcome,
}

fn models(
    log: &TrainTest,
    question: &DiagnosisOptions,
    decision: &Decision,
) -> Result<Models, SpecError> {
    let proposal = &decision.proposal;
    let mut baseline = match &question.given {
        Some((spec, parameters)) => given(log, spec, parameters)?,
        None => outcome(log, &decision.base)?,
    };
    baseline.test = proposal.before.metrics;
    let mut extended = proposal.extended.clone().unwrap_or_else(|| baseline.clone());
    extended.test = proposal.after.metrics;
    Ok(Models { baseline, extended })
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

/// Errors that no model of the joint can avoid, Nm.
struct Floors {
    noise_floor: f64,
    coloured: f64,
}

fn floors(log: &TrainTest, after: &Predicted) -> Floors {
    let coloured = evaluation::coloured_floor(&log.test_tracks, after);
    let noise_floor = evaluation::noise_floor(&log.test_tracks, log.decimate).max(coloured);
    Floors { noise_floor, coloured }
}

/// What causes are seen without a fit of their own.
fn observed(see: impl Fn(&dyn Cause) -> Option<Observation>) -> impl Iterator<Item = Finding> {
    let all = cause::ALL.iter().copied();
    all.filter_map(move |cause| Some(Finding::observed(cause, see(cause)?)))
}

/// Errors and verdicts of a model that has been fitted.
fn outcome(log: &TrainTest, model: &FittedModel) -> Result<Outcome, SpecError> {
    let options = FitOptions {
        starts: 1,
        start: Some(model.parameters.clone()),
        fixed: model.fixed.clone(),
        resolution: Some(model.resolution),
        ..FitOptions::default()
    };
    identify(&model.spec, &model.parameters, log.train_rows(), log.test_rows(), &options)
}

/// A model taken as it is.
fn given(log: &TrainTest, spec: &Spec, parameters: &Parameters<f64>) -> Result<Outcome, SpecError> {
    let fixed: Vec<ParameterId> = parameters.active().collect();
    let options =
        FitOptions { starts: 1, start: Some(parameters.clone()), fixed, ..FitOptions::default() };
    identify(spec, parameters, log.train_rows(), log.test_rows(), &options)
}

/// The paper's certificates of both models on the training runs.
fn certificates(
    log: &TrainTest,
    Models { baseline, extended }: &Models,
    findings: &[Finding],
    seed: u64,
) -> Certificates {
    let settings =
        stochastic_extension::Settings { seed, joint: log.train.joint, ..Default::default() };
    let certify = |outcome: &Outcome| {
        let fitted = outcome.estimates.iter().filter(|e| e.std_error.is_some());
        let free: Vec<ParameterId> = fitted.map(|e| e.id).collect();
        stochastic_extension::certify(&outcome.parameters, &free, &log.train_tracks, &settings)
    };
    let before = certify(baseline);
    let after = if extended.spec == baseline.spec { before.clone() } else { certify(extended) };
    let loose = baseline.estimates.iter().filter(|e| e.state != State::Determined);
    let loose: Vec<ParameterId> = loose.map(|e| e.id).collect();
    let causes: Vec<(&str, &[ParameterId])> =
        findings.iter().map(|finding| (finding.cause.name(), finding.cause.acts_on())).collect();
    let reading = stochastic_extension::reading(&before, &loose, &causes);
    Certificates { before, after, reading }
}

/// Returns the autocorrelation time of the residual in rows if it is more than noise, else 0.
fn unexplained_memory_rows(after: &Predicted, noise_floor: f64) -> f64 {
    let memory = autocorrelation_time(after.residuals.iter().map(Vec::as_slice));
    let times = after.metrics.rmse / noise_floor.max(f64::MIN_POSITIVE);
    let hangs_together = memory > MIN_MEMORY_ROWS || times > STRUCTURE_FLOOR_RATIO;
    if times > STRUCTURE && hangs_together { memory } else { 0.0 }
}
