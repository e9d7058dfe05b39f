//! Refusal of a time column that is no clock.

use crate::clean::{Cleaner, OpenRun};
use crate::clock_fault::{ClockFault, clock_fault};
use crate::column_pair::ColumnPair;
use crate::contract::TIME;
use crate::error::DataError;
use crate::number::figure;
use crate::setting::Setting;
use crate::unit::conversion;

/// Plausible steps between rows, s: rates of 2.5 Hz to 200 kHz.
const PLAUSIBLE_STEPS_S: std::ops::RangeInclusive<f64> = 5e-6..=0.4;

/// Units that are tried for steps that have none.
const STEP_UNITS: [&str; 3] = ["ms", "us", "ns"];

/// A rate in an example.
const EXAMPLE_RATE: &str = "200Hz";

/// Minimum number of values of a column for their share of the rows to show a rate.
const MIN_FIRST_ROWS: usize = 100;

impl Cleaner<'_> {
    /// Refuses a column of a slower channel whose values fill the first rows: they belong to other times than that of their row.
    ///
    /// # Errors
    /// If velocity or torque is in just the first half, third .. of all rows.
    pub(super) fn check_rates(&self) -> Result<(), DataError> {
        let [run] = self.runs.as_slice() else { return Ok(()) };
        for (values, reading) in run.required.iter().zip(&self.layout.required) {
            let (rows, first) = (values.len(), values.iter().take_while(|of| !of.is_nan()).count());
            let factor = (rows as f64 / first.max(1) as f64).round() as usize;
            let is_share = factor > 1 && (factor * first).abs_diff(rows) < factor;
            if first >= MIN_FIRST_ROWS && is_share && values[first..].iter().all(|of| of.is_nan()) {
                let column = &self.layout.names[reading.index];
                return Err(DataError::file(
                    self.file,
                    format!(
                        "column {column} in just the first {first} of {rows} rows, as of a channel with 1/{factor} of the rate"
                    ),
                    "a column of times for each rate",
                ));
            }
        }
        Ok(())
    }

    /// Refuses a time column that is no clock, with the option to type.
    pub(super) fn check_clock(&self, runs: &[OpenRun]) -> Result<(), DataError> {
        if !self.clock.reads_stamps() {
            return Ok(());
        }
        let faults = runs.iter().filter_map(|run| Some((run, clock_fault(&run.required[0])?)));
        let Some((run, fault)) = faults.into_iter().next() else { return Ok(()) };
        let column = &self.layout.names[self.layout.required[0].index];
        let all = run.row_numbers.len();
        let (found, step_s) = match fault {
            ClockFault::Steps { median_s } => {
                (format!("times that do not advance in {all} rows"), median_s)
            }
            ClockFault::StandsStill { rows, stamp_s, .. } if rows == all => (
                format!("{} s in all {all} rows: the clock stands still", figure(stamp_s)),
                stamp_s,
            ),
            ClockFault::StandsStill { first, rows, stamp_s } => {
                let (from, to) = (run.row_numbers[first], run.row_numbers[first + rows - 1]);
                let stamp = figure(stamp_s);
                (format!("{stamp} s in the rows {from} to {to}: the clock stands still"), 0.0)
            }
        };
        let rate = Setting::Rate.suggested(EXAMPLE_RATE);
        let by_rate = format!("{rate} with the rate of the rows in place of {EXAMPLE_RATE}");
        let (found, expected) = match self.step_pair(column, step_s) {
            Some((pair, step_s)) => (
                format!("{found}, it looks like the step between rows"),
                format!(
                    "{} if each row is {} ms after the row before, or {by_rate}",
                    Setting::Columns.suggested(pair),
                    figure(1e3 * step_s)
                ),
            ),
            None => (found, format!("a clock that advances, or {by_rate}")),
        };
        let what = format!("{}: column {column}", self.file.display());
        Err(DataError::request(what, found, expected))
    }

    /// Returns the pair of `--columns` that reads a column as steps, and the step, s. `step_s` is the step as it was read.
    fn step_pair(&self, column: &str, step_s: f64) -> Option<(ColumnPair, f64)> {
        let source = self.layout.sources.iter().find(|source| source.name == TIME);
        let unit = source.and_then(|source| source.unit.as_deref());
        let is_plausible = |step_s: &f64| PLAUSIBLE_STEPS_S.contains(step_s);
        let pair = |unit| ColumnPair { is_step: true, ..ColumnPair::new(TIME, column, unit) };
        if is_plausible(&step_s) {
            return Some((pair(unit), step_s));
        }
        STEP_UNITS.iter().filter(|_| unit.is_none_or(|unit| unit == "s")).find_map(|unit| {
            let step_s = conversion(TIME, unit).ok()?.apply(step_s);
            is_plausible(&step_s).then(|| (pair(Some(unit)), step_s))
        })
    }
}
