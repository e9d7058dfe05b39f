//! Dates and times of day as text, in the notations of loggers, spreadsheets and PLCs.
//!
//! A text is split at its time of day: the date is before it, AM or PM, an offset or a time zone behind it. The words of
//! the date are a year, a month (a number or an English name) and a day, in an order that their form states:
//! `2024-03-14`, `14-Mar-24`, `14.03.2024`, `20240314`, `Thu Mar 14 .. 2024`. `03/04/2024` has two readings. It is
//! refused unless the user gives the order of day, month and year.
//!
//! Durations are read as well: `T#1m2s15ms` of IEC 61131-3, `0 days 00:00:00.015` of pandas, and `02:05.5`, minutes and
//! seconds, as a spreadsheet shows them.

use super::zone::{offset_s, split_zone};
use chrono::{DateTime, Month, NaiveDate, NaiveDateTime, NaiveTime, Weekday};

/// Nanoseconds of a second.
const SECOND_NS: i128 = 1_000_000_000;

/// Nanoseconds of an hour.
const HOUR_NS: i128 = 3600 * SECOND_NS;

/// Nanoseconds of a day.
const DAY_NS: i128 = 24 * HOUR_NS;

/// What is expected instead of `03/04/2024`.
const AMBIGUOUS_ORDER: &str = "an unambiguous date as 2024-04-03: day and month may be exchanged, so give their order \
                               behind the column's name, :dmy or :mdy";

/// What is expected instead of `24/03/14`.
const AMBIGUOUS_YEAR: &str = "an unambiguous date as 2024-04-03: day, month and year may be exchanged, so give their \
                              order behind the column's name, :dmy, :mdy or :ymd";

/// What is expected instead of `09:15`.
const AMBIGUOUS_MINUTES: &str = "seconds, as 09:15:00 or 09:15.0: these may be hours and minutes";

/// What is expected instead of a date without a time.
const NO_TIME_OF_DAY: &str = "a time of day as well, as 2024-03-14 09:15:02.015: of a column of dates and one of times, \
                              take the times as time_s";

/// What is expected instead of another text with digits.
pub(super) const ACCEPTED: &str = "seconds, or a date or time as 2024-03-14 09:15:02.015, 14.03.2024 09:15:02, \
                                   14-Mar-2024 09:15:02, 09:15:02.015, 15:02.0 or T#2s15ms";

/// The order of day, month and year in a date of three numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DateOrder {
    DayMonthYear,
    MonthDayYear,
    YearMonthDay,
}

impl DateOrder {
    /// Returns the order with a name, as the user gives it in place of a unit.
    pub fn parse(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "dmy" => Some(Self::DayMonthYear),
            "mdy" => Some(Self::MonthDayYear),
            "ymd" => Some(Self::YearMonthDay),
            _ => None,
        }
    }
}

/// A time as text states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stamp {
    /// A date and a time of day, ns since 1970 in UTC.
    Date(i128),
    /// A time of day or of an hour, ns, that restarts after `period` ns.
    Cyclic { ns: i128, period: i128 },
    /// A duration, ns.
    Elapsed(i128),
}

impl Stamp {
    /// Returns the nanoseconds.
    pub fn nanoseconds(self) -> i128 {
        match self {
            Self::Date(ns) | Self::Elapsed(ns) | Self::Cyclic { ns, .. } => ns,
        }
    }
}

/// Parses a date, a time of day or a duration. Returns `None` for another text.
///
/// # Errors
/// What is expected instead, if the text is a date with several readings or without a time of day.
pub(super) fn parse_stamp(
    text: &[u8],
    order: Option<DateOrder>,
) -> Result<Option<Stamp>, &'static str> {
    let Ok(text) = std::str::from_utf8(text) else { return Ok(None) };
    let text = text.trim().trim_matches('"');
    // A column of words calls this for each of its rows.
    if !text.bytes().any(|byte| byte.is_ascii_digit()) {
        return Ok(None);
    }
    let text = match text.split_once('#') {
        Some((prefix, rest)) => match prefix.to_ascii_uppercase().trim_start_matches('L') {
            "T" | "TIME" => return Ok(duration(rest).map(Stamp::Elapsed)),
            "DT" | "TOD" | "TIME_OF_DAY" | "DATE_AND_TIME" => rest,
            _ => return Ok(None),
        },
        None => text,
    };
    if let Ok(stamp) = DateTime::parse_from_rfc3339(text) {
        return Ok(stamp.timestamp_nanos_opt().map(|ns| Stamp::Date(ns.into())));
    }
    match with_colons(text) {
        Some(text) => around_time(&text, order),
        None if text.contains(':') => around_time(text, order),
        None => match calendar_day(text, order) {
            Ok(Some(_)) if text.bytes().any(|byte| !byte.is_ascii_digit()) => Err(NO_TIME_OF_DAY),
            _ => Ok(None),
        },
    }
}

