//! The hard rules of a diagnosis. Everything else is weighed by the calibration ([`super::calibration`]).
//!
//! A rule rejects a cause whatever its probability: it has no effect, its value is impossible, or a
//! model without it explains the log equally well. Each rule has a name, a limit and the reason for
//! the limit. `diagnosis.json` lists the rules that acted under `decisions`.

use super::cause::{Cause, CauseIdentity};
use super::train_test::FollowedColumn;

/// A hard rule.
#[derive(Debug)]
pub struct Rule {
    /// Name of the rule in `diagnosis.json`.
    pub name: &'static str,
    /// Its limit, in the unit that `reason` names.
    pub limit: f64,
    /// What the limit is and why it has its value.
    pub reason: &'static str,
}

impl PartialEq for Rule {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// A cause must reduce the error on held-out rows.
pub const NO_REDUCTION: Rule = Rule {
    name: "no-reduction",
    limit: 0.0,
    reason: "reduction of the squared error on held-out rows, Nm^2: without one there is no effect",
};

/// A reduction must be significant.
pub const NOT_SIGNIFICANT: Rule = Rule {
    name: "not-significant",
    limit: 0.05,
    reason: "probability of the reduction in a log with nothing hidden, corrected for all candidates: one false \
             candidate in 20 clean logs before the calibration",
};

/// A cause must remove a part of the error above the floor.
pub const NEGLIGIBLE: Rule = Rule {
    name: "negligible",
    limit: 0.03,
    reason: "share of the squared error above the noise floor: a long log makes any effect significant",
};

/// Bristles of several stiffnesses must not explain the same.
pub const NULL_MODEL: Rule = Rule {
    name: "explained-by-null-model",
    limit: 0.8,
    reason: "share of the effect that the cause's null model also explains",
};

/// A term whose parameter is at its bound represents another effect.
pub const AT_BOUND: Rule = Rule {
    name: "at-bound",
    limit: 0.01,
    reason: "relative distance of a fitted parameter from its bound",
};

/// The fitted parameters must not contradict the cause.
pub const CONTRADICTED: Rule = Rule {
    name: "contradicted",
    limit: 0.0,
    reason: "number of contradictions between the fitted parameters and the meaning of the cause",
};

/// A log must show a wave more than once.
pub const SHORT_WAVE: Rule = Rule {
    name: "short-wave",
    limit: 1.5,
    reason: "periods of a wave in the range of the positions: fewer are a trend",
};

/// A size must be physically possible.
pub const UNPHYSICAL: Rule = Rule {
    name: "unphysical-size",
    limit: 0.0,
    reason: "sizes below the least physical size of the cause, for example a drag that drives",
};

/// An interval must not contain the size of no effect.
pub const SPANS_NO_EFFECT: Rule = Rule {
    name: "spans-no-effect",
    limit: 0.95,
    reason: "coverage of the interval that must exclude the size of no effect",
};

/// A delay must be distinguishable from hysteresis.
pub const TIME_SHIFT: Rule = Rule {
    name: "time-shift-or-hysteresis",
    limit: 0.5,
    reason: "share of its reduction that a delay keeps beside Maxwell-slip elements, whose torque depends on the travel \
             and not on the time",
};

/// A curve of any shape must add to the named causes.
pub const ANY_SHAPE: Rule = Rule {
    name: "curve-adds-little",
    limit: 0.2,
    reason: "share of the reduction by named causes that a curve of any shape must add: it may be the last part of one of \
             their effects",
};

/// An extension must reduce the held-out error after a new fit.
pub const NO_GAIN: Rule = Rule {
    name: "no-gain",
    limit: 0.0,
    reason: "lower end of the 95 % interval of the gain on held-out rows",
};

/// A cause must be more likely real than the naming threshold of the calibration.
pub const BELOW_THRESHOLD: Rule = Rule {
    name: "below-naming-threshold",
    limit: f64::NAN,
    reason: "calibrated probability that the cause is real; the calibration sets the threshold so that wrong names are rare",
};

/// All rules.
pub const ALL: [&Rule; 13] = [
    &SHORT_WAVE,
    &NO_REDUCTION,
    &NOT_SIGNIFICANT,
    &NEGLIGIBLE,
    &NULL_MODEL,
    &AT_BOUND,
    &CONTRADICTED,
    &UNPHYSICAL,
    &SPANS_NO_EFFECT,
    &TIME_SHIFT,
    &ANY_SHAPE,
    &NO_GAIN,
    &BELOW_THRESHOLD,
];

/// A rule that rejects, with the figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Rejection {
    /// The rule.
    pub rule: &'static Rule,
    /// Why, as the end of a sentence.
    pub why: String,
}

impl Rejection {
    /// Creates the rejection by a rule.
    pub fn new(rule: &'static Rule, why: impl Into<String>) -> Self {
        Self { rule, why: why.into() }
    }
}

/// A cause that a rule has rejected after its fit.
#[derive(Clone, Debug, PartialEq)]
pub struct RuleDecision {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log that it follows.
    pub columns: Vec<String>,
    /// The rule and the figures.
    pub rejection: Rejection,
}

impl RuleDecision {
    /// Returns the identity of the rejected cause if it follows this column.
    pub fn identity(&self, follows: Option<&FollowedColumn>) -> CauseIdentity {
        CauseIdentity::new(self.cause, follows)
    }

    /// Returns the decision as one sentence.
    pub fn in_words(&self) -> String {
        let name = self.cause.name();
        format!(
            "{name} ({}) was evaluated and rejected: {}",
            self.columns.join(", "),
            self.rejection.why
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_have_unique_names_and_reasons() {
        let mut names: Vec<&str> = ALL.iter().map(|rule| rule.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
        assert!(ALL.iter().all(|rule| rule.reason.len() > 20));
    }

    #[test]
    fn in_words_names_cause_columns_and_reason() {
        let decision = RuleDecision {
            cause: super::super::cause::ALL[0],
            columns: vec!["radial_force_n".into()],
            rejection: Rejection::new(&AT_BOUND, "its fit ends at the bound of radial_gain"),
        };
        let words = decision.in_words();
        assert!(
            words.starts_with("radial-force-coulomb (radial_force_n)") && words.contains("bound")
        );
    }
}
