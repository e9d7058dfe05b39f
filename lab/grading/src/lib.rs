//! Grades the diagnosis on scenarios with a known truth.
//!
//! [`unkind_worlds::planned`] hides an effect in a log, and [`friction_diagnose`] receives only the
//! log. Seeds from [`TUNING_SEED`] serve to tune the diagnosis, seeds from [`GRADING_SEED`] to grade it. Another seed is another machine,
//! campaign and set of sensors, and not only other noise.

mod boosting;
pub mod calibrated_rule;
pub mod calibration_fit;
pub mod calibration_tables;
mod cause_regressors;
pub mod contest;
pub mod contest_figures;
pub mod contest_logs;
pub mod contest_verdicts;
mod error;
pub mod evidence_table;
pub mod gear_play;
pub mod measured;
pub mod planted;
pub mod regression;
mod regression_trees;
mod regressors;
pub mod score;
mod statistics;
mod stop_operator;
pub mod transfer_log;
pub mod transfer_product;
pub mod transfer_rivals;

pub use error::{GradingError, end};

use friction_diagnose::{Diagnosis, DiagnosisOptions, Finding, diagnose};
use joint_log::log_check::{self, CheckedLog, Corrections};
use joint_log::{Dataset, Split, SplitRule, split};
use joint_rig::simulated;
use rayon::prelude::*;
use simulated_machines::scenarios::Scenario;
use unkind_worlds::planned::{Kind, benchmark, draw};

/// Base seed of the scenarios for tuning the diagnosis.
pub const TUNING_SEED: u64 = 1;

/// Base seed of the scenarios for grading the diagnosis.
pub const GRADING_SEED: u64 = 20_261_122;

/// Result of a diagnosis on one scenario.
#[derive(Clone, Debug)]
pub struct Grade {
    /// Kind of the scenario.
    pub kind: Kind,
    /// Seed of the scenario.
    pub seed: u64,
    /// Hidden causes, strongest first; empty if none.
    pub hidden: Vec<&'static str>,
    /// Named causes, in order.
    pub named: Vec<&'static str>,
    /// Causes that the first finding is confusable with.
    pub confusable: Vec<&'static str>,
    /// The first cause is right (see [`grade`]).
    pub right: bool,
    /// The sizes; `None` unless one cause was hidden and named first.
    pub sizes: Option<Sizes>,
    /// Reduction of the held-out error.
    pub gain: f64,
    /// Plain held-out RMSE of the extended model over the sensor's noise.
    pub error_over_noise: f64,
    /// RMS of the visible effect over the noise; 0 if nothing was hidden.
    pub visible: f64,
    /// Run time, s.
    pub seconds: f64,
    /// Rows of the log.
    pub rows: usize,
    /// Best candidates, one line.
    pub candidates: String,
}

/// Sizes of an effect, in the unit of its cause.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// The hidden size.
    pub hidden: f64,
    /// The estimated size.
    pub estimated: f64,
    /// Interval of the estimate.
    pub ci95: [f64; 2],
}

impl Sizes {
    /// Returns true if the hidden size lies in the interval.
    pub fn is_inside(&self) -> bool {
        (self.ci95[0]..=self.ci95[1]).contains(&self.hidden)
    }
}

