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
    let named = named(found);
    let mut ranking: Vec<Ranked> = Vec::new();
    for (index, score) in found.scores.iter().enumerate() {
        let (name, named) = (name(score), named.contains(&index));
        let own = Ranked { name, score, named, against: against(found, index) };
        match ranking.iter_mut().find(|ranked| ranked.name == own.name) {
            None => ranking.push(own),
            // Of two orders that look alike in print, the one in the answer.
            Some(ranked) if own.named => *ranked = own,
            Some(_) => {}
        }
    }
    ranking
}

/// Which of the scores are in the answer: of each finding the best setting, of a periodic one that of its order.
fn named(found: &Diagnosis) -> Vec<usize> {
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

/// Whether a finding may have come from a candidate.
fn is_of(finding: &Finding, score: &CandidateScore) -> bool {
    finding.cause == score.cause && finding.columns == score.columns
}

/// What stood against the score of this index; empty where it is in the answer.
pub(super) fn against(found: &Diagnosis, index: usize) -> String {
    let score = &found.scores[index];
    if named(found).contains(&index) {
        return String::new();
    }
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
    let rivals = |finding: &&Finding| {
        let mut rivals = finding.confusable_with.iter();
        rivals.any(|rival| rival.cause == score.cause && rival.columns == score.columns)
    };
    if let Some(finding) = found.findings.iter().find(rivals) {
        return format!("passed alone; not told apart from {}", finding.cause.name());
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
