//! Compares the diagnosis with the regression on one unkind world.
//!
//! | world | right | abstained | wrong |
//! |---|---|---|---|
//! | nothing hidden | `none` | `unknown` | any other name |
//! | a detectable effect | its name first, or within `confusable_with` of the first | `none`, `unknown` | any other name |
//! | an undetectable effect | `none`, `unknown`, or its name | - | any other name |
//!
//! An effect is detectable if a refit of the true structure gains three standard errors ([`UnkindTruth::is_detectable`]). Causes
//! that hold for the log whatever is hidden (a filtered torque *is* late) are removed first. Processor time is that of one
//! thread.

use super::GradingError;
use super::diagnose_log;
use super::regression::regress;
use compensator_core::TermKind;
use friction_diagnose::{Diagnosis, DiagnosisOptions, Finding};
use friction_fit::spec::parse_rigid_body;
use joint_log::{Dataset, Split};
use joint_rig::simulated;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use unkind_worlds::{Family, UnkindTruth, UnkindWorld};

/// Verdict on an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The best possible answer.
    Right,
    /// No cause was named for a detectable effect.
    Abstained,
    /// A cause was named that is not there.
    Wrong,
}

impl Verdict {
    /// Returns the verdict as one word.
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::Right => "right",
            Verdict::Abstained => "abstained",
            Verdict::Wrong => "wrong",
        }
    }
}

/// Answer of the diagnosis or the regression for a world.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Named causes, in order.
    pub named: Vec<&'static str>,
    /// Causes that the first one is confusable with.
    pub confusable: Vec<&'static str>,
    /// Verdict on the answer.
    pub verdict: Verdict,
    /// Reduction of the held-out error: 1 - RMSE after / RMSE before.
    pub gain: f64,
    /// Held-out RMSE of the extended model over the floor of the same rows.
    pub error_over_floor: f64,
    /// The true size lies in the 95 % interval; `None` unless the true cause was named first.
    pub size_inside: Option<bool>,
    /// Probability of each finding with a term, and true if its cause is real; empty for the regression.
    pub probabilities: Vec<(f64, bool)>,
    /// Processor time, s.
    pub seconds: f64,
    /// Best candidates, one line, for analysing a miss.
    pub candidates: String,
    /// Further values of the diagnosis, for analysing which of them separate right from wrong names.
    pub figures: Value,
}

/// A world with both answers.
#[derive(Clone, Debug)]
pub struct Contest {
    /// The truth, without its rows.
    pub truth: UnkindTruth,
    /// Rows of the log.
    pub rows: usize,
    /// Answer of the diagnosis, if it was run.
    pub ours: Option<Answer>,
    /// Answer of the regression.
    pub rival: Answer,
}

/// Returns the verdict on causes named in order.
pub fn verdict(
    truth: &UnkindTruth,
    named: &[&'static str],
    confusable: &[&'static str],
) -> Verdict {
    let is_informative = |name: &&&'static str| !truth.true_of_the_log.contains(*name);
    let first = named.iter().find(is_informative).copied().unwrap_or("none");
    let is_first = named.first() == Some(&first);
    let cause = truth.cause();
    let open = first == "none" || first == "unknown";
    if first == cause || (is_first && cause != "none" && confusable.contains(&cause)) {
        return Verdict::Right;
    }
    match (open, !truth.hidden.is_empty() && !truth.is_detectable()) {
        (true, true) => Verdict::Right,
        (true, false) => Verdict::Abstained,
        (false, _) => Verdict::Wrong,
    }
}

/// Runs `work` on one thread and returns its result with the processor time, s.
///
/// # Errors
/// Returns an error if no thread can be created.
pub fn time_on_one_thread<T: Send>(
    work: impl FnOnce() -> T + Send,
) -> Result<(T, f64), GradingError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let clock = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    };
    Ok(pool.install(|| {
        let begin = clock();
        let found = work();
        (found, clock() - begin)
    }))
}

/// Runs the regression, and unless `rival_only` the diagnosis, on the world of a seed in a family.
///
/// # Errors
/// Returns an error if the log cannot be diagnosed, because such a world must not be dropped from the count.
pub fn run_contest(seed: u64, family: Family, rival_only: bool) -> Result<Contest, GradingError> {
    let UnkindWorld { log, truth } = unkind_worlds::draw_family(seed, family);
    let data = simulated::dataset(&log);
    let rigid_body = parse_rigid_body(&truth.rigid_body.join(","))?;
    let rival = rival(&data, &truth, &rigid_body)?;
    let ours = if rival_only { None } else { Some(ours(&data, &truth, rigid_body)?) };
    let truth = UnkindTruth { floor_errors: Vec::new(), torque: Vec::new(), ..truth };
    Ok(Contest { truth, rows: data.rows, ours, rival })
}

fn rival(
    data: &Dataset,
    truth: &UnkindTruth,
    rigid_body: &[TermKind],
) -> Result<Answer, GradingError> {
    let (found, seconds) = time_on_one_thread(|| regress(data, rigid_body))?;
    Ok(Answer {
        candidates: found.describe(),
        verdict: verdict(truth, &found.named, &[]),
        named: found.named,
        confusable: Vec::new(),
        gain: found.gain,
        error_over_floor: found.rmse / truth.floor_nm,
        size_inside: None,
        probabilities: Vec::new(),
        seconds,
        figures: Value::Null,
    })
}

