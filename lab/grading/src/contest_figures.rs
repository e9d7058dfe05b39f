//! The figures by which the contest is judged, as a table with limits.
//!
//! A row of the table: the group of logs, the figure, its value, and the limits within which it must lie. The limits are set by
//! hand when a table is accepted; a new value outside of them on either side is a change that somebody must look at.

use crate::GradingError;
use crate::contest_verdicts::Grades;
use crate::evidence_table::{EvidenceRow, Truth};
use std::fmt::Write;

/// Name of the table in the repository.
pub const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/graded/contest.tsv");

/// Names of the groups of logs: real machines, the worlds that the calibration saw, and others.
pub const LOG_GROUPS: [&str; 3] =
    ["measured, each machine left out", "worlds of the fit, left out", "fresh worlds"];

/// Name of the share of the worlds with two effects of which both are found.
const BOTH_FOUND: &str = "both of two found, %";

const HEAD: &str = "logs\tfigure\tvalue\tlower\tupper";

/// A row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureRow {
    /// Group of logs.
    pub logs: String,
    /// Name of the figure.
    pub figure: String,
    /// Its value.
    pub value: f64,
    /// The limits.
    pub limits: [f64; 2],
}

impl FigureRow {
    /// Returns true if the value is within the limits.
    pub fn is_within(&self) -> bool {
        (self.limits[0]..=self.limits[1]).contains(&self.value)
    }
}

/// Returns the figures of a group of logs. `named` is the probability at and above which a cause is named.
pub fn figures(
    logs: &str,
    rows: &[EvidenceRow],
    probabilities: &[f64],
    named: f64,
) -> Vec<FigureRow> {
    let mut table = Vec::new();
    let mut add = |figure: &str, value: f64| {
        let figure = figure.to_owned();
        table.push(FigureRow { logs: logs.into(), figure, value, limits: [value, value] });
    };
    let grades = Grades::new(rows, probabilities, named);
    let all = grades.sum(|_, _| true);
    if rows.iter().any(|row| row.is_measured) {
        add("logs", (all.right + all.abstained + all.wrong) as f64);
        add("right first", all.right as f64);
        add("wrong first", all.wrong as f64);
    } else {
        let of = |kind: &str| grades.sum(|_, log_kind| log_kind == kind);
        let share = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let clean = of("clean");
        let seen = [of("one"), of("two")];
        let total = seen
            .iter()
            .map(|verdicts| verdicts.right + verdicts.abstained + verdicts.wrong)
            .sum::<usize>();
        add("worlds", (all.right + all.abstained + all.wrong) as f64);
        add("detectable effects", all.effects as f64);
        add("detectable effects found, %", share(all.found, all.effects));
        add("worlds with effects: wrong first, %", share(seen[0].wrong + seen[1].wrong, total));
        add(
            "clean worlds named wrongly, %",
            share(clean.wrong, clean.right + clean.abstained + clean.wrong),
        );
        add(BOTH_FOUND, share(both_found(rows, probabilities, named), of_two(rows)));
    }
    let judged: Vec<(f64, f64)> = rows
        .iter()
        .zip(probabilities)
        .filter(|(row, _)| row.truth != Truth::Unknown && row.case(1.0, 0).is_some())
        .map(|(row, p)| (*p, f64::from(u8::from(row.truth == Truth::Real))))
        .collect();
    let real = |low: f64, high: f64| {
        let probabilities: Vec<f64> =
            judged.iter().filter(|(p, _)| (low..high).contains(p)).map(|(_, y)| *y).collect();
        (
            probabilities.len() as f64,
            100.0 * probabilities.iter().sum::<f64>() / (probabilities.len() as f64).max(1.0),
        )
    };
    for (name, low, high) in [("0.9 or more", 0.9, 2.0), ("0.6 to 0.9", 0.6, 0.9)] {
        add(&format!("findings at {name}"), real(low, high).0);
        add(&format!("findings at {name}: real, %"), real(low, high).1);
    }
    let squares: f64 = judged.iter().map(|(p, y)| (p - y).powi(2)).sum();
    add("Brier score", squares / (judged.len() as f64).max(1.0));
    table
}

/// Returns the detectable effects of each world that hides two of them.
fn pairs(rows: &[EvidenceRow]) -> Vec<(&str, Vec<&str>)> {
    let mut worlds: Vec<(&str, Vec<&str>)> = Vec::new();
    for row in rows.iter().filter(|row| row.is_detectable) {
        match worlds.iter_mut().find(|(log, _)| *log == row.log) {
            Some((_, effects)) => effects.push(&row.cause),
            None => worlds.push((&row.log, vec![&row.cause])),
        }
    }
    worlds.retain(|(_, effects)| effects.len() == 2);
    worlds
}

