//! The data as every other module sees them: runs of plain columns.
//!
//! A [`Run`] is one experiment: columns of equal length in time order, SI units, no NaN and no
//! infinity anywhere. Columns, not rows, because fits and tests walk along one quantity at a time.
//! A [`Dataset`] is all runs of all files that were given, which share one joint kind and one list
//! of columns; a column one file lacks is absent in all, so a regressor never changes its meaning
//! from run to run.
//!
//! A rotary and a linear joint differ only in the units they are printed with: "torque" below
//! means a force in N, and "velocity" m/s, when the joint is [`Joint::Prismatic`].

use std::ops::Range;
use std::path::PathBuf;

use super::error::BadRows;

/// What the joint does, and with it the units of its columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Joint {
    /// It turns: rad, rad/s, rad/s2, Nm.
    Revolute,
    /// It slides: m, m/s, m/s2, N.
    Prismatic,
}

impl Joint {
    /// `"Nm"` or `"N"`.
    pub fn torque_unit(self) -> &'static str {
        match self {
            Joint::Revolute => "Nm",
            Joint::Prismatic => "N",
        }
    }

    /// `"rad"` or `"m"`.
    pub fn position_unit(self) -> &'static str {
        match self {
            Joint::Revolute => "rad",
            Joint::Prismatic => "m",
        }
    }

    /// `"rad/s"` or `"m/s"`.
    pub fn velocity_unit(self) -> &'static str {
        match self {
            Joint::Revolute => "rad/s",
            Joint::Prismatic => "m/s",
        }
    }

    /// `"rad/s2"` or `"m/s2"`.
    pub fn acceleration_unit(self) -> &'static str {
        match self {
            Joint::Revolute => "rad/s2",
            Joint::Prismatic => "m/s2",
        }
    }
}

/// Everything that was read, cleaned and skipped.
#[derive(Debug, Clone)]
pub struct Dataset {
    /// The joint kind, by the target column: `torque_nm` or `force_n`.
    pub joint: Joint,
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
    /// Joint position in rad or m.
    pub position: Option<Vec<f64>>,
    /// Measured acceleration in rad/s2 or m/s2; see [`Run::acceleration_or_derived`].
    pub acceleration: Option<Vec<f64>>,
    /// Side load on the shaft in N.
    pub radial_force_n: Option<Vec<f64>>,
    /// Pressure difference over the seal in Pa.
    pub pressure_diff_pa: Option<Vec<f64>>,
    /// Temperature in degrees Celsius.
    pub temperature_c: Option<Vec<f64>>,
    /// Torque transmitted to the load in Nm.
    pub load_torque_nm: Option<Vec<f64>>,
    /// Extra columns, parallel to [`Dataset::covariates`].
    pub extra: Vec<Vec<f64>>,
    /// Text columns that hold one value throughout the run: (column, value).
    pub labels: Vec<(String, String)>,
}

