//! A column and the quantity that it may hold: what a survey suggests for `--columns`.

use super::torque_scale;
use std::fmt;

/// Follows a time column that holds the steps between the rows: `time_s=dt:us:step`.
pub(super) const STEP_MARK: &str = "step";

/// A column and the quantity that it may hold. Its text is a pair of `--columns`, which a front end quotes as its shell demands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnPair {
    /// Contract name of the quantity.
    pub quantity: &'static str,
    /// The column's name in the file; with `#` in the place of the joint, the columns of all joints.
    pub column: String,
    /// Unit of the values; `None` for that of the contract.
    pub unit: Option<String>,
    /// True if the values are the steps between the rows.
    pub is_step: bool,
    /// True if the file has no names, so that the column's name is its number, from 1.
    pub is_numbered: bool,
}

impl ColumnPair {
    /// Returns the pair of a named column.
    pub(super) fn new(quantity: &'static str, column: &str, unit: Option<&str>) -> Self {
        let (column, unit) = (column.to_owned(), unit.map(str::to_owned));
        Self { quantity, column, unit, is_step: false, is_numbered: false }
    }

    /// Returns the column as it follows the contract name, with its unit: `speed:rpm`.
    pub(super) fn column_in_unit(&self) -> String {
        self.column.clone() + &self.suffix()
    }

    /// Returns true if its unit is one of a current.
    pub(super) fn is_current(&self) -> bool {
        self.unit.as_deref().is_some_and(|unit| torque_scale::amperes(unit).is_some())
    }

    fn suffix(&self) -> String {
        let parts = [self.unit.as_deref(), self.is_step.then_some(STEP_MARK)];
        parts.into_iter().flatten().map(|part| format!(":{part}")).collect()
    }
}

impl fmt::Display for ColumnPair {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { quantity, column, is_numbered, .. } = self;
        match is_numbered {
            true => write!(f, "{column}={quantity}{}", self.suffix()),
            false => write!(f, "{quantity}={column}{}", self.suffix()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_of_pair_is_that_of_columns() {
        let named = ColumnPair::new("velocity_rad_s", "speed [rpm]", Some("rpm"));
        assert_eq!(named.to_string(), "velocity_rad_s=speed [rpm]:rpm");
        assert_eq!(named.column_in_unit(), "speed [rpm]:rpm");
        let numbered = ColumnPair { is_numbered: true, ..ColumnPair::new("time_s", "1", None) };
        assert_eq!(numbered.to_string(), "1=time_s");
        let step = ColumnPair { is_step: true, unit: Some("us".into()), ..numbered };
        assert_eq!(step.to_string(), "1=time_s:us:step");
        assert_eq!(ColumnPair { is_numbered: false, ..step }.to_string(), "time_s=1:us:step");
    }
}
