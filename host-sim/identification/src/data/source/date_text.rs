//! Dates of binary formats as the text of a CSV file.

use chrono::DateTime;

pub(super) const SECOND_NS: i64 = 1_000_000_000;
pub(super) const DAY_NS: i64 = 86_400 * SECOND_NS;

/// Formats a count of units since 1970, each of `unit_ns` nanoseconds. Returns an empty text if the calendar does not
/// cover it.
pub(super) fn date_text(count: i64, unit_ns: i64) -> String {
    let ns = i128::from(count) * i128::from(unit_ns);
    let second = i128::from(SECOND_NS);
    let stamp = i64::try_from(ns.div_euclid(second))
        .ok()
        .and_then(|seconds| DateTime::from_timestamp(seconds, ns.rem_euclid(second) as u32));
    stamp.map(|stamp| stamp.format("%Y-%m-%dT%H:%M:%S%.9fZ").to_string()).unwrap_or_default()
}
