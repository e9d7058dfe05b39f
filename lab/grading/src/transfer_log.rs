//! The log of a machine, parted for a transfer: a model gets the training rows, and the test rows judge it.
//!
//! The table is kept as it lies in the file, so that the parts can be written as logs of their own, which a program reads as any
//! other log. Every third run is the test; of fewer than three runs it is the last 30 % of the rows.

use crate::GradingError;
use crate::statistics::quantile;
use joint_log::{Cells, Table, parquet_table};
use std::path::Path;

/// Least number of runs of which every third is the test.
const MIN_RUNS: usize = 3;

/// Share of the rows that is the training part of fewer runs.
const TRAINING_SHARE: f64 = 0.7;

/// Share of the 95th percentile of the speed above which a row is moving.
const MOVING_SHARE: f64 = 0.01;

/// A part of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The rows that a model gets.
    Training,
    /// The rows that judge it.
    Test,
}

/// A log with its parts. Rows of a run follow each other.
#[derive(Clone, Debug)]
pub struct TransferLog {
    table: Table,
    /// Names of this project, in the order of the table's columns.
    names: Vec<String>,
    /// Row of the table of each row.
    order: Vec<usize>,
    /// Name of each row's run; all are empty without a column of runs.
    pub run: Vec<String>,
    /// True for the rows of the test.
    pub is_test: Vec<bool>,
    /// 95th percentile of the speed, in the unit of the velocity.
    pub speed: f64,
    /// Times, s.
    pub time: Vec<f64>,
    /// Velocities, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Measured torques or forces, Nm or N, or what the log has in their place.
    pub torque: Vec<f64>,
}

impl TransferLog {
    /// Reads a CSV or Parquet file. `renamed` maps names of this project to those of the file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or lacks time, velocity or torque.
    pub fn read(path: &Path, renamed: &[(String, String)]) -> Result<Self, GradingError> {
        let table = if path.extension().is_some_and(|end| end == "parquet") {
            parquet_table(path)?
        } else {
            csv_table(&std::fs::read_to_string(path).map_err(GradingError::io(path))?)
        };
        Self::new(table, renamed).map_err(|error| error.of(path.display().to_string()))
    }

    /// Parts the rows of a table.
    fn new(table: Table, renamed: &[(String, String)]) -> Result<Self, GradingError> {
        let renamed_to = |name: &String| {
            let pair = renamed.iter().find(|(_, theirs)| theirs == name);
            pair.map_or(name, |(ours, _)| ours).clone()
        };
        let names: Vec<String> = table.columns.iter().map(|(name, _)| renamed_to(name)).collect();
        let rows = table.columns.first().map_or(0, |(_, cells)| cells.len());
        let runs = names.iter().position(|name| name == "run");
        let run_of = |row: usize| runs.map_or(String::new(), |at| table.columns[at].1.text_of(row));
        let run: Vec<String> = (0..rows).map(run_of).collect();
        let mut all: Vec<&String> = Vec::new();
        run.iter().for_each(|name| {
            if !all.contains(&name) {
                all.push(name);
            }
        });
        let place = |row: &usize| all.iter().position(|name| **name == run[*row]);
        let mut order: Vec<usize> = (0..rows).collect();
        order.sort_by_cached_key(place);
        let is_test = |row: &usize| {
            if all.len() < MIN_RUNS {
                *row as f64 >= TRAINING_SHARE * rows as f64
            } else {
                place(row).is_some_and(|at| at % 3 == 2)
            }
        };
        let is_test = order.iter().map(is_test).collect();
        let run = order.iter().map(|row| run[*row].clone()).collect();
        let (time, velocity, torque) = (Vec::new(), Vec::new(), Vec::new());
        let mut log =
            Self { table, names, order, run, is_test, speed: 0.0, time, velocity, torque };
        let column = |start: &[&str]| {
            log.starting(start).ok_or_else(|| GradingError::NoColumn(start.join(" or ")))
        };
        (log.time, log.velocity, log.torque) =
            (column(&["time_s"])?, column(&["velocity"])?, column(&["torque_nm", "force_n"])?);
        log.speed = quantile(log.velocity.iter().map(|velocity| velocity.abs()), 0.95);
        Ok(log)
    }