/// Grades a diagnosis.
///
/// With one or two effects, the first cause must be a hidden one. Without an effect, the answer must be `none`. With a decoy,
/// the true cause must be first, and no finding may use the decoy.
///
/// Confounded: the true cause or its twin is first and declares the other as confusable, or the first is `unknown`. Outside
/// the catalogue: the first is `unknown`, or declares `unknown` as confusable.
pub fn grade(kind: Kind, seed: u64, scenario: &Scenario, found: &Diagnosis) -> Grade {
    let truth = &scenario.truth;
    let hidden: Vec<&'static str> = truth.hidden.iter().map(|hidden| hidden.cause).collect();
    let named: Vec<&'static str> = found.findings.iter().map(|f| f.cause.name()).collect();
    let first = found.findings.first();
    let confusable: Vec<&'static str> = first.map_or(Vec::new(), |finding| {
        finding.confusable_with.iter().map(|rival| rival.cause.name()).collect()
    });
    let is_open = first.is_some_and(|finding| !finding.cause.is_named());
    let is_first_true = named.first().is_some_and(|name| hidden.contains(name));
    let right = match kind {
        Kind::None => named.is_empty(),
        Kind::One(_) | Kind::Two(..) => is_first_true,
        Kind::Decoy => {
            let is_decoy = |name: &String| truth.decoys.iter().any(|decoy| decoy.column == name);
            let names_decoy =
                found.findings.iter().any(|finding| finding.columns.iter().any(is_decoy));
            is_first_true && !names_decoy
        }
        Kind::Confounded => {
            let both: Vec<&str> = hidden.iter().chain(&truth.confusable_with).copied().collect();
            let is_confusable = confusable.iter().any(|name| both.contains(name));
            named.first().is_some_and(|name| both.contains(name) && is_confusable) || is_open
        }
        Kind::Outside => {
            let is_confusable = |f: &Finding| f.confusable_with.iter().any(|r| !r.cause.is_named());
            is_open || first.is_some_and(is_confusable)
        }
    };
    let only = matches!(kind, Kind::One(_) | Kind::Decoy) && is_first_true;
    let sizes = first.filter(|_| only).and_then(|finding| {
        let hidden = truth.hidden.first()?;
        let (estimated, ci95) = (finding.size.value, finding.size.ci95());
        Some(Sizes { hidden: hidden.size, estimated, ci95 })
    });
    let candidates = contest::format_candidates(found);
    Grade {
        kind,
        seed,
        hidden,
        named,
        confusable,
        right,
        sizes,
        gain: found.gain.value,
        error_over_noise: plain_rmse(found) / truth.noise_nm,
        visible: truth.hidden.first().map_or(0.0, |hidden| hidden.visible_rms_nm / truth.noise_nm),
        seconds: found.seconds,
        rows: scenario.log.rows(),
        candidates,
    }
}

/// Returns the held-out error of the extended model, Nm, over all rows that the diagnosis uses. Its own error weighs rows by how
/// well its laws describe them, so it may hide what it does not model.
fn plain_rmse(found: &Diagnosis) -> f64 {
    let log = &found.log;
    let tracks = if found.left_out.is_some() { &log.train_tracks } else { &log.test_tracks };
    let (mut sum, mut rows) = (0.0, 0usize);
    for (track, model) in tracks.iter().zip(&found.after.torque) {
        for row in (0..track.len()).filter(|row| track.is_included(*row)) {
            sum += (track.torque[row] - model[row]).powi(2);
            rows += 1;
        }
    }
    (sum / rows.max(1) as f64).sqrt()
}

/// Diagnoses a log as the command does: the log is checked, its motion reconstructed, and every run left out once.
///
/// # Errors
/// Returns an error if the command would refuse the log, or it cannot be split or diagnosed.
pub fn diagnose_log(
    data: Dataset,
    question: &DiagnosisOptions,
) -> Result<(Diagnosis, Split), GradingError> {
    log_check::refuse(&data)?;
    let CheckedLog { data, findings, suspicion, .. } =
        log_check::check(data, Corrections::default());
    if let Some(suspicion) = suspicion {
        return Err(suspicion.error(&data).into());
    }
    let parts = split(&data, &SplitRule::LeaveOneRunOut, 0)?;
    let question = DiagnosisOptions { log_findings: findings, ..question.clone() };
    let found = diagnose(&data, &parts, &question, &|_| {})?;
    Ok((found, parts))
}

/// Draws a scenario and grades its diagnosis.
///
/// # Errors
/// Returns an error if the log cannot be diagnosed, because such a scenario must not be dropped from the count.
pub fn grade_scenario(kind: Kind, seed: u64) -> Result<Grade, GradingError> {
    let scenario = draw(kind, seed);
    let data = simulated::dataset(&scenario.log);
    let (found, _) = diagnose_log(data, &DiagnosisOptions::default())
        .map_err(|error| error.of(format!("{kind:?}, seed {seed}")))?;
    Ok(grade(kind, seed, &scenario, &found))
}

/// Grades all scenarios of a benchmark; see [`benchmark`].
///
/// # Errors
/// As [`grade_scenario`], for the first scenario that fails.
pub fn grade_benchmark(seed_base: u64, per_kind: usize) -> Result<Vec<Grade>, GradingError> {
    let scenarios: Vec<(Kind, u64)> = benchmark(seed_base, per_kind).collect();
    scenarios.into_par_iter().map(|(kind, seed)| grade_scenario(kind, seed)).collect()
}
