//! The data as every other module sees them: runs of plain columns.
//!
//! A [`Run`] is one experiment: columns of equal length in time order, SI units, no NaN and no
//! infinity anywhere. Columns, not rows, because fits and tests walk along one quantity at a time.
//! A [`Dataset`] is all runs of all files that were given, which share one joint kind and one list
//! of columns; a column one file lacks is absent in all, so a regressor never changes its meaning
//! from run to run.
//!
//! A rotary and a linear joint differ only in the units they are printed with: "torque" below
//! means a force in N, and "velocity" m/s, when the joint is [`JointKind::Prismatic`].

use std::ops::Range;
use std::path::PathBuf;

use super::contract;
use super::error::BadRows;
use compensator_core::quantity::{JointKind, Quantity};

/// Everything that was read, cleaned and skipped.
#[derive(Debug, Clone)]
pub struct Dataset {
    /// The joint kind, by the target column: `torque_nm` or `force_n`.
    pub joint: JointKind,
    /// The runs in the order they first appear in the files. None is empty.
    pub runs: Vec<Run>,
    /// The files, in the order given.
    pub files: Vec<PathBuf>,
    /// Rows in `runs`, after skipping.
    pub rows: usize,
    /// Rows of data the files hold, bad ones included.
    pub rows_read: usize,
    /// Rows left out because a cell could not be believed.
    pub bad_rows: BadRows,
    /// Names of the extra numeric columns, in the order of [`Run::extra`].
    pub covariates: Vec<String>,
    /// Columns that are in a file but not in the runs, each with the reason.
    pub left_out_columns: Vec<LeftOutColumn>,
    /// What else a careful reader should know, a sentence each.
    pub notes: Vec<String>,
    /// Where each column comes from, `time_s` first; empty of what was never in a file.
    pub sources: Vec<SourceColumn>,
}

/// Where a column of the data comes from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SourceColumn {
    /// Its name in the contract, or its own.
    pub name: String,
    /// Its name in the (first) file.
    pub header: String,
    /// The unit it is in there, where `--columns` says it.
    pub unit: Option<String>,
    /// Rows that held no value of it and were filled, in all files.
    pub filled: usize,
    /// How they were, as the end of a sentence.
    pub fill: Option<&'static str>,
}

/// A column that is in a file but not in the data.
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
    /// Which of [`Dataset::files`] it is from.
    pub file: usize,
    /// Time in s. Never decreasing; a step may be zero where a logger's clock is coarse.
    pub time_s: Vec<f64>,
    /// Joint velocity in rad/s or m/s.
    pub velocity: Vec<f64>,
    /// The torque (Nm) or force (N) to be explained.
    pub torque: Vec<f64>,
    /// What else was measured, in the units of its column; see [`Run::get`].
    pub measured: Measured,
    /// Extra columns, parallel to [`Dataset::covariates`].
    pub extra: Vec<Vec<f64>>,
    /// Text columns that hold one value throughout the run: (column, value).
    pub labels: Vec<(String, String)>,
    /// How the motion may also have been: a few draws of the true velocity minus [`Run::velocity`], rad/s or
    /// m/s, a value per row, from what is known of it ([`crate::motion`]). Empty where the velocity is taken
    /// as it stands.
    pub velocity_draws: Vec<Vec<f64>>,
    /// Whether [`Run::velocity`] is free of noise to speak of: exact as logged, or smoothed already
    /// ([`crate::motion`]). Its slope may then be taken from row to row.
    pub velocity_is_smooth: bool,
}

/// Columns of a run by their quantity.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured([Option<Vec<f64>>; Quantity::ALL.len()]);

impl Run {
    /// The column of a quantity, in its unit in the contract.
    pub fn get(&self, quantity: Quantity) -> Option<&[f64]> {
        match quantity {
            Quantity::CampaignTime => Some(&self.time_s),
            Quantity::Velocity => Some(&self.velocity),
            Quantity::Torque => Some(&self.torque),
            _ => self.measured.0[quantity as usize].as_deref(),
        }
    }

    /// Sets the column of a quantity, as long as time is.
    pub fn set(&mut self, quantity: Quantity, values: Vec<f64>) {
        match quantity {
            Quantity::CampaignTime => self.time_s = values,
            Quantity::Velocity => self.velocity = values,
            Quantity::Torque => self.torque = values,
            _ => self.measured.0[quantity as usize] = Some(values),
        }
    }

