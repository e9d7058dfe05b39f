//! Rates of a log that indicate another unit of its time.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::{header, typed};
use crate::number::figure;
use crate::setting::Setting;
use crate::size::PROBABLE_RATES_HZ;
use crate::statistics::median;
use crate::unit::conversion;
use crate::{DataError, Dataset};
use std::ops::Range;

/// Plausible rates of a log of friction, Hz. Slow logs of steady speeds have about 4 Hz.
const PLAUSIBLE_RATES_HZ: Range<f64> = 2.5..2e5;

/// Maximum possible rate, Hz. Current loops run at 100 kHz at most, and torque sensors are slower.
const MAX_RATE_HZ: f64 = 1e6;

/// Units of time.
const TIME_UNITS: [&str; 7] = ["s", "ms", "us", "ns", "min", "h", "days"];

/// A unit of time, with the rate of the log in it.
struct RatedUnit {
    unit: &'static str,
    rate_hz: f64,
}

/// Returns the units of time that make a rate probable.
fn probable_units(data: &Dataset, rate_hz: f64) -> Vec<RatedUnit> {
    let given = data.given_unit("time_s").unwrap_or("s");
    let length = |unit: &str| Some(conversion("time_s", unit).ok()?.apply(1.0));
    // A unit in another notation, such as `msec`, leaves the lengths unknown.
    let given_s = TIME_UNITS.contains(&given).then(|| length(given)).flatten();
    let Some(given_s) = given_s else { return Vec::new() };
    let rated = TIME_UNITS
        .iter()
        .filter_map(|unit| Some(RatedUnit { unit, rate_hz: rate_hz * given_s / length(unit)? }));
    rated.filter(|of| PROBABLE_RATES_HZ.contains(&of.rate_hz)).collect()
}

/// Refuses a log that is faster than any logger.
pub fn impossible(data: &Dataset) -> Option<DataError> {
    let steps = data.runs.iter().flat_map(|run| run.time_s.windows(2).map(|w| w[1] - w[0]));
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    let median_s = median(&mut steps)?;
    // Rows that arrive in bursts have short steps, but not on average.
    let mean_s = steps.iter().sum::<f64>() / steps.len() as f64;
    if median_s.max(mean_s) * MAX_RATE_HZ >= 1.0 {
        return None;
    }
    let (rate, column) = (1.0 / median_s, header(data, "time_s"));
    let units = probable_units(data, rate);
    let typed = |RatedUnit { unit, rate_hz }: &RatedUnit| {
        let typed = Setting::Columns.suggested(format!("time_s={column}:{unit}"));
        format!("{typed} ({} rows a second)", figure(*rate_hz))
    };
    let mut typed: Vec<String> = units.iter().map(typed).collect();
    if typed.is_empty() {
        let example = Setting::Columns.suggested("time_s=NAME:days");
        typed.push(format!("another unit of the time, as {example}"));
    }
    let typed = typed.join(" or ");
    Some(DataError::file(
        data.first_file(),
        format!("{} rows a second by the column {column}", figure(rate)),
        format!("at most 1e6; by its rate the time may have another unit: {typed}"),
    ))
}

/// Returns the rate of a log, Hz, if it is not plausible.
pub fn implausible_rate(log: &Log) -> Option<f64> {
    let rate_hz = 1.0 / log.sensors.step_s;
    (log.sensors.step_s > 0.0 && !PLAUSIBLE_RATES_HZ.contains(&rate_hz)).then_some(rate_hz)
}

/// Returns the unit of the time that explains a rate, Hz.
pub fn probable_unit(log: &Log, rate_hz: f64) -> Option<&'static str> {
    probable_units(log.data, rate_hz).first().map(|of| of.unit)
}

/// Reports a rate that is not plausible.
pub fn implausible(log: &Log) -> Vec<LogFinding> {
    let Some(rate) = implausible_rate(log) else { return Vec::new() };
    let hint = match probable_unit(log, rate) {
        Some(unit) => {
            format!("may be in {unit} (--columns {})", typed(log.data, "time_s", unit))
        }
        None => "may not be in seconds".into(),
    };
    let words = format!(
        "By its stamps the log has {} rows a second: the time {hint}. Nothing is changed.",
        figure(rate)
    );
    vec![LogFindingKind::UnitSuspect.finding(&["time_s"], rate, "Hz", words)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SourceColumn;

    fn log(step_s: impl Fn(usize) -> f64, unit: Option<&str>) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let mut time = vec![0.0];
        (1..100).for_each(|row| time.push(time[row - 1] + step_s(row)));
        let columns = vec![time, vec![1.0; 100], vec![2.0; 100]];
        let mut data = Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("columns");
        let unit = unit.map(str::to_owned);
        let source =
            SourceColumn { name: "time_s".into(), header: "t".into(), unit, ..Default::default() };
        data.sources = vec![source];
        data
    }

    #[test]
    fn impossible_with_days_as_seconds_suggests_units() {
        let error = impossible(&log(|_| 0.005 / 86_400.0, None)).expect("200 Hz in days");
        let parts = ["columns time_s=t:h ", "4800 ", "columns time_s=t:days ", "200.0 "];
        crate::message::check("checks", "days as seconds", &error.to_string(), &parts);
    }

    #[test]
    fn impossible_with_unit_given_suggests_units_of_the_file() {
        let error = impossible(&log(|_| 1e-7, Some("us"))).expect("10 MHz");
        crate::message::require(&error.to_string(), &["columns time_s=t:ms ", "10000 "]);
    }

    #[test]
    fn impossible_with_fast_or_bursting_log_returns_none() {
        assert!(impossible(&log(|_| 2e-6, None)).is_none());
        assert!(impossible(&log(|row| if row % 10 == 0 { 0.01 } else { 1e-7 }, None)).is_none());
    }
}
