//! Another reading of the torque that comes late or early: an actuator's force on another bus.
//!
//! Such a column follows the torque; where it follows the torque of some rows ago much better than that of its
//! own row, its channel is late. Columns that do not follow the torque closely are not judged: what they do
//! may be physics.

use super::column::Column;
use super::{Kind, Log, LogFinding};
use crate::data::segments;
use crate::number::figure;
use nalgebra::DMatrix;

/// Correlation with the torque, at the best shift, from which a column is another reading of it.
const FOLLOWS: f64 = 0.9;

/// What is left of the torque unexplained at the best shift, over what is left without a shift.
const BETTER: f64 = 0.6;

/// Longest shift looked for, s, and in rows.
const LONGEST: (f64, usize) = (0.25, 300);

/// Columns that are judged together, at most.
const MOST: usize = 6;

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
    let others = || log.columns.iter().filter(|column| column.quantity.is_none());
    let mut found = Vec::new();
    let mut tell = |columns: &[&Column], shift: i64| {
        let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
        let seconds = shift as f64 * step_s;
        let late = if shift > 0 { "late" } else { "early" };
        let (are, them) = if names.len() > 1 {
            ("together are", "They are taken as they stand")
        } else {
            ("is", "It is taken as it stands")
        };
        found.push(LogFinding {
            kind: Kind::ChannelLag,
            value: seconds,
            unit: "s".into(),
            corrected: false,
            in_words: format!(
                "{} {are} another reading of {}, {} ms {late} against it. {them}.",
                names.join(" and "),
                log.torque(),
                figure(1e3 * seconds.abs())
            ),
            columns: names,
        });
    };
    let alone: Vec<(&Column, i64)> =
        others().filter_map(|column| Some((column, shift(log, &[column], longest)?))).collect();
    alone.iter().for_each(|(column, shift)| tell(&[*column], *shift));
    if alone.is_empty() {
        // Two actuators on either side: neither follows the torque, their difference does.
        let unit = log.data.joint.torque_unit();
        let varies = |column: &&Column| column.pairs().any(|(before, now)| before != now);
        let group: Vec<&Column> =
            others().filter(|column| column.unit == unit).filter(varies).collect();
        if let Some(shift) =
            (2..=MOST).contains(&group.len()).then(|| shift(log, &group, longest)).flatten()
        {
            tell(&group, shift);
        }
    }
    found
}

/// Rows by which columns are late, if they are another reading of the torque together.
fn shift(log: &Log, columns: &[&Column], longest: usize) -> Option<i64> {
    let stride = log.data.rows.div_ceil(ROWS).max(1);
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
    let left = |shift: i64| left(&parts, shift, longest);
    let reach = longest as i64;
    let (least, shift) =
        (-reach..=reach).map(|shift| (left(shift), shift)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let follows = least < 1.0 - FOLLOWS * FOLLOWS && least < BETTER * left(0);
    (follows && shift.abs() < reach && shift.unsigned_abs() as usize >= SHORTEST).then_some(shift)
}

/// A stretch of the torque and of the columns.
struct Part<'a> {
    torque: &'a [f64],
    columns: Vec<&'a [f64]>,
}

/// What the columns, `shift` rows later, leave of the torque's variance, as a share.
fn left(parts: &[Part], shift: i64, longest: usize) -> f64 {
    let count = parts[0].columns.len();
    let mut products = DMatrix::<f64>::zeros(count + 1, count + 1);
    for part in parts {
        // The same torques for every shift, or the shifts could not be compared.
        let rows = longest..part.torque.len() - longest;
        let start = (rows.start as i64 + shift) as usize;
        let mut all: Vec<&[f64]> =
            part.columns.iter().map(|column| &column[start..start + rows.len()]).collect();
        all.push(&part.torque[rows]);
        let means: Vec<f64> =
            all.iter().map(|values| values.iter().sum::<f64>() / values.len() as f64).collect();
        for i in 0..all.len() {
            for j in 0..=i {
                let (a, b) = (all[i].iter(), all[j].iter());
                let sum: f64 = a.zip(b).map(|(a, b)| (a - means[i]) * (b - means[j])).sum();
                products[(i, j)] += sum;
            }
        }
    }
    // The last pivot of a Cholesky factor is the root of what the others leave of the last column.
    let total = products[(count, count)];
    products.fill_upper_triangle_with_lower_triangle();
    products.cholesky().map_or(1.0, |factor| factor.l()[(count, count)].powi(2) / total)
}
