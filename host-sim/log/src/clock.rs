//! Conversion of a time column to seconds.
//!
//! A log's clock may count seconds, milliseconds or nanoseconds since 1970, or hold dates
//! (`2024-05-01T12:00:00.25Z`). Nanoseconds since 1970 have nineteen digits, but an `f64` keeps only sixteen: rows
//! 200 ns apart would get the same stamp. Such stamps and dates are therefore read as whole nanoseconds and counted
//! from the first stamp of the file, the origin. The origin is kept, so that joined files of one campaign share a
//! clock.

use super::cell::CellReader;
use super::date::{ACCEPTED, DateOrder, Stamp, parse_day, parse_stamp};
use super::row_clock::{RowClock, STEP, Timing};
use super::table::Row;
use chrono::{DateTime, NaiveDate, Timelike};

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
    /// The column of the dates, if the time column holds only times of day.
    dates: Option<usize>,
    /// True if that column holds dates.
    pub is_dated: bool,
    is_started: bool,
    /// Last stamp of a time of day, with the days (or hours) that passed, ns.
    last_cyclic_ns: Option<i128>,
    /// Counts the rows, if they have no stamps.
    rows: Option<RowClock>,
}

impl Clock {
    /// Creates the clock of a time column. `dates` is a column that may hold the dates of its times of day.
    pub fn new(reading: CellReader, dates: Option<usize>) -> Self {
        Self {
            reading,
            origin_ns: None,
            dates,
            is_dated: false,
            is_started: false,
            last_cyclic_ns: None,
            rows: None,
        }
    }

    /// Adds up steps or counts rows in place of reading stamps. `run` is the column of the run's name.
    pub fn with_timing(mut self, timing: Timing, run: Option<usize>) -> Self {
        self.rows = (timing != Timing::Stamps).then(|| RowClock::new(timing, run));
        self
    }

    /// Returns true if the times are those of stamps in the time column.
    pub fn reads_stamps(&self) -> bool {
        self.rows.is_none()
    }

    /// Returns what the time column of a row should hold, if it is not a step.
    pub fn step_error(&self, row: &Row) -> Option<&'static str> {
        let is_negative = self.reading.raw(row).is_some_and(|step| step < 0.0);
        (!self.reads_stamps() && is_negative).then_some(STEP)
    }

    /// Returns the order of day, month and year that the user gave.
    pub fn date_order(&self) -> Option<DateOrder> {
        self.reading.conversion.and_then(|conversion| conversion.date_order())
    }

    /// Returns the time of a row, s, or `None` if the cell holds no time.
    #[inline]
    pub fn time_s(&mut self, row: &Row) -> Option<f64> {
        if let Some(rows) = &mut self.rows {
            return rows.time_s(&self.reading, row);
        }
        match self.reading.raw(row) {
            // The contract's own column: seconds without a conversion.
            Some(value) if self.reading.conversion.is_none() && self.origin_ns.is_none() => {
                self.is_started = true;
                Some(value)
            }
            Some(value) => self.convert_count(row, value),
            None => {
                let stamp =
                    parse_stamp(&row.text(self.reading.index), self.date_order()).ok()??;
                let ns = self.absolute_ns(stamp, row)?;
                self.seconds_since_origin(ns)
            }
        }
    }

    /// Returns the nanoseconds of a stamp. A time of day gets the date of its row. Without one, a step back by more than
    /// half a day is midnight; other steps back are left for the check of the order.
    fn absolute_ns(&mut self, stamp: Stamp, row: &Row) -> Option<i128> {
        let Stamp::Cyclic { ns, period } = stamp else { return Some(stamp.nanoseconds()) };
        let date = |column| parse_day(&row.text(column), self.date_order());
        match self.dates.map(date) {
            Some(Ok(Some(day))) => {
                self.is_dated = true;
                return Some(day + ns);
            }
            Some(Err(_)) => return None,
            Some(Ok(None)) if self.is_dated => return None,
            _ => {}
        }
        let cycles =
            self.last_cyclic_ns.map_or(0, |last| (last - ns + period / 2).div_euclid(period));
        let ns = ns + cycles.max(0) * period;
        self.last_cyclic_ns = Some(ns);
        Some(ns)
    }

    fn convert_count(&mut self, row: &Row, value: f64) -> Option<f64> {
        // A number without a unit has no common origin with the dates of its column.
        let conversion = self.reading.conversion?;
        let whole = if value.fract() != 0.0 || !value.is_finite() {
            None
        } else if value.abs() < MAX_EXACT_INTEGER {
            Some(value as i128)
        } else {
            std::str::from_utf8(&row.text(self.reading.index)).ok()?.trim().parse().ok()
        };
        let stamp = whole.and_then(|whole: i128| whole.checked_mul(conversion.nanoseconds()?));
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

/// Returns what a cell of the time column should hold instead, if it is a date or time that cannot be read.
pub(super) fn date_error(text: &[u8], order: Option<DateOrder>) -> Option<&'static str> {
    let has = |of: fn(&u8) -> bool| text.iter().any(of);
    match parse_stamp(text, order) {
        Err(expected) => Some(expected),
        Ok(Some(_)) => None,
        // A number with a sign of dates is mostly a date in another notation.
        Ok(None) => {
            (has(u8::is_ascii_digit) && has(|byte| b":/-#".contains(byte))).then_some(ACCEPTED)
        }
    }
}

