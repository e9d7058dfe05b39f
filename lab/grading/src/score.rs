//! Scores a set of unkind worlds: tables by sensors and by size of the effect, and the misses.

use super::contest::{Answer, Contest, Verdict};
use super::statistics::quantile;
use std::fmt::Write;
use unkind_worlds::SensorKind;

/// Lower bounds of the bins of the effect's size, in floors.
const EFFECT_BINS: [f64; 7] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Maximum held-out error that counts as optimal, in floors.
const MAX_OPTIMAL_ERROR: f64 = 1.2;

/// Number of answers by verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Right answers.
    pub right: usize,
    /// Wrong causes.
    pub wrong: usize,
    /// Abstentions.
    pub abstained: usize,
}

impl Count {
    /// Counts the verdicts of answers.
    pub fn of<'a>(answers: impl Iterator<Item = &'a Answer>) -> Self {
        let mut count = Self::default();
        for answer in answers {
            match answer.verdict {
                Verdict::Right => count.right += 1,
                Verdict::Wrong => count.wrong += 1,
                Verdict::Abstained => count.abstained += 1,
            }
        }
        count
    }

    fn cell(self) -> String {
        format!("{} / {} / {}", self.right, self.wrong, self.abstained)
    }
}

fn ours(contest: &Contest) -> Option<&Answer> {
    contest.ours.as_ref()
}

fn rival(contest: &Contest) -> Option<&Answer> {
    Some(&contest.rival)
}

type Side = fn(&Contest) -> Option<&Answer>;
const SIDES: [Side; 2] = [ours, rival];

fn row(text: &mut String, name: &str, contests: &[&Contest]) {
    let [ours, rival] = SIDES.map(|side| Count::of(contests.iter().filter_map(|c| side(c))).cell());
    let _ = writeln!(text, "| {name} | {} | {ours} | {rival} |", contests.len());
}

/// Formats a share.
fn share(good: usize, all: usize) -> String {
    format!("{good} of {all} ({:.1} %)", 100.0 * good as f64 / all.max(1) as f64)
}

/// Returns the tables, without the misses and without machine-dependent values.
pub fn tables(contests: &[Contest]) -> String {
    let pick =
        |of: &dyn Fn(&Contest) -> bool| contests.iter().filter(|c| of(c)).collect::<Vec<_>>();
    let mut text = String::new();
    let head = "| worlds | diagnosis: right / wrong / abstained | regression: right / wrong / abstained |\n|---|---|---|---|\n";
    let _ = write!(text, "| sensors {head}");
    for kind in SensorKind::ALL {
        row(&mut text, kind.name(), &pick(&|c| c.truth.sensor == kind));
    }
    row(&mut text, "**all**", &pick(&|_| true));
    let _ = write!(text, "\n| hidden effect {head}");
    row(&mut text, "nothing", &pick(&|c| c.truth.hidden.is_empty()));
    let hides = |c: &Contest| !c.truth.hidden.is_empty();
    row(&mut text, "detectable", &pick(&|c| hides(c) && c.truth.is_detectable()));
    row(&mut text, "undetectable", &pick(&|c| hides(c) && !c.truth.is_detectable()));
    for plant in ["bristles", "slip-elements", "lubricated-seal"] {
        row(&mut text, plant, &pick(&|c| c.truth.plant == plant));
    }
    let _ = write!(text, "\n| effect, in floors {head}");
    for (at, from) in EFFECT_BINS.iter().enumerate() {
        let to = EFFECT_BINS.get(at + 1).copied().unwrap_or(f64::INFINITY);
        let inside = |c: &Contest| hides(c) && (*from..to).contains(&c.truth.effect_in_floors());
        row(&mut text, &format!("{from} to {to}"), &pick(&inside));
    }
    let _ = write!(text, "\n| detectable cause {head}");
    let mut causes: Vec<&str> = contests.iter().map(|c| c.truth.cause()).collect();
    causes.sort_unstable();
    causes.dedup();
    for cause in causes {
        let is_of_cause =
            |c: &Contest| hides(c) && c.truth.is_detectable() && c.truth.cause() == cause;
        row(&mut text, cause, &pick(&is_of_cause));
    }
    text += "\n| quantity | diagnosis | regression |\n|---|---|---|\n";
    let both = |of: &dyn Fn(Vec<&Answer>) -> String| {
        SIDES.map(|side| of(contests.iter().filter_map(side).collect()))
    };
    let mut line = |what: &str, of: &dyn Fn(Vec<&Answer>) -> String| {
        let [ours, rival] = both(of);
        let _ = writeln!(text, "| {what} | {ours} | {rival} |");
    };
    line("held-out error within 1.2 of the floor", &|answers| {
        share(
            answers.iter().filter(|a| a.error_over_floor <= MAX_OPTIMAL_ERROR).count(),
            answers.len(),
        )
    });
    line("true size inside its 95 % interval", &|answers| {
        let sized: Vec<bool> = answers.iter().filter_map(|a| a.size_inside).collect();
        share(sized.iter().filter(|inside| **inside).count(), sized.len())
    });
    line("negative gains", &|answers| answers.iter().filter(|a| a.gain < 0.0).count().to_string());
    text + &calibration(contests)
}

