//! Conversion of a time column to seconds.
//!
//! A log's clock may count seconds, milliseconds or nanoseconds since 1970, or hold dates
//! (`2024-05-01T12:00:00.25Z`). Nanoseconds since 1970 have nineteen digits, but an `f64` keeps only sixteen: rows
//! 200 ns apart would get the same stamp. Such stamps and dates are therefore read as whole nanoseconds and counted
//! from the first stamp of the file, the origin. The origin is kept, so that joined files of one campaign share a
//! clock.

use super::cell::CellReader;
use super::row::LogRow;
use super::zone::{offset_s, split_zone};
use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

/// Stamps of at least this size, ns (three years), count from 1970. Smaller ones count from the start of the logger.
const MIN_EPOCH_NS: i128 = 100_000_000_000_000_000;

/// Limit below which an `f64` represents every whole number exactly: 2^53.
const MAX_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// The clock of a file.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    pub reading: CellReader,
    /// Origin of the seconds, ns since 1970; `None` while the column's own origin is used.
    pub origin_ns: Option<i128>,
    is_started: bool,
}

impl Clock {
    pub fn new(reading: CellReader) -> Self {
        Self { reading, origin_ns: None, is_started: false }
    }

    /// Returns the time of a row, s, or `None` if the cell holds no time.
    #[inline]
    pub fn time_s(&mut self, row: &impl LogRow) -> Option<f64> {
        match self.reading.raw(row) {
            // The contract's own column: seconds without a conversion.
            Some(value) if self.reading.conversion.is_none() && self.origin_ns.is_none() => {
                self.is_started = true;
                Some(value)
            }
            Some(value) => self.convert_count(row, value),
            None => self.seconds_since_origin(parse_date_ns(&row.text(self.reading.index))?),
        }
    }

    fn convert_count(&mut self, row: &impl LogRow, value: f64) -> Option<f64> {
        let Some(conversion) = self.reading.conversion else { return Some(value) };
        let whole = if value.fract() != 0.0 || !value.is_finite() {
            None
        } else if value.abs() < MAX_EXACT_INTEGER {
            Some(value as i128)
        } else {
            std::str::from_utf8(&row.text(self.reading.index)).ok()?.trim().parse().ok()
        };
        let stamp = whole.and_then(|whole: i128| whole.checked_mul(conversion.nanoseconds()));
        match (stamp, self.origin_ns) {
            (Some(stamp), _)
                if self.origin_ns.is_some() || !self.is_started && stamp >= MIN_EPOCH_NS =>
            {
                self.seconds_since_origin(stamp)
            }
            (_, Some(origin)) => Some(conversion.apply(value) - origin as f64 / 1e9),
            _ => {
                self.is_started = true;
                Some(conversion.apply(value))
            }
        }
    }

    /// Returns the seconds since the origin. The first stamp sets the origin.
    fn seconds_since_origin(&mut self, stamp_ns: i128) -> Option<f64> {
        if self.is_started && self.origin_ns.is_none() {
            // A date in a column of plain seconds has no common origin with them.
            return None;
        }
        self.is_started = true;
        let origin = *self.origin_ns.get_or_insert(stamp_ns);
        Some((stamp_ns - origin) as f64 / 1e9)
    }
}

/// Nanoseconds of a second.
const SECOND_NS: i128 = 1_000_000_000;

/// Forms of a date and time of day with an offset from UTC, beside RFC 3339.
const WITH_OFFSET: [&str; 3] =
    ["%Y-%m-%dT%H:%M:%S%.f%z", "%Y-%m-%d %H:%M:%S%.f%z", "%Y-%m-%d %H:%M:%S%.f %z"];

/// Forms of a date and time of day.
const WITHOUT_OFFSET: [&str; 5] = [
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%Y-%m-%d %I:%M:%S%.f %p",
    "%Y/%m/%d %I:%M:%S%.f %p",
];

/// Forms of a time of day.
const TIMES_OF_DAY: [&str; 3] = ["%H:%M:%S%.f", "%I:%M:%S%.f %p", "%I:%M:%S%.f%p"];

/// Parses a date and time of day with or without an offset from UTC or a time zone, or a time of day alone. Returns ns.
fn parse_date_ns(text: &[u8]) -> Option<i128> {
    parse_date(text).ok().flatten()
}