fn ours(
    data: &Dataset,
    truth: &UnkindTruth,
    rigid_body: Vec<TermKind>,
) -> Result<Answer, GradingError> {
    let question = DiagnosisOptions { rigid_body, ..DiagnosisOptions::default() };
    let (answer, seconds) = time_on_one_thread(|| diagnose_log(data.clone(), &question))?;
    let (found, parts) = answer.map_err(|error| error.of(format!("seed {}", truth.seed)))?;
    let named: Vec<&'static str> = found.findings.iter().map(|f| f.cause.name()).collect();
    let first = found.findings.first();
    let confusable: Vec<&'static str> = first.map_or(Vec::new(), |finding| {
        finding.confusable_with.iter().map(|rival| rival.cause.name()).collect()
    });
    let hidden = truth.hidden.first().map(|effect| &effect.hidden);
    let named_first = first.zip(hidden).filter(|(finding, hidden)| {
        finding.cause.name() == hidden.cause && hidden.cause != "unknown"
    });
    Ok(Answer {
        verdict: verdict(truth, &named, &confusable),
        gain: found.gain.value,
        error_over_floor: found.after.metrics.rmse / floor_of_held_out(&found, &parts, truth),
        size_inside: named_first.map(|(finding, hidden)| {
            let [low, high] = finding.size.ci95();
            (low..=high).contains(&hidden.size)
        }),
        probabilities: probabilities(&found, truth),
        seconds,
        candidates: format_candidates(&found),
        figures: figures(&found),
        named,
        confusable,
    })
}

/// Returns the calibrated probability of each finding that was fitted, and whether its cause is hidden in the world. Causes
/// that hold for the log whatever is hidden are left out.
fn probabilities(found: &Diagnosis, truth: &UnkindTruth) -> Vec<(f64, bool)> {
    let is_hidden = |name: &str| truth.is_hidden(name);
    let fitted = found.findings.iter().filter(|finding| {
        let name = finding.cause.name();
        let was_weighed = found.candidates.iter().any(|candidate| candidate.cause == finding.cause);
        was_weighed && !truth.true_of_the_log.contains(&name)
    });
    let real = |finding: &Finding| {
        let mut names = finding.confusable_with.iter().map(|rival| rival.cause.name());
        is_hidden(finding.cause.name()) || names.any(is_hidden)
    };
    fitted.map(|finding| (finding.probability, real(finding))).collect()
}

/// Values of a diagnosis: first finding, gain, and its own noise floor.
fn figures(found: &Diagnosis) -> Value {
    let first = found.findings.first().map(|first| {
        json!({
            "size": first.size.value,
            "ci95": first.size.ci95(),
            "p_value": first.p_value,
            "probability": first.probability,
            "stability": first.stability,
            "share_of_residual": first.share_of_residual,
        })
    });
    json!({
        "first": first,
        "gain_ci95": found.gain.ci95,
        "before_rmse": found.before.metrics.rmse,
        "after_rmse": found.after.metrics.rmse,
        "own_floor": found.noise_floor,
        "left_over": found.unexplained_memory_rows,
        "after_nrmse": found.after.metrics.nrmse_std,
    })
}

/// Returns the best candidates of a diagnosis, one line.
pub(super) fn format_candidates(found: &Diagnosis) -> String {
    let candidates = found.candidates.iter().take(5).map(|candidate| {
        format!(
            "{}({}) {:.3} p {:.2}",
            candidate.cause.name(),
            candidate.columns().join(","),
            candidate.figures.alone,
            candidate.probability
        )
    });
    candidates.collect::<Vec<_>>().join("; ")
}

/// Returns the floor on the held-out rows of a diagnosis, Nm.
fn floor_of_held_out(found: &Diagnosis, parts: &Split, truth: &UnkindTruth) -> f64 {
    let (mut sum, mut rows) = (0.0, 0usize);
    for track in &found.log.test_tracks {
        let Some(part) = parts.test.get(track.run) else { continue };
        let Some(errors) = truth.floor_errors.get(part.run) else { continue };
        let from = part.rows.start + track.first_row;
        for error in errors.iter().skip(from).take(track.torque.len()) {
            sum += error * error;
            rows += 1;
        }
    }
    if rows > 0 { (sum / rows as f64).sqrt() } else { truth.floor_nm }
}

impl Answer {
    fn json(&self) -> Value {
        json!({
            "named": self.named,
            "confusable_with": self.confusable,
            "verdict": self.verdict.name(),
            "gain": self.gain,
            "error_over_floor": self.error_over_floor,
            "size_inside": self.size_inside,
            "probabilities": self.probabilities,
            "processor_seconds": self.seconds,
            "candidates": self.candidates,
            "figures": self.figures,
        })
    }

    /// Returns the named causes, joined by `+`.
    pub fn names(&self) -> String {
        if self.named.is_empty() { "none".into() } else { self.named.join("+") }
    }
}

impl Contest {
    /// Returns the contest as JSON.
    pub fn json(&self) -> Value {
        json!({
            "truth": self.truth.json(),
            "rows": self.rows,
            "ours": self.ours.as_ref().map(Answer::json),
            "rival": self.rival.json(),
        })
    }

    /// Returns the contest as one line.
    pub fn line(&self) -> String {
        let truth = &self.truth;
        let ours = self.ours.as_ref().map_or("-".into(), |ours| {
            format!(
                "{} {} gain {:.2} error/floor {:.2} {:.1} s",
                ours.verdict.name(),
                ours.names(),
                ours.gain,
                ours.error_over_floor,
                ours.seconds
            )
        });
        format!(
            "seed {} {} {} {} rows: {} (effect {:.3} floors, {:.1} errors) | ours {ours} | rival {} {} gain {:.2} {:.1} s",
            truth.seed,
            truth.sensor.name(),
            truth.plant,
            self.rows,
            truth.cause(),
            truth.effect_in_floors(),
            truth.gain_in_errors(),
            self.rival.verdict.name(),
            self.rival.names(),
            self.rival.gain,
            self.rival.seconds
        )
    }
}
