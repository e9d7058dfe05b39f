//! A finding: a cause with its size, its significance and a description in one sentence.

use super::cause::Cause;
use super::evaluation::Gain;
use super::evidence::Evidence;
use super::extended::{Size, WaveOrder};
use joint_log::JointKind;
use joint_log::number::significant;

/// A cause that this log cannot distinguish from a finding.
#[derive(Clone, Debug)]
pub struct ConfoundedCause {
    /// The cause.
    pub cause: &'static Cause,
    /// Columns of the log that it follows.
    pub columns: Vec<String>,
    /// Share of the finding's effect that it also explains.
    pub share: f64,
}

/// One cause of the base model's error.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The cause.
    pub cause: &'static Cause,
    /// Columns of the log that it follows.
    pub columns: Vec<String>,
    /// Size with its interval.
    pub size: Size,
    /// Order of a periodic cause.
    pub order: Option<WaveOrder>,
    /// Probability that the best of all candidates reaches this error reduction under the null
    /// hypothesis.
    pub p_value: f64,
    /// Calibrated probability that the cause is real, 0 to 1 ([`super::contest_calibration`]). For a cause that was observed without
    /// a fit, the complement of its p value.
    pub probability: f64,
    /// Share of resampled logs in which it, or a cause that the log cannot distinguish from it, is the best candidate.
    pub stability: f64,
    /// Share of the squared residual that only this cause explains.
    pub share_of_residual: f64,
    /// What the model of all causes gains by this one on held-out rows, as a share of the RMS error.
    pub gain: Gain,
    /// True if the extended model holds the cause. The error of any other finding remains.
    pub is_in_model: bool,
    /// Causes that this log cannot distinguish from it.
    pub confusable_with: Vec<ConfoundedCause>,
    /// Description in one sentence.
    pub in_words: String,
    /// Plot that shows it.
    pub evidence: Option<Evidence>,
}

impl Finding {
    /// Creates a finding of a cause without figures.
    pub fn of(cause: &'static Cause) -> Self {
        Self {
            cause,
            columns: Vec::new(),
            size: Size::default(),
            order: None,
            p_value: 1.0,
            probability: 0.0,
            stability: 0.0,
            share_of_residual: 0.0,
            gain: Gain::default(),
            is_in_model: false,
            confusable_with: Vec::new(),
            in_words: String::new(),
            evidence: None,
        }
    }

    /// Returns the size with its interval, and with the order of a periodic cause.
    pub fn size_in_words(&self, joint: JointKind) -> String {
        self.with_order(joint, &self.size.in_words())
    }

    /// Returns the words for a size, after the order of a periodic cause.
    pub fn with_order(&self, joint: JointKind, size: &str) -> String {
        self.order
            .map_or_else(|| size.to_owned(), |order| format!("{}: {size}", order.in_words(joint)))
    }

    /// Returns what the finding does to the squared error.
    pub fn share_in_words(&self) -> String {
        let percent = significant(100.0 * self.share_of_residual, 3);
        match self.is_in_model {
            true => format!("reduces the squared error by {percent} %"),
            false if self.share_of_residual == 0.0 => "does not show in the torque".to_owned(),
            false => format!("makes {percent} % of the squared error, which the model keeps"),
        }
    }
}

/// Returns a probability for a report. A value that would be rounded to certainty is given as a bound.
pub fn probability_in_words(probability: f64) -> String {
    if probability > 0.99 { "above 0.99".to_owned() } else { format!("{probability:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probability_in_words_is_never_certainty() {
        assert_eq!(probability_in_words(1.0), "above 0.99");
        assert_eq!(probability_in_words(0.9), "0.90");
    }
}