/// Returns the day, as nanoseconds since 1970, of a text that is a date without a time.
///
/// # Errors
/// What is expected instead, if the text is a date with several readings.
pub(super) fn parse_day(
    text: &[u8],
    order: Option<DateOrder>,
) -> Result<Option<i128>, &'static str> {
    let Ok(text) = std::str::from_utf8(text) else { return Ok(None) };
    let day = calendar_day(text.trim().trim_matches('"'), order)?;
    Ok(day.map(|day| nanoseconds(day.and_time(NaiveTime::MIN))))
}

/// Adds the colons to `20240314 091502.015`.
fn with_colons(text: &str) -> Option<String> {
    let (day, time) = text.split_once([' ', 'T', '_', '-'])?;
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (clock, rest) = time.split_at_checked(6)?;
    let is_compact = day.len() == 8 && is_digits(day) && is_digits(clock);
    if !is_compact || rest.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    Some(format!("{day} {}:{}:{}{rest}", &clock[..2], &clock[2..4], &clock[4..]))
}

/// A time of day with its place in a text.
struct TimeOfDay<'a> {
    before: &'a str,
    /// Hours, minutes, seconds and nanoseconds. The hours are `None` for minutes and seconds alone.
    hour: Option<u32>,
    minute: u32,
    second: u32,
    nanosecond: u32,
    behind: &'a str,
    /// True if the text states the seconds.
    has_seconds: bool,
}

impl TimeOfDay<'_> {
    fn nanoseconds(&self, hour: u32) -> i128 {
        let seconds = 60 * (60 * u64::from(hour) + u64::from(self.minute)) + u64::from(self.second);
        i128::from(seconds) * SECOND_NS + i128::from(self.nanosecond)
    }
}

/// Finds the time of day in a text: `09:15:02`, with a fraction behind a point, a comma or a colon, or `15:02.0`.
fn find_time(text: &str) -> Option<TimeOfDay<'_>> {
    let colon = text.find(':')?;
    let start = text[..colon].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    let start = (start..=colon).find(|at| text.is_char_boundary(*at))?;
    let (first, rest) = (text[start..colon].parse::<u32>().ok()?, &text[colon + 1..]);
    let (second_part, rest) = two_digits(rest)?;
    let with_seconds = rest.strip_prefix(':').and_then(two_digits);
    let (hour, minute, second, has_seconds, rest) = match with_seconds {
        Some((second, rest)) => (Some(first), second_part, second, true, rest),
        None if rest.starts_with(['.', ',']) => (None, first, second_part, true, rest),
        None => (Some(first), second_part, 0, false, rest),
    };
    let digits = rest.strip_prefix(['.', ',', ':']).unwrap_or_default();
    let count = digits.bytes().take_while(u8::is_ascii_digit).count();
    let used: String = digits[..count].chars().chain("000000000".chars()).take(9).collect();
    let behind = if count > 0 { &digits[count..] } else { rest };
    // A rounded 59.96 s is written as 60.0.
    let is_valid = minute < 60 && second <= 60;
    is_valid.then_some(TimeOfDay {
        before: &text[..start],
        hour,
        minute,
        second,
        nanosecond: used.parse().ok()?,
        behind: behind.trim(),
        has_seconds,
    })
}

/// Splits a text behind its first two digits.
fn two_digits(text: &str) -> Option<(u32, &str)> {
    let (digits, rest) = text.split_at_checked(2)?;
    let is_number = digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| Some((digits.parse().ok()?, rest)))?
}

