//! What a simulation gets wrong, why, and what a better model gains.
//!
//! ```text
//! log           runs to learn from, runs to judge by, columns that may be blamed         train_test
//!  -> base      the simplest law the log supports, fitted; rows weighed                  baseline, uncertain_motion
//!  -> zero      runs shifted to one phase, where the position's zero is not the shaft's        unknown_zero
//!  -> sensitivities  what the model does, row by row, and its derivatives                sensitivities, order, harmonics
//!  -> candidates     each cause as columns beside the model                              cause, candidate
//!  -> products  of all columns by blocks: falls of the error on unseen rows              survey, gram_blocks, error_reduction
//!  -> choice    those that pass, fitted by the core; the best stays; again; reviewed     round, select, block_errors, review, other_laws
//!  -> judged    fitted anew, every run left out once; what does not gain is taken back   proposal, left_out, evaluation, regime
//!  -> reported  size, sentence, where it shows                                           extended, finding, evidence, summary
//! ```
//!
//! The linear fit beside the model ([`gram_blocks`]) only decides which candidates are fitted. What is reported was
//! fitted by the core's own step, everything jointly, and judged on held-out runs. What may be blamed, and
//! what each cause needs to be found and reported, is in [`cause`]: a file for each, and one list.

pub mod accepted_cause;
pub mod baseline;
pub mod block_errors;
pub mod calibration;
pub mod candidate;
pub mod cause;
pub mod cause_evidence;
pub mod error_reduction;
pub mod evaluation;
pub mod evidence;
pub mod experiment;
pub mod extended;
pub mod finding;
pub mod gram_blocks;
pub mod harmonics;
pub mod hysteresis;
pub mod late_channel;
pub mod left_out;
pub mod model;
pub mod order;
pub mod other_laws;
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

pub use cause::{Cause, Remedy};
pub use evaluation::Gain;
pub use extended::Size;
pub use finding::{ConfoundedCause, Finding};
pub use regime::Share;
pub use round::CandidateScore;
pub use train_test::TrainTest;

use crate::data::{Dataset, Split};
use crate::fit::statistics::autocorrelation_time;
use crate::fit::{FitOptions, Outcome, State};
use crate::fit::{Predicted, identify, predict};
use crate::log_check::{LogFinding, LogFindingKind};
use crate::spec::{Spec, SpecError};
use crate::stochastic::{self, Certificate};
use accepted_cause::AcceptedCause;
use baseline::Baseline;
use calibration::Calibration;
use compensator_core::term::TORQUE_RIPPLE_PARAMETERS;
use compensator_core::{ParameterId, Parameters, TermKind};
use extended::{Observation, Unexplained};
use gram_blocks::LeftOut;
use late_channel::LateChannelKind;
use model::{FitCache, FittedModel};
use proposal::Proposal;
use rules::RuleDecision;
use search::{Extension, Search};
use std::time::Instant;
use thresholds::{NEGLIGIBLE, STRUCTURE};

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
    /// What is wrong with the log itself ([`crate::log_check`]): handed through to the answer.
    pub log_findings: Vec<LogFinding>,
    /// Late channels that are left as they are logged ([`late_channel`]).
    pub as_logged: Vec<LogFindingKind>,
    /// Probability at and above which a cause is named, if not that of the calibration. Above 1, no cause is named, and the
    /// evidence is only weighed.
    pub naming_threshold: Option<f64>,
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
    /// Where in the motion the base model is wrong, held-out rows.
    pub by_regime: Vec<Share>,
    /// In which direction.
    pub by_direction: Vec<Share>,
    /// By thirds of every column, and by run.
    pub by_column: Vec<(String, Vec<Share>)>,
    /// Every candidate beside the base law, best first.
    pub scores: Vec<CandidateScore>,
    /// Accepted causes as the calibration weighed them, before those below its threshold were removed.
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

