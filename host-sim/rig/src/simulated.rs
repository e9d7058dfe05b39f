//! The log of a simulated machine as a data set. The machines' crate cannot depend on identification.

use joint_log::Dataset;
use simulated_machines::Log;

/// Returns the data set that reading the log's `data.csv` would give.
///
/// # Panics
/// Panics if the columns differ in length, or if time, velocity or torque is missing.
pub fn dataset(log: &Log) -> Dataset {
    let runs = log.runs.iter().map(|run| (run.name.clone(), run.columns.clone()));
    Dataset::from_columns(&log.columns, runs).expect("a machine logs time, velocity and torque")
}