/// Reads the text around a time of day.
fn around_time(text: &str, order: Option<DateOrder>) -> Result<Option<Stamp>, &'static str> {
    let Some(time) = find_time(text) else { return Ok(None) };
    let mut behind = time.behind;
    let mut hour = time.hour;
    for (mark, is_afternoon) in [("AM", false), ("PM", true)] {
        let Some(head) = behind.get(..2).filter(|head| head.eq_ignore_ascii_case(mark)) else {
            continue;
        };
        behind = behind[head.len()..].trim();
        hour = hour.filter(|hour| (1..=12).contains(hour));
        hour = hour.map(|hour| hour % 12 + if is_afternoon { 12 } else { 0 });
        if hour.is_none() {
            return Ok(None);
        }
    }
    let before = time.before.trim_end_matches(['T', ' ', '-', ',', '_']).trim();
    if before.is_empty() && behind.is_empty() {
        return match (hour, time.has_seconds) {
            (_, false) => Err(AMBIGUOUS_MINUTES),
            (Some(hour), true) if hour < 24 => {
                Ok(Some(Stamp::Cyclic { ns: time.nanoseconds(hour), period: DAY_NS }))
            }
            (Some(hour), true) => Ok(Some(Stamp::Elapsed(time.nanoseconds(hour)))),
            (None, true) => Ok(Some(Stamp::Cyclic { ns: time.nanoseconds(0), period: HOUR_NS })),
        };
    }
    if let Some(days) = before.strip_suffix("days").or(before.strip_suffix("day")) {
        let days = days.trim().parse::<u32>().ok().filter(|_| behind.is_empty());
        let elapsed = |(days, hour): (u32, u32)| i128::from(days) * DAY_NS + time.nanoseconds(hour);
        return Ok(days.zip(hour).map(elapsed).map(Stamp::Elapsed));
    }
    // `date` and `ctime` write the year last.
    let (behind, year) = match behind.rsplit_once(' ').unwrap_or(("", behind)) {
        (zone, year) if year.len() == 4 && year.parse::<u32>().is_ok() => (zone.trim(), year),
        _ => (behind, ""),
    };
    let Some(day) = calendar_day(&format!("{before} {year}"), order)? else { return Ok(None) };
    let time = hour.and_then(|hour| {
        NaiveTime::from_hms_nano_opt(hour, time.minute, time.second, time.nanosecond)
    });
    let Some(local) = time.map(|time| day.and_time(time)) else { return Ok(None) };
    let Some(offset_s) = zone_offset_s(&local, behind)? else { return Ok(None) };
    Ok(Some(Stamp::Date(nanoseconds(local) - i128::from(offset_s) * SECOND_NS)))
}

/// Returns the offset from UTC, s, that the text behind a local time states. Without a text it is 0.
fn zone_offset_s(local: &NaiveDateTime, zone: &str) -> Result<Option<i64>, &'static str> {
    if zone.is_empty() {
        return Ok(Some(0));
    }
    if zone.starts_with(['+', '-']) {
        // An offset before a zone in brackets is more exact than the zone.
        let offset = zone.split('[').next().unwrap_or_default().trim().replace(':', "");
        let full = if offset.len() == 3 { format!("{offset}00") } else { offset };
        let parsed = DateTime::parse_from_str(&format!("2000-01-01 00:00:00 {full}"), "%F %T %z");
        return Ok(parsed.ok().map(|of| i64::from(of.offset().local_minus_utc())));
    }
    let name = split_zone(&format!("x {zone}")).map_or(zone, |(_, name)| name).to_owned();
    offset_s(local, &name).map(Some)
}

/// Short names of months that are none of the English ones of three letters.
const OTHER_MONTHS: [(&str, u32); 6] =
    [("mär", 3), ("mrz", 3), ("mai", 5), ("sept", 9), ("okt", 10), ("dez", 12)];

