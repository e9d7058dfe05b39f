//! The candidate causes of a diagnosis, best first, and why each was rejected.
//!
//! A cause with several settings (such as a delay of one row or of two) has one candidate for each setting; the ranking
//! shows only its best one. A candidate that is significant alone may still not be a finding: the joint fit may have
//! ended at a bound, another cause may explain more, or the final review may have removed it. The reason is reported in
//! each case.

use friction_diagnose::accepted_cause::AcceptedCause;
use friction_diagnose::calibration::Calibration;
use friction_diagnose::gram_blocks::LeftOut;
use friction_diagnose::rules::RuleDecision;
use friction_diagnose::{CandidateScore, Diagnosis, Finding};
use joint_log::number::significant;

/// A candidate cause in its best setting.
pub struct RankedCandidate<'a> {
    /// Name with columns and order.
    pub name: String,
    /// Calibrated probability that the candidate is real, 0 to 1.
    pub probability: f64,
    /// Score of the candidate.
    pub score: &'a CandidateScore,
    /// True if the candidate is a finding.
    pub is_finding: bool,
    /// Why the candidate was rejected; empty for a finding.
    pub rejected_because: String,
}

/// Returns the name of a candidate with its columns and order.
fn name(score: &CandidateScore) -> String {
    let mut name = score.cause.name().to_owned();
    if !score.columns.is_empty() {
        name += &format!(" ({})", score.columns.join(", "));
    }
    if let Some(order) = score.order {
        name += &format!(", order {}", significant(order, 4));
    }
    if score.level {
        name += ", scaled with the friction level";
    }
    name
}

/// Returns each candidate in its best setting, best first.
pub fn ranking(found: &Diagnosis) -> Vec<RankedCandidate<'_>> {
    let findings = finding_indices(found);
    let mut ranking: Vec<RankedCandidate> = Vec::new();
    for (index, score) in found.scores.iter().enumerate() {
        let (name, is_finding) = (name(score), findings.contains(&index));
        let rejected_because = rejection_reason(found, index);
        let probability = probability(found, score);
        let own = RankedCandidate { name, probability, score, is_finding, rejected_because };
        match ranking.iter_mut().find(|ranked| ranked.name == own.name) {
            None => ranking.push(own),
            // Two orders may be equal after rounding; a finding has priority.
            Some(ranked) if own.is_finding => *ranked = own,
            Some(_) => {}
        }
    }
    ranking
}

/// Returns the index of the score of each finding: its best setting, or for a periodic cause that of its order.
fn finding_indices(found: &Diagnosis) -> Vec<usize> {
    let own = |finding: &Finding| {
        let distance = |index: &usize| match (finding.order, found.scores[*index].order) {
            (Some((own, _)), Some(order)) => (order - own).abs(),
            _ => 0.0,
        };
        let settings =
            (0..found.scores.len()).filter(|index| is_of(finding, &found.scores[*index]));
        settings.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    found.findings.iter().filter_map(own).collect()
}

/// Returns true if the finding and the candidate have the same cause and columns.
fn is_of(finding: &Finding, score: &CandidateScore) -> bool {
    finding.cause == score.cause && finding.columns == score.columns
}

/// Returns why the candidate with this index was rejected; empty for a finding.
pub fn rejection_reason(found: &Diagnosis, index: usize) -> String {
    let score = &found.scores[index];
    if finding_indices(found).contains(&index) {
        return String::new();
    }
    if let Some(rejection) = &score.rejection {
        return rejection.why.clone();
    }
    let is_own = |decision: &&RuleDecision| {
        decision.cause == score.cause && decision.columns == score.columns
    };
    if let Some(decision) = found.decisions.iter().find(is_own) {
        return format!("significant alone, but in the joint fit: {}", decision.rejection.why);
    }
    let rivals = |finding: &&Finding| {
        let mut rivals = finding.confusable_with.iter();
        rivals.any(|rival| rival.cause == score.cause && rival.columns == score.columns)
    };
    if let Some(finding) = found.findings.iter().find(rivals) {
        return format!("significant alone, but indistinguishable from {}", finding.cause.name());
    }
    if found.findings.iter().any(|finding| is_of(finding, score)) {
        return "another setting of the same cause is a finding".into();
    }
    match found.findings.is_empty() {
        true => "significant alone, but not confirmed in the final review".into(),
        false => "significant alone, but adds too little to the findings".into(),
    }
}

/// Returns the calibrated probability that a candidate is real: that of its finding or of its review, otherwise from its
/// linear fit.
pub fn probability(found: &Diagnosis, score: &CandidateScore) -> f64 {
    let finding = found.findings.iter().find(|finding| is_of(finding, score));
    if let Some(finding) = finding {
        return finding.probability;
    }
    if let Some(weighed) = &score.weighed {
        return weighed.probability;
    }
    let is_own = |own: &&AcceptedCause| own.cause == score.cause && own.columns == score.columns;
    let reviewed = found.weighed.iter().find(is_own).map(|own| own.probability);
    reviewed.unwrap_or_else(|| match score.rejection {
        Some(_) => Calibration::current().candidate.probability(&score.evidence).min(UNNAMED),
        None => Calibration::current().candidate.probability(&score.evidence),
    })
}

/// Highest probability of a candidate that a rule has rejected.
const UNNAMED: f64 = 0.5;

/// Formats the gain of a candidate with two standard errors, in percent.
pub fn gain(score: &CandidateScore) -> String {
    let share = significant(100.0 * score.share, 3);
    match score.share_error.is_finite() {
        true => format!("{share} ± {}", significant(200.0 * score.share_error, 2)),
        false => share,
    }
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
