//! Simple reconstructions of the motion and of the initial state from the log alone.
//!
//! The angle is interpolated linearly, or the velocity is integrated. Both can be smoothed over several rows, and the
//! filter's delay is compensated. These reconstructions define the error floor of a world ([`super::visible`]). A better
//! method may have a smaller error.

use super::campaign::RunPlan;
use super::plant::{Machine, RunInput};
use simulated_machines::imposed::{Point, Trajectory};
use simulated_machines::sampling::Readings;

/// A method to reconstruct the motion between rows from a log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// True to interpolate the logged angle, false to integrate the logged velocity.
    pub angle: bool,
    /// Number of rows of the moving average.
    pub smooth: usize,
    /// Delay of the logged velocity, s.
    pub delay_s: f64,
}

impl Reading {
    /// Returns the reconstructed trajectory.
    pub fn trajectory(
        &self,
        times: &[f64],
        trajectory: &Trajectory,
        logged: &Readings,
    ) -> Trajectory {
        const PARTS: usize = 3;
        let undelayed = |at: usize| {
            // The velocity at this time is logged one delay later.
            let when = times[at] + self.delay_s;
            let next = times.partition_point(|t| *t < when).min(times.len() - 1);
            logged.velocity[next]
        };
        let velocity: Vec<f64> = (0..times.len()).map(undelayed).collect();
        let velocity = moving_average(&velocity, self.smooth);
        let angles = if self.angle {
            moving_average(&logged.position, self.smooth)
        } else {
            let mut at = trajectory.points[trajectory.rows[0]].angle;
            let sum = (0..velocity.len()).map(|row| {
                if row > 0 {
                    let seconds = times[row] - times[row - 1];
                    at += 0.5 * (velocity[row] + velocity[row - 1]) * seconds;
                }
                at
            });
            sum.collect()
        };
        let mut read = Trajectory {
            points: Vec::with_capacity(PARTS * trajectory.rows.len()),
            rows: Vec::with_capacity(trajectory.rows.len()),
            accelerations: trajectory.accelerations.clone(),
        };
        for row in 0..angles.len() {
            if row > 0 {
                for part in 1..PARTS {
                    let share = part as f64 / PARTS as f64;
                    let between = |of: &[f64]| of[row - 1] + share * (of[row] - of[row - 1]);
                    let (t, angle, velocity) =
                        (between(times), between(&angles), between(&velocity));
                    read.points.push(Point { t, angle, velocity });
                }
            }
            let point = Point { t: times[row], angle: angles[row], velocity: velocity[row] };
            read.points.push(point);
            read.rows.push(read.points.len() - 1);
        }
        read
    }
}

/// Number of rows from which the initial contact torque is estimated.
const START_ROWS: usize = 30;
/// Number of trial values in each direction, from zero to the static level.
const TRIALS_PER_SIDE: i32 = 8;

/// A trajectory from its first row on.
pub(super) struct Started {
    pub trajectory: Trajectory,
    /// Contact torque at the start, as a share of the Coulomb level.
    pub held: f64,
}

/// Cuts a trajectory before its first row and estimates the contact torque there from the first rows' torque.
///
/// The log alone does not contain the motion before its first row.
pub(super) fn estimate_start(
    machine: &Machine,
    run: &RunPlan,
    trajectory: &Trajectory,
    logged: &Readings,
    channel: impl Fn(&[f64]) -> Vec<f64>,
) -> Started {
    let first = trajectory.rows[0];
    let cut = Trajectory {
        points: trajectory.points[first..].to_vec(),
        rows: trajectory.rows.iter().map(|row| row - first).collect(),
        accelerations: trajectory.accelerations.clone(),
    };
    let rows = START_ROWS.min(cut.rows.len());
    let start = Trajectory {
        points: cut.points[..=cut.rows[rows - 1]].to_vec(),
        rows: cut.rows[..rows].to_vec(),
        accelerations: cut.accelerations[..rows].to_vec(),
    };
    let seal = &machine.mechanism.joint.seal;
    let error = |held: f64| -> f64 {
        let torques = machine.torques(std::iter::once(RunInput { held, ..run.input(&start) }));
        let torque: Vec<f64> = torques.into_iter().flatten().collect();
        channel(&torque).iter().zip(&logged.torque).map(|(m, t)| (m - t) * (m - t)).sum()
    };
    let most = seal.static_nm / seal.coulomb_nm;
    let tried = (-TRIALS_PER_SIDE..=TRIALS_PER_SIDE)
        .map(|share| most * f64::from(share) / f64::from(TRIALS_PER_SIDE));
    // Without slip, the error is a parabola of the contact torque. Its minimum lies near the best trial value.
    let tried: Vec<(f64, f64)> = tried.map(|held| (error(held), held)).collect();
    let best = (0..tried.len()).min_by(|a, b| tried[*a].0.total_cmp(&tried[*b].0)).unwrap_or(0);
    let mut found = tried[best];
    if let [before, here, after] = tried[best.saturating_sub(1)..(best + 2).min(tried.len())] {
        let bend = before.0 - 2.0 * here.0 + after.0;
        let held = here.1 + 0.5 * (after.1 - here.1) * (before.0 - after.0) / bend;
        if held.is_finite() && held.abs() <= most && error(held) < found.0 {
            found.1 = held;
        }
    }
    Started { trajectory: cut, held: found.1 }
}

/// Returns the centred moving average over `rows` rows.
fn moving_average(values: &[f64], rows: usize) -> Vec<f64> {
    let half = rows / 2;
    (0..values.len())
        .map(|at| {
            let about = at.saturating_sub(half)..(at + half + 1).min(values.len());
            let count = about.len() as f64;
            values[about].iter().sum::<f64>() / count
        })
        .collect()
}
