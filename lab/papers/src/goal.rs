//! Targets of a paper's experiments.

use joint_log::number::significant;
use serde::ser::{Serialize, SerializeStruct, Serializer};

/// Side of the bound on which a value must lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundSide {
    /// At the bound or below.
    AtMost,
    /// At the bound or above.
    AtLeast,
}

/// A target for one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Description of the value.
    pub what: String,
    /// Unit, such as `%`, `Nm` or `s`; empty for a plain number.
    pub unit: &'static str,
    /// Required side of the bound.
    pub side: BoundSide,
    /// Bound, in `unit`.
    pub bound: f64,
    /// Our value, in `unit`; always finite.
    pub ours: f64,
    /// Explanation, above all of a missed goal: whole sentences, or empty.
    pub remark: String,
}

impl Goal {
    /// A goal that `ours` must not exceed.
    pub fn at_most(what: impl Into<String>, unit: &'static str, ours: f64, bound: f64) -> Self {
        let (what, side) = (what.into(), BoundSide::AtMost);
        Self { what, unit, side, bound, ours, remark: String::new() }
    }

    /// A goal that `ours` must at least reach.
    pub fn at_least(what: impl Into<String>, unit: &'static str, ours: f64, bound: f64) -> Self {
        Self { side: BoundSide::AtLeast, ..Self::at_most(what, unit, ours, bound) }
    }

    /// Adds an explanation.
    #[must_use]
    pub fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remark = remark.into();
        self
    }

    /// Returns true if the goal is reached.
    pub fn is_reached(&self) -> bool {
        match self.side {
            BoundSide::AtMost => self.ours <= self.bound,
            BoundSide::AtLeast => self.ours >= self.bound,
        }
    }

    /// Returns "reached" or "missed".
    pub fn verdict(&self) -> &'static str {
        if self.is_reached() { "reached" } else { "missed" }
    }

    /// Returns the bound as text, such as `at most 2 %`.
    pub fn bound_text(&self) -> String {
        let side = match self.side {
            BoundSide::AtMost => "at most",
            BoundSide::AtLeast => "at least",
        };
        format!("{side} {}", self.with_unit(self.bound))
    }

    /// Returns our value with its unit.
    pub fn ours_text(&self) -> String {
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
        let is_most = self.side == BoundSide::AtMost;
        goal.serialize_field("wanted", if is_most { "at most" } else { "at least" })?;
        goal.serialize_field("bound", &self.bound)?;
        goal.serialize_field("ours", &self.ours)?;
        goal.serialize_field("reached", &self.is_reached())?;
        goal.serialize_field("remark", &self.remark)?;
        goal.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goal_at_its_bound_is_reached() {
        let most = |ours| Goal::at_most("error", "%", ours, 5.0);
        assert!(most(5.0).is_reached() && !most(5.1).is_reached());
        assert_eq!((most(5.1).verdict(), most(5.0).verdict()), ("missed", "reached"));
        assert!(Goal { side: BoundSide::AtLeast, ..most(5.1) }.is_reached());
        assert_eq!(most(4.0).bound_text(), "at most 5 %");
        assert_eq!(Goal::at_least("ratio", "", 2.346, 2.0).ours_text(), "2.35");
        assert_eq!(Goal::at_most("drop", "%", -89.0, 2.0).ours_text(), "−89 %");
        assert_eq!(Goal::at_least("count", "", 1234.0, 2.0).ours_text(), "1234");
    }
}
