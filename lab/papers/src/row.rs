//! One result of a paper, beside the printed one.

use joint_log::number::significant;
use serde::Serialize;

/// Formats a percentage with its sign.
pub(crate) fn percent(value: f64) -> String {
    format!("{}{} %", if value > 0.0 { "+" } else { "" }, significant(value, 3))
}

/// One result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResultRow {
    /// Number of the paper's table or figure, such as `2` or `Fig. 9`; a name for tables of our own.
    pub table: String,
    /// Row of the table, such as a model.
    pub row: String,
    /// Column of the table, such as a test, a joint or a speed.
    pub column: String,
    /// Unit, such as `%`, `Nm` or `s`; empty for a plain number.
    pub unit: String,
    /// Our value; always finite.
    pub ours: f64,
    /// Standard deviation of our value over repeats; `None` without repeats.
    pub spread: Option<f64>,
    /// The paper's value, if it prints one.
    pub printed: Option<f64>,
    /// Our value comes from a simulated machine.
    pub simulated: bool,
}

impl ResultRow {
    /// A simulated value; see [`ResultRow::measured`] for measured data.
    pub fn simulated(table: &str, row: &str, column: &str, unit: &str, ours: f64) -> Self {
        let [table, row, column, unit] = [table, row, column, unit].map(str::to_owned);
        Self { table, row, column, unit, ours, spread: None, printed: None, simulated: true }
    }

    /// A value from measured data.
    pub fn measured(table: &str, row: &str, column: &str, unit: &str, ours: f64) -> Self {
        Self { simulated: false, ..Self::simulated(table, row, column, unit, ours) }
    }

    /// Adds the paper's value.
    #[must_use]
    pub fn printed(mut self, printed: f64) -> Self {
        self.printed = Some(printed);
        self
    }

    /// Adds the spread over repeats.
    #[must_use]
    pub fn spread(mut self, spread: f64) -> Self {
        self.spread = Some(spread);
        self
    }
}