/// Lower bounds of the bins of a finding's probability.
const PROBABILITY_BINS: [f64; 4] = [0.0, 0.6, 0.9, 1.0];

/// Returns the table of the calibration: how many findings of a probability are real, and the Brier score.
fn calibration(contests: &[Contest]) -> String {
    let findings: Vec<(f64, bool)> =
        contests.iter().filter_map(ours).flat_map(|answer| answer.probabilities.clone()).collect();
    let mut text =
        String::from("\n| probability of a finding | findings | real |\n|---|---|---|\n");
    for bounds in PROBABILITY_BINS.windows(2) {
        let are_real: Vec<bool> = findings
            .iter()
            .filter(|(p, _)| (bounds[0]..bounds[1]).contains(p))
            .map(|f| f.1)
            .collect();
        let real = are_real.iter().filter(|real| **real).count();
        let _ = writeln!(
            text,
            "| {:.1} to {:.1} | {} | {} |",
            bounds[0],
            bounds[1],
            are_real.len(),
            share(real, are_real.len())
        );
    }
    let error = |(p, real): &(f64, bool)| (p - f64::from(u8::from(*real))).powi(2);
    let brier = findings.iter().map(error).sum::<f64>() / findings.len().max(1) as f64;
    let _ = writeln!(text, "\nBrier score of the findings: {brier:.3}");
    text
}

/// Returns the file in git with these tables: column names and rows of each, with tabs between cells.
pub fn file(contests: &[Contest], seed: u64, tables: &str) -> String {
    let worlds = contests.len();
    let half = worlds / 2;
    let mut text = format!(
        "Simulated: {worlds} worlds of seed base {seed}, by `cargo run --release -p friction-grading --example unkind -- \
         --worlds {half} --seed {seed} --update`.\n\n"
    );
    for line in tables.lines().filter(|line| !line.starts_with("|---")) {
        let cells = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |"));
        text += &cells.unwrap_or(line).replace(" | ", "\t");
        text.push('\n');
    }
    text
}

/// Returns the processor times: median, 95th percentile, maximum, s.
pub fn times(contests: &[Contest]) -> String {
    let of = |side: Side| {
        let seconds: Vec<f64> = contests.iter().filter_map(side).map(|a| a.seconds).collect();
        let at = |share| quantile(seconds.iter().copied(), share);
        format!("median {:.2} s, 95 % {:.2} s, most {:.2} s", at(0.5), at(0.95), at(1.0))
    };
    format!("processor time: diagnosis {}; regression {}", of(ours), of(rival))
}

/// Lists the worlds that the diagnosis missed, or the regression if the diagnosis was not run.
pub fn misses(contests: &[Contest]) -> String {
    let mut text = String::new();
    for contest in contests {
        let answer = contest.ours.as_ref().unwrap_or(&contest.rival);
        if answer.verdict == Verdict::Right {
            continue;
        }
        let _ = writeln!(text, "{}", contest.line());
        let _ = writeln!(text, "    {}", contest.truth.description);
        if !answer.candidates.is_empty() {
            let _ = writeln!(text, "    candidates: {}", answer.candidates);
        }
    }
    text
}
