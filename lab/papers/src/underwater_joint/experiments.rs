//! Runs the three pool tests with every arm over several seeds, with measures and one course of each.
//!
//! A seed is another day of the same joint: other sensor noise and another initial temperature.

use super::arms::DriverArm;
use super::measures::{self, Spread};
use super::tasks::{Conditions, Course, Task, run};
use crate::PaperError;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Range of the initial temperature of a day, deg C.
const TEMPERATURE_C: std::ops::Range<f64> = 16.0..26.0;

/// A measure of a course.
pub struct Measure {
    /// Name of the column.
    pub column: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Computes the measure.
    pub of: fn(&Course) -> f64,
}

/// Measures of a task, most important first.
pub const fn measures(task: Task) -> &'static [Measure] {
    match task {
        Task::VelocityTracking => &[Measure {
            column: "mean velocity error",
            unit: "rpm",
            of: measures::velocity_error_rpm,
        }],
        Task::LowSpeed => &[
            Measure { column: "mean error", unit: "%", of: measures::error_rate_percent },
            Measure {
                column: "starting oscillation",
                unit: "s",
                of: measures::starting_oscillation_s,
            },
            Measure { column: "times stuck", unit: "", of: measures::stick_count },
        ],
        Task::Hold => &[Measure { column: "swing", unit: "rad", of: measures::hold_swing_rad }],
        Task::Impact => &[
            Measure { column: "time to target", unit: "s", of: measures::time_to_target_s },
            Measure { column: "overshoot", unit: "%", of: measures::overshoot_percent },
        ],
    }
}

/// Results of one arm in one task.
#[derive(Clone, Debug)]
pub struct TaskResult {
    /// Name of the arm.
    pub arm: &'static str,
    /// Values of each measure, one per seed.
    pub values: Vec<Vec<f64>>,
    /// Course of the first seed.
    pub course: Course,
    /// Number of seeds in which the driver stopped the joint.
    pub stopped: usize,
}

impl TaskResult {
    /// Returns mean and spread of a measure.
    pub fn spread(&self, measure: usize) -> Spread {
        Spread::of(&self.values[measure])
    }
}

/// Returns the conditions of a seed.
pub fn conditions_of_day(joint: &Conditions, seed: u64) -> Conditions {
    let mut random = Pcg64::seed_from_u64(seed);
    Conditions { temperature_c: random.random_range(TEMPERATURE_C), seed, ..*joint }
}

/// A run of one seed.
struct Day {
    /// Values of the measures of the task.
    values: Vec<f64>,
    /// The driver stopped the joint.
    is_stopped: bool,
    /// The course, of the first seed only: it is long.
    course: Option<Course>,
}

/// Runs a task with every arm, once per seed.
///
/// # Errors
/// Returns the arm and the reason of the first run that fails, or an error without seeds.
pub fn run_experiment(
    task: Task,
    arms: &[DriverArm],
    joint: &Conditions,
    seeds: u64,
) -> Result<Vec<TaskResult>, PaperError> {
    let each = |arm: &DriverArm| {
        let days: Vec<u64> = (0..seeds).collect();
        let courses = days.into_par_iter().map(|seed| {
            let course = run(task, arm, &conditions_of_day(joint, joint.seed.wrapping_add(seed)))?;
            let values = measures(task).iter().map(|of| (of.of)(&course)).collect();
            Ok(Day { values, is_stopped: course.stopped, course: (seed == 0).then_some(course) })
        });
        let mut days: Vec<Day> =
            courses.collect::<Result<_, PaperError>>().map_err(|error| error.of(arm.name))?;
        let first = days.first_mut().and_then(|day| day.course.take());
        Ok(TaskResult {
            arm: arm.name,
            values: (0..measures(task).len())
                .map(|at| days.iter().map(|day| day.values[at]).collect())
                .collect(),
            stopped: days.iter().filter(|day| day.is_stopped).count(),
            course: first.ok_or(PaperError::NoSeeds)?,
        })
    };
    arms.par_iter().map(each).collect()
}
