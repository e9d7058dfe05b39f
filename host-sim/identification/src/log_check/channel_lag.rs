//! Another reading of the torque that comes late or early: an actuator's force on another bus.
//!
//! Such a column follows the torque; where it follows the torque of some rows ago much better than that of its
//! own row, its channel is late. Columns that do not follow the torque closely are not judged: what they do
//! may be physics.

use super::column::Column;
use super::{Kind, Log, LogFinding};
use crate::data::segments;
use crate::number::figure;

/// Correlation with the torque, at the best shift, from which a column is another reading of it.
const FOLLOWS: f64 = 0.9;

/// What is left of the column unexplained at the best shift, over what is left without a shift.
const BETTER: f64 = 0.6;

/// Longest shift looked for, s, and in rows.
const LONGEST: (f64, usize) = (0.25, 300);

/// Shortest shift that is told, rows.
const SHORTEST: usize = 2;

/// Rows looked at, at most.
const ROWS: usize = 40_000;

pub fn channel_lag(log: &Log) -> Vec<LogFinding> {
    let step_s = log.sensors.step_s;
    if step_s <= 0.0 {
        return Vec::new();
    }
    let longest = ((LONGEST.0 / step_s) as usize).clamp(SHORTEST + 1, LONGEST.1);
    let mut found = Vec::new();
    for column in log.columns.iter().filter(|column| column.quantity.is_none()) {
        let Some(shift) = shift(log, column, longest) else { continue };
        let seconds = shift as f64 * step_s;
        let late = if shift > 0 { "late" } else { "early" };
        found.push(LogFinding {
            kind: Kind::ChannelLag,
            columns: vec![column.name.clone()],
            value: seconds,
            unit: "s".into(),
            corrected: false,
            in_words: format!(
                "{} is another reading of the {} and is {} ms {late} against it. It is taken as it stands.",
                column.name,
                log.torque(),
                figure(1e3 * seconds.abs())
            ),
        });
    }
    found
}

/// Rows by which the column is late, if it is.
fn shift(log: &Log, column: &Column, longest: usize) -> Option<i64> {
    let stride = log.data.rows.div_ceil(ROWS).max(1);
    let mut pairs: Vec<(&[f64], &[f64])> = Vec::new();
    for (run, values) in log.data.runs.iter().zip(&column.runs) {
        let longest_rows = segments(run).into_iter().max_by_key(std::ops::Range::len)?;
        let length = (longest_rows.len() / stride).max(4 * longest).min(longest_rows.len());
        if length > 3 * longest {
            let rows = longest_rows.start..longest_rows.start + length;
            pairs.push((&run.torque[rows.clone()], &values[rows]));
        }
    }
    if pairs.is_empty() {
        return None;
    }
    let at = |shift: i64| correlation(&pairs, shift, longest).abs();
    let plain = at(0);
    let reach = longest as i64;
    let (best, shift) =
        (-reach..=reach).map(|shift| (at(shift), shift)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let left = |of: f64| 1.0 - of * of;
    let is_inside = shift.abs() < reach;
    let tells = best > FOLLOWS && left(best) < BETTER * left(plain);
    (tells && is_inside && shift.unsigned_abs() as usize >= SHORTEST).then_some(shift)
}

/// Correlation of the torque with the column `shift` rows later.
fn correlation(pairs: &[(&[f64], &[f64])], shift: i64, longest: usize) -> f64 {
    let (mut n, mut sx, mut sy, mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (torque, column) in pairs {
        // The same torques for every shift, or the shifts could not be compared.
        let rows = longest..torque.len() - longest;
        let start = (rows.start as i64 + shift) as usize;
        for (x, y) in torque[rows.clone()].iter().zip(&column[start..start + rows.len()]) {
            n += 1.0;
            sx += x;
            sy += y;
            xx += x * x;
            yy += y * y;
            xy += x * y;
        }
    }
    let variance = (xx - sx * sx / n) * (yy - sy * sy / n);
    if variance > 0.0 { (xy - sx * sy / n) / variance.sqrt() } else { 0.0 }
}
