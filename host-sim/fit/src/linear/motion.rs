//! The motion of a log in long columns, as regressors need it.
//!
//! All runs stand behind each other. What is derived, a position without an encoder, a velocity without the noise of single
//! rows, an acceleration, is derived here once, so that a fit and a prediction on another log derive it alike.

use super::operator::{later, low_pass, running_mean, smooth};
use crate::torque_low_pass::{LowPassShape, TorqueLowPass};
use joint_log::statistics::quantile_by_count;
use joint_log::{Dataset, JointKind, Quantity, Run, segments};
use std::ops::Range;

/// Rows over which a velocity is averaged beside a logged position.
const SMOOTHED_ROWS: usize = 5;

/// Time and motion of all rows. Units are those of the log: rad or m, s.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Kind of the joint.
    pub joint: JointKind,
    /// Rows of each run.
    pub runs: Vec<Range<usize>>,
    /// Median sample period, s.
    pub step_s: f64,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Position: logged, or integrated from the velocity within each run.
    pub position: Vec<f64>,
    /// True if the position is logged.
    pub has_position: bool,
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Velocity without its noise of single rows, for regressors that bend near zero speed.
    pub smooth_velocity: Vec<f64>,
    /// Acceleration, measured or derived.
    pub acceleration: Vec<f64>,
    /// True if time continues from run to run, as on the clock of a campaign.
    pub has_campaign_clock: bool,
}

impl Motion {
    /// Collects the motion of a log.
    pub fn new(data: &Dataset) -> Self {
        let runs = run_ranges(data);
        let long =
            |of: &dyn Fn(&Run) -> Vec<f64>| data.runs.iter().flat_map(of).collect::<Vec<_>>();
        let time_s = long(&|run| run.time_s.clone());
        let velocity = long(&|run| run.velocity.clone());
        let has_position = data.runs.iter().all(|run| run.get(Quantity::Position).is_some());
        let position = long(&|run| match run.get(Quantity::Position).filter(|_| has_position) {
            Some(position) => position.to_vec(),
            None => integrated(run),
        });
        let smooth_velocity = match has_position {
            true => smooth(&velocity, &runs, SMOOTHED_ROWS),
            false => velocity.clone(),
        };
        Self {
            joint: data.joint,
            step_s: median_step(&time_s, &runs),
            acceleration: long(&|run| run.acceleration_or_derived().into_owned()),
            has_campaign_clock: has_campaign_clock(data.runs.iter()),
            runs,
            time_s,
            position,
            has_position,
            velocity,
            smooth_velocity,
        }
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Returns true if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns values as a torque channel would log them that is late by `late_s` and has a low-pass.
    pub fn as_logged(&self, values: &[f64], late_s: f64, low_pass: TorqueLowPass) -> Vec<f64> {
        let rows = low_pass.time_s / self.step_s;
        let filtered = match low_pass.shape {
            _ if rows <= 0.0 => values.to_vec(),
            LowPassShape::FirstOrder => self::low_pass(values, &self.runs, rows),
            LowPassShape::SecondOrder => {
                let first = self::low_pass(values, &self.runs, 0.5 * rows);
                self::low_pass(&first, &self.runs, 0.5 * rows)
            }
            LowPassShape::RunningMean => running_mean(values, &self.runs, 2.0 * rows),
        };
        if late_s == 0.0 { filtered } else { later(&filtered, &self.runs, late_s / self.step_s) }
    }
}

/// Returns the rows of each run in long columns.
fn run_ranges(data: &Dataset) -> Vec<Range<usize>> {
    let mut at = 0;
    let range = |run: &Run| {
        at += run.len();
        at - run.len()..at
    };
    data.runs.iter().map(range).collect()
}

/// Returns the displacement of a run without a position, by the trapezoid sum of its velocity over unbroken stretches.
fn integrated(run: &Run) -> Vec<f64> {
    let mut position = vec![0.0; run.len()];
    for stretch in segments(run) {
        for row in stretch {
            let before = row.saturating_sub(1);
            let seconds = run.time_s[row] - run.time_s[before];
            let mean = 0.5 * (run.velocity[row] + run.velocity[before]);
            position[row] = position[before] + mean * seconds;
        }
    }
    position
}

fn median_step(time_s: &[f64], runs: &[Range<usize>]) -> f64 {
    let steps = runs.iter().flat_map(|run| time_s[run.clone()].windows(2).map(|w| w[1] - w[0]));
    let positive = steps.filter(|step| *step > 0.0).collect();
    quantile_by_count(positive, 0.5).unwrap_or_default().max(1e-9)
}

/// Returns true if no two runs overlap in time: the clock of a campaign goes on from run to run. If every run starts at the same
/// time, the order of the runs is unknown.
pub fn has_campaign_clock<'a>(runs: impl Iterator<Item = &'a Run>) -> bool {
    let ends = |run: &Run| Some([*run.time_s.first()?, *run.time_s.last()?]);
    let mut ends: Vec<[f64; 2]> = runs.filter_map(ends).collect();
    ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    ends.windows(2).all(|pair| pair[0][1] <= pair[1][0])
}

/// Returns a column of a log in all rows; `None` if a run lacks it.
pub(crate) fn long(data: &Dataset, name: &str) -> Option<Vec<f64>> {
    let columns = data.runs.iter().map(|run| data.column(run, name));
    Some(columns.collect::<Option<Vec<&[f64]>>>()?.concat())
}
