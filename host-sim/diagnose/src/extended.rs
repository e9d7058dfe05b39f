//! What a cause is read from once it is found: the joint fit, or what is left.

use super::train_test::FollowedColumn;
use super::train_test::TrainTest;
use ParameterId as Id;
use compensator_core::ParameterId;
use compensator_core::term::LookupFormula;
use friction_fit::params::unit;
use friction_fit::{Estimate, Outcome};
use joint_log::JointKind;
use joint_log::number::{figure, significant, with_error};
use std::f64::consts::TAU;

/// Standard errors on either side that hold 95 %.
const NINETY_FIVE: f64 = 1.96;

/// A size with its interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Size {
    /// The value, in `unit`.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    ci95: [f64; 2],
}

/// A size that is not known.
impl Default for Size {
    fn default() -> Self {
        Self::new(0.0, 0.0, "")
    }
}

impl Size {
    /// A value with its standard error. An error that is not positive stands for a value that the log does not determine.
    pub fn new(value: f64, error: f64, unit: &str) -> Self {
        let reach = NINETY_FIVE * error;
        Self::with_interval(value, [value - reach, value + reach], unit)
    }

    /// A value with a 95 % interval, which is widened to hold the value. Without a width, the log does not determine the
    /// value, and the interval has no bounds.
    pub fn with_interval(value: f64, [low, high]: [f64; 2], unit: &str) -> Self {
        let ci95 = match low < high {
            true => [low.min(value), high.max(value)],
            false => [f64::NEG_INFINITY, f64::INFINITY],
        };
        Self { value, unit: unit.to_owned(), ci95 }
    }

    /// Returns the 95 % interval. It holds the value and has a width; the bounds of a value that the log does not determine
    /// are infinite.
    pub fn ci95(&self) -> [f64; 2] {
        self.ci95
    }

    /// Returns the 95 % interval if it has bounds.
    pub fn bounds(&self) -> Option<[f64; 2]> {
        self.ci95.iter().all(|bound| bound.is_finite()).then_some(self.ci95)
    }

    /// With unit and interval.
    pub fn in_words(&self) -> String {
        let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        let interval = match self.bounds() {
            Some([low, high]) => format!("95 % interval {} to {}", figure(low), figure(high)),
            None => "its interval is not determined".to_owned(),
        };
        format!("{}{unit} ({interval})", figure(self.value))
    }
}

/// The extended model a finding is read from.
#[derive(Clone, Copy, Debug)]
pub struct Extended<'a> {
    /// The joint fit of everything.
    pub outcome: &'a Outcome,
    /// The log it was fitted on.
    pub log: &'a TrainTest,
    /// The column the finding follows, if its cause may follow any.
    pub follows: Option<&'a FollowedColumn>,
}

impl Extended<'_> {
    /// Whether the joint turns or slides.
    pub fn joint(&self) -> JointKind {
        self.log.train.joint
    }

    /// Whether the finding is a share of the friction level over a column.
    pub fn follows_level(&self) -> bool {
        self.follows.is_some_and(|follows| follows.level)
    }

    /// The level's formula over the column it follows.
    pub fn formula(&self) -> LookupFormula {
        self.follows.map_or(LookupFormula::None, |follows| follows.formula)
    }

    /// What the fit says of a parameter.
    pub fn estimate(&self, id: Id) -> Option<&Estimate> {
        self.outcome.estimates.iter().find(|estimate| estimate.id == id)
    }

    /// Value of a parameter.
    pub fn value(&self, id: Id) -> f64 {
        self.outcome.parameters.get(id)
    }

    /// Its standard error; 0 where it was kept.
    pub fn error(&self, id: Id) -> f64 {
        self.estimate(id).and_then(|e| e.std_error).unwrap_or(0.0)
    }

    /// Its unit on this joint.
    pub fn unit(&self, id: Id) -> &'static str {
        unit(id, self.joint())
    }

    /// A parameter as a size.
    pub fn size(&self, id: Id) -> Size {
        Size::new(self.value(id), self.error(id), self.unit(id))
    }

    /// Length of a pair of coefficients, of the sine and of the cosine.
    pub fn amplitude(&self, sine: Id, cosine: Id) -> Size {
        let (s, c) = (self.value(sine), self.value(cosine));
        let length = s.hypot(c).max(f64::MIN_POSITIVE);
        let spread = (s * self.error(sine)).hypot(c * self.error(cosine)) / length;
        Size::new(length, spread, self.unit(sine))
    }
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
    pub fn in_words(self, joint: JointKind) -> String {
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
    fn ci95_of_any_size_holds_its_value_and_has_a_width() {
        let values = [0.0, 0.6768, -3.0];
        let intervals = [[0.6594, 0.6594], [0.1, 0.2], [0.5, 0.9], [0.2, 0.1], [f64::NAN, 1.0]];
        let drawn = values.iter().flat_map(|value| {
            intervals.map(|interval| Size::with_interval(*value, interval, "Nm"))
        });
        let errors = [0.0, 0.1, f64::NAN, f64::INFINITY];
        let fitted = values.iter().flat_map(|value| errors.map(|e| Size::new(*value, e, "Nm")));
        for size in drawn.chain(fitted) {
            let [low, high] = size.ci95();
            assert!(low < high && (low..=high).contains(&size.value), "{size:?}");
        }
        assert_eq!(Size::with_interval(0.15, [0.1, 0.2], "Nm").bounds(), Some([0.1, 0.2]));
        assert_eq!(Size::new(1.0, 0.0, "Nm").bounds(), None);
    }

    #[test]
    fn in_words_of_size_without_bounds_prints_no_number_as_interval() {
        let words = Size::new(1.0, 0.0, "Nm").in_words();
        crate::message::check("sizes", "size without interval", &words, &["1.000 Nm"]);
        assert_eq!(words.matches(|c: char| c.is_ascii_digit()).count(), 4, "{words}");
    }
}
