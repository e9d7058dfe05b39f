//! Time zones at the end of a time stamp: `UTC`, `CEST`, `Europe/Berlin`.
//!
//! An abbreviation is an offset only if all zones that use it agree. `CST` is -06:00 in Chicago and +08:00 in Shanghai,
//! so a stamp with it is refused. A name of the IANA database (`Europe/Berlin`) has an offset for each local time, but
//! for the hour that a change from summer time repeats.

use chrono::{NaiveDateTime, Offset, TimeZone};
use chrono_tz::Tz;

/// Abbreviations with one meaning, and their offset from UTC, minutes.
const ABBREVIATIONS: &[(&str, i32)] = &[
    ("UTC", 0),
    ("GMT", 0),
    ("Z", 0),
    ("WET", 0),
    ("WEST", 60),
    ("CET", 60),
    ("CEST", 120),
    ("MEZ", 60),
    ("MESZ", 120),
    ("EET", 120),
    ("EEST", 180),
    ("MSK", 180),
    ("JST", 540),
    ("KST", 540),
    ("AEST", 600),
    ("AEDT", 660),
    ("NZST", 720),
    ("NZDT", 780),
    ("EDT", -240),
    ("PDT", -420),
    ("PST", -480),
];

/// Abbreviations of several zones.
const AMBIGUOUS: &[&str] =
    &["CST", "CDT", "IST", "BST", "AST", "ADT", "EST", "MST", "MDT", "SST", "ECT", "GST"];

/// What is expected instead of a stamp with such an abbreviation.
const AMBIGUOUS_ZONE: &str = "an offset such as +01:00: several time zones have this abbreviation";

/// What is expected instead of a stamp with another word at its end.
const UNKNOWN_ZONE: &str = "an offset such as +01:00, UTC, or a zone such as Europe/Berlin";

/// What is expected instead of a local time that occurs twice or never.
const REPEATED_HOUR: &str =
    "an offset such as +01:00: the change of summer time repeats or skips this local time";

/// Splits a stamp into the local time and the zone at its end. `[Europe/Berlin]` may follow an offset.
pub(super) fn split_zone(text: &str) -> Option<(&str, &str)> {
    let text = text.trim();
    let (local, zone) = match text.strip_suffix(']') {
        Some(inside) => inside.rsplit_once('[')?,
        None => text.rsplit_once(' ')?,
    };
    let is_zone = zone.starts_with(|c: char| c.is_ascii_alphabetic())
        && !zone.eq_ignore_ascii_case("AM")
        && !zone.eq_ignore_ascii_case("PM");
    is_zone.then_some((local.trim_end(), zone))
}

/// Returns the offset of a local time from UTC, s.
///
/// # Errors
/// What is expected instead.
pub(super) fn offset_s(local: &NaiveDateTime, zone: &str) -> Result<i64, &'static str> {
    if let Some((_, minutes)) =
        ABBREVIATIONS.iter().find(|(name, _)| name.eq_ignore_ascii_case(zone))
    {
        return Ok(60 * i64::from(*minutes));
    }
    if AMBIGUOUS.iter().any(|name| name.eq_ignore_ascii_case(zone)) {
        return Err(AMBIGUOUS_ZONE);
    }
    let zone: Tz = zone.parse().map_err(|_| UNKNOWN_ZONE)?;
    let offset = zone.offset_from_local_datetime(local).single().ok_or(REPEATED_HOUR)?;
    Ok(i64::from(offset.fix().local_minus_utc()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offset(stamp: &str, zone: &str) -> Result<i64, &'static str> {
        offset_s(&stamp.parse().unwrap(), zone)
    }

    #[test]
    fn offset_s_with_known_zone_returns_offset() {
        assert_eq!(offset("2024-05-01T10:00:00", "CEST"), Ok(7200));
        assert_eq!(offset("2024-05-01T10:00:00", "utc"), Ok(0));
        assert_eq!(offset("2024-05-01T10:00:00", "Europe/Berlin"), Ok(7200));
        assert_eq!(offset("2024-12-01T10:00:00", "Europe/Berlin"), Ok(3600));
        assert_eq!(offset("2024-12-01T10:00:00", "America/New_York"), Ok(-18000));
    }

    #[test]
    fn offset_s_with_ambiguous_time_or_zone_returns_error() {
        assert_eq!(offset("2024-05-01T10:00:00", "CST"), Err(AMBIGUOUS_ZONE));
        assert_eq!(offset("2024-05-01T10:00:00", "noon"), Err(UNKNOWN_ZONE));
        assert_eq!(offset("2024-10-27T02:30:00", "Europe/Berlin"), Err(REPEATED_HOUR));
        assert_eq!(offset("2024-03-31T02:30:00", "Europe/Berlin"), Err(REPEATED_HOUR));
    }

    #[test]
    fn split_zone_with_zone_at_the_end_returns_it() {
        assert_eq!(split_zone("2024-05-01 10:00:00 CEST"), Some(("2024-05-01 10:00:00", "CEST")));
        let bracketed = split_zone("2024-05-01T10:00:00+02:00[Europe/Berlin]");
        assert_eq!(bracketed, Some(("2024-05-01T10:00:00+02:00", "Europe/Berlin")));
        assert_eq!(split_zone("10:00:00 PM"), None);
        assert_eq!(split_zone("2024-05-01 10:00:00"), None);
    }
}
