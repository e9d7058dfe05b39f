//! The diagnosis graded on scenarios whose truth is known.
//!
//! [`simulated_machines::scenarios`] hides an effect; [`friction_identification::diagnose`] sees the log alone; here the two meet. The
//! scenarios used to tune the diagnosis are drawn from [`TUNING`], those that grade it from [`GRADING`]: another
//! seed is another machine, another campaign, other sensors, not the same with other noise.

mod cause_columns;
pub mod contest;
pub mod measured;
pub mod planted;
pub mod regression;
pub mod score;
mod stop_operator;

use crate::simulated;
use friction_identification::data::{Dataset, Split, SplitRule, split};
use friction_identification::diagnose::{Diagnosis, Finding, Question, diagnose};
use friction_identification::log_check::{self, Correct};
use rayon::prelude::*;
use simulated_machines::scenarios::{Kind, Scenario, benchmark, draw};

/// Seed of the scenarios that may be looked at while the diagnosis is made better.
pub const TUNING: u64 = 1;

/// Seed of the scenarios that judge it.
pub const GRADING: u64 = 20_261_122;

/// How a diagnosis did on one scenario.
#[derive(Clone, Debug)]
pub struct Grade {
    /// What was hidden.
    pub kind: Kind,
    /// Seed of the scenario.
    pub seed: u64,
    /// The hidden causes, strongest first; empty where none.
    pub hidden: Vec<&'static str>,
    /// The causes named, in order.
    pub named: Vec<&'static str>,
    /// Causes the first finding says it cannot be told from.
    pub confusable: Vec<&'static str>,
    /// Whether the first cause is right (see [`grade`]).
    pub right: bool,
    /// Whether the true size lies in the interval, where one cause was hidden and named first.
    pub size_inside: Option<bool>,
    /// True size and named one.
    pub sizes: Option<(f64, f64, [f64; 2])>,
    /// Held-out RMSE of the extended model over the sensor's noise.
    pub error_over_noise: f64,
    /// RMS the effect shows over the noise, 0 where nothing was hidden.
    pub visible: f64,
    /// Time, s.
    pub seconds: f64,
    /// Rows of the log.
    pub rows: usize,
    /// A line on what was heard.
    pub heard: String,
}

/// Grades a diagnosis.
///
/// One or two effects: the first cause is one that was hidden. Nothing: `none`. A decoy: the true cause
/// first, and the decoy not named. Confounded: the true cause or its twin first, and the other one named
/// as not told apart; or `unknown`. Outside the catalogue: `unknown`, or a cause that says it cannot be told
/// from `unknown`.
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
            let blamed = found.findings.iter().any(|finding| finding.columns.iter().any(is_decoy));
            is_first_true && !blamed
        }
        Kind::Confounded => {
            let both: Vec<&str> = hidden.iter().chain(&truth.confusable_with).copied().collect();
            let hedged = confusable.iter().any(|name| both.contains(name));
            named.first().is_some_and(|name| both.contains(name) && hedged) || is_open
        }
        Kind::Outside => {
            let hedged = |f: &Finding| f.confusable_with.iter().any(|r| !r.cause.is_named());
            is_open || first.is_some_and(hedged)
        }
    };
    let only = matches!(kind, Kind::One(_) | Kind::Decoy) && is_first_true;
    let sizes = first.filter(|_| only).and_then(|finding| {
        let hidden = truth.hidden.first()?;
        Some((hidden.size, finding.size.value, finding.size.ci95))
    });
    let heard = found
        .scores
        .iter()
        .take(5)
        .map(|h| {
            format!(
                "{}({}) {:.3} p{:.0e}",
                h.cause.name(),
                h.columns.join(","),
                h.share,
                h.fit.p_value
            )
        })
        .collect::<Vec<_>>()
        .join("; ");
    Grade {
        kind,
        seed,
        hidden,
        named,
        confusable,
        right,
        size_inside: sizes.map(|(size, _, [low, high])| (low..=high).contains(&size)),
        sizes,
        error_over_noise: found.after.metrics.rmse / truth.noise_nm,
        visible: truth.hidden.first().map_or(0.0, |hidden| hidden.visible_rms_nm / truth.noise_nm),
        seconds: found.seconds,
        rows: scenario.log.rows(),
        heard,
    }
}

/// The diagnosis as a user gets it: the log checked, its motion reconstructed, every run left out once.
///
/// # Errors
/// One line, where the log cannot be split or diagnosed.
pub fn ask(data: Dataset, question: &Question) -> Result<(Diagnosis, Split), String> {
    let checked = log_check::check(data, Correct::default());
    let parts = split(&checked.data, &SplitRule::EachOut, 0).map_err(|e| e.to_string())?;
    let question = Question { log_findings: checked.findings, ..question.clone() };
    let found = diagnose(&checked.data, &parts, &question, &|_| {}).map_err(|e| e.to_string())?;
    Ok((found, parts))
}

/// Draws a scenario, diagnoses it, grades the diagnosis.
///
/// # Errors
/// One line, where the log cannot be split or diagnosed: such a scenario must not drop out of the count.
pub fn examine(kind: Kind, seed: u64) -> Result<Grade, String> {
    let failed = |why: String| format!("{kind:?}, seed {seed}: {why}");
    let scenario = draw(kind, seed);
    let data = simulated::dataset(&scenario.log);
    let (found, _) = ask(data, &Question::default()).map_err(failed)?;
    Ok(grade(kind, seed, &scenario, &found))
}

/// Examines a benchmark of scenarios; see [`benchmark`].
///
/// # Errors
/// As [`examine`], of the first scenario that fails.
pub fn examine_benchmark(seed_base: u64, per_kind: usize) -> Result<Vec<Grade>, String> {
    let scenarios: Vec<(Kind, u64)> = benchmark(seed_base, per_kind).collect();
    scenarios.into_par_iter().map(|(kind, seed)| examine(kind, seed)).collect()
}
