//! Summary of a log in a few lines, printed after every reading.
//!
//! Most misread logs show at a glance: a rate of 1 Hz, a speed of 3000 rad/s, half of the rows left out. So the
//! summary states rows, runs, rate, and the range, unit and origin of each column.

use super::column::{Column, all};
use crate::number::figure;
use crate::statistics::{extent, median_step};
use crate::{Dataset, SourceColumn};

/// Summary of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// Number of runs.
    pub runs: usize,
    /// Rows in them.
    pub rows: usize,
    /// Rows that were left out as bad.
    pub rows_left_out: usize,
    /// Median rate of the slowest and of the fastest run, Hz; 0 if no run has two rows.
    pub rate_hz: [f64; 2],
    /// Total time within runs, s.
    pub seconds: f64,
    /// Time first, then all columns.
    pub columns: Vec<ColumnOverview>,
}

/// Summary of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnOverview {
    /// Its name in the contract, or its own.
    pub name: String,
    /// The unit of its values here.
    pub unit: String,
    /// Its minimum and maximum.
    pub range: [f64; 2],
    /// Its origin; `None` for data that were not read from a file.
    pub source: Option<SourceColumn>,
}

/// Formats a number with four digits. It is rounded first, so that 99.9999 and 100 are formatted alike.
fn rounded(value: f64) -> String {
    figure(format!("{value:.3e}").parse().unwrap_or(value))
}

/// Summarises a log.
pub fn overview(data: &Dataset) -> Overview {
    let mut columns = vec![ColumnOverview {
        name: "time_s".into(),
        unit: "s".into(),
        range: extent(data.runs.iter().flat_map(|run| run.time_s.iter().copied())),
        source: data.source("time_s").cloned(),
    }];
    columns.extend(all(data).iter().map(|column: &Column| ColumnOverview {
        name: column.name.clone(),
        unit: column.unit.clone(),
        range: extent(column.values()),
        source: data.source(&column.name).cloned(),
    }));
    let steps = data.runs.iter().filter_map(|run| median_step(&run.time_s));
    let rates = steps.map(|step| 1.0 / step);
    let [least, most] = extent(rates);
    let ends = data.runs.iter().filter_map(|run| Some((run.time_s.first()?, run.time_s.last()?)));
    Overview {
        runs: data.runs.len(),
        rows: data.rows,
        rows_left_out: data.bad_rows.count,
        rate_hz: if least.is_finite() { [least, most] } else { [0.0; 2] },
        seconds: ends.map(|(first, last)| last - first).sum(),
        columns,
    }
}

impl Overview {
    /// Returns the rate: one number if both ends are equal as printed, else a range with equal decimals.
    pub fn rate_in_words(&self) -> String {
        let [least, most] = self.rate_hz;
        let fastest = rounded(most);
        let least: f64 = rounded(least).parse().unwrap_or(least);
        let decimals = fastest.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        match format!("{least:.decimals$}") {
            _ if most == 0.0 => "no rate".to_owned(),
            slowest if slowest == fastest => format!("{fastest} Hz"),
            slowest => format!("{slowest} to {fastest} Hz"),
        }
    }

    /// Returns the summary in lines for a terminal, with the notes of the reader.
    pub fn lines(&self, data: &Dataset) -> Vec<String> {
        let rate = self.rate_in_words();
        let plural = if self.runs == 1 { "run" } else { "runs" };
        let seconds = rounded(self.seconds);
        let mut lines =
            vec![format!("{} {plural}, {} rows, {rate}, {seconds} s in all", self.runs, self.rows)];
        let width = self.columns.iter().map(|column| column.name.chars().count()).max();
        for ColumnOverview { name, unit, range, source } in &self.columns {
            let [least, most] = range.map(rounded);
            let from = match source {
                Some(SourceColumn { header, unit: Some(unit), .. }) => {
                    format!("   from {header} in {unit}")
                }
                Some(SourceColumn { header, .. }) if header != name => format!("   from {header}"),
                _ => String::new(),
            };
            let width = width.unwrap_or_default();
            lines.push(format!("  {name:width$}  {least} to {most} {unit}{from}"));
        }
        lines.extend(data.notes.iter().cloned());
        if self.rows_left_out > 0 {
            lines.push(format!("{} rows are left out as bad:", self.rows_left_out));
            lines.extend(data.bad_rows.first.iter().map(|cell| format!("  {cell}")));
        }
        let left_out = data.left_out_columns.iter();
        lines.extend(left_out.map(|of| format!("column {} is left out: {}", of.name, of.why)));
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_in_words_has_one_number_or_a_range_of_equal_decimals() {
        let empty = overview(&Dataset::default());
        let words = |rate_hz| Overview { rate_hz, ..empty.clone() }.rate_in_words();
        for (rates, expected) in [
            ([999.999, 1000.001], "1000 Hz"),
            ([999.2, 1000.4], "999 to 1000 Hz"),
            ([99.97, 100.02], "100.0 Hz"),
            ([12_345.6, 12_345.9], "12350 Hz"),
            ([9.5, 100.0], "9.5 to 100.0 Hz"),
        ] {
            assert_eq!(words(rates), expected);
        }
    }

    #[test]
    fn lines_with_two_runs_summarises_log() {
        let names = ["time_s", "velocity_rad_s", "torque_nm", "flow"].map(str::to_owned);
        let run = |name: &str, rate: f64| {
            let time: Vec<f64> = (0..101).map(|i| f64::from(i) / rate).collect();
            let speed = time.iter().map(|t| t.sin()).collect();
            (name.to_owned(), vec![time.clone(), speed, vec![2.0; 101], vec![-3.0; 101]])
        };
        let data = Dataset::from_columns(&names, [run("a", 100.0), run("b", 50.0)]).unwrap();
        let lines = overview(&data).lines(&data);
        let figures = ["2 runs", "202 rows", "50.0 to 100.0 Hz", "3.000 s"];
        let ranges = ["time_s", "0", "2.000 s", "velocity_rad_s", "0", "1.000 rad/s"];
        let constants = ["torque_nm", "2.000", "2.000 Nm", "flow", "-3.000", "-3.000"];
        let parts = [&figures[..], &ranges, &constants].concat();
        crate::message::check("checks", "overview", &lines.join("\n"), &parts);
    }
}
