//! Everyone who was weighed beside the base model, best first, and what stood against each.
//!
//! A cause that may be set in several ways (a delay of one row or of two) is weighed once a setting; a reader
//! wants its best one. What passed alone need not be in the answer: the fit with everything else may have
//! ended at a bound, another cause may have explained more, the review may have taken it out. Each of
//! these is said, so that an answer, or that there is none, can be followed.

use friction_identification::diagnose::gram_blocks::LeftOut;
use friction_identification::diagnose::{CandidateScore, Diagnosis, Finding};
use friction_identification::number::significant;

/// A candidate in its best setting.
pub(super) struct Ranked<'a> {
    /// What it is called.
    pub name: String,
    /// What it got.
    pub score: &'a CandidateScore,
    /// Whether it is in the answer.
    pub named: bool,
    /// What stood against it; empty where it is in the answer.
    pub against: String,
}

/// What a candidate is called.
fn name(heard: &CandidateScore) -> String {
    let mut name = heard.cause.name().to_owned();
    if !heard.columns.is_empty() {
        name += &format!(" ({})", heard.columns.join(", "));
    }
    if let Some(order) = heard.order {
        name += &format!(", order {}", significant(order, 4));
    }
    if heard.level {
        name += ", of the level";
    }
    name
}

/// Each candidate in its best setting, best first.
pub(super) fn ranking(found: &Diagnosis) -> Vec<Ranked<'_>> {
    let mut ranking: Vec<Ranked> = Vec::new();
    for score in &found.scores {
        let name = name(score);
        if !ranking.iter().any(|ranked| ranked.name == name) {
            ranking.push(Ranked { name, score, named: false, against: against(found, score) });
        }
    }
    for finding in &found.findings {
        let is_of = |ranked: &&mut Ranked| is_of(finding, ranked.score);
        let distance = |ranked: &Ranked| match (finding.order, ranked.score.order) {
            (Some((found, _)), Some(order)) => (order - found).abs(),
            _ => 0.0,
        };
        // Of equals the first, which is the best.
        let own = ranking.iter_mut().filter(is_of);
        if let Some(own) = own.min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            own.named = true;
            own.against.clear();
        }
    }
    ranking
}

/// Whether a finding may have come from a candidate.
fn is_of(finding: &Finding, score: &CandidateScore) -> bool {
    finding.cause == score.cause && finding.columns == score.columns
}

/// What stood against a candidate that is not in the answer.
pub(super) fn against(found: &Diagnosis, score: &CandidateScore) -> String {
    if !score.passed {
        return score.against.clone();
    }
    let cause = score.cause.name();
    let weighed = format!("{cause} ({}) was weighed and not taken: ", score.columns.join(", "));
    let taken_back = format!("{cause} passed beside the base model, but fitted anew");
    for note in &found.log.notes {
        if let Some(why) = note.strip_prefix(&weighed) {
            return format!("passed alone; fitted with everything else {why}");
        }
        if note.starts_with(&taken_back) {
            return "passed alone; fitted anew it does not gain on rows left out".into();
        }
    }
    if found.findings.iter().any(|finding| is_of(finding, score)) {
        return "another setting of it is in the answer".into();
    }
    match found.findings.is_empty() {
        true => "passed alone; did not hold when all were heard again".into(),
        false => "passed alone; beside what was found it adds too little".into(),
    }
}

/// A share with two standard errors, in percent.
pub(super) fn gain(score: &CandidateScore) -> String {
    let share = significant(100.0 * score.share, 3);
    match score.share_error.is_finite() {
        true => format!("{share} ± {}", significant(200.0 * score.share_error, 2)),
        false => share,
    }
}

/// What was left out of the fits by which models are judged, as `data.left_out` has it.
pub(super) fn left_out(found: &Diagnosis) -> &'static str {
    match found.left_out {
        Some(LeftOut::Runs) => "runs",
        Some(LeftOut::Stretches) => "stretches",
        None => "held-out",
    }
}

/// The same in a sentence.
pub(super) fn left_out_in_words(found: &Diagnosis) -> &'static str {
    match found.left_out {
        Some(LeftOut::Runs) => {
            "Every run was left out once: each row is judged by fits that have seen nothing of its run."
        }
        Some(LeftOut::Stretches) => {
            "An eighth of every run was left out at a time, one stretch after another: each row is judged by fits that have not \
             seen its stretch, though they have seen the rest of its run."
        }
        None => "The rows to judge by were set apart; no fit has seen them.",
    }
}
