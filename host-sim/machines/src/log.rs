//! What a simulated machine logs: runs of named columns.
//!
//! Column names are those of the contract for measured data (`time_s`, `velocity_rad_s`, `torque_nm`,
//! `pressure_diff_pa`, ...), any other name is a covariate: whoever reads logs reads these as well. A new
//! quantity is another name, and nothing here changes.

use std::fmt::Write;

/// The log of a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Names of the columns, with their units; `time_s` is the first.
    pub columns: Vec<String>,
    /// The runs in the order they were made.
    pub runs: Vec<LoggedRun>,
}

/// The log of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoggedRun {
    /// Its name, unique in the log.
    pub name: String,
    /// A column of equal length for each of [`Log::columns`].
    pub columns: Vec<Vec<f64>>,
}

impl LoggedRun {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }
}

impl Log {
    /// Number of rows of all runs.
    pub fn rows(&self) -> usize {
        self.runs.iter().map(LoggedRun::rows).sum()
    }

    /// A column of a run by its name, where there is one.
    pub fn column<'a>(&self, run: &'a LoggedRun, name: &str) -> Option<&'a [f64]> {
        let at = self.columns.iter().position(|column| column == name)?;
        run.columns.get(at).map(Vec::as_slice)
    }

    /// `data.csv` by the contract. Each number has the shortest digits that read back as the same number.
    pub fn csv(&self) -> String {
        let mut text = format!("run,{}\n", self.columns.join(","));
        for run in &self.runs {
            for row in 0..run.rows() {
                text += &run.name;
                for column in &run.columns {
                    // Writing to a string does not fail.
                    let _ = write!(text, ",{}", column[row]);
                }
                text.push('\n');
            }
        }
        text
    }
}
