//! Probability of each cause of a contest, and what is physically impossible.
//!
//! The probability is the evidence. A rule refuses only what cannot be, and it does so through the probability, so that no
//! report shows a likely cause that is not named beside an unlikely one that is.

use super::cause::{self, Cause};
use super::contest::{CauseKey, Figures, Outcome, Rows};
use super::contest_calibration::ContestCalibration;
use super::extended::Size;
use super::finding::ConfoundedCause;
use super::rules::{self, Rejection};
use joint_log::statistics::extent;
use std::f64::consts::TAU;

/// Probability at and above which a cause is named.
pub const NAMED: f64 = 0.5;

/// Highest probability of what is physically impossible.
pub(crate) const IMPOSSIBLE: f64 = 0.05;

/// Highest probability of a cause whose size may be none.
pub(crate) const MAY_BE_NONE: f64 = 0.45;

/// Fewest periods of a wave in the range of the positions.
const MIN_PERIODS: f64 = 1.5;

/// A cause with its evidence and probability.
#[derive(Clone, Debug)]
pub struct WeighedCause {
    /// The cause.
    pub cause: &'static Cause,
    /// Its figures in the contest.
    pub figures: Figures,
    /// Probability that it is real.
    pub probability: f64,
    /// What the driver's law keeps less than the linear promise, as a share of it; `None` if it was not fitted.
    pub shortfall: Option<f64>,
    /// The rule that lowered the probability.
    pub rejection: Option<Rejection>,
}

impl WeighedCause {
    /// Returns true if the cause is named.
    pub fn is_named(&self) -> bool {
        self.probability >= NAMED
    }

    /// Returns the standard error of what it takes alone, as a share of the squared error; 0 if it takes nothing.
    pub fn gain_error(&self) -> f64 {
        let error = (self.figures.alone / self.figures.alone_in_errors).abs();
        if error.is_finite() { error } else { 0.0 }
    }

    /// Returns why it is not named, as the end of a sentence; empty if it is.
    pub fn reason(&self) -> String {
        match &self.rejection {
            _ if self.is_named() => String::new(),
            Some(rejection) => rejection.why.clone(),
            None => format!(
                "a probability of {:.2} is below the naming threshold of {NAMED:.2}",
                self.probability
            ),
        }
    }

    /// Columns of the log that it follows.
    pub fn columns(&self) -> Vec<String> {
        self.figures.key.columns.clone()
    }

    /// Lowers the probability by a rule.
    pub fn reject(&mut self, limit: f64, rejection: Rejection) {
        self.probability = self.probability.min(limit);
        self.rejection = Some(rejection);
    }

    /// Lowers the probability if the fitted size is impossible, or if its interval holds no effect.
    pub fn check_size(&mut self, size: &Size, least: Option<f64>) {
        if let Some(least) = least.filter(|least| size.value < *least) {
            let why = format!("its size {} is below {least}, the least possible", size.in_words());
            self.reject(IMPOSSIBLE, Rejection::new(&rules::UNPHYSICAL, why));
        }
        let no_effect = self.cause.no_effect_size;
        if size.bounds().is_some_and(|[low, high]| (low..=high).contains(&no_effect)) {
            let why = format!("its size {} does not exclude no effect", size.in_words());
            self.reject(MAY_BE_NONE, Rejection::new(&rules::SPANS_NO_EFFECT, why));
        }
    }
}

/// Returns the causes of a contest with their probabilities, in its order.
pub fn weigh(outcome: &Outcome, rows: &Rows) -> Vec<WeighedCause> {
    let weighed = |figures: &Figures| {
        let mut weighed = WeighedCause {
            cause: cause::named(figures.key.cause)?,
            probability: ContestCalibration::current().probability(outcome, figures),
            figures: figures.clone(),
            shortfall: None,
            rejection: None,
        };
        if let Some(periods) = periods(figures, rows).filter(|periods| *periods < MIN_PERIODS) {
            let why = format!(
                "the log spans {periods:.1} periods of the wave, which do not determine it"
            );
            weighed.reject(IMPOSSIBLE, Rejection::new(&rules::SHORT_WAVE, why));
        }
        Some(weighed)
    };
    outcome.causes.iter().filter_map(weighed).collect()
}

/// Returns how many periods of the slowest wave of a ripple the positions span; `None` for another cause.
fn periods(figures: &Figures, rows: &Rows) -> Option<f64> {
    let order = figures.detail.orders().iter().copied().reduce(f64::min)?;
    let [low, high] = extent(rows.position.iter().copied());
    Some(order * (high - low) / TAU)
}

/// Returns the causes that stand in for one of them.
pub fn confounded(weighed: &[WeighedCause], figures: &Figures) -> Vec<ConfoundedCause> {
    let rival = |key: &CauseKey| {
        // A cause with the same columns as the first one never wins a draw, so it is no candidate.
        let other = weighed.iter().find(|other| other.figures.key == *key);
        let alone = other.map_or(figures.alone, |other| other.figures.alone);
        let share = (alone / figures.alone.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        Some(ConfoundedCause {
            cause: cause::named(key.cause)?,
            columns: key.columns.clone(),
            share,
        })
    };
    // A curve without a cause is no answer that another experiment could choose.
    figures.confusable_with.iter().filter(|key| key.cause != "unknown").filter_map(rival).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weighed(name: &'static str, no_effect: &Size) -> WeighedCause {
        let key = CauseKey { cause: name, columns: Vec::new() };
        let mut cause = WeighedCause {
            cause: cause::named(name).expect("a cause"),
            figures: Figures { key, ..Figures::default() },
            probability: 0.95,
            shortfall: None,
            rejection: None,
        };
        cause.check_size(no_effect, cause_least(name));
        cause
    }

    fn cause_least(name: &str) -> Option<f64> {
        (name == "dwell-time-static").then_some(0.0)
    }

    #[test]
    fn check_size_with_interval_of_no_effect_lowers_the_probability_below_naming() {
        let sure = weighed("torque-offset", &Size::new(1.0, 0.1, "Nm"));
        assert!(sure.probability > 0.9 && sure.rejection.is_none());
        let unsure = weighed("torque-offset", &Size::new(0.1, 0.1, "Nm"));
        assert!(!unsure.is_named() && unsure.rejection.is_some());
        let negative = weighed("dwell-time-static", &Size::new(-1.0, 0.1, "Nm"));
        assert!(negative.probability <= IMPOSSIBLE);
    }

    #[test]
    fn follows_of_several_columns_joins_them_as_the_cause_does() {
        let key = |cause, columns: &[&str]| {
            let columns = columns.iter().map(|name| (*name).to_owned()).collect();
            CauseKey { cause, columns }.follows()
        };
        assert_eq!(key("unknown", &["a_n", "b_c"]), "a_n x b_c");
        assert_eq!(key("joint-coupling", &["dq_1", "dq_2"]), "dq_1, dq_2");
        assert!(key("unknown", &[]).is_empty());
    }
}
