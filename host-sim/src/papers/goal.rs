//! What a paper's experiments were to reach, and what they did.

use friction_identification::number::significant;
use serde::ser::{Serialize, SerializeStruct, Serializer};

/// On which side of its bound a number is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The bound or less.
    AtMost,
    /// The bound or more.
    AtLeast,
}

/// One goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// What is measured, in a reader's words.
    pub what: String,
    /// `%`, `Nm`, `s`; empty for a plain number.
    pub unit: &'static str,
    /// On which side of the bound.
    pub wanted: Wanted,
    /// The bound, in that unit.
    pub bound: f64,
    /// What came out, in that unit; always finite.
    pub ours: f64,
    /// What else is to be known of it, above all where it is missed: sentences; empty for none.
    pub remark: String,
}

impl Goal {
    /// A number that is to be no larger.
    pub fn at_most(what: impl Into<String>, unit: &'static str, ours: f64, bound: f64) -> Self {
        let (what, wanted) = (what.into(), Wanted::AtMost);
        Self { what, unit, wanted, bound, ours, remark: String::new() }
    }

    /// A number that is to be no smaller.
    pub fn at_least(what: impl Into<String>, unit: &'static str, ours: f64, bound: f64) -> Self {
        Self { wanted: Wanted::AtLeast, ..Self::at_most(what, unit, ours, bound) }
    }

    /// The same with what is to be known of it.
    #[must_use]
    pub fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remark = remark.into();
        self
    }

    /// Whether it is reached.
    pub fn reached(&self) -> bool {
        match self.wanted {
            Wanted::AtMost => self.ours <= self.bound,
            Wanted::AtLeast => self.ours >= self.bound,
        }
    }

    /// "reached" or "missed".
    pub fn verdict(&self) -> &'static str {
        if self.reached() { "reached" } else { "missed" }
    }

    /// The bound as a reader has it: `at most 2 %`.
    pub fn bound_in_words(&self) -> String {
        let side = match self.wanted {
            Wanted::AtMost => "at most",
            Wanted::AtLeast => "at least",
        };
        format!("{side} {}", self.with_unit(self.bound))
    }

    /// What came out, with its unit.
    pub fn ours_in_words(&self) -> String {
        self.with_unit(self.ours)
    }

    fn with_unit(&self, value: f64) -> String {
        const DIGITS: usize = 3;
        let is_whole = value.fract() == 0.0 && value.abs() < 1e6;
        let number = if is_whole {
            format!("{value}").replace('-', "−")
        } else {
            significant(value, DIGITS)
        };
        format!("{number} {}", self.unit).trim_end().to_owned()
    }
}

impl Serialize for Goal {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut goal = serializer.serialize_struct("Goal", 7)?;
        goal.serialize_field("what", &self.what)?;
        goal.serialize_field("unit", self.unit)?;
        let is_most = self.wanted == Wanted::AtMost;
        goal.serialize_field("wanted", if is_most { "at most" } else { "at least" })?;
        goal.serialize_field("bound", &self.bound)?;
        goal.serialize_field("ours", &self.ours)?;
        goal.serialize_field("reached", &self.reached())?;
        goal.serialize_field("remark", &self.remark)?;
        goal.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_belongs_to_what_is_wanted() {
        let most = |ours| Goal::at_most("error", "%", ours, 5.0);
        assert!(most(5.0).reached() && !most(5.1).reached());
        assert_eq!((most(5.1).verdict(), most(5.0).verdict()), ("missed", "reached"));
        assert!(Goal { wanted: Wanted::AtLeast, ..most(5.1) }.reached());
        assert_eq!(most(4.0).bound_in_words(), "at most 5 %");
        assert_eq!(Goal::at_least("ratio", "", 2.346, 2.0).ours_in_words(), "2.35");
        assert_eq!(Goal::at_most("drop", "%", -89.0, 2.0).ours_in_words(), "−89 %");
        assert_eq!(Goal::at_least("count", "", 1234.0, 2.0).ours_in_words(), "1234");
    }
}
