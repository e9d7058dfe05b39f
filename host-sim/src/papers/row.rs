//! One number of a paper, ours beside the printed.

use serde::Serialize;

/// One number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The paper's table or figure, as it is numbered there: `2`, `Fig. 9`; of our own, a name.
    pub table: String,
    /// Which row of it: a model, an arm.
    pub row: String,
    /// Which column: a test, a joint, a speed.
    pub column: String,
    /// `%`, `Nm`, `s`; empty for a plain number.
    pub unit: String,
    /// Our number; always finite.
    pub ours: f64,
    /// Standard deviation of ours over repeats; `None` where nothing was repeated.
    pub spread: Option<f64>,
    /// The paper's number, where it prints one.
    pub printed: Option<f64>,
    /// Ours comes from a simulated machine, not from a measured one.
    pub simulated: bool,
}

impl Row {
    /// A simulated number in its place; see [`Row::measured`] for the other kind.
    pub fn simulated(table: &str, row: &str, column: &str, unit: &str, ours: f64) -> Self {
        let [table, row, column, unit] = [table, row, column, unit].map(str::to_owned);
        Self { table, row, column, unit, ours, spread: None, printed: None, simulated: true }
    }

    /// A number from measured data in its place.
    pub fn measured(table: &str, row: &str, column: &str, unit: &str, ours: f64) -> Self {
        Self { simulated: false, ..Self::simulated(table, row, column, unit, ours) }
    }

    /// The same with what the paper prints there.
    #[must_use]
    pub fn printed(mut self, printed: f64) -> Self {
        self.printed = Some(printed);
        self
    }

    /// The same with the spread of repeats.
    #[must_use]
    pub fn spread(mut self, spread: f64) -> Self {
        self.spread = Some(spread);
        self
    }
}
