//! Verdicts on the names that a rule gives to the candidates of contests.
//!
//! | log | right | abstained | wrong |
//! |---|---|---|---|
//! | nothing hidden | `none` | no cause, but more error than noise (`unknown`) | a cause |
//! | detectable effects | one of them first, or among the first's `confusable_with` | no cause | another cause |
//! | effects that cannot be seen | no cause, or one of them | - | another cause |
//!
//! Causes that hold for the log whatever is hidden are neither right nor wrong. A measured log is right if its first cause is
//! known, and otherwise wrong or, without a cause, abstained.

use crate::evidence_table::{EvidenceRow, Truth};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Remaining error in noise floors above which a log without a cause is not explained.
const MAX_FLOORS_OF_NONE: f64 = 2.5;

/// Counts of a group of logs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdicts {
    /// Logs with a right first answer.
    pub right: usize,
    /// Logs without an answer.
    pub abstained: usize,
    /// Logs with a wrong first name.
    pub wrong: usize,
    /// Detectable effects.
    pub effects: usize,
    /// Detectable effects that were named at any place.
    pub found: usize,
}

/// The judged logs of an evidence table.
#[derive(Clone, Debug, Default)]
pub struct Grades {
    /// By origin and by what is hidden.
    pub groups: BTreeMap<(String, &'static str), Verdicts>,
    /// Effects of simulated logs by cause.
    pub causes: BTreeMap<String, Effects>,
    /// How often each cause was named first and wrongly.
    pub wrong: BTreeMap<String, usize>,
}

/// Counts of the effects of a cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects {
    /// Those that are detectable.
    pub detectable: usize,
    /// Those of them that were named.
    pub found: usize,
}

impl Grades {
    /// Judges a rule. `score` ranks the candidates; those at or above `least` are named.
    pub fn new(rows: &[EvidenceRow], score: &[f64], least: f64) -> Self {
        let mut by_log: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (at, row) in rows.iter().enumerate() {
            by_log.entry(&row.log).or_default().push(at);
        }
        let mut grades = Self::default();
        for log_rows in by_log.values() {
            grades.judge(rows, log_rows, score, least);
        }
        grades
    }

    fn judge(&mut self, rows: &[EvidenceRow], log_rows: &[usize], score: &[f64], least: f64) {
        let log = &rows[log_rows[0]];
        let mut named: Vec<usize> = log_rows.to_vec();
        named.retain(|at| {
            let row = &rows[*at];
            row.is_candidate && score[*at] >= least && (!row.is_of_log || row.is_detectable)
        });
        named.sort_by(|a, b| score[*b].total_cmp(&score[*a]));
        let effects: Vec<&EvidenceRow> =
            log_rows.iter().map(|at| &rows[*at]).filter(|row| row.is_detectable).collect();
        let is_named =
            |effect: &EvidenceRow| named.iter().any(|at| rows[*at].cause == effect.cause);
        let is_real = |row: &EvidenceRow| {
            let is_hidden = |cause: &String| effects.iter().any(|effect| effect.cause == *cause);
            matches!(row.truth, Truth::Real | Truth::Accepted)
                || row.confusable_with.iter().any(is_hidden)
        };
        let kind = match (log.is_measured, log.hidden, effects.len()) {
            (true, ..) => "measured",
            (_, 0, _) => "clean",
            (_, _, 0) => "not detectable",
            (_, 1, _) => "one",
            _ => "two",
        };
        let group = self.groups.entry((log.origin.clone(), kind)).or_default();
        let is_open = log.floors > MAX_FLOORS_OF_NONE;
        match named.first().map(|at| &rows[*at]) {
            Some(first) if is_real(first) => group.right += 1,
            Some(first) => {
                group.wrong += 1;
                *self.wrong.entry(first.cause.clone()).or_default() += 1;
            }
            None if kind == "not detectable" || (kind == "clean" && !is_open) => group.right += 1,
            None => group.abstained += 1,
        }
        if log.is_measured {
            return;
        }
        for effect in effects {
            let found = usize::from(is_named(effect));
            group.effects += 1;
            group.found += found;
            let counts = self.causes.entry(effect.cause.clone()).or_default();
            counts.detectable += 1;
            counts.found += found;
        }
    }

    /// Returns the sum over the groups that meet a condition.
    pub fn sum(&self, is_meant: impl Fn(&str, &str) -> bool) -> Verdicts {
        let mut sum = Verdicts::default();
        for ((origin, kind), verdicts) in &self.groups {
            if is_meant(origin, kind) {
                sum.right += verdicts.right;
                sum.abstained += verdicts.abstained;
                sum.wrong += verdicts.wrong;
                sum.effects += verdicts.effects;
                sum.found += verdicts.found;
            }
        }
        sum
    }

    /// Returns the tables by origin and by cause.
    pub fn tables(&self) -> String {
        let mut text = String::from(
            "| origin | hidden | right | abstained | wrong | effects found |\n|---|---|---|---|---|---|\n",
        );
        let mut line = |origin: &str, kind: &str, verdicts: &Verdicts| {
            let Verdicts { right, abstained, wrong, effects, found } = verdicts;
            let _ = writeln!(
                text,
                "| {origin} | {kind} | {right} | {abstained} | {wrong} | {found} of {effects} |"
            );
        };
        for ((origin, kind), verdicts) in &self.groups {
            line(origin, kind, verdicts);
        }
        for kind in ["clean", "not detectable", "one", "two", "measured"] {
            line("all", kind, &self.sum(|_, log_kind| log_kind == kind));
        }
        text += "\n| cause | detectable | found |\n|---|---|---|\n";
        for (cause, Effects { detectable, found }) in &self.causes {
            let _ = writeln!(text, "| {cause} | {detectable} | {found} |");
        }
        let words: Vec<String> =
            self.wrong.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
        text + "\nwrong first names: " + &words.join(", ") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_diagnose::contest_calibration::FIGURES;

    fn row(log: &str, hidden: usize, cause: &str, truth: Truth) -> EvidenceRow {
        EvidenceRow {
            log: log.into(),
            origin: "bristles".into(),
            is_measured: false,
            hidden,
            cause: cause.into(),
            follows: String::new(),
            truth,
            is_of_log: false,
            is_detectable: truth == Truth::Real,
            is_candidate: true,
            confusable_with: Vec::new(),
            law: String::new(),
            inclusion: 0.0,
            materiality: 0.0,
            floors: 1.0,
            rmse: [0.0; 2],
            figures: vec![0.0; FIGURES.len()],
        }
    }

    #[test]
    fn new_counts_first_names_and_found_effects() {
        let rows = [
            row("a", 1, "backlash", Truth::Real),
            row("a", 1, "time-drift", Truth::False),
            row("b", 0, "time-drift", Truth::False),
            row("c", 2, "backlash", Truth::Real),
            row("c", 2, "torque-offset", Truth::Real),
        ];
        let grades = Grades::new(&rows, &[0.9, 0.8, 0.7, 0.6, 0.4], 0.5);
        let all = grades.sum(|_, _| true);
        assert_eq!((all.right, all.abstained, all.wrong), (2, 0, 1));
        assert_eq!((all.effects, all.found), (3, 2));
        let strict = Grades::new(&rows, &[0.9, 0.8, 0.7, 0.6, 0.4], 0.95).sum(|_, _| true);
        assert_eq!((strict.right, strict.abstained, strict.wrong), (1, 2, 0));
    }
}
