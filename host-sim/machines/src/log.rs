//! Log of a simulated machine: runs with named columns.
//!
//! Column names follow the contract for measured data (`time_s`, `velocity_rad_s`, `torque_nm`, `pressure_diff_pa`,
//! ...). Any other name is a covariate. Simulated logs can therefore be read like measured ones, and a new quantity
//! needs no change here.

use std::fmt::Write;

/// Columns of the log of a driven joint, on its test stand and in the pool.
pub const JOINT_COLUMNS: [&str; 8] = [
    "time_s",
    "velocity_rad_s",
    "torque_nm",
    "position_rad",
    "radial_force_n",
    "pressure_diff_pa",
    "temperature_c",
    "load_torque_nm",
];

/// Log of a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Names of the columns, with their units; `time_s` is the first.
    pub columns: Vec<String>,
    /// The runs in chronological order.
    pub runs: Vec<LoggedRun>,
}

/// Log of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoggedRun {
    /// Name of the run, unique in the log.
    pub name: String,
    /// Values of each of [`Log::columns`]. All columns have equal length.
    pub columns: Vec<Vec<f64>>,
}

impl LoggedRun {
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }
}

impl Log {
    /// Returns the number of rows of all runs.
    pub fn rows(&self) -> usize {
        self.runs.iter().map(LoggedRun::rows).sum()
    }

    /// Returns a column of a run by its name, or `None` if it does not exist.
    pub fn column<'a>(&self, run: &'a LoggedRun, name: &str) -> Option<&'a [f64]> {
        let at = self.columns.iter().position(|column| column == name)?;
        run.columns.get(at).map(Vec::as_slice)
    }

    /// Returns the log with the digits of the file: microseconds of time, nine significant digits of other columns.
    pub fn rounded(mut self) -> Self {
        for run in &mut self.runs {
            for (name, values) in self.columns.iter().zip(&mut run.columns) {
                let rounded = if name == "time_s" { microseconds } else { significant };
                values.iter_mut().for_each(|value| *value = rounded(*value));
            }
        }
        self
    }

    /// Returns the content of `data.csv`. Each number has the fewest digits that read back as the same number.
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

/// Rounds to nine significant digits. Zero has no sign, and a value that is not finite stays.
fn significant(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    if !value.is_finite() {
        return value;
    }
    let scale = 10f64.powi(8 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale
}

/// Rounds to microseconds.
fn microseconds(time_s: f64) -> f64 {
    (time_s * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_of_a_value_that_is_no_number_keeps_it() {
        let columns = ["time_s", "torque_nm"].map(str::to_owned).to_vec();
        let values = vec![vec![0.0, 1e-3], vec![f64::NAN, 1.234_567_890_1]];
        let runs = vec![LoggedRun { name: "0".to_owned(), columns: values }];
        let log = Log { columns, runs }.rounded();
        assert_eq!(log.csv(), "run,time_s,torque_nm\n0,0,NaN\n0,0.001,1.23456789\n");
    }
}
