//! A cause that the search has accepted, before it becomes a finding.

use super::cause::CauseCandidate;
use super::cause::definition::Cause;
use super::cause_evidence::CauseEvidence;
use super::extended::Extended;
use super::finding::{ConfoundedCause, Finding};
use super::gram_blocks::CandidateFit;
use super::rules::{self, Rejection};
use super::train_test::FollowedColumn;
use super::train_test::TrainTest;
use compensator_core::TermKind;
use friction_fit::{Estimate, Outcome, State};

/// An accepted cause.
#[derive(Clone, Debug)]
pub struct AcceptedCause {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// The term that takes it into the model.
    pub term: TermKind,
    /// Columns it needs.
    pub columns: Vec<String>,
    /// What it follows, for a cause that may follow any column.
    pub follows: Option<FollowedColumn>,
    /// What the last review said.
    pub fit: CandidateFit,
    /// Share of the residual it explains that nothing else does.
    pub share: f64,
    /// Other causes that would explain the same.
    pub rivals: Vec<ConfoundedCause>,
    /// What speaks for it.
    pub evidence: CauseEvidence,
    /// Calibrated probability that it is real.
    pub probability: f64,
    /// It describes the runs there are; for others it has been shown to fail, or could not be shown.
    pub only_describes: bool,
}

impl AcceptedCause {
    /// A candidate that was taken into the model, with what its fit showed.
    pub fn chosen(candidate: &CauseCandidate, fit: CandidateFit) -> Self {
        Self {
            cause: candidate.cause,
            term: candidate.term,
            columns: candidate.columns.clone(),
            follows: candidate.follows.clone(),
            fit,
            share: 0.0,
            rivals: Vec::new(),
            evidence: CauseEvidence::default(),
            probability: 0.0,
            only_describes: false,
        }
    }

    /// Returns the rule that rejects the cause in the fit to all rows: a parameter at its bound, an impossible size, or an
    /// interval that contains no effect.
    pub fn rejection(&self, outcome: &Outcome, log: &TrainTest) -> Option<Rejection> {
        let own = |estimate: &&Estimate| self.term.parameters().contains(&estimate.id);
        let mut own = outcome.estimates.iter().filter(own);
        if let Some(estimate) = own.find(|estimate| estimate.state == State::AtBound) {
            let why = format!("in the fit to all rows, {} is at its bound", estimate.id.name());
            return Some(Rejection::new(&rules::AT_BOUND, why));
        }
        let size = self.cause.size(&Extended { outcome, log, follows: self.follows.as_ref() });
        if let Some(least) = self.cause.least_size(log).filter(|least| size.value < *least) {
            let why = format!("its size {} is below {least}, the least possible", size.in_words());
            return Some(Rejection::new(&rules::UNPHYSICAL, why));
        }
        let [low, high] = size.ci95();
        let has_interval = low < high && low.is_finite() && high.is_finite();
        let spans = (low..=high).contains(&self.cause.no_effect_size());
        (has_interval && spans).then(|| {
            let why = format!("its size {} does not exclude no effect", size.in_words());
            Rejection::new(&rules::SPANS_NO_EFFECT, why)
        })
    }

    /// The finding, as the joint fit has it.
    pub fn finding(&self, outcome: &Outcome, log: &TrainTest) -> Finding {
        let extended = Extended { outcome, log, follows: self.follows.as_ref() };
        let cause = self.cause;
        let size = cause.size(&extended);
        let mut in_words = cause.in_words(&size, &extended);
        let rival = |rival: &ConfoundedCause| {
            let columns = &rival.columns;
            let by = if columns.is_empty() {
                String::new()
            } else {
                format!(" ({})", columns.join(", "))
            };
            let (name, percent) = (rival.cause.name(), 100.0 * rival.share);
            format!("{name}{by}, which would explain {percent:.0} % of it")
        };
        let rivals: Vec<String> = self.rivals.iter().map(rival).collect();
        if !rivals.is_empty() {
            in_words += &format!("; this log cannot distinguish it from {}", rivals.join(", or "));
        }
        if self.only_describes {
            in_words += "; it describes these runs and has not been shown to apply to others: its column hardly \
                         changes within a run, and there are few runs";
        }
        Finding {
            cause,
            columns: self.columns.clone(),
            in_words,
            size,
            order: cause.order(&extended),
            p_value: self.fit.p_value,
            probability: self.probability,
            stability: self.fit.stability,
            share_of_residual: self.share,
            is_in_model: true,
            confusable_with: self.rivals.clone(),
            evidence: cause.evidence(&self.columns, &extended),
        }
    }
}

#[cfg(test)]
mod tests;