/// Maximum number of causes withdrawn from proposals before the search ends.
const MAX_WITHDRAWN_CAUSES: usize = 4;

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
    let begin = Instant::now();
    let mut whole = TrainTest::new(data, split, question.decimate, &question.rigid_body);
    let mut some = whole.thinned().into_owned();
    progress("fitting the baseline");
    let mut chosen = base(&some, question)?;
    let mut log_findings = question.log_findings.clone();
    let mut sought: Vec<LateChannelKind> = LateChannelKind::ALL.to_vec();
    sought.retain(|late| !question.as_logged.contains(&late.kind()));
    while let Some(found) = late_channel::found(&some, &chosen.model, &sought)? {
        progress("fitting the baseline with a delayed channel");
        log_findings.retain(|finding| finding.kind != found.late.kind());
        log_findings.push(found.finding(data.joint));
        sought.retain(|late| *late != found.late);
        let (law, logged, some_logged) = (chosen.model.spec.law, whole, some);
        whole = found.lag_compensated(logged.clone());
        some = whole.thinned().into_owned();
        chosen = base(&some, question)?;
        // Beside a law that lacked what the lateness hid, another shape and time may have stood in for it.
        if chosen.model.spec.law != law
            && let Some(nearer) = late_channel::found(&some_logged, &chosen.model, &[found.late])?
        {
            log_findings.retain(|finding| finding.kind != nearer.late.kind());
            log_findings.push(nearer.finding(data.joint));
            whole = nearer.lag_compensated(logged);
            some = whole.thinned().into_owned();
            chosen = base(&some, question)?;
        }
    }
    if let Some(weighed) = uncertain_motion::weighed(&whole, &chosen.model) {
        whole = weighed.with_floor();
        some = whole.thinned().into_owned();
        progress("fitting the baseline to rows weighted by the uncertainty of their motion");
        chosen = base(&some, question)?;
    }
    let Baseline { model: mut base, at_rest } = chosen;
    if let Some(aligned) = unknown_zero::aligned(&whole, &base) {
        whole = aligned;
        some = whole.thinned().into_owned();
    }
    if let Some(at_rest) = &at_rest {
        some = some.without(at_rest);
    }
    let seed = question.seed;
    let fits = FitCache::new(&some);
    let whole = match &at_rest {
        Some(at_rest) => whole.without(at_rest),
        None => whole,
    };
    let resolution = base.resolution;
    let as_it_is = question
        .given
        .as_ref()
        .map(|(_, parameters)| predict(parameters, whole.test_rows(), resolution));
    let is_chosen = question.model.is_none() && question.given.is_none();
    let mut refuted = Vec::new();
    let naming_threshold =
        question.naming_threshold.unwrap_or(Calibration::current().naming_threshold);
    let (mut scores, mut weighed, mut decisions) = (Vec::new(), Vec::new(), Vec::new());
    let mut said = Vec::new();
    let proposal = loop {
        let search =
            Search { log: &some, fits: &fits, base: &base, naming_threshold, seed, progress };
        let selection = select::select(&search, &refuted)?;
        if is_chosen
            && let Some(richer) = baseline::reselect_base_law(&some, &base, &selection.extended)?
        {
            progress("restarting with a richer law");
            base = richer;
            refuted.clear();
            weighed.clear();
            decisions.clear();
            continue;
        }
        progress("evaluating on held-out rows");
        let extension = Extension { model: selection.extended, found: selection.found };
        let proposal = proposal::propose(&search, &whole, extension, as_it_is.clone())?;
        if scores.is_empty() {
            scores = selection.scores;
        }
        if weighed.is_empty() {
            weighed = selection.weighed;
        }
        decisions.extend(selection.decisions.into_iter().chain(proposal.decisions.clone()));
        said.extend(proposal.notes.clone());
        refuted.extend(proposal.taken_back.iter().cloned());
        // What was taken back may have stood in the way of another.
        if proposal.taken_back.is_empty() || refuted.len() > MAX_WITHDRAWN_CAUSES {
            break proposal;
        }
    };
    let Proposal { extension, extended, before, after, gain, left_out, .. } = proposal;
    let follows = extension.model.follows.as_ref().filter(|follows| follows.extra);
    let mut log = whole.following(follows).into_owned();
    said.extend(decisions.iter().map(RuleDecision::in_words));
    said.sort_unstable();
    said.dedup();
    log.notes.extend(said);
    let mut baseline = match &question.given {
        Some((spec, parameters)) => given(&log, spec, parameters)?,
        None => outcome(&log, &base)?,
    };
    baseline.test = before.metrics;
    let mut extended = extended.unwrap_or_else(|| baseline.clone());
    extended.test = after.metrics;
    let at = sensitivities::sensitivities(
        &baseline.parameters,
        &[],
        &log.test_tracks,
        baseline.resolution,
    );
    let found = extension.found.iter();
    let mut findings: Vec<Finding> = found.map(|found| found.finding(&extended, &log)).collect();
    let coloured = evaluation::coloured_floor(&log.test_tracks, &after);
    let noise_floor = evaluation::noise_floor(&log.test_tracks, log.decimate).max(coloured);
    let unexplained_memory_rows = unexplained_memory_rows(&after, noise_floor);
    let noise_floor = evaluation::lower_floor(noise_floor, &log.test_tracks, &after).max(coloured);
    findings.extend(observed(|cause| cause.in_log(&log)));
    if findings.is_empty() && unexplained_memory_rows > 0.0 && after.metrics.nrmse_std > NEGLIGIBLE
    {
        let rest = Unexplained {
            after: &after,
            noise_floor,
            times_floor: STRUCTURE,
            log: &log,
            seed: question.seed,
        };
        findings.extend(observed(|cause| cause.in_rest(&rest)));
    }
    progress("certifying");
    let certificates = certificates(&log, &baseline, &extended, &findings, question.seed);
    Ok(Diagnosis {
        log_findings,
        noise_floor,
        by_regime: regime::by_regime(&log.test_tracks, &at),
        by_direction: regime::by_direction(&log.test_tracks, &at),
        by_column: regime::by_column(&log, &at),
        scores,
        weighed,
        decisions,
        certificates,
        auxiliary: follows.map(|follows| follows.column.clone()),
        left_out,
        log,
        baseline,
        extended,
        before,
        after,
        findings,
        gain,
        unexplained_memory_rows,
        seconds: begin.elapsed().as_secs_f64(),
    })
}

