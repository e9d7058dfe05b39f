//! The evidence of contests on logs with known causes, as a table: a row for each candidate.
//!
//! A log without candidates, and a hidden effect that is no candidate, have rows too, so that every log and effect is counted.

use crate::GradingError;
use crate::calibration_fit::Case;
use friction_diagnose::contest_calibration::FIGURES;

/// What is known of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// The cause is in the log.
    Real,
    /// The cause is among the answers that count as right for a measured log, and a stronger candidate is too.
    Accepted,
    /// The cause is not in the log.
    False,
    /// The cause is not among those that are known of a measured log, and may be true.
    Unknown,
}

impl Truth {
    const ALL: [(Truth, &'static str); 4] =
        [(Truth::Real, "1"), (Truth::Accepted, "a"), (Truth::False, "0"), (Truth::Unknown, "-")];

    fn text(self) -> &'static str {
        Self::ALL.iter().find(|(variant, _)| *variant == self).map_or("-", |(_, text)| text)
    }

    fn parse(text: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, name)| *name == text).map(|(variant, _)| *variant)
    }
}

/// A row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct EvidenceRow {
    /// Name of the log.
    pub log: String,
    /// Plant of a world, or machine of a measured log.
    pub origin: String,
    /// True if the log is measured.
    pub is_measured: bool,
    /// Number of effects that are hidden in a world.
    pub hidden: usize,
    /// The cause; `none` for the row of the log itself.
    pub cause: String,
    /// The column that the cause follows, or empty.
    pub follows: String,
    /// What is known of the candidate.
    pub truth: Truth,
    /// True if the cause holds for the log whatever is hidden.
    pub is_of_log: bool,
    /// True if the cause is hidden and a refit of the true structure shows it.
    pub is_detectable: bool,
    /// True if the contest returned the candidate.
    pub is_candidate: bool,
    /// Causes that stand in for it.
    pub confusable_with: Vec<String>,
    /// Law and correction of the best hypothesis.
    pub law: String,
    /// Inclusion, for a rule without a calibration.
    pub inclusion: f64,
    /// Materiality, likewise.
    pub materiality: f64,
    /// Remaining error in noise floors.
    pub floors: f64,
    /// Remaining error of the best law without a cause, and of the best hypothesis, in the unit of the log.
    pub rmse: [f64; 2],
    /// The figures of [`FIGURES`].
    pub figures: Vec<f64>,
}

const HEAD: [&str; 17] = [
    "log",
    "origin",
    "measured",
    "hidden",
    "cause",
    "follows",
    "real",
    "of_log",
    "detectable",
    "candidate",
    "confusable_with",
    "law",
    "raw_inclusion",
    "raw_materiality",
    "floors",
    "base_rmse",
    "rmse",
];

/// Returns the text of a table.
pub fn emit(rows: &[EvidenceRow]) -> String {
    let head = HEAD.into_iter().chain(FIGURES.iter().map(|figure| figure.name));
    let mut text = head.collect::<Vec<&str>>().join("\t") + "\n";
    let flag = |flag: bool| String::from(if flag { "1" } else { "0" });
    for row in rows {
        let mut cells = vec![
            row.log.clone(),
            row.origin.clone(),
            flag(row.is_measured),
            row.hidden.to_string(),
            row.cause.clone(),
            row.follows.clone(),
            row.truth.text().into(),
            flag(row.is_of_log),
            flag(row.is_detectable),
            flag(row.is_candidate),
            row.confusable_with.join("+"),
            row.law.clone(),
        ];
        let plain = [row.inclusion, row.materiality, row.floors];
        let numbers = plain.iter().chain(&row.rmse).chain(&row.figures);
        cells.extend(numbers.map(|value| format!("{value:.5}")));
        text += &(cells.join("\t") + "\n");
    }
    text
}

