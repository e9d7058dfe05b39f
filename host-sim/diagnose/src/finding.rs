//! A finding: a cause with its size, its significance and a description in one sentence.

use super::cause::Cause;
use super::evaluation::Gain;
use super::evidence::Evidence;
use super::extended::Size;
use joint_log::JointKind;
use joint_log::number::{significant, with_error};
use std::f64::consts::TAU;

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

/// Order of a periodic cause: its phase over the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaveOrder {
    /// The order: waves a turn, or rad/m.
    pub value: f64,
    /// Its standard error.
    pub std_error: f64,
}

impl WaveOrder {
    /// Returns the order with two standard errors. A joint that slides has no turn, and gets the length of a wave.
    fn in_words(self, joint: JointKind) -> String {
        let (order, reach) = (self.value, 2.0 * self.std_error);
        let with_reach = |value: f64, reach: f64| match reach > 0.0 {
            true => with_error(value, reach),
            false if value.fract() == 0.0 => format!("{value:.0}"),
            false => significant(value, 4),
        };
        match joint {
            JointKind::Revolute => format!("{} a turn", with_reach(order, reach)),
            JointKind::Prismatic => {
                let length = TAU / order;
                format!("one wave in {} m", with_reach(length, length * reach / order))
            }
        }
    }
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
    fn order_in_words_names_turns_or_the_length_of_a_wave() {
        let words = |value, std_error, joint| WaveOrder { value, std_error }.in_words(joint);
        assert_eq!(words(8.0, 0.0, JointKind::Revolute), "8 a turn");
        assert_eq!(words(202.13, 0.11, JointKind::Revolute), "202.13 ± 0.22 a turn");
        let slides = words(TAU / 0.02, TAU / 2.0, JointKind::Prismatic);
        assert_eq!(slides, "one wave in 0.02000 ± 0.00040 m");
    }

    #[test]
    fn probability_in_words_is_never_certainty() {
        assert_eq!(probability_in_words(1.0), "above 0.99");
        assert_eq!(probability_in_words(0.9), "0.90");
    }
}
