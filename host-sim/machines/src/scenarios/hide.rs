//! The value of `--hide`: which effect is hidden, and its size.

use super::hidden_cause::HiddenCause;
use super::kind::Kind;

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

impl Hide {
    /// Parses `CAUSE` or `CAUSE:SIZE`.
    ///
    /// # Errors
    /// Returns a message with the expected values if the text is not valid.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let effect = HiddenCause::parse(name);
        if effect.is_none() && name != NONE_NAME {
            let known: Vec<&str> = HiddenCause::ALL.iter().map(|effect| effect.name()).collect();
            return Err(format!(
                "unknown cause, expected one of {NONE_NAME}, {}",
                known.join(", ")
            ));
        }
        let Some(size) = size else { return Ok(Self { effect, size: None }) };
        let Some(effect) = effect.filter(|effect| *effect != HiddenCause::OutsideCatalogue) else {
            return Err(format!("{name} takes no size"));
        };
        let (least, most) = effect.bounds();
        match size.parse::<f64>() {
            Ok(number) if (least..=most).contains(&number) => {
                Ok(Self { effect: Some(effect), size: Some(number) })
            }
            _ => Err(format!(
                "expected a size from {least} to {most} {} ({} is no effect)",
                effect.unit(),
                effect.neutral()
            )),
        }
    }
}

/// Returns the kind of scenario with these hidden effects.
///
/// # Errors
/// Returns a message if there are more than two effects, or two equal ones.
pub fn kind(hide: &[Hide]) -> Result<Kind, String> {
    let kind = match *hide {
        [Hide { effect: None, .. }] => Kind::None,
        [Hide { effect: Some(effect), .. }] => Kind::One(effect),
        [Hide { effect: Some(one), .. }, Hide { effect: Some(other), .. }] if one != other => {
            Kind::Two(one, other)
        }
        [_, _] => {
            return Err("--hide: expected two different causes, and none only by itself".into());
        }
        _ => return Err(format!("--hide: found {} causes, expected at most two", hide.len())),
    };
    Ok(kind)
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
            let message = Hide::parse(text).unwrap_err();
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
                Err(message) => assert!(!message.is_empty() && !message.contains('\n'), "{text:?}"),
            }
        }
    }

    #[test]
    fn kind_with_equal_or_more_than_two_causes_returns_error() {
        let kind = |texts: &[&str]| {
            kind(&texts.iter().map(|text| Hide::parse(text).unwrap()).collect::<Vec<_>>())
        };
        assert_eq!(kind(&["none"]), Ok(Kind::None));
        assert_eq!(kind(&["backlash"]), Ok(Kind::One(HiddenCause::Backlash)));
        let both = Kind::Two(HiddenCause::Backlash, HiddenCause::TorqueOffset);
        assert_eq!(kind(&["backlash", "torque-offset"]), Ok(both));
        for texts in [
            &["none", "backlash"][..],
            &["backlash", "none"],
            &["backlash", "backlash"],
            &["backlash", "torque-offset", "time-drift"],
        ] {
            assert!(kind(texts).is_err(), "{texts:?}");
        }
    }
}
