//! Velocity and torque in each other's column.
//!
//! A position shows which of the two is the velocity: its travel is the integral of the velocity. If it is the integral
//! of the torque column instead, at a known scale, and not that of the velocity column, the two are swapped. The travel
//! over several rows is compared, because a difference from row to row is mostly noise.

use super::header;
use super::unit::velocity_units;
use super::wrap::{self, Wrap, is_velocity_derived};
use crate::setting::Setting;
use crate::{DataError, Dataset, Run, segments};
use compensator_core::quantity::Quantity;

/// Rows of the travels that are compared; the best of them counts.
const TRAVEL_ROWS: [usize; 4] = [1, 4, 16, 64];

/// Minimum share of the squared travel that the integral of a column explains, for the column to be the velocity.
const MIN_SHARE_OF_VELOCITY: f64 = 0.98;

/// Maximum unexplained share of the velocity, relative to that of another column. A torque of friction alone follows the
/// velocity too: it leaves 5 to 30 % of the travel unexplained.
const MAX_RESIDUAL_RATIO: f64 = 0.1;

/// Maximum relative difference to a known scale.
const MAX_SCALE_DIFFERENCE: f64 = 0.03;

/// Minimum number of travels for a decision.
const MIN_TRAVELS: usize = 50;

/// Refuses a log whose torque column holds the velocity.
pub fn swapped(data: &Dataset) -> Option<DataError> {
    if is_velocity_derived(data)
        || data.runs.iter().any(|run| run.get(Quantity::Position).is_none())
    {
        return None;
    }
    let wrap = wrap::find(data);
    let torque = best(data, wrap, |run| &run.torque)?;
    let velocity = best(data, wrap, |run| &run.velocity)?;
    let is_velocity = torque.share > MIN_SHARE_OF_VELOCITY;
    if !is_velocity || 1.0 - torque.share > MAX_RESIDUAL_RATIO * (1.0 - velocity.share) {
        return None;
    }
    let is_near = |scale: f64| (torque.scale / scale - 1.0).abs() < MAX_SCALE_DIFFERENCE;
    let unit = velocity_units(data.joint).into_iter().find(|of| is_near(of.size))?.unit;
    let [velocity, torque] = [Quantity::Velocity, Quantity::Torque].map(|of| of.name(data.joint));
    let [from_velocity, from_torque] = [velocity, torque].map(|name| header(data, name));
    let unit = if unit == data.joint.velocity_unit() { String::new() } else { format!(":{unit}") };
    let pairs = format!("{velocity}={from_torque}{unit},{torque}={from_velocity}");
    Some(DataError::file(
        data.first_file(),
        format!(
            "the derivative of the position in the column {from_torque} of the torque, and not in the column \
             {from_velocity} of the velocity"
        ),
        Setting::Columns.suggested(pairs),
    ))
}

/// A column compared with the travel.
struct Integral {
    /// Column over derivative of the position.
    scale: f64,
    /// Share of the squared travel that its integral explains.
    share: f64,
}

/// Compares a column with the travel. Returns `None` if there are too few rows or no motion.
fn best<'a>(
    data: &'a Dataset,
    wrap: Option<Wrap>,
    column: impl Fn(&'a Run) -> &'a [f64],
) -> Option<Integral> {
    let compared = TRAVEL_ROWS.iter().filter_map(|rows| {
        let (mut xx, mut xy, mut yy, mut count) = (0.0, 0.0, 0.0, 0usize);
        for run in &data.runs {
            let Some(position) = run.get(Quantity::Position) else { continue };
            for segment in segments(run) {
                let time = &run.time_s[segment.clone()];
                let (position, values) = (&position[segment.clone()], &column(run)[segment]);
                for from in (0..time.len().saturating_sub(*rows)).step_by(*rows) {
                    let (mut travel, mut integral) = (0.0, 0.0);
                    for row in from + 1..=from + rows {
                        let step = position[row] - position[row - 1];
                        let turns = wrap.map_or(0.0, |wrap| wrap.turns(step) * wrap.period);
                        travel += step - turns;
                        let mean = 0.5 * (values[row] + values[row - 1]);
                        integral += mean * (time[row] - time[row - 1]);
                    }
                    xx += integral * integral;
                    xy += integral * travel;
                    yy += travel * travel;
                    count += 1;
                }
            }
        }
        let is_moving = xx > 0.0 && yy > 0.0 && count >= MIN_TRAVELS;
        is_moving.then(|| Integral { scale: xx / xy, share: xy * xy / (xx * yy) })
    });
    compared.max_by(|a, b| a.share.total_cmp(&b.share))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Swings with a torque of Coulomb and viscous friction, and noise of the position.
    fn log(columns: impl Fn(f64, f64) -> (f64, f64)) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"].map(str::to_owned);
        let rows = (0..2000).map(|row| {
            let time = 0.01 * f64::from(row);
            let velocity = 2.0 * (1.7 * time).sin() + (0.9 * time).cos();
            let (first, second) = columns(velocity, 0.5 * velocity.signum() + 0.1 * velocity);
            let noise = 1e-4 * f64::from(row * 7919 % 13 - 6);
            let angle = -2.0 / 1.7 * (1.7 * time).cos() + (0.9 * time).sin() / 0.9;
            [time, first, second, angle + noise]
        });
        let rows: Vec<[f64; 4]> = rows.collect();
        let columns = (0..4).map(|at| rows.iter().map(|row| row[at]).collect()).collect();
        Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("columns")
    }

    #[test]
    fn swapped_with_columns_in_each_others_place_names_the_option() {
        let error = swapped(&log(|velocity, torque| (torque, velocity))).expect("swapped");
        assert!(
            error
                .to_string()
                .ends_with("columns velocity_rad_s=torque_nm,torque_nm=velocity_rad_s"),
            "{error}"
        );
        let in_rpm = |velocity: f64, torque: f64| (torque, 60.0 / std::f64::consts::TAU * velocity);
        let error = swapped(&log(in_rpm)).expect("swapped").to_string();
        assert!(error.contains("velocity_rad_s=torque_nm:rpm"), "{error}");
    }

    #[test]
    fn swapped_with_right_columns_returns_none() {
        assert!(swapped(&log(|velocity, torque| (velocity, torque))).is_none());
        // Purely viscous, so that the torque is a velocity too.
        assert!(swapped(&log(|velocity, _| (velocity, velocity))).is_none());
        // A torque that is no velocity beside a velocity that is none either.
        assert!(swapped(&log(|_, torque| (torque, 0.37 * torque))).is_none());
    }
}
