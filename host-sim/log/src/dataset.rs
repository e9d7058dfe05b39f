//! The data set: runs with columns of numbers.
//!
//! A [`Run`] is one experiment: columns of equal length in time order, in SI units, all values finite. Data are stored
//! by column, because fits and tests process one quantity at a time. A [`Dataset`] holds all runs of all files. The
//! runs share one joint kind and one list of columns. A column that one file lacks is absent in all, so that a
//! regressor has the same meaning in every run.
//!
//! A rotary and a linear joint differ only in units: for [`JointKind::Prismatic`], "torque" below is a force in N, and
//! "velocity" is in m/s.

use std::ops::Range;
use std::path::PathBuf;

use super::contract;
use super::error::BadRows;
use compensator_core::quantity::{JointKind, Quantity};

/// All data that were read and validated.
#[derive(Debug, Clone, Default)]
pub struct Dataset {
    /// The joint kind, by the target column: `torque_nm` or `force_n`.
    pub joint: JointKind,
    /// The runs in the order of their first row in the files. None is empty.
    pub runs: Vec<Run>,
    /// The files, in the order given.
    pub files: Vec<PathBuf>,
    /// Rows in `runs`, after skipping.
    pub rows: usize,
    /// Rows in the files, including bad ones.
    pub rows_read: usize,
    /// Rows left out because of an invalid cell.
    pub bad_rows: BadRows,
    /// Names of the extra numeric columns, in the order of [`Run::extra`].
    pub covariates: Vec<String>,
    /// Columns of the files that are not in the runs, with the reason.
    pub left_out_columns: Vec<LeftOutColumn>,
    /// Notes for the report, one sentence each.
    pub notes: Vec<String>,
    /// The control law of the servo that the torque is computed by, in words; `None` for a torque of the log.
    pub torque_law: Option<String>,
    /// The torque of one ampere, Nm/A or N/A, by which the log's current became the torque; `None` for a log of a torque.
    pub torque_constant: Option<f64>,
    /// Origin of each column, `time_s` first; empty for data that were not read from a file.
    pub sources: Vec<SourceColumn>,
}

/// Why columns are no data set; one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ColumnsError {
    /// There is none of these targets, or both.
    #[error("columns: expected either {0} or {1}")]
    Target(&'static str, &'static str),
    /// This column is missing.
    #[error("columns: expected {0}")]
    Missing(&'static str),
    /// The columns of a run differ in number or length.
    #[error("run {run}: expected {count} columns of one length")]
    Lengths {
        /// The name of the run.
        run: String,
        /// The number of columns.
        count: usize,
    },
}

/// The origin of a column.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SourceColumn {
    /// Its name in the contract, or its own name.
    pub name: String,
    /// Its name in the first file.
    pub header: String,
    /// Its unit in the file, if `--columns` gives one.
    pub unit: Option<String>,
    /// Number of filled rows in all files.
    pub filled: usize,
    /// How they were filled, as the end of a sentence.
    pub fill: Option<&'static str>,
}

/// A column of a file that is not in the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOutColumn {
    /// Its name in the file.
    pub name: String,
    /// Why it was left out, as the end of a sentence that starts with the name.
    pub why: String,
}

/// One experiment: columns of equal length, in time order, every value finite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Run {
    /// Its name, unique in the data set.
    pub name: String,
    /// Index of its file in [`Dataset::files`].
    pub file: usize,
    /// Time in s. Never decreasing; a step may be zero where a logger's clock is coarse.
    pub time_s: Vec<f64>,
    /// Joint velocity in rad/s or m/s.
    pub velocity: Vec<f64>,
    /// The torque (Nm) or force (N) to be explained.
    pub torque: Vec<f64>,
    /// The other measured columns, in their units; see [`Run::get`].
    pub measured: Measured,
    /// Extra columns, parallel to [`Dataset::covariates`].
    pub extra: Vec<Vec<f64>>,
    /// Text columns that hold one value throughout the run: (column, value).
    pub labels: Vec<(String, String)>,
    /// Random draws of the true velocity minus [`Run::velocity`], rad/s or m/s, one value per row. They represent the
    /// uncertainty of the reconstructed motion ([`crate::motion`]). Empty if the velocity is used as logged.
    pub velocity_draws: Vec<Vec<f64>>,
    /// 1 in rows whose torque was a spike and is replaced by an estimate, else 0; empty if there is none. These rows have
    /// a valid motion, and weight 0 in fits and errors.
    pub torque_spikes: Vec<f64>,
    /// The number of the piece that each row belongs to, where the position jumps from one piece to the next; empty if it does
    /// not. No computation with memory crosses from piece to piece ([`crate::segments`]).
    pub pieces: Vec<f64>,
    /// True if [`Run::velocity`] has negligible noise: exact as logged, or smoothed ([`crate::motion`]). Its
    /// derivative may then be taken from row to row.
    pub velocity_is_smooth: bool,
}