    /// As [`Run::set`], for a run in one expression.
    #[must_use]
    pub fn with(mut self, quantity: Quantity, values: Vec<f64>) -> Self {
        self.set(quantity, values);
        self
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there are no rows. Never so in a [`Dataset`].
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Rows `range` as a run of its own, with the same name and labels.
    ///
    /// # Panics
    /// If the range does not lie inside the run.
    pub fn slice(&self, range: Range<usize>) -> Run {
        let cut = |column: &Vec<f64>| column[range.clone()].to_vec();
        let mut part = self.map_columns(cut);
        part.time_s = cut(&self.time_s);
        part
    }

    /// A copy in which every numeric column, time too, went through `f`, which treats all alike.
    #[cfg(feature = "fit")]
    pub(crate) fn with_columns(&self, f: impl Fn(&Vec<f64>) -> Vec<f64>) -> Run {
        let time_s = f(&self.time_s);
        Run { time_s, ..self.map_columns(f) }
    }

    /// A copy in which every numeric column but time went through `f`; time is empty.
    pub(super) fn map_columns(&self, f: impl Fn(&Vec<f64>) -> Vec<f64>) -> Run {
        Run {
            name: self.name.clone(),
            file: self.file,
            time_s: Vec::new(),
            velocity: f(&self.velocity),
            torque: f(&self.torque),
            measured: Measured(self.measured.0.each_ref().map(|of| of.as_ref().map(&f))),
            extra: self.extra.iter().map(&f).collect(),
            labels: self.labels.clone(),
            velocity_draws: self.velocity_draws.iter().map(&f).collect(),
            velocity_is_smooth: self.velocity_is_smooth,
        }
    }
}

impl Dataset {
    /// A data set that was never in a file: each run with a column of equal length for each of the names,
    /// which are those of the contract ([`super::read()`]); any other name is a covariate.
    ///
    /// # Errors
    /// One line: a required column is missing, or a run's columns differ in number or length. Values are
    /// taken as they are: whoever is not sure of them writes a file and reads it.
    pub fn of_columns(
        names: &[String],
        runs: impl IntoIterator<Item = (String, Vec<Vec<f64>>)>,
    ) -> Result<Self, String> {
        let has = |name: &str| names.iter().any(|own| own == name);
        let [turns, slides] = Quantity::Torque.info().names;
        let joint = match (has(turns), has(slides)) {
            (true, false) => JointKind::Revolute,
            (false, true) => JointKind::Prismatic,
            _ => return Err(format!("columns: expected either {turns} or {slides}")),
        };
        let required = [Quantity::CampaignTime, Quantity::Velocity, Quantity::Torque];
        let place = |name: &str| {
            let is = |quantity: &Quantity| quantity.name(joint) == name;
            required.into_iter().find(is).or_else(|| contract::parse_optional(name, joint))
        };
        let mut data = Self {
            joint,
            runs: Vec::new(),
            files: Vec::new(),
            rows: 0,
            rows_read: 0,
            bad_rows: BadRows::default(),
            covariates: names.iter().filter(|name| place(name).is_none()).cloned().collect(),
            left_out_columns: Vec::new(),
            notes: Vec::new(),
            sources: Vec::new(),
        };
        for quantity in required {
            let name = quantity.name(joint);
            if !has(name) {
                return Err(format!("columns: expected {name}"));
            }
        }
        for (name, columns) in runs {
            let rows = columns.first().map_or(0, Vec::len);
            if columns.len() != names.len() || columns.iter().any(|column| column.len() != rows) {
                return Err(format!("run {name}: expected {} columns of one length", names.len()));
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

    /// A column of a run by the name it has in the contract or in [`Dataset::covariates`].
    /// Position, velocity and acceleration answer to the names of either joint kind.
    pub fn column<'a>(&self, run: &'a Run, name: &str) -> Option<&'a [f64]> {
        if let Some(known) = Quantity::parse(name).and_then(|(quantity, _)| run.get(quantity)) {
            return Some(known);
        }
        let at = self.covariates.iter().position(|covariate| covariate == name)?;
        run.extra.get(at).map(Vec::as_slice)
    }

    /// The one value `column` has throughout a run, as text: the run's name for `run`, a label,
    /// or a numeric column that does not change. `None` where there is no such column or it
    /// changes inside the run.
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

    /// Names of all columns that are constant in every run, `run` first: what
    /// [`SplitRule::HoldOut`](super::SplitRule::HoldOut) can go by.
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
    fn a_slice_has_the_rows_of_every_column() {
        let part = run().slice(1..4);
        assert_eq!(part.time_s, [1.0, 2.0, 3.0]);
        assert_eq!(part.velocity, [0.0, 2.0, 3.0]);
        assert_eq!(part.extra, [[7.0; 3]]);
    }

    #[test]
    fn constants_come_from_the_name_the_labels_and_the_columns() {
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
            sources: vec![],
        };
        assert_eq!(data.constant(&data.runs[0], "kp").as_deref(), Some("7"));
        assert_eq!(data.constant(&data.runs[0], "velocity_rad_s"), None);
        assert_eq!(data.constant_columns(), ["run", "trajectory", "kp"]);
    }
}