/// As [`parse_date_ns`]. Returns `None` for a text that is not a date.
///
/// # Errors
/// What is expected instead, if the text is a date whose time zone cannot be known.
fn parse_date(text: &[u8]) -> Result<Option<i128>, &'static str> {
    let Ok(text) = std::str::from_utf8(text) else { return Ok(None) };
    let text = text.trim().trim_matches('"');
    // Quick rejection: a column of words calls this for each of its rows.
    if !text.starts_with(|c: char| c.is_ascii_digit()) || !text.contains(':') {
        return Ok(None);
    }
    if let Some(stamp) = parse_with_offset(text) {
        return Ok(Some(stamp));
    }
    if let Some(local) = parse_local(text) {
        return Ok(Some(nanoseconds(local)));
    }
    if let Some((local, zone)) = split_zone(text) {
        // An offset before a zone in brackets is more exact than the zone.
        if let Some(stamp) = parse_with_offset(local) {
            return Ok(Some(stamp));
        }
        if let Some(local) = parse_local(local) {
            let offset_s = i128::from(offset_s(&local, zone)?);
            return Ok(Some(nanoseconds(local) - offset_s * SECOND_NS));
        }
    }
    let time = TIMES_OF_DAY.iter().find_map(|form| NaiveTime::parse_from_str(text, form).ok());
    Ok(time.map(|time| {
        i128::from(time.num_seconds_from_midnight()) * SECOND_NS + i128::from(time.nanosecond())
    }))
}

fn parse_with_offset(text: &str) -> Option<i128> {
    let of_form = |form: &&str| DateTime::parse_from_str(text, form).ok();
    let stamp = DateTime::parse_from_rfc3339(text).ok();
    stamp
        .or_else(|| WITH_OFFSET.iter().find_map(of_form))
        .map(|stamp| i128::from(stamp.timestamp()) * SECOND_NS + i128::from(stamp.nanosecond()))
}

fn parse_local(text: &str) -> Option<NaiveDateTime> {
    WITHOUT_OFFSET.iter().find_map(|form| NaiveDateTime::parse_from_str(text, form).ok())
}

/// Returns the nanoseconds since 1970 of a time in UTC.
fn nanoseconds(time: NaiveDateTime) -> i128 {
    let stamp = time.and_utc();
    i128::from(stamp.timestamp()) * SECOND_NS + i128::from(stamp.timestamp_subsec_nanos())
}

/// Returns what a cell of the time column should hold instead, if it is a date that cannot be read.
pub(super) fn date_error(text: &[u8]) -> Option<&'static str> {
    parse_date(text).err()
}

/// Formats a stamp, ns since 1970, as ISO 8601 in UTC. Returns `None` if the calendar does not cover it.
pub(super) fn format_stamp(ns: i128) -> Option<String> {
    let seconds = i64::try_from(ns.div_euclid(1_000_000_000)).ok()?;
    let stamp = DateTime::from_timestamp(seconds, ns.rem_euclid(1_000_000_000) as u32)?;
    Some(stamp.format("%Y-%m-%dT%H:%M:%S%.9fZ").to_string())
}

/// Formats the origin for a message.
pub(super) fn format_origin(origin_ns: i128) -> String {
    let seconds = origin_ns.div_euclid(1_000_000_000) as i64;
    match DateTime::from_timestamp(seconds, 0) {
        // A time of day without a date.
        Some(stamp) if seconds < 86_400 => {
            format!("{:02}:{:02}:{:02}", stamp.hour(), stamp.minute(), stamp.second())
        }
        Some(stamp) => {
            let day = stamp.date_naive();
            format!("{day:?} {:02}:{:02}:{:02} UTC", stamp.hour(), stamp.minute(), stamp.second())
        }
        None => format!("{origin_ns} ns"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_date_ns_with_common_formats_returns_nanoseconds() {
        let noon = 1_714_564_800_000_000_000;
        for text in [
            "2024-05-01T12:00:00Z",
            "2024-05-01T14:00:00+02:00",
            "2024-05-01T14:00:00+0200",
            "2024-05-01 12:00:00",
            "2024-05-01 12:00:00 UTC",
            "2024/05/01 12:00:00.000",
            "\"2024-05-01T12:00:00.000000000\"",
            "2024-05-01 14:00:00 CEST",
            "2024-05-01 14:00:00.0 Europe/Berlin",
            "2024-05-01T14:00:00+02:00[Europe/Berlin]",
            "2024-05-01 12:00:00 PM",
            "2024-05-01 02:00:00.000 PM CEST",
        ] {
            assert_eq!(parse_date_ns(text.as_bytes()), Some(noon), "{text}");
        }
        assert_eq!(parse_date_ns(b"2024-05-01T12:00:00.123456789Z"), Some(noon + 123_456_789));
        assert_eq!(parse_date_ns(b"00:01:00.5"), Some(60_500_000_000));
        assert_eq!(parse_date_ns(b"12:01:00.5 AM"), Some(60_500_000_000));
        assert_eq!(parse_date_ns(b"1:00:00 pm"), Some(13 * 3_600_000_000_000));
        assert!(date_error(b"2024-05-01 12:00:00 CST").unwrap().contains("several time zones"));
        assert_eq!(date_error(b"noon: CST"), None);
        for text in ["", "noon", "12", "2024-05-01", "2024-13-01T12:00:00Z"] {
            assert_eq!(parse_date_ns(text.as_bytes()), None, "{text}");
        }
        assert_eq!(format_origin(noon), "2024-05-01 12:00:00 UTC");
        assert_eq!(format_origin(60_500_000_000), "00:01:00");
    }
}
