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

/// A way from its first row on, and what the contact holds there by the first torque: nobody who has the log alone
/// knows what was before.
pub(super) fn begun(machine: &Machine, run: &RunPlan, way: &Way, torque_nm: f64) -> (Way, f64) {
    let first = way.rows[0];
    let begun = Way {
        points: way.points[first..].to_vec(),
        rows: way.rows.iter().map(|row| row - first).collect(),
        accelerations: way.accelerations.clone(),
    };
    let start = Way {
        points: begun.points[..1].to_vec(),
        rows: vec![0],
        accelerations: begun.accelerations[..1].to_vec(),
    };
    let seal = &machine.joint.seal;
    // The torque is linear in what the contact holds.
    let [slack, coulomb] = [0.0, 1.0].map(|held| {
        let torques = machine.torques(std::iter::once((&run.condition, &start, held)));
        torques.into_iter().flatten().next().unwrap_or(0.0)
    });
    let held = if coulomb == slack { 0.0 } else { (torque_nm - slack) / (coulomb - slack) };
    let most = seal.static_nm / seal.coulomb_nm;
    (begun, held.clamp(-most, most))
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
