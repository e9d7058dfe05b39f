//! Cells of a time column, made into seconds.
//!
//! A log's clock may count anything: seconds, milliseconds, nanoseconds since 1970, or write the date out
//! (`2024-05-01T12:00:00.25Z`). Nanoseconds since 1970 have nineteen digits, of which a 64-bit number keeps sixteen:
//! taken as they are, rows 200 ns apart would share a stamp. So such stamps and dates are read as whole nanoseconds
//! and counted from the file's first one, the origin, which is kept: several files of one campaign
//! share its clock again when they are joined.

use super::clean::Row;
use super::reading::Reading;
use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

/// Stamps from here on, ns (three years), count from 1970 and not from when the logger was switched on.
const EPOCH_NS: i128 = 100_000_000_000_000_000;

/// Whole numbers above this are no longer exact in 64 bits.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// The clock of a file.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    pub reading: Reading,
    /// What the seconds count from, ns since 1970; `None` while it is what the column counts from.
    pub origin_ns: Option<i128>,
    started: bool,
}

impl Clock {
    pub fn new(reading: Reading) -> Self {
        Self { reading, origin_ns: None, started: false }
    }

    /// The time of a row, s; `None` if the cell is none.
    #[inline]
    pub fn time_s(&mut self, row: &impl Row) -> Option<f64> {
        match self.reading.raw(row) {
            // Seconds as they are: the contract's own column.
            Some(value) if self.reading.conversion.is_none() && self.origin_ns.is_none() => {
                self.started = true;
                Some(value)
            }
            Some(value) => self.counted(row, value),
            None => self.since(date(&row.text(self.reading.index))?),
        }
    }

    fn counted(&mut self, row: &impl Row, value: f64) -> Option<f64> {
        let Some(conversion) = self.reading.conversion else { return Some(value) };
        let whole = if value.fract() != 0.0 || !value.is_finite() {
            None
        } else if value.abs() < EXACT {
            Some(value as i128)
        } else {
            std::str::from_utf8(&row.text(self.reading.index)).ok()?.trim().parse().ok()
        };
        let stamp = whole.and_then(|whole: i128| whole.checked_mul(conversion.nanoseconds()));
        match (stamp, self.origin_ns) {
            (Some(stamp), _) if self.origin_ns.is_some() || !self.started && stamp >= EPOCH_NS => {
                self.since(stamp)
            }
            (_, Some(origin)) => Some(conversion.apply(value) - origin as f64 / 1e9),
            _ => {
                self.started = true;
                Some(conversion.apply(value))
            }
        }
    }

    /// Seconds since the origin, which the first stamp sets.
    fn since(&mut self, stamp_ns: i128) -> Option<f64> {
        if self.started && self.origin_ns.is_none() {
            // A date among plain seconds is no time of theirs.
            return None;
        }
        self.started = true;
        let origin = *self.origin_ns.get_or_insert(stamp_ns);
        Some((stamp_ns - origin) as f64 / 1e9)
    }
}

/// A date and time of day, with an offset from UTC or without, or a time of day alone, in ns.
fn date(text: &[u8]) -> Option<i128> {
    let text = std::str::from_utf8(text).ok()?.trim().trim_matches('"');
    // A quick look first: a column of words is asked for each of its rows.
    if !text.as_bytes().first()?.is_ascii_digit() || !text.contains(':') {
        return None;
    }
    if let Ok(stamp) = DateTime::parse_from_rfc3339(text) {
        return Some(
            i128::from(stamp.timestamp()) * 1_000_000_000 + i128::from(stamp.nanosecond()),
        );
    }
    for form in ["%Y-%m-%dT%H:%M:%S%.f%z", "%Y-%m-%d %H:%M:%S%.f%z", "%Y-%m-%d %H:%M:%S%.f %z"] {
        if let Ok(stamp) = DateTime::parse_from_str(text, form) {
            return Some(
                i128::from(stamp.timestamp()) * 1_000_000_000 + i128::from(stamp.nanosecond()),
            );
        }
    }
    for form in ["%Y-%m-%dT%H:%M:%S%.f", "%Y-%m-%d %H:%M:%S%.f", "%Y/%m/%d %H:%M:%S%.f"] {
        if let Ok(stamp) = NaiveDateTime::parse_from_str(text.trim_end_matches(" UTC"), form) {
            let stamp = stamp.and_utc();
            return Some(
                i128::from(stamp.timestamp()) * 1_000_000_000
                    + i128::from(stamp.timestamp_subsec_nanos()),
            );
        }
    }
    let time = NaiveTime::parse_from_str(text, "%H:%M:%S%.f").ok()?;
    let seconds = i128::from(time.num_seconds_from_midnight());
    Some(seconds * 1_000_000_000 + i128::from(time.nanosecond()))
}

/// The origin as a person reads it.
pub(super) fn origin(origin_ns: i128) -> String {
    let seconds = origin_ns.div_euclid(1_000_000_000) as i64;
    match DateTime::from_timestamp(seconds, 0) {
        // Times of day without a date.
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
    fn dates_are_read_as_they_are_written() {
        let noon = 1_714_564_800_000_000_000;
        for text in [
            "2024-05-01T12:00:00Z",
            "2024-05-01T14:00:00+02:00",
            "2024-05-01T14:00:00+0200",
            "2024-05-01 12:00:00",
            "2024-05-01 12:00:00 UTC",
            "2024/05/01 12:00:00.000",
            "\"2024-05-01T12:00:00.000000000\"",
        ] {
            assert_eq!(date(text.as_bytes()), Some(noon), "{text}");
        }
        assert_eq!(date(b"2024-05-01T12:00:00.123456789Z"), Some(noon + 123_456_789));
        assert_eq!(date(b"00:01:00.5"), Some(60_500_000_000));
        for text in ["", "noon", "12", "2024-05-01", "2024-13-01T12:00:00Z"] {
            assert_eq!(date(text.as_bytes()), None, "{text}");
        }
        assert_eq!(origin(noon), "2024-05-01 12:00:00 UTC");
        assert_eq!(origin(60_500_000_000), "00:01:00");
    }
}