/// Where a column of the contract is kept.
enum Place<'a> {
    Required(&'a mut Vec<f64>),
    Optional(&'a mut Option<Vec<f64>>),
}

impl Run {
    /// Where a column of the contract is kept; `None` for a covariate.
    fn place(&mut self, name: &str) -> Option<Place<'_>> {
        Some(match name {
            "time_s" => Place::Required(&mut self.time_s),
            "velocity_rad_s" | "velocity_m_s" => Place::Required(&mut self.velocity),
            "torque_nm" | "force_n" => Place::Required(&mut self.torque),
            "position_rad" | "position_m" => Place::Optional(&mut self.position),
            "acceleration_rad_s2" | "acceleration_m_s2" => Place::Optional(&mut self.acceleration),
            "radial_force_n" => Place::Optional(&mut self.radial_force_n),
            "pressure_diff_pa" => Place::Optional(&mut self.pressure_diff_pa),
            "temperature_c" => Place::Optional(&mut self.temperature_c),
            "load_torque_nm" => Place::Optional(&mut self.load_torque_nm),
            _ => return None,
        })
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

    /// A copy in which every numeric column but time went through `f`; time is empty.
    pub(super) fn map_columns(&self, f: impl Fn(&Vec<f64>) -> Vec<f64>) -> Run {
        let opt = |column: &Option<Vec<f64>>| column.as_ref().map(&f);
        Run {
            name: self.name.clone(),
            file: self.file,
            time_s: Vec::new(),
            velocity: f(&self.velocity),
            torque: f(&self.torque),
            position: opt(&self.position),
            acceleration: opt(&self.acceleration),
            radial_force_n: opt(&self.radial_force_n),
            pressure_diff_pa: opt(&self.pressure_diff_pa),
            temperature_c: opt(&self.temperature_c),
            load_torque_nm: opt(&self.load_torque_nm),
            extra: self.extra.iter().map(&f).collect(),
            labels: self.labels.clone(),
        }
    }
}

impl Dataset {
    /// A data set that was never in a file: each run with a column of equal length for each of the names,
    /// which are those of the contract ([`super::read`]); any other name is a covariate.
    ///
    /// # Errors
    /// One line: a required column is missing, or a column is not as long as its run's time. Values are
    /// taken as they are: whoever is not sure of them writes a file and reads it.
    pub fn of_columns(
        names: &[String],
        runs: impl IntoIterator<Item = (String, Vec<Vec<f64>>)>,
    ) -> Result<Self, String> {
        let has = |name: &str| names.iter().any(|own| own == name);
        let joint = match (has("torque_nm"), has("force_n")) {
            (true, false) => Joint::Revolute,
            (false, true) => Joint::Prismatic,
            _ => return Err("columns: expected either torque_nm or force_n".into()),
        };
        let mut data = Self {
            joint,
            runs: Vec::new(),
            files: Vec::new(),
            rows: 0,
            rows_read: 0,
            bad_rows: BadRows::default(),
            covariates: Vec::new(),
            left_out_columns: Vec::new(),
            notes: Vec::new(),
        };
        let known = |name: &String| Run::default().place(name).is_some();
        data.covariates = names.iter().filter(|name| !known(name)).cloned().collect();
        for (name, columns) in runs {
            let mut run = Run { name, ..Run::default() };
            for (column, values) in names.iter().zip(columns) {
                match run.place(column) {
                    Some(Place::Required(place)) => *place = values,
                    Some(Place::Optional(place)) => *place = Some(values),
                    None => run.extra.push(values),
                }
            }
            let rows = run.len();
            if !names.iter().all(|name| data.column(&run, name).is_some_and(|c| c.len() == rows)) {
                return Err(format!("run {}: columns differ in length", run.name));
            }
            if run.velocity.len() != rows || run.torque.len() != rows {
                return Err(format!("run {}: expected time, velocity and torque", run.name));
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
        match name {
            "time_s" => Some(&run.time_s),
            "velocity_rad_s" | "velocity_m_s" => Some(&run.velocity),
            "torque_nm" | "force_n" => Some(&run.torque),
            "position_rad" | "position_m" if run.position.is_some() => run.position.as_deref(),
            "acceleration_rad_s2" | "acceleration_m_s2" if run.acceleration.is_some() => {
                run.acceleration.as_deref()
            }
            "radial_force_n" => run.radial_force_n.as_deref(),
            "pressure_diff_pa" => run.pressure_diff_pa.as_deref(),
            "temperature_c" => run.temperature_c.as_deref(),
            "load_torque_nm" => run.load_torque_nm.as_deref(),
            _ => {
                let at = self.covariates.iter().position(|covariate| covariate == name)?;
                run.extra.get(at).map(Vec::as_slice)
            }
        }
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
        let contract = ["radial_force_n", "pressure_diff_pa", "temperature_c", "load_torque_nm"];
        let mut names: Vec<String> = vec!["run".into()];
        if let Some(run) = self.runs.first() {
            names.extend(run.labels.iter().map(|(name, _)| name.clone()));
        }
        names.extend(contract.iter().map(|name| (*name).to_string()));
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
            joint: Joint::Revolute,
            runs: vec![run()],
            files: vec![],
            rows: 4,
            rows_read: 4,
            bad_rows: BadRows::default(),
            covariates: vec!["kp".into()],
            left_out_columns: vec![],
            notes: vec![],
        };
        assert_eq!(data.constant(&data.runs[0], "kp").as_deref(), Some("7"));
        assert_eq!(data.constant(&data.runs[0], "velocity_rad_s"), None);
        assert_eq!(data.constant_columns(), ["run", "trajectory", "kp"]);
    }
}
