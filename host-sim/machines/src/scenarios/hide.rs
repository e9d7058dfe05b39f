//! The value of `--hide`: which effect is hidden, and its size.

use super::hidden_cause::HiddenCause;

/// A request to hide an effect, or none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hide {
    /// The effect. `None` to hide none.
    pub effect: Option<HiddenCause>,
    /// Size in the unit of the effect. `None` to draw a size that is visible.
    pub size: Option<f64>,
}

/// Value for a scenario without a hidden effect.
const NONE_NAME: &str = "none";

/// Why effects cannot be hidden.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HideError {
    /// No cause has this name.
    #[error("unknown cause, expected one of {NONE_NAME}, {}", HiddenCause::ALL.map(HiddenCause::name).join(", "))]
    UnknownCause,
    /// The cause has no size.
    #[error("{name} takes no size")]
    NoSize {
        /// Name of the cause, or `none`.
        name: String,
    },
    /// The size is no number, or outside the bounds of its effect.
    #[error(
        "expected a size from {} to {} {} ({} is no effect)",
        effect.bounds().0, effect.bounds().1, effect.unit(), effect.neutral()
    )]
    Size {
        /// The effect.
        effect: HiddenCause,
    },
    /// A scenario hides no more than two effects.
    #[error("--hide: found {count} causes, expected at most two")]
    TooMany {
        /// Number of requests.
        count: usize,
    },
    /// The two effects of a scenario are equal, or one is `none`.
    #[error("--hide: expected two different causes, and none only by itself")]
    NotDifferent,
    /// `none` stands beside an effect.
    #[error("none: expected only by itself")]
    NoneBesideEffect,
    /// An effect is given twice.
    #[error("{}: given twice", cause.name())]
    GivenTwice {
        /// The effect.
        cause: HiddenCause,
    },
    /// A driven joint cannot have the effect.
    #[error("{}: {reason}", cause.name())]
    NotInPlant {
        /// The effect.
        cause: HiddenCause,
        /// Why the plant does not have it.
        reason: &'static str,
    },
    /// The family of friction has no Stribeck exponent.
    #[error("stribeck-shape: friction of the family {family} has no Stribeck exponent")]
    NoStribeckExponent {
        /// Name of the family.
        family: &'static str,
    },
}

impl From<HiddenCause> for Hide {
    /// Hides an effect of a drawn size.
    fn from(effect: HiddenCause) -> Self {
        Self { effect: Some(effect), size: None }
    }
}

impl Hide {
    /// Parses `CAUSE` or `CAUSE:SIZE`.
    ///
    /// # Errors
    /// Returns an error with the expected values if the text is not valid.
    pub fn parse(text: &str) -> Result<Self, HideError> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let effect = HiddenCause::parse(name);
        if effect.is_none() && name != NONE_NAME {
            return Err(HideError::UnknownCause);
        }
        let Some(size) = size else { return Ok(Self { effect, size: None }) };
        let Some(effect) = effect.filter(|effect| *effect != HiddenCause::OutsideCatalogue) else {
            return Err(HideError::NoSize { name: name.to_owned() });
        };
        let (least, most) = effect.bounds();
        match size.parse::<f64>() {
            Ok(number) if (least..=most).contains(&number) => {
                Ok(Self { effect: Some(effect), size: Some(number) })
            }
            _ => Err(HideError::Size { effect }),
        }
    }

    /// Requires effects that a scenario can hide: none, one, or two different ones.
    ///
    /// # Errors
    /// Returns an error if there are more than two effects, or two equal ones.
    pub fn require_scenario(hide: &[Self]) -> Result<(), HideError> {
        match *hide {
            [_] => Ok(()),
            [Hide { effect: Some(one), .. }, Hide { effect: Some(other), .. }] if one != other => {
                Ok(())
            }
            [_, _] => Err(HideError::NotDifferent),
            _ => Err(HideError::TooMany { count: hide.len() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_cause_and_size_returns_both() {
        let hide = |text| Hide::parse(text).unwrap();
        assert_eq!(hide("none"), Hide { effect: None, size: None });
        let effect = Some(HiddenCause::PressureCoulomb);
        assert_eq!(hide("pressure-coulomb"), Hide { effect, size: None });
        assert_eq!(hide("pressure-coulomb:2e-6"), Hide { effect, size: Some(2e-6) });
        assert_eq!(hide("torque-offset:-0.1").size, Some(-0.1));
        assert_eq!(hide("unknown").effect, Some(HiddenCause::OutsideCatalogue));
    }

    #[test]
    fn parse_of_invalid_text_reports_what_was_expected() {
        for (text, word) in [
            ("pressure", "none, radial-force-coulomb"),
            ("", "none, radial-force-coulomb"),
            (":", "none, radial-force-coulomb"),
            ("None", "none, radial-force-coulomb"),
            ("none:1", "none takes no size"),
            ("unknown:1", "unknown takes no size"),
            ("pressure-coulomb:", "from 0 to 0.0001 Nm/Pa"),
            ("pressure-coulomb:1", "from 0 to 0.0001 Nm/Pa"),
            ("pressure-coulomb:-1e-9", "from 0 to 0.0001 Nm/Pa"),
            ("pressure-coulomb:1e-6:2", "from 0 to 0.0001 Nm/Pa"),
            ("torque-offset:nan", "from -10 to 10 Nm"),
            ("torque-offset:inf", "from -10 to 10 Nm"),
            ("stribeck-shape:0", "from 0.3 to 8 1 (2 is no effect)"),
        ] {
            let message = Hide::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }

    #[test]
    fn parse_of_random_text_does_not_panic() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        let parts = [
            "none",
            "unknown",
            "backlash",
            "time-drift",
            ":",
            "-",
            ".",
            "0",
            "1e",
            "e-3",
            "99",
            "inf",
            "NaN",
            " ",
            "\u{e9}",
            "\0",
            "",
        ];
        for _ in 0..5000 {
            let count = random.random_range(0..5);
            let text: String =
                (0..count).map(|_| parts[random.random_range(0..parts.len())]).collect();
            match Hide::parse(&text) {
                Ok(Hide { effect: Some(effect), size: Some(size) }) => {
                    let (least, most) = effect.bounds();
                    assert!((least..=most).contains(&size), "{text:?}");
                }
                Ok(Hide { effect, size }) => assert_eq!(size, None, "{text:?} {effect:?}"),
                Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{text:?}"),
            }
        }
    }

    #[test]
    fn require_scenario_with_equal_or_more_than_two_causes_returns_error() {
        let require = |texts: &[&str]| {
            let hide: Vec<Hide> = texts.iter().map(|text| Hide::parse(text).unwrap()).collect();
            Hide::require_scenario(&hide)
        };
        for texts in [&["none"][..], &["backlash"], &["backlash", "torque-offset"]] {
            assert_eq!(require(texts), Ok(()), "{texts:?}");
        }
        for texts in [
            &["none", "backlash"][..],
            &["backlash", "none"],
            &["backlash", "backlash"],
            &["backlash", "torque-offset", "time-drift"],
        ] {
            assert!(require(texts).is_err(), "{texts:?}");
        }
    }
}
