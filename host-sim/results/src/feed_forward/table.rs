//! The table of torque over speed, and its interpolation.
//!
//! The speeds are denser towards zero, where friction changes most. Between the smallest speeds of both directions the
//! torque is a straight line: a jump at zero would excite the joint at each reversal. The width of that line is the one with
//! the smallest error on the training rows, because a joint in presliding does not hold its full level.

use super::steady::{Estimated, SteadyModel};
use friction_fit::Track;

/// Number of speeds in each direction.
const SPEEDS: usize = 16;

/// Candidates for the smallest speed, as a share of the largest.
const RAMP_SHARES: [f64; 7] = [0.003, 0.006, 0.012, 0.025, 0.05, 0.1, 0.2];

/// Share of the rows whose speed is in the table. The fastest rows are often noise.
const COVERED_SHARE: f64 = 0.999;

/// A point of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TablePoint {
    /// Velocity, rad/s or m/s.
    pub velocity: f64,
    /// Torque that drives the joint at this velocity, Nm or N.
    pub torque: f64,
    /// Its standard error, Nm or N.
    pub std_error: f64,
    /// Number of training rows that are closer to this point than to another one.
    pub rows: usize,
}

/// Returns the largest speed that the tracks cover.
pub fn covered_speed(tracks: &[Track]) -> f64 {
    let samples = tracks.iter().flat_map(|track| &track.samples);
    let mut speeds: Vec<f64> = samples.map(|sample| sample.velocity_rad_s.abs()).collect();
    speeds.sort_by(f64::total_cmp);
    let last = speeds.len().saturating_sub(1) as f64;
    speeds.get((COVERED_SHARE * last).round() as usize).copied().unwrap_or(0.0)
}

/// Returns the table whose `error` is smallest, of the candidates for its smallest speed.
pub fn best_table(
    model: &SteadyModel,
    train: &[Track],
    error: impl Fn(&[TablePoint]) -> f64,
) -> Vec<TablePoint> {
    let fastest = covered_speed(train);
    let candidates = RAMP_SHARES.map(|share| table(model, share * fastest, fastest));
    let errors = candidates.iter().map(|table| error(table));
    let best = errors.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(at, _)| at);
    let mut table = candidates[best].clone();
    count_rows(&mut table, train);
    table
}

/// Returns the table from a smallest to a largest speed, both positive.
fn table(model: &SteadyModel, slowest: f64, fastest: f64) -> Vec<TablePoint> {
    let ratio = (fastest / slowest).powf(1.0 / (SPEEDS - 1) as f64);
    let speeds = || (0..SPEEDS as i32).map(move |at| slowest * ratio.powi(at));
    let negative = speeds().rev().map(|speed| -speed);
    let velocities = negative.chain([0.0]).chain(speeds());
    let point = |velocity: f64| {
        let Estimated { value: torque, std_error } = match velocity {
            // The line between both directions passes here.
            0.0 => {
                let (ahead, back) = (model.torque(slowest), model.torque(-slowest));
                Estimated {
                    value: 0.5 * (ahead.value + back.value),
                    std_error: 0.5 * (ahead.std_error + back.std_error),
                }
            }
            velocity => model.torque(velocity),
        };
        TablePoint { velocity, torque, std_error, rows: 0 }
    };
    velocities.map(point).collect()
}

fn count_rows(table: &mut [TablePoint], tracks: &[Track]) {
    for sample in tracks.iter().flat_map(|track| &track.samples) {
        let velocity = sample.velocity_rad_s;
        let after = table.partition_point(|point| point.velocity < velocity).min(table.len() - 1);
        let before = after.saturating_sub(1);
        let is_before =
            (velocity - table[before].velocity).abs() < (table[after].velocity - velocity).abs();
        table[if is_before { before } else { after }].rows += 1;
    }
}

/// Returns the torque of a table at a velocity: linear between the points, constant beyond the last ones.
pub fn interpolated(table: &[TablePoint], velocity: f64) -> f64 {
    let after = table.partition_point(|point| point.velocity < velocity);
    match (after.checked_sub(1).and_then(|before| table.get(before)), table.get(after)) {
        (Some(before), Some(after)) => {
            let share = (velocity - before.velocity) / (after.velocity - before.velocity);
            before.torque + share * (after.torque - before.torque)
        }
        (Some(only), None) | (None, Some(only)) => only.torque,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::Sample;

    fn point(velocity: f64, torque: f64) -> TablePoint {
        TablePoint { velocity, torque, std_error: 0.0, rows: 0 }
    }

    #[test]
    fn interpolated_between_and_beyond_points_is_linear_and_constant() {
        let table = [point(-1.0, -2.0), point(0.0, 0.5), point(2.0, 1.5)];
        let expected =
            [(-9.0, -2.0), (-1.0, -2.0), (-0.5, -0.75), (0.0, 0.5), (1.0, 1.0), (3.0, 1.5)];
        for (velocity, torque) in expected {
            assert!((interpolated(&table, velocity) - torque).abs() < 1e-12, "{velocity}");
        }
        assert_eq!(interpolated(&[], 1.0), 0.0);
    }

    #[test]
    fn count_rows_assigns_each_row_to_nearest_point() {
        let velocities = [-5.0, -0.9, -0.4, 0.1, 0.9, 1.2, 9.0];
        let samples = velocities.map(|v| Sample { velocity_rad_s: v, ..Sample::default() });
        let track = Track::even(samples.to_vec(), vec![0.0; 7], 0.01);
        let mut table = [point(-1.0, 0.0), point(0.0, 0.0), point(2.0, 0.0)];
        count_rows(&mut table, &[track]);
        assert_eq!(table.map(|point| point.rows), [2, 3, 2]);
    }
}
