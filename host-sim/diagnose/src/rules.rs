//! The hard rules of a diagnosis. Everything else is weighed by the calibration ([`super::contest_calibration`]).
//!
//! A rule lowers the probability of what is physically impossible. Each rule has a name, a limit and the reason for the limit.
//! `diagnosis.json` lists the rules that acted under `decisions`.

/// A hard rule.
#[derive(Debug, PartialEq)]
pub struct Rule {
    /// Name of the rule in `diagnosis.json`.
    pub name: &'static str,
    /// Its limit, in the unit that `reason` names.
    pub limit: f64,
    /// What the limit is and why it has its value.
    pub reason: &'static str,
}

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

/// Positions on both sides of a gear show its play directly.
pub const NO_PLAY_BETWEEN_POSITIONS: Rule = Rule {
    name: "no-play-between-positions",
    limit: 0.5,
    reason: "probability of play by the positions on both sides of the gear: below it, the torque alone does not name backlash",
};

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

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&Rule; 4] =
        [&SHORT_WAVE, &UNPHYSICAL, &SPANS_NO_EFFECT, &NO_PLAY_BETWEEN_POSITIONS];

    #[test]
    fn rules_have_unique_names_and_reasons() {
        let mut names: Vec<&str> = ALL.iter().map(|rule| rule.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
        assert!(ALL.iter().all(|rule| rule.reason.len() > 20));
    }
}