/// What causes are seen without a fit of their own.
fn observed(see: impl Fn(&dyn Cause) -> Option<Observation>) -> impl Iterator<Item = Finding> {
    let all = cause::ALL.iter().copied();
    all.filter_map(move |cause| Some(Finding::observed(cause, see(cause)?)))
}

fn base(log: &TrainTest, question: &DiagnosisOptions) -> Result<Baseline, SpecError> {
    match (&question.given, &question.model) {
        (Some((spec, parameters)), _) => baseline::asked_for(log, spec, Some(parameters)),
        (None, Some(spec)) => {
            let spec = spec.clone().on(&log.rigid_body);
            baseline::asked_for(log, &spec, None)
        }
        (None, None) => baseline::choose(log),
    }
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
    baseline: &Outcome,
    extended: &Outcome,
    findings: &[Finding],
    seed: u64,
) -> Certificates {
    let settings = stochastic::Settings { seed, joint: log.train.joint, ..Default::default() };
    let certify = |outcome: &Outcome| {
        let fitted = outcome.estimates.iter().filter(|e| e.std_error.is_some());
        let free: Vec<ParameterId> = fitted.map(|e| e.id).collect();
        stochastic::certify(&outcome.parameters, &free, &log.train_tracks, &settings)
    };
    let before = certify(baseline);
    let after = if extended.spec == baseline.spec { before.clone() } else { certify(extended) };
    let loose = baseline.estimates.iter().filter(|e| e.state != State::Determined);
    let loose: Vec<ParameterId> = loose.map(|e| e.id).collect();
    let causes: Vec<(&str, &[ParameterId])> =
        findings.iter().map(|finding| (finding.cause.name(), finding.cause.acts_on())).collect();
    let reading = stochastic::reading(&before, &loose, &causes);
    Certificates { before, after, reading }
}

/// Returns the autocorrelation time of the residual in rows if it is more than noise, else 0.
fn unexplained_memory_rows(after: &Predicted, noise_floor: f64) -> f64 {
    let memory = autocorrelation_time(after.residuals.iter().map(Vec::as_slice));
    let times = after.metrics.rmse / noise_floor.max(f64::MIN_POSITIVE);
    let hangs_together = memory > MIN_MEMORY_ROWS || times > STRUCTURE_FLOOR_RATIO;
    if times > STRUCTURE && hangs_together { memory } else { 0.0 }
}