/// Reads the words of a date. Returns `None` if they are not a date.
fn calendar_day(text: &str, order: Option<DateOrder>) -> Result<Option<NaiveDate>, &'static str> {
    let lower = text.to_lowercase();
    let is_weekday = |word: &str| word.parse::<Weekday>().is_ok();
    let words = lower.split(|c: char| !c.is_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty() && !is_weekday(word)).collect();
    let number = |word: &str| word.parse::<u32>().ok().filter(|_| word.len() <= 4);
    let day = |[year, month, day]: [&str; 3]| {
        let numbers = (number(year)?, month_number(month)?, number(day)?);
        // POSIX: two digits from 69 are of the last century.
        let year = match (year.len(), numbers.0) {
            (4, year) => year,
            (2, year) if year < 69 => 2000 + year,
            (2, year) => 1900 + year,
            _ => return None,
        };
        NaiveDate::from_ymd_opt(year as i32, numbers.1, numbers.2)
    };
    let is_name = |word: &str| number(word).is_none();
    match *words.as_slice() {
        [all] if all.len() == 8 && all.is_ascii() => Ok(day([&all[..4], &all[4..6], &all[6..]])),
        [a, b, c] if a.len() == 4 => Ok(day([a, b, c])),
        [a, b, c] if is_name(b) => Ok(day([c, b, a])),
        [a, b, c] if is_name(a) => Ok(day([c, a, b])),
        [a, b, c] => match order {
            Some(DateOrder::DayMonthYear) => Ok(day([c, b, a])),
            Some(DateOrder::MonthDayYear) => Ok(day([c, a, b])),
            Some(DateOrder::YearMonthDay) => Ok(day([a, b, c])),
            // Points stand only in dates that begin with the day.
            None if text.contains('.') => Ok(day([c, b, a])),
            None => match (day([c, b, a]), day([c, a, b])) {
                (None, None) => Ok(None),
                _ if c.len() == 2 => Err(AMBIGUOUS_YEAR),
                (Some(_), Some(_)) if a != b => Err(AMBIGUOUS_ORDER),
                (by_day, by_month) => Ok(by_day.or(by_month)),
            },
        },
        _ => Ok(None),
    }
}

fn month_number(word: &str) -> Option<u32> {
    let other = OTHER_MONTHS.iter().find(|(name, _)| *name == word).map(|(_, number)| *number);
    let english = || word.parse::<Month>().ok().map(|month| month.number_from_month());
    other.or_else(|| word.parse().ok()).or_else(english)
}

/// Parses the parts of a duration, `1d2h3m4s5ms6us7ns`, as nanoseconds.
fn duration(text: &str) -> Option<i128> {
    let units = [
        ("d", DAY_NS as f64),
        ("h", HOUR_NS as f64),
        ("m", 60e9),
        ("s", 1e9),
        ("ms", 1e6),
        ("us", 1e3),
        ("ns", 1.0),
    ];
    let (negative, text) = text.strip_prefix('-').map_or((false, text), |rest| (true, rest));
    let text = text.replace('_', "").to_ascii_lowercase();
    let (mut rest, mut sum) = (text.as_str(), 0);
    while !rest.is_empty() {
        let letters = rest.find(|c: char| c.is_ascii_alphabetic())?;
        let number: f64 = rest[..letters].parse().ok()?;
        let end = rest[letters..].find(|c: char| !c.is_ascii_alphabetic());
        let end = end.map_or(rest.len(), |end| letters + end);
        let (_, size) = units.iter().find(|(name, _)| *name == &rest[letters..end])?;
        sum += (number * size).round() as i128;
        rest = &rest[end..];
    }
    Some(if negative { -sum } else { sum })
}

/// Returns the nanoseconds since 1970 of a time in UTC.
fn nanoseconds(time: NaiveDateTime) -> i128 {
    let stamp = time.and_utc();
    i128::from(stamp.timestamp()) * SECOND_NS + i128::from(stamp.timestamp_subsec_nanos())
}

/// Formats a stamp, ns since 1970, as ISO 8601 in UTC. Returns `None` if the calendar does not cover it.
pub(super) fn format_stamp(ns: i128) -> Option<String> {
    let seconds = i64::try_from(ns.div_euclid(1_000_000_000)).ok()?;
    let stamp = DateTime::from_timestamp(seconds, ns.rem_euclid(1_000_000_000) as u32)?;
    Some(stamp.format("%Y-%m-%dT%H:%M:%S%.9fZ").to_string())
}

#[cfg(test)]
mod tests;
