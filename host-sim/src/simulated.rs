//! A simulated machine's log as measured data: the machines know nothing of who reads their logs.

use friction_identification::data::Dataset;
use simulated_machines::Log;

/// The data set, as if the log had been written to `data.csv` and read again.
///
/// # Panics
/// If the log is no log: columns of unequal length, or none of time, velocity and torque.
pub fn dataset(log: &Log) -> Dataset {
    let runs = log.runs.iter().map(|run| (run.name.clone(), run.columns.clone()));
    Dataset::of_columns(&log.columns, runs).expect("a machine logs time, velocity and torque")
}
