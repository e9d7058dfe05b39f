//! Another reading of the torque with a delay: for example an actuator's force on another bus.
//!
//! Such a column follows the torque. If it follows the torque of some rows ago much better than that of its own row,
//! its channel is delayed. Columns that do not follow the torque closely are not evaluated: their delay may be physical.

use super::column::Column;
use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::number::figure;
use crate::segments;
use crate::work::checkpoint;
use nalgebra::DMatrix;

/// Minimum correlation with the torque, at the best shift, for a column to be another reading of it.
const MIN_CORRELATION: f64 = 0.9;

/// Maximum residual variance at the best shift, relative to that without a shift.
const MAX_RESIDUAL_RATIO: f64 = 0.6;

/// Maximum shift that is searched, s.
const MAX_SHIFT_S: f64 = 0.25;

/// Maximum shift that is searched, rows.
const MAX_SHIFT_ROWS: usize = 300;

/// Maximum number of columns that are evaluated together.
const MAX_COLUMNS: usize = 6;

/// Minimum shift that is reported, rows.
const MIN_SHIFT_ROWS: usize = 2;

/// Maximum number of rows that are evaluated.
const MAX_ROWS: usize = 40_000;

pub fn channel_lag(log: &Log) -> Vec<LogFinding> {
    let step_s = log.sensors.step_s;
    if step_s <= 0.0 {
        return Vec::new();
    }
    let longest = ((MAX_SHIFT_S / step_s) as usize).clamp(MIN_SHIFT_ROWS + 1, MAX_SHIFT_ROWS);
    let others =
        || log.columns.iter().filter(|column| column.quantity.is_none() && !column.is_motion());
    let mut found = Vec::new();
    let mut report = |columns: &[&Column], shift: i64| {
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        let seconds = shift as f64 * step_s;
        let late = if shift > 0 { "late" } else { "early" };
        let (are, them) = if names.len() > 1 {
            ("together are", "They are taken as they stand")
        } else {
            ("is", "It is taken as it stands")
        };
        let words = format!(
            "{} {are} another reading of {}, {} ms {late} against it. {them}.",
            names.join(" and "),
            log.torque(),
            figure(1e3 * seconds.abs())
        );
        found.push(LogFindingKind::ChannelLag.finding(&names, seconds, "s", words));
    };
    let alone: Vec<(&Column, i64)> =
        others().filter_map(|column| Some((column, shift(log, &[column], longest)?))).collect();
    alone.iter().for_each(|(column, shift)| report(&[*column], *shift));
    if alone.is_empty() {
        // Two antagonistic actuators: neither follows the torque, but their difference does.
        let unit = log.data.joint.torque_unit();
        let varies = |column: &&Column| column.pairs().any(|(before, now)| before != now);
        let group: Vec<&Column> =
            others().filter(|column| column.unit == unit).filter(varies).collect();
        if let Some(shift) =
            (2..=MAX_COLUMNS).contains(&group.len()).then(|| shift(log, &group, longest)).flatten()
        {
            report(&group, shift);
        }
    }
    found
}

/// Returns the delay of the columns in rows, if together they are another reading of the torque.
fn shift(log: &Log, columns: &[&Column], longest: usize) -> Option<i64> {
    let stride = log.data.rows.div_ceil(MAX_ROWS).max(1);
    let mut parts: Vec<Part> = Vec::new();
    for (index, run) in log.data.runs.iter().enumerate() {
        let longest_rows = segments(run).into_iter().max_by_key(std::ops::Range::len)?;
        let length = (longest_rows.len() / stride).max(4 * longest).min(longest_rows.len());
        if length > 3 * longest {
            let rows = longest_rows.start..longest_rows.start + length;
            let mut cut: Vec<&[f64]> = Vec::new();
            for column in columns {
                cut.push(&column.runs[index][rows.clone()]);
            }
            parts.push(Part { torque: &run.torque[rows], columns: cut });
        }
    }
    if parts.is_empty() {
        return None;
    }
    let residual = |shift: i64| residual_share(&parts, shift, longest);
    let reach = longest as i64;
    let (least, shift) = (-reach..=reach)
        .map(|shift| (residual(shift), shift))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let follows =
        least < 1.0 - MIN_CORRELATION * MIN_CORRELATION && least < MAX_RESIDUAL_RATIO * residual(0);
    let is_long = shift.unsigned_abs() as usize >= MIN_SHIFT_ROWS;
    (follows && shift.abs() < reach && is_long).then_some(shift)
}

/// A segment of the torque and of the columns.
struct Part<'a> {
    torque: &'a [f64],
    columns: Vec<&'a [f64]>,
}

/// Returns the share of the torque's variance that the columns, `shift` rows later, do not explain.
fn residual_share(parts: &[Part], shift: i64, longest: usize) -> f64 {
    let count = parts[0].columns.len();
    let mut products = DMatrix::<f64>::zeros(count + 1, count + 1);
    for part in parts {
        checkpoint();
        // The same torque rows for every shift, so that the shifts are comparable.
        let rows = longest..part.torque.len() - longest;
        let start = (rows.start as i64 + shift) as usize;
        let mut all: Vec<&[f64]> =
            part.columns.iter().map(|column| &column[start..start + rows.len()]).collect();
        all.push(&part.torque[rows]);
        let means: Vec<f64> =
            all.iter().map(|values| values.iter().sum::<f64>() / values.len() as f64).collect();
        for (i, (one, mean)) in all.iter().zip(&means).enumerate() {
            for (j, (other, its_mean)) in all.iter().zip(&means).enumerate().take(i + 1) {
                let both = one.iter().zip(*other);
                let sum: f64 = both.map(|(a, b)| (a - mean) * (b - its_mean)).sum();
                products[(i, j)] += sum;
            }
        }
    }
    // The last pivot of a Cholesky factor is the square root of the last column's residual.
    let total = products[(count, count)];
    products.fill_upper_triangle_with_lower_triangle();
    products.cholesky().map_or(1.0, |factor| factor.l()[(count, count)].powi(2) / total)
}
