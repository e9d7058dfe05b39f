//! The three pool tests with every arm, over seeds; what is measured of each, and one course of each to be drawn.
//!
//! A seed is another day of the same joint: other sensor noise, another temperature at the start.

use super::arms::Arm;
use super::measures::{self, Spread};
use super::tasks::{Conditions, Course, Task, run};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Temperature a joint begins a day at, deg C.
const TEMPERATURE_C: std::ops::Range<f64> = 16.0..26.0;

/// A number that is taken of a course.
pub struct Measure {
    /// Its column.
    pub column: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// How.
    pub of: fn(&Course) -> f64,
}

/// What is measured of a task, the most important first.
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
            Measure { column: "times stuck", unit: "", of: measures::sticks },
        ],
        Task::Hold => &[Measure { column: "swing", unit: "rad", of: measures::hold_swing_rad }],
        Task::Impact => &[
            Measure { column: "time to target", unit: "s", of: measures::time_to_target_s },
            Measure { column: "overshoot", unit: "%", of: measures::overshoot_percent },
        ],
    }
}

/// One arm in one task.
#[derive(Clone, Debug)]
pub struct Result {
    /// The arm's name.
    pub arm: &'static str,
    /// Each measure's values, a value per seed.
    pub values: Vec<Vec<f64>>,
    /// The course of the first seed.
    pub course: Course,
    /// Seeds in which the driver stopped by itself.
    pub stopped: usize,
}

impl Result {
    /// Mean and spread of a measure.
    pub fn spread(&self, measure: usize) -> Spread {
        Spread::of(&self.values[measure])
    }
}

/// Conditions of a seed.
pub fn day(joint: &Conditions, seed: u64) -> Conditions {
    let mut random = Pcg64::seed_from_u64(seed);
    Conditions { temperature_c: random.random_range(TEMPERATURE_C), seed, ..*joint }
}

/// Makes every arm do a task on so many days.
///
/// # Errors
/// The first run that could not be made, with its arm.
pub fn experiment(
    task: Task,
    arms: &[Arm],
    joint: &Conditions,
    seeds: u64,
) -> std::result::Result<Vec<Result>, String> {
    let each = |arm: &Arm| {
        let days: Vec<u64> = (0..seeds).collect();
        let courses = days.into_par_iter().map(|seed| {
            let course = run(task, arm, &day(joint, joint.seed.wrapping_add(seed)))?;
            let values: Vec<f64> = measures(task).iter().map(|of| (of.of)(&course)).collect();
            Ok((values, (seed == 0).then_some(course.clone()), course.stopped))
        });
        let courses: Vec<(Vec<f64>, Option<Course>, bool)> = courses
            .collect::<std::result::Result<_, String>>()
            .map_err(|why| format!("{}: {why}", arm.name))?;
        Ok(Result {
            arm: arm.name,
            values: (0..measures(task).len())
                .map(|at| courses.iter().map(|course| course.0[at]).collect())
                .collect(),
            stopped: courses.iter().filter(|course| course.2).count(),
            course: courses.into_iter().find_map(|course| course.1).unwrap_or_default(),
        })
    };
    arms.par_iter().map(each).collect()
}
