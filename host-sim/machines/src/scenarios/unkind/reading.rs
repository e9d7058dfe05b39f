//! Plain readings of a log: what whoever has the log alone can make of the motion and of the state it begins in.
//!
//! No smoother, no filter of anyone's: angles joined by straight lines or velocities added up, smoothed over some rows
//! or not, the filter's delay taken out. They set the floor of a world ([`super::visible`]), and a better reading may go
//! below it.

use super::campaign::RunPlan;
use super::plant::{Machine, Point, Way};

/// The channels of a run that are not covariates, every row, lost ones included.
pub(super) struct Logged {
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    pub torque: Vec<f64>,
}

/// A plain method to read the motion between rows from a log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Straight from angle to angle; else the logged velocity added up.
    pub angle: bool,
    /// Rows smoothed over.
    pub smooth: usize,
    /// How late the velocity is, s.
    pub delay_s: f64,
}

impl Reading {
    /// The way as it is read.
    pub fn way(&self, run: &RunPlan, way: &Way, logged: &Logged) -> Way {
        const PARTS: usize = 3;
        let early = |at: usize| {
            // The velocity logged a delay later is that of now.
            let when = run.times[at] + self.delay_s;
            let next = run.times.partition_point(|t| *t < when).min(run.times.len() - 1);
            logged.velocity[next]
        };
        let velocity: Vec<f64> = (0..run.times.len()).map(early).collect();
        let velocity = mean_over(&velocity, self.smooth);
        let angles = if self.angle {
            mean_over(&logged.position, self.smooth)
        } else {
            let mut at = way.points[way.rows[0]].angle;
            let sum = (0..velocity.len()).map(|row| {
                if row > 0 {
                    let seconds = run.times[row] - run.times[row - 1];
                    at += 0.5 * (velocity[row] + velocity[row - 1]) * seconds;
                }
                at
            });
            sum.collect()
        };
        let mut read = Way {
            points: Vec::with_capacity(PARTS * way.rows.len()),
            rows: Vec::with_capacity(way.rows.len()),
            accelerations: way.accelerations.clone(),
        };
        for row in 0..angles.len() {
            if row > 0 {
                for part in 1..PARTS {
                    let share = part as f64 / PARTS as f64;
                    let between = |of: &[f64]| of[row - 1] + share * (of[row] - of[row - 1]);
                    let (t, angle, velocity) =
                        (between(&run.times), between(&angles), between(&velocity));
                    read.points.push(Point { t, angle, velocity });
                }
            }
            let point = Point { t: run.times[row], angle: angles[row], velocity: velocity[row] };
            read.points.push(point);
            read.rows.push(read.points.len() - 1);
        }
        read
    }
}

/// Rows by which what the contact holds at the first of them is found.
const FIRST_ROWS: usize = 30;
/// Shares of the static level that are tried, to either side.
const TRIED: i32 = 8;

/// A way from its first row on, and what the contact holds there, found by the first rows' torque: nobody who has the
/// log alone knows what was before.
pub(super) fn begun(
    machine: &Machine,
    run: &RunPlan,
    way: &Way,
    logged: &Logged,
    channel: impl Fn(&[f64]) -> Vec<f64>,
) -> (Way, f64) {
    let first = way.rows[0];
    let begun = Way {
        points: way.points[first..].to_vec(),
        rows: way.rows.iter().map(|row| row - first).collect(),
        accelerations: way.accelerations.clone(),
    };
    let rows = FIRST_ROWS.min(begun.rows.len());
    let start = Way {
        points: begun.points[..=begun.rows[rows - 1]].to_vec(),
        rows: begun.rows[..rows].to_vec(),
        accelerations: begun.accelerations[..rows].to_vec(),
    };
    let seal = &machine.joint.seal;
    let error = |held: f64| -> f64 {
        let torques = machine.torques(std::iter::once((&run.condition, &start, held)));
        let torque: Vec<f64> = torques.into_iter().flatten().collect();
        channel(&torque).iter().zip(&logged.torque).map(|(m, t)| (m - t) * (m - t)).sum()
    };
    let most = seal.static_nm / seal.coulomb_nm;
    let tried = (-TRIED..=TRIED).map(|share| most * f64::from(share) / f64::from(TRIED));
    // Errors are a parabola of what is held, as long as nothing slips: its bottom lies near the best of the tried.
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
    (begun, found.1)
}

/// The mean of so many rows about each.
fn mean_over(values: &[f64], rows: usize) -> Vec<f64> {
    let half = rows / 2;
    (0..values.len())
        .map(|at| {
            let about = at.saturating_sub(half)..(at + half + 1).min(values.len());
            let count = about.len() as f64;
            values[about].iter().sum::<f64>() / count
        })
        .collect()
}