    /// Returns the numbers of a column; missing ones are interpolated. `None` if there is no such column, or none of its cells
    /// is a number.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let at = self.names.iter().position(|known| known == name)?;
        let cells = &self.table.columns[at].1;
        let number = |row: &usize| match cells {
            Cells::Numbers(cells) => cells[*row],
            cells => cells.text_of(*row).parse().unwrap_or(f64::NAN),
        };
        let mut numbers: Vec<f64> = self.order.iter().map(number).collect();
        fill_gaps(&mut numbers).then_some(numbers)
    }

    /// Returns the first column whose name starts with one of these.
    pub fn starting(&self, starts: &[&str]) -> Option<Vec<f64>> {
        let mut names = self.names.iter();
        self.column(names.find(|name| starts.iter().any(|start| name.starts_with(start)))?)
    }

    /// Returns the numbers of all columns that are neither run, time, motion nor torque.
    pub fn covariates(&self) -> Vec<Vec<f64>> {
        let other = ["run", "time_s", "torque", "force", "velocity", "position"];
        let names =
            self.names.iter().filter(|name| !other.iter().any(|start| name.starts_with(start)));
        names.filter_map(|name| self.column(name)).collect()
    }

    /// Returns the rows that judge a model: those of the test that move.
    pub fn judging_rows(&self) -> Vec<usize> {
        let is_judge = |row: &usize| {
            self.is_test[*row] && self.velocity[*row].abs() > MOVING_SHARE * self.speed
        };
        (0..self.time.len()).filter(is_judge).collect()
    }

    /// Returns -1, 0 or 1: the direction of a row, 0 if it does not move.
    pub fn direction(&self, row: usize) -> f64 {
        let velocity = self.velocity[row];
        if velocity.abs() > MOVING_SHARE * self.speed { velocity.signum() } else { 0.0 }
    }

    /// Returns the rows of each run, in order.
    pub fn runs(&self) -> Vec<std::ops::Range<usize>> {
        let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
        for row in 0..self.run.len() {
            match runs.last_mut() {
                Some(last) if self.run[last.start] == self.run[row] => last.end = row + 1,
                _ => runs.push(row..row + 1),
            }
        }
        runs
    }

    /// Writes the test or the training rows as CSV, with the names of the file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write(&self, path: &Path, part: Part) -> Result<(), GradingError> {
        let is_test = part == Part::Test;
        let names: Vec<&str> = self.table.columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut text = names.join(",") + "\n";
        for row in (0..self.order.len()).filter(|row| self.is_test[*row] == is_test) {
            let cells = self.table.columns.iter().map(|(_, cells)| cells.text_of(self.order[row]));
            text += &(cells.collect::<Vec<String>>().join(",") + "\n");
        }
        std::fs::write(path, text).map_err(GradingError::io(path))
    }

    /// Returns the root of the mean squared error of predictions for some rows.
    pub fn rmse(&self, rows: &[usize], predicted: impl Fn(usize) -> f64) -> f64 {
        let squares = rows.iter().map(|row| (self.torque[*row] - predicted(*row)).powi(2));
        (squares.sum::<f64>() / rows.len() as f64).sqrt()
    }
}

/// Returns a table of texts; cells have no quotes.
fn csv_table(text: &str) -> Table {
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default().trim_start_matches('\u{feff}').split(',');
    let mut columns: Vec<(String, Vec<String>)> =
        header.map(|name| (name.trim().to_owned(), Vec::new())).collect();
    for line in lines.filter(|line| !line.trim().is_empty()) {
        let mut cells = line.split(',');
        for (_, column) in &mut columns {
            column.push(cells.next().unwrap_or_default().to_owned());
        }
    }
    let columns = columns.into_iter().map(|(name, cells)| (name, Cells::Texts(cells)));
    Table { name: String::new(), columns: columns.collect() }
}

/// Replaces missing numbers by the line between their neighbours, at the ends by the nearest. Returns false if all are missing.
fn fill_gaps(numbers: &mut [f64]) -> bool {
    let known: Vec<usize> = (0..numbers.len()).filter(|at| numbers[*at].is_finite()).collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else { return false };
    let (low, high) = (numbers[*first], numbers[*last]);
    numbers[..*first].fill(low);
    numbers[last + 1..].fill(high);
    for pair in known.windows(2) {
        let (from, to) = (numbers[pair[0]], numbers[pair[1]]);
        let steps = (pair[1] - pair[0]) as f64;
        for (step, missing) in numbers[pair[0]..pair[1]].iter_mut().enumerate().skip(1) {
            *missing = from + step as f64 / steps * (to - from);
        }
    }
    true
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns the log of a text, whose columns have the names of this project.
    pub(crate) fn log_of(csv: &str) -> TransferLog {
        TransferLog::new(csv_table(csv), &[]).expect("a log")
    }

    fn log_of_runs(runs: &str) -> TransferLog {
        let rows = runs.chars().enumerate();
        let rows = rows.map(|(row, run)| format!("{run},{row},{row},1\n"));
        log_of(&("run,time_s,velocity_rad_s,torque_nm\n".to_owned() + &rows.collect::<String>()))
    }

    #[test]
    fn split_of_many_runs_tests_every_third_by_first_appearance() {
        let log = log_of_runs("bbaaccbddee");
        assert_eq!(log.run.concat(), "bbbaaccddee");
        let tested: Vec<&str> =
            (0..11).filter(|row| log.is_test[*row]).map(|row| log.run[row].as_str()).collect();
        assert_eq!(tested, ["c", "c"]);
        assert_eq!(log.runs(), [0..3, 3..5, 5..7, 7..9, 9..11]);
    }

    #[test]
    fn split_of_two_runs_tests_last_rows() {
        let log = log_of_runs("aaaaabbbbb");
        let tested: Vec<usize> = (0..10).filter(|row| log.is_test[*row]).collect();
        assert_eq!(tested, [7, 8, 9]);
    }

    #[test]
    fn rmse_of_judging_rows_leaves_out_training_and_standstill() {
        let log = log_of(
            "run,time_s,velocity_rad_s,torque_nm\n\
             a,0,10,50\nb,0,10,50\nc,0,10,3\nc,1,0.05,90\nc,2,-10,-4\n",
        );
        assert_eq!(log.judging_rows(), [2, 4]);
        assert!((log.rmse(&log.judging_rows(), |_| 0.0) - 12.5f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn column_with_missing_cells_is_interpolated() {
        let log = log_of("time_s,velocity_rad_s,torque_nm,x\n0,1,1,\n1,1,1,2\n2,1,1,\n3,1,1,4\n");
        assert_eq!(log.column("x"), Some(vec![2.0, 2.0, 3.0, 4.0]));
        assert_eq!(log.column("y"), None);
    }
}
