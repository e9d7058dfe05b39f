//! Times of rows without stamps: rows at a constant rate, and a column that holds the step before each row.
//!
//! Each run has its own count of steps, because runs may alternate row by row. A run starts where the latest row before
//! it ends, so that the runs of a campaign follow each other in time.

use super::cell::CellReader;
use super::table::Row;
use std::collections::HashMap;

/// Origin of the times of a log.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) enum Timing {
    /// A column of stamps.
    #[default]
    Stamps,
    /// A column of the steps between the rows.
    Steps,
    /// No column: the rows have this rate, Hz.
    Rate(f64),
}

/// Parses a rate with its unit, Hz: `200Hz`, `1 kHz`. Returns `None` if it is not a positive rate.
pub fn parse_rate_hz(text: &str) -> Option<f64> {
    let text = text.trim().to_lowercase();
    let number = text.strip_suffix("hz")?;
    let (number, factor) = match number.strip_suffix('k') {
        Some(number) => (number, 1e3),
        None => (number, 1.0),
    };
    let rate_hz = factor * number.trim().parse::<f64>().ok()?;
    (rate_hz.is_finite() && rate_hz > 0.0).then_some(rate_hz)
}

/// The expected content of a cell that holds a step.
pub(super) const STEP: &str = "a step of at least 0";

/// Adds up the steps of each run.
#[derive(Debug, Clone)]
pub(super) struct RowClock {
    timing: Timing,
    /// The column of the run's name.
    run: Option<usize>,
    /// Steps up to the last row of each run: counts of a constant rate, or in the unit of the column.
    totals: HashMap<Box<[u8]>, f64>,
    /// The largest of these; `None` before the first row.
    latest: Option<f64>,
    /// The last valid step. It takes the place of a step that cannot be read.
    last_step: f64,
}

impl RowClock {
    pub fn new(timing: Timing, run: Option<usize>) -> Self {
        Self { timing, run, totals: HashMap::new(), latest: None, last_step: 0.0 }
    }

    /// Returns the time of the next row, s; `None` if it has no valid step.
    pub fn time_s(&mut self, reading: &CellReader, row: &Row) -> Option<f64> {
        let step = match self.timing {
            Timing::Stamps => return None,
            Timing::Rate(_) => Some(1.0),
            Timing::Steps => reading.raw(row).filter(|step| step.is_finite() && *step >= 0.0),
        };
        self.last_step = step.unwrap_or(self.last_step);
        let name = self.run.map(|column| row.text(column)).unwrap_or_default();
        let before = self.totals.get(&*name).copied().or(self.latest);
        // The first row of the log is at 0: the step before it leads to no row.
        let total = before.map_or(0.0, |before| before + self.last_step);
        match self.totals.get_mut(&*name) {
            Some(known) => *known = total,
            None => drop(self.totals.insert(name.as_ref().into(), total)),
        }
        self.latest = Some(self.latest.map_or(total, |latest| latest.max(total)));
        step?;
        Some(match self.timing {
            Timing::Rate(rate_hz) => total / rate_hz,
            _ => reading.conversion.map_or(total, |conversion| conversion.apply(total)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::each_text_row;
    use crate::unit::conversion;

    fn times(timing: Timing, rows: &[&[&str]]) -> Vec<Option<f64>> {
        let mut clock = RowClock::new(timing, Some(1));
        let conversion = conversion("time_s", "ms").ok();
        let reading = CellReader { conversion, ..CellReader::plain(0) };
        each_text_row(rows, |row| clock.time_s(&reading, row))
    }

    #[test]
    fn parse_rate_hz_with_unit_returns_rate() {
        assert_eq!(parse_rate_hz("200Hz"), Some(200.0));
        assert_eq!(parse_rate_hz("0.5 kHz"), Some(500.0));
        for wrong in ["200", "0Hz", "-1Hz", "nanHz", "5ms", "Hz"] {
            assert_eq!(parse_rate_hz(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn time_s_with_steps_adds_them_up_for_each_run() {
        let rows: [&[&str]; 5] = [&["7", "a"], &["5", "a"], &["6", "b"], &["1", "a"], &["2", "b"]];
        let expected = [0.0, 0.005, 0.011, 0.006, 0.013].map(Some);
        assert_eq!(times(Timing::Steps, &rows), expected);
    }

    #[test]
    fn time_s_with_invalid_step_keeps_later_rows_in_time() {
        let rows: [&[&str]; 4] = [&["5", "a"], &["5", "a"], &["-3", "a"], &["5", "a"]];
        assert_eq!(times(Timing::Steps, &rows), [Some(0.0), Some(0.005), None, Some(0.015)]);
    }

    #[test]
    fn time_s_with_rate_counts_rows() {
        let rows: [&[&str]; 3] = [&["x", "a"], &["", "a"], &["1", "b"]];
        assert_eq!(times(Timing::Rate(200.0), &rows), [Some(0.0), Some(0.005), Some(0.01)]);
    }
}