/// Parses a table.
///
/// # Errors
/// Returns an error if the head differs from this version's figures, or a row is invalid.
pub fn parse(text: &str) -> Result<Vec<EvidenceRow>, GradingError> {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split('\t').collect();
    let expected: Vec<&str> =
        HEAD.into_iter().chain(FIGURES.iter().map(|figure| figure.name)).collect();
    if head != expected {
        return Err(GradingError::OtherEvidence);
    }
    let row = |(at, line): (usize, &str)| {
        parse_row(line).ok_or_else(|| GradingError::Line {
            line: at + 2,
            expected: format!("{} cells of a row", expected.len()),
        })
    };
    lines.enumerate().map(row).collect()
}

fn parse_row(line: &str) -> Option<EvidenceRow> {
    let cells: Vec<&str> = line.split('\t').collect();
    let (words, numbers) = cells.split_at_checked(HEAD.len() - 5)?;
    let numbers: Vec<f64> = numbers.iter().map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
    let [inclusion, materiality, floors, base, rmse, figures @ ..] = numbers.as_slice() else {
        return None;
    };
    let confusable = words[10].split('+').filter(|name| !name.is_empty());
    if figures.len() != FIGURES.len() {
        return None;
    }
    Some(EvidenceRow {
        log: words[0].into(),
        origin: words[1].into(),
        is_measured: parse_flag(words[2])?,
        hidden: words[3].parse().ok()?,
        cause: words[4].into(),
        follows: words[5].into(),
        truth: Truth::parse(words[6])?,
        is_of_log: parse_flag(words[7])?,
        is_detectable: parse_flag(words[8])?,
        is_candidate: parse_flag(words[9])?,
        confusable_with: confusable.map(str::to_owned).collect(),
        law: words[11].into(),
        inclusion: *inclusion,
        materiality: *materiality,
        floors: *floors,
        rmse: [*base, *rmse],
        figures: figures.to_vec(),
    })
}

fn parse_flag(text: &str) -> Option<bool> {
    match text {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    }
}

/// Weight of a candidate of a measured log that is not among its known causes.
const UNKNOWN_WEIGHT: f64 = 0.3;

impl EvidenceRow {
    /// Returns the candidate as a case of a fit, or `None` if its truth does not depend on the evidence: an effect that is no
    /// candidate, a cause that holds for the log whatever is hidden, or one of several accepted answers.
    pub fn case(&self, weight: f64, fold: usize) -> Option<Case> {
        let has_evidence = self.is_detectable || !self.is_of_log;
        let is_case = self.is_candidate && has_evidence && self.truth != Truth::Accepted;
        let is_unknown = self.truth == Truth::Unknown;
        is_case.then(|| Case {
            cause: self.cause.clone(),
            follows: self.follows.clone(),
            figures: self.figures.clone(),
            is_real: self.truth == Truth::Real,
            weight: if is_unknown { UNKNOWN_WEIGHT * weight } else { weight },
            fold,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_emitted_table_returns_the_same_rows() {
        let row = EvidenceRow {
            log: "a".into(),
            origin: "bristles".into(),
            is_measured: false,
            hidden: 1,
            cause: "backlash".into(),
            follows: String::new(),
            truth: Truth::Real,
            is_of_log: false,
            is_detectable: true,
            is_candidate: true,
            confusable_with: vec!["unmodelled-inertia".into(), "channel-delay".into()],
            law: "lugre, none".into(),
            inclusion: 0.5,
            materiality: 0.25,
            floors: 1.5,
            rmse: [0.25, 0.125],
            figures: (0..FIGURES.len()).map(|at| 0.5 * at as f64).collect(),
        };
        let measured = EvidenceRow {
            is_measured: true,
            truth: Truth::Unknown,
            confusable_with: Vec::new(),
            ..row.clone()
        };
        let rows = [row, measured];
        assert_eq!(parse(&emit(&rows)).unwrap(), rows);
        assert!(parse("log\torigin\n").is_err());
        for (right, wrong) in [("\t1\tbacklash", "\tx\tbacklash"), ("\t-\t", "\t?\t")] {
            let text = emit(&rows).replace(right, wrong);
            let error = parse(&text).expect_err(wrong).to_string();
            assert!(error.starts_with("line "), "{error}");
        }
        assert_eq!(rows[1].case(1.0, 0).unwrap().weight, UNKNOWN_WEIGHT);
    }
}