/// A row of a data set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    /// Index into [`Dataset::runs`].
    pub run: usize,
    /// The row in the run.
    pub row: usize,
}

/// Columns of a run by their quantity.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured([Option<Vec<f64>>; Quantity::ALL.len()]);

impl Run {
    /// Returns the column of a quantity, in its unit in the contract.
    pub fn get(&self, quantity: Quantity) -> Option<&[f64]> {
        match quantity {
            Quantity::CampaignTime => Some(&self.time_s),
            Quantity::Velocity => Some(&self.velocity),
            Quantity::Torque => Some(&self.torque),
            _ => self.measured.0[quantity as usize].as_deref(),
        }
    }

    /// Sets the column of a quantity. `values` must be as long as the time.
    pub fn set(&mut self, quantity: Quantity, values: Vec<f64>) {
        match quantity {
            Quantity::CampaignTime => self.time_s = values,
            Quantity::Velocity => self.velocity = values,
            Quantity::Torque => self.torque = values,
            _ => self.measured.0[quantity as usize] = Some(values),
        }
    }

    /// Returns true if the torque of a row was a spike ([`Run::torque_spikes`]).
    pub fn is_spike(&self, row: usize) -> bool {
        self.torque_spikes.get(row).is_some_and(|spike| *spike > 0.0)
    }

    /// Sets a column and returns the run. See [`Run::set`].
    #[must_use]
    pub fn with(mut self, quantity: Quantity, values: Vec<f64>) -> Self {
        self.set(quantity, values);
        self
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Returns true if there are no rows. No run in a [`Dataset`] is empty.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns the rows of `range` as a run with the same name and labels.
    ///
    /// # Panics
    /// If the range is not inside the run.
    pub fn slice(&self, range: Range<usize>) -> Run {
        self.with_columns(|column| column[range.clone()].to_vec())
    }

    /// Applies `f` to every numeric column including time. `f` must treat all columns alike.
    pub(crate) fn with_columns(&self, f: impl Fn(&Vec<f64>) -> Vec<f64>) -> Run {
        Run {
            name: self.name.clone(),
            file: self.file,
            time_s: f(&self.time_s),
            velocity: f(&self.velocity),
            torque: f(&self.torque),
            measured: Measured(self.measured.0.each_ref().map(|of| of.as_ref().map(&f))),
            extra: self.extra.iter().map(&f).collect(),
            labels: self.labels.clone(),
            velocity_draws: self.velocity_draws.iter().map(&f).collect(),
            torque_spikes: if_any(&self.torque_spikes, &f),
            pieces: if_any(&self.pieces, &f),
            velocity_is_smooth: self.velocity_is_smooth,
        }
    }
}

/// Applies `f` to a column that may be absent.
fn if_any(column: &Vec<f64>, f: impl Fn(&Vec<f64>) -> Vec<f64>) -> Vec<f64> {
    if column.is_empty() { Vec::new() } else { f(column) }
}

impl Dataset {
    /// Creates a data set from columns. `names` are names of the contract ([`super::read()`]) or covariates. Each run
    /// has one column of equal length per name. The values are not validated.
    ///
    /// # Errors
    /// A required column is missing, or a run's columns differ in number or length.
    pub fn from_columns(
        names: &[String],
        runs: impl IntoIterator<Item = (String, Vec<Vec<f64>>)>,
    ) -> Result<Self, ColumnsError> {
        let has = |name: &str| names.iter().any(|known| known == name);
        let [turns, slides] = Quantity::Torque.info().names;
        let joint = match (has(turns), has(slides)) {
            (true, false) => JointKind::Revolute,
            (false, true) => JointKind::Prismatic,
            _ => return Err(ColumnsError::Target(turns, slides)),
        };
        let required = [Quantity::CampaignTime, Quantity::Velocity, Quantity::Torque];
        let place = |name: &str| {
            let is = |quantity: &Quantity| quantity.name(joint) == name;
            required.into_iter().find(is).or_else(|| contract::parse_optional(name, joint))
        };
        let mut data = Self {
            joint,
            covariates: names.iter().filter(|name| place(name).is_none()).cloned().collect(),
            ..Self::default()
        };
        for quantity in required {
            let name = quantity.name(joint);
            if !has(name) {
                return Err(ColumnsError::Missing(name));
            }
        }
        for (name, columns) in runs {
            let rows = columns.first().map_or(0, Vec::len);
            if columns.len() != names.len() || columns.iter().any(|column| column.len() != rows) {
                return Err(ColumnsError::Lengths { run: name, count: names.len() });
            }
            let mut run = Run { name, ..Run::default() };
            for (column, values) in names.iter().zip(columns) {
                match place(column) {
                    Some(quantity) => run.set(quantity, values),
                    None => run.extra.push(values),
                }
            }
            data.rows += rows;
            data.runs.push(run);
        }
        data.rows_read = data.rows;
        Ok(data)
    }

