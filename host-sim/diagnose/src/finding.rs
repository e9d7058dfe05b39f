//! A finding: a cause with its size, its significance and a description in one sentence.

use super::cause::definition::Cause;
use super::evidence::Evidence;
use super::extended::{Observation, Size};

/// A cause that this log cannot distinguish from a finding.
#[derive(Clone, Debug)]
pub struct ConfoundedCause {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log that it follows.
    pub columns: Vec<String>,
    /// Share of the finding's effect that it also explains.
    pub share: f64,
}

/// One cause of the base model's error.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log that it follows.
    pub columns: Vec<String>,
    /// Size with its interval.
    pub size: Size,
    /// Order of a periodic cause, with its standard error.
    pub order: Option<(f64, f64)>,
    /// Probability that the best of all candidates reaches this error reduction under the null
    /// hypothesis.
    pub p_value: f64,
    /// Calibrated probability that the cause is real, 0 to 1 ([`super::calibration`]). For a cause that was observed without
    /// a fit, the complement of its p value.
    pub probability: f64,
    /// Share of resampled logs in which it, or a cause that the log cannot distinguish from it, is the best candidate.
    pub stability: f64,
    /// Share of the squared residual that only this cause explains.
    pub share_of_residual: f64,
    /// Causes that this log cannot distinguish from it.
    pub confusable_with: Vec<ConfoundedCause>,
    /// Description in one sentence.
    pub in_words: String,
    /// Plot that shows it.
    pub evidence: Option<Evidence>,
}

impl Finding {
    /// Creates a finding of a cause without figures.
    pub fn of(cause: &'static dyn Cause) -> Self {
        Self {
            cause,
            columns: Vec::new(),
            size: Size::default(),
            order: None,
            p_value: 1.0,
            probability: 0.0,
            stability: 0.0,
            share_of_residual: 0.0,
            confusable_with: Vec::new(),
            in_words: String::new(),
            evidence: None,
        }
    }

    /// Creates the finding of a cause that was observed without a fit.
    pub fn observed(cause: &'static dyn Cause, seen: Observation) -> Self {
        Self {
            cause,
            columns: seen.columns,
            size: seen.size,
            order: None,
            p_value: seen.p_value,
            probability: 1.0 - seen.p_value.clamp(0.0, 1.0),
            stability: seen.stability,
            share_of_residual: seen.share_of_residual,
            confusable_with: Vec::new(),
            in_words: seen.in_words,
            evidence: seen.evidence,
        }
    }
}
