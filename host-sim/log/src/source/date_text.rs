//! Dates of binary formats as the text of a CSV file.

use crate::date::format_stamp;

pub(super) const SECOND_NS: i64 = 1_000_000_000;
pub(super) const DAY_NS: i64 = 86_400 * SECOND_NS;

/// Formats a count of units since 1970, each of `unit_ns` nanoseconds. Returns an empty text if the calendar does not
/// cover it.
pub(super) fn date_text(count: i64, unit_ns: i64) -> String {
    format_stamp(i128::from(count) * i128::from(unit_ns)).unwrap_or_default()
}
