//! Columns that are another reading of the torque, or another column under a second name.
//!
//! A motor current is the torque in another unit and holds every error of a model, so it explains a residual without being its
//! cause. It is recognised by its correlation with the torque from row to row, which pressure or temperature cannot have.

use joint_log::Dataset;
use joint_log::statistics::correlation;

/// Correlation of values above which a column is another reading of the torque.
const SAME_VALUES: f64 = 0.95;

/// Correlation of differences from row to row above which a column is another reading of the torque.
const SAME_STEPS: f64 = 0.5;

/// Correlation above which two columns are one.
const SAME_COLUMN: f64 = 0.9999;

/// How much a column is like the torque.
pub(crate) struct TorqueLikeness {
    /// Size of the correlation of the values, 0 to 1.
    pub of_values: f64,
    /// Size of the correlation of the differences from row to row, 0 to 1.
    pub of_steps: f64,
}

impl TorqueLikeness {
    /// Compares a column with the torque over all runs that have it.
    pub(crate) fn new(data: &Dataset, name: &str) -> Self {
        let runs = data.runs.iter();
        let columns = runs.filter_map(|run| Some((data.column(run, name)?, run.torque.as_slice())));
        let values = columns
            .clone()
            .flat_map(|(column, torque)| column.iter().copied().zip(torque.iter().copied()));
        let steps = columns.flat_map(|(column, torque)| {
            let pairs = column.windows(2).zip(torque.windows(2));
            pairs.map(|(column, torque)| (column[1] - column[0], torque[1] - torque[0]))
        });
        Self { of_values: correlation(values).abs(), of_steps: correlation(steps).abs() }
    }

    /// Returns true if the column is another reading of the torque.
    pub(crate) fn is_reading_of_torque(&self) -> bool {
        self.of_values > SAME_VALUES || self.of_steps > SAME_STEPS
    }
}

/// Returns true if every run has both columns and their values are the same but for offset and unit.
pub(crate) fn is_same_column(data: &Dataset, one: &str, other: &str) -> bool {
    let pairs = data.runs.iter().map(|run| data.column(run, one).zip(data.column(run, other)));
    let Some(pairs) = pairs.collect::<Option<Vec<_>>>() else { return false };
    let rows = pairs.iter().flat_map(|(one, other)| one.iter().copied().zip(other.iter().copied()));
    correlation(rows).abs() > SAME_COLUMN
}