fn of_two(rows: &[EvidenceRow]) -> usize {
    pairs(rows).len()
}

fn both_found(rows: &[EvidenceRow], probabilities: &[f64], named: f64) -> usize {
    let is_found = |log: &str, cause: &&str| {
        rows.iter().zip(probabilities).any(|(row, p)| {
            row.log == log && row.cause == **cause && row.is_candidate && *p >= named
        })
    };
    let pairs = pairs(rows);
    pairs.iter().filter(|(log, causes)| causes.iter().all(|cause| is_found(log, cause))).count()
}

/// Returns the text of a table. Rows keep the limits of `before` while their values are within them; the others get limits
/// around the value.
pub fn emit(rows: &[FigureRow], before: &[FigureRow]) -> String {
    let mut text = format!("{HEAD}\n");
    for row in rows {
        let same = |other: &&FigureRow| other.logs == row.logs && other.figure == row.figure;
        let kept = before.iter().find(same).map(|other| other.limits);
        let kept = kept.filter(|limits| (limits[0]..=limits[1]).contains(&row.value));
        let [low, high] = kept.unwrap_or_else(|| around(row.value));
        let FigureRow { logs, figure, value, .. } = row;
        let _ = writeln!(text, "{logs}\t{figure}\t{value:.4}\t{low:.4}\t{high:.4}");
    }
    text
}

/// Returns limits of a value for which nobody has set any: a fifth of it, and at least two hundredths.
fn around(value: f64) -> [f64; 2] {
    let margin = (0.2 * value.abs()).max(0.02);
    [value - margin, value + margin]
}

/// Parses a table.
///
/// # Errors
/// Returns an error if the head or a row is invalid.
pub fn parse(text: &str) -> Result<Vec<FigureRow>, GradingError> {
    let mut lines = text.lines();
    if lines.next() != Some(HEAD) {
        return Err(GradingError::Head(HEAD));
    }
    let row = |(at, line): (usize, &str)| {
        let wrong = || GradingError::Line {
            line: at + 2,
            expected: "logs, figure and three numbers".into(),
        };
        let cells: Vec<&str> = line.split('\t').collect();
        let [logs, figure, numbers @ ..] = cells.as_slice() else { return Err(wrong()) };
        let numbers: Vec<f64> = numbers
            .iter()
            .map(|cell| cell.parse().map_err(|_| wrong()))
            .collect::<Result<_, _>>()?;
        let [value, low, high] = numbers.as_slice() else { return Err(wrong()) };
        let (logs, figure) = ((*logs).to_owned(), (*figure).to_owned());
        Ok(FigureRow { logs, figure, value: *value, limits: [*low, *high] })
    };
    lines.enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(log: &str, cause: &str, is_candidate: bool) -> EvidenceRow {
        EvidenceRow {
            log: log.into(),
            origin: "bristles".into(),
            is_measured: false,
            hidden: 2,
            cause: cause.into(),
            follows: String::new(),
            truth: Truth::Real,
            is_of_log: false,
            is_detectable: true,
            is_candidate,
            confusable_with: Vec::new(),
            law: String::new(),
            inclusion: 0.0,
            materiality: 0.0,
            floors: 1.0,
            rmse: [1.0; 2],
            figures: vec![0.0; friction_diagnose::contest_calibration::FIGURES.len()],
        }
    }

    #[test]
    fn figures_of_two_worlds_count_the_one_with_both_effects() {
        let rows = [
            effect("a", "backlash", true),
            effect("a", "time-drift", true),
            effect("b", "backlash", true),
            effect("b", "time-drift", false),
        ];
        let table = figures("worlds", &rows, &[0.9, 0.6, 0.7, 0.9], 0.5);
        let value = |name: &str| table.iter().find(|row| row.figure == name).map(|row| row.value);
        assert_eq!(value(BOTH_FOUND), Some(50.0));
        assert_eq!(value("detectable effects found, %"), Some(75.0));
        assert_eq!(value("findings at 0.6 to 0.9"), Some(2.0));
    }

    #[test]
    fn emit_keeps_limits_that_hold_and_sets_others_around_the_value() {
        let row = |value: f64, limits: [f64; 2]| FigureRow {
            logs: "worlds".into(),
            figure: "Brier score".into(),
            value,
            limits,
        };
        let before = [row(0.08, [0.05, 0.09])];
        let parsed = parse(&emit(&[row(0.07, [0.0; 2])], &before)).expect("a table");
        assert_eq!(parsed, [row(0.07, [0.05, 0.09])]);
        let parsed = parse(&emit(&[row(0.2, [0.0; 2])], &before)).expect("a table");
        assert!(parsed[0].is_within() && parsed[0].limits != before[0].limits);
    }
}
