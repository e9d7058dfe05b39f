//! The candidate causes of a diagnosis, those of the best hypothesis first, and why each is not named.

use friction_diagnose::{Diagnosis, Finding, LeftOut, WeighedCause};
use joint_log::number::significant;

/// A candidate cause in a report.
pub struct RankedCandidate<'a> {
    /// Name with columns and detail.
    pub name: String,
    /// Calibrated probability that the candidate is real, 0 to 1.
    pub probability: f64,
    /// The candidate.
    pub candidate: &'a WeighedCause,
    /// True if the candidate is a finding.
    pub is_finding: bool,
    /// Why the candidate is not named; empty for a finding.
    pub rejected_because: String,
}

/// Returns the name of a candidate with its columns and its detail, such as the order of a ripple.
fn name(candidate: &WeighedCause) -> String {
    let mut name = candidate.cause.name().to_owned();
    let columns = candidate.columns();
    if !columns.is_empty() {
        name += &format!(" ({})", columns.join(", "));
    }
    if !candidate.figures.detail.is_empty() {
        name += &format!(", {}", candidate.figures.detail);
    }
    name
}

/// Returns all candidates, those of the best hypothesis first.
pub fn ranking(found: &Diagnosis) -> Vec<RankedCandidate<'_>> {
    let ranked = |candidate| {
        let finding = finding_of(found, candidate);
        RankedCandidate {
            name: name(candidate),
            // A finding is less likely beside a fault of the log that explains the error as well.
            probability: finding.map_or(candidate.probability, |finding| finding.probability),
            candidate,
            is_finding: finding.is_some(),
            rejected_because: candidate.reason(),
        }
    };
    found.candidates.iter().map(ranked).collect()
}

/// Returns the finding of a candidate, if it is one.
fn finding_of<'a>(found: &'a Diagnosis, candidate: &WeighedCause) -> Option<&'a Finding> {
    let mut findings = found.findings.iter().filter(|_| candidate.is_named());
    // A candidate has the columns beside the motion, a finding all.
    let columns = candidate.columns();
    let has_columns = |columns: &[String], of: &[String]| columns.is_empty() || of == columns;
    findings
        .find(|finding| finding.cause == candidate.cause && has_columns(&columns, &finding.columns))
}

/// Formats the gain of a candidate alone with two standard errors, in percent.
pub fn gain(candidate: &WeighedCause) -> String {
    let share = significant(100.0 * candidate.figures.alone, 3);
    format!("{share} ± {}", significant(200.0 * candidate.gain_error(), 2))
}

/// Returns the parts that were held out in turn, as in `data.left_out`.
pub fn left_out(found: &Diagnosis) -> &'static str {
    match found.left_out {
        Some(LeftOut::Runs) => "runs",
        Some(LeftOut::Stretches) => "stretches",
        None => "held-out",
    }
}

/// Describes the held-out parts in a sentence.
pub fn left_out_in_words(found: &Diagnosis) -> &'static str {
    match found.left_out {
        Some(LeftOut::Runs) => {
            "Each run was held out once: every row is predicted by a model that was fitted without its run."
        }
        Some(LeftOut::Stretches) => {
            "One eighth of each run was held out at a time: every row is predicted by a model that was fitted without its \
             segment, but with the rest of its run."
        }
        None => "The test rows were held out; no model was fitted to them.",
    }
}