/// Returns what a cell of the column of dates should hold instead, if it has several readings.
pub(super) fn day_error(text: &[u8], order: Option<DateOrder>) -> Option<&'static str> {
    parse_day(text, order).err()
}

/// Returns true if the text is a date or time, perhaps with several readings.
pub(super) fn is_date(text: &[u8]) -> bool {
    parse_stamp(text, None).is_ok_and(|stamp| stamp.is_some())
        || date_error(text, None).is_some_and(|of| of != ACCEPTED)
}

/// Formats seconds since 1970 as `2026-11-22 12:34`, in UTC.
pub fn utc_minute(epoch_s: u64) -> String {
    let stamp = DateTime::from_timestamp(epoch_s as i64, 0).unwrap_or_default();
    stamp.format("%Y-%m-%d %H:%M").to_string()
}

/// Returns the days since 1970 of a date as `2026-11-25` or `20261125`.
pub fn day_number(date: &str) -> Option<i64> {
    let is_of_date = |(at, letter): (usize, char)| match (date.len(), at) {
        (10, 4 | 7) => letter == '-',
        (8 | 10, _) => letter.is_ascii_digit(),
        _ => false,
    };
    let digits = date.replace('-', "");
    let day = NaiveDate::parse_from_str(&digits, "%Y%m%d").ok()?;
    date.char_indices().all(is_of_date).then(|| (day - NaiveDate::default()).num_days())
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

    use crate::table::each_text_row;

    fn times(dates: Option<usize>, rows: &[&[&str]]) -> Vec<Option<f64>> {
        let mut clock = Clock::new(CellReader::plain(0), dates);
        each_text_row(rows, |row| clock.time_s(row))
    }

    #[test]
    fn time_s_past_midnight_or_the_hour_continues() {
        let found = times(None, &[&["23:59:59.5"], &["00:00:00.5"], &["00:00:00.25"]]);
        assert_eq!(
            found,
            [Some(0.0), Some(1.0), Some(0.75)],
            "a small step back is none past midnight"
        );
        assert_eq!(times(None, &[&["59:59.5"], &["00:00.5"]]), [Some(0.0), Some(1.0)]);
    }

    #[test]
    fn time_s_with_column_of_dates_adds_the_day() {
        let found = times(Some(1), &[&["23:59:59", "14.03.2024"], &["00:00:01", "16.03.2024"]]);
        assert_eq!(found, [Some(0.0), Some(86_402.0)]);
        assert_eq!(times(Some(1), &[&["1.5", "3"], &["2.5", "3"]]), [Some(1.5), Some(2.5)]);
    }

    #[test]
    fn time_s_with_plain_number_among_dates_returns_none() {
        let rows: [&[&str]; 3] = [&["2024-05-01T12:00:00"], &["1.5"], &["2024-05-01T12:00:02"]];
        assert_eq!(times(None, &rows), [Some(0.0), None, Some(2.0)]);
    }

    #[test]
    fn time_s_of_counts_since_1970_counts_from_the_first() {
        // 0.0864 s is a whole number of nanoseconds, but not in `f64`; 1/32768 s is none.
        for (unit, count, seconds) in [
            ("ns", 1_714_564_800_000_000_000_i64, 1e-9),
            ("0.0864s", 19_844_500_000, 0.0864),
            ("1/32768s", 56_182_859_000_000, 1.0 / 32_768.0),
        ] {
            let conversion = crate::unit::conversion("time_s", unit).ok();
            let mut clock = Clock::new(CellReader { conversion, ..CellReader::plain(0) }, None);
            let (first, last) = (count.to_string(), (count + 1_000_000).to_string());
            let found = each_text_row(&[&[&*first], &[&*last]], |row| clock.time_s(row));
            let passed_s = found[1].unwrap() - found[0].unwrap();
            assert!((passed_s / (1e6 * seconds) - 1.0).abs() < 1e-6, "{unit}: {passed_s}");
        }
    }

    #[test]
    fn format_origin_with_date_or_time_of_day_returns_text() {
        assert_eq!(format_origin(1_714_564_800_000_000_000), "2024-05-01 12:00:00 UTC");
        assert_eq!(format_origin(60_500_000_000), "00:01:00");
    }

    #[test]
    fn date_error_with_unreadable_date_lists_notations() {
        assert_eq!(date_error(b"14/Foo/2024 09:15:02", None), Some(ACCEPTED));
        assert_eq!(date_error(b"Channels", None), None);
        assert!(is_date(b"03/04/2024 09:15:02") && !is_date(b"a-1"));
    }

    #[test]
    fn utc_minute_formats_epoch_seconds_as_calendar_time() {
        for (epoch_s, text) in [
            (0, "1970-01-01 00:00"),
            (951_782_399, "2000-02-28 23:59"),
            (951_782_400, "2000-02-29 00:00"),
            (951_868_800, "2000-03-01 00:00"),
            (1_795_350_600, "2026-11-22 12:30"),
            (4_107_542_399, "2100-02-28 23:59"),
            (4_107_542_400, "2100-03-01 00:00"),
        ] {
            assert_eq!(utc_minute(epoch_s), text);
        }
    }

    #[test]
    fn day_number_with_date_returns_days_since_1970() {
        assert_eq!([day_number("1970-01-02"), day_number("20000229")], [Some(1), Some(11_016)]);
        for other in
            ["12345678", "1970-1-02", "2026-02-30", "19700102x", "-1970-0102", "dive 10", ""]
        {
            assert_eq!(day_number(other), None, "{other}");
        }
    }
}