    /// Returns a column of a run by its name in the contract or in [`Dataset::covariates`]. Position, velocity and
    /// acceleration are found under the names of both joint kinds.
    pub fn column<'a>(&self, run: &'a Run, name: &str) -> Option<&'a [f64]> {
        if let Some(known) = Quantity::parse(name).and_then(|(quantity, _)| run.get(quantity)) {
            return Some(known);
        }
        let at = self.covariates.iter().position(|covariate| covariate == name)?;
        run.extra.get(at).map(Vec::as_slice)
    }

    /// Returns the column of a quantity in each run; `None` if a run lacks it.
    pub(crate) fn columns_of(&self, quantity: Quantity) -> Option<Vec<&[f64]>> {
        self.runs.iter().map(|run| run.get(quantity)).collect()
    }

    /// Returns the origin of a column; `None` if it was not read from a file.
    pub(crate) fn source(&self, name: &str) -> Option<&SourceColumn> {
        self.sources.iter().find(|source| source.name == name)
    }

    /// Returns the unit that `--columns` gives for a column.
    pub(crate) fn given_unit(&self, name: &str) -> Option<&str> {
        self.source(name)?.unit.as_deref()
    }

    /// Returns the first file, which an error of the whole log names; an empty path for data that were not read from a file.
    pub(crate) fn first_file(&self) -> PathBuf {
        self.files.first().cloned().unwrap_or_default()
    }

    /// Returns the value that `column` has throughout a run, as text: the run's name for `run`, a label, or a constant
    /// numeric column. Returns `None` if there is no such column or if it changes inside the run.
    pub fn constant(&self, run: &Run, column: &str) -> Option<String> {
        if column == "run" {
            return Some(run.name.clone());
        }
        if let Some((_, value)) = run.labels.iter().find(|(name, _)| name == column) {
            return Some(value.clone());
        }
        let values = self.column(run, column)?;
        let first = *values.first()?;
        values.iter().all(|&v| v == first).then(|| first.to_string())
    }

    /// Returns the names of all columns that are constant in every run, `run` first. These can be used with
    /// [`SplitRule::HoldOut`](super::SplitRule::HoldOut).
    pub fn constant_columns(&self) -> Vec<String> {
        let mut names: Vec<String> = vec!["run".into()];
        if let Some(run) = self.runs.first() {
            names.extend(run.labels.iter().map(|(name, _)| name.clone()));
        }
        names.extend(contract::covariates().map(|of| of.name(self.joint).to_owned()));
        names.extend(self.covariates.iter().cloned());
        names.retain(|name| self.runs.iter().all(|run| self.constant(run, name).is_some()));
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run() -> Run {
        Run {
            time_s: vec![0.0, 1.0, 2.0, 3.0],
            velocity: vec![-1.0, 0.0, 2.0, 3.0],
            torque: vec![4.0; 4],
            extra: vec![vec![7.0; 4]],
            labels: vec![("trajectory".into(), "sine".into())],
            ..Run::default()
        }
    }

    #[test]
    fn slice_keeps_the_rows_of_every_column() {
        let part = run().slice(1..4);
        assert_eq!(part.time_s, [1.0, 2.0, 3.0]);
        assert_eq!(part.velocity, [0.0, 2.0, 3.0]);
        assert_eq!(part.extra, [[7.0; 3]]);
    }

    #[test]
    fn constant_returns_names_labels_and_constant_columns() {
        let data = Dataset {
            joint: JointKind::Revolute,
            runs: vec![run()],
            files: vec![],
            rows: 4,
            rows_read: 4,
            bad_rows: BadRows::default(),
            covariates: vec!["kp".into()],
            left_out_columns: vec![],
            notes: vec![],
            torque_law: None,
            torque_constant: None,
            sources: vec![],
        };
        assert_eq!(data.constant(&data.runs[0], "kp").as_deref(), Some("7"));
        assert_eq!(data.constant(&data.runs[0], "velocity_rad_s"), None);
        assert_eq!(data.constant_columns(), ["run", "trajectory", "kp"]);
    }
}
