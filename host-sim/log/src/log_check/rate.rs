//! Rates of a log that indicate another unit of its time.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::{header, typed};
use crate::number::figure;
use crate::setting::Setting;
use crate::statistics::median;
use crate::unit::conversion;
use crate::{DataError, Dataset};

/// Plausible rates of a log of friction, Hz. Slow logs of steady speeds have about 4 Hz.
const PLAUSIBLE_RATES_HZ: (f64, f64) = (2.5, 2e5);

/// Maximum possible rate, Hz. Current loops run at 100 kHz at most, and torque sensors are slower.
const MAX_RATE_HZ: f64 = 1e6;

/// Probable true rates of a log whose clock has another unit, Hz.
const PROBABLE_RATES_HZ: (f64, f64) = (10.0, 1e5);

/// Units of time.
const TIME_UNITS: [&str; 7] = ["s", "ms", "us", "ns", "min", "h", "days"];

/// Returns the units of time that make a rate probable, with the rate in each.
fn probable_units(data: &Dataset, rate_hz: f64) -> Vec<(&'static str, f64)> {
    let given = data.given_unit("time_s").unwrap_or("s");
    let length = |unit: &str| Some(conversion("time_s", unit).ok()?.apply(1.0));
    // A unit in another notation, such as `msec`, leaves the lengths unknown.
    let given_s = TIME_UNITS.contains(&given).then(|| length(given)).flatten();
    let Some(given_s) = given_s else { return Vec::new() };
    let rated =
        TIME_UNITS.iter().filter_map(|unit| Some((*unit, rate_hz * given_s / length(unit)?)));
    let is_probable = |rate: f64| (PROBABLE_RATES_HZ.0..PROBABLE_RATES_HZ.1).contains(&rate);
    rated.filter(|(_, rate)| is_probable(*rate)).collect()
}

/// Refuses a log that is faster than any logger.
pub fn impossible(data: &Dataset) -> Option<DataError> {
    let steps = data.runs.iter().flat_map(|run| run.time_s.windows(2).map(|w| w[1] - w[0]));
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    let median_s = median(&mut steps)?;
    // Rows that arrive in bursts have short steps, but not on average.
    let mean_s = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    if steps.is_empty() || median_s.max(mean_s) * MAX_RATE_HZ >= 1.0 {
        return None;
    }
    let rate = 1.0 / median_s;
    let units = probable_units(data, rate);
    let each: Vec<String> = units
        .iter()
        .map(|(unit, rate)| {
            let pair = format!("time_s={}:{unit}", header(data, "time_s"));
            format!("{} ({} rows a second)", Setting::Columns.suggested(pair), figure(*rate))
        })
        .collect();
    let what_to_type = match each.is_empty() {
        true => {
            let example = Setting::Columns.suggested("time_s=NAME:days");
            format!("another unit of the time, as {example}")
        }
        false => each.join(" or "),
    };
    let column = header(data, "time_s");
    Some(DataError::file(
        data.first_file(),
        format!("{} rows a second by the column {column}", figure(rate)),
        format!("at most 1e6; by its rate the time may have another unit: {what_to_type}"),
    ))
}

/// Returns the rate of a log, Hz, if it is not plausible.
fn implausible_rate(log: &Log) -> Option<f64> {
    let rate = 1.0 / log.sensors.step_s;
    let is_plausible = (PLAUSIBLE_RATES_HZ.0..PLAUSIBLE_RATES_HZ.1).contains(&rate);
    (log.sensors.step_s > 0.0 && !is_plausible).then_some(rate)
}

/// Returns a rate that is not plausible, Hz, with the unit of the time that explains it.
pub fn probable_unit(log: &Log) -> Option<(f64, &'static str)> {
    let rate = implausible_rate(log)?;
    probable_units(log.data, rate).first().map(|(unit, _)| (rate, *unit))
}

/// Reports a rate that is not plausible.
pub fn implausible(log: &Log) -> Vec<LogFinding> {
    let Some(rate) = implausible_rate(log) else { return Vec::new() };
    let hint = match probable_unit(log) {
        Some((_, unit)) => {
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
