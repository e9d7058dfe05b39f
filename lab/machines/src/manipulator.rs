//! Simulated manipulator with three joints and fluidic muscles.
//!
//! It is the arm of the third paper (see `docs/src/reference/literature.md`). It has three joints, the masses and
//! lengths of Table 2, and a pair of muscles at each joint. The valves receive the control signals of figures 3 and 5.
//! Runs take 110 s at 1 kHz and are averaged over ten repeats.
//!
//! The paper does not give the mounting of the arm ([`rigid_body`]), the size of the muscles ([`muscle`]) and the
//! friction of the joints ([`friction`]). These modules state the assumptions. The friction is more detailed than any
//! model that is fitted to it.
//!
//! [`rigid_body`] and [`muscle`] are known to an experimenter. [`friction`] is the ground truth. [`course`] defines the
//! set pressures of the valves. [`mod@record`] simulates the runs.

pub mod course;
pub mod friction;
pub mod muscle;
pub mod record;
pub mod rigid_body;

pub use course::Course;
pub use record::{Averaged, Recording, record};

use rand::SeedableRng;
use rand_pcg::Pcg64;
use simulated_machines::{Log, LoggedRun};

/// Number of joints.
pub const JOINTS: usize = 3;

/// A campaign: the course of the paper, followed by random courses.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// Set pressures of each run.
    pub courses: Vec<Course>,
    /// Averaged log of each run.
    pub runs: Vec<Averaged>,
}

/// Records the course of the paper and `others` random courses. The same seed gives the same campaign.
pub fn campaign(seed: u64, others: usize, how: &Recording) -> Campaign {
    let mut random = Pcg64::seed_from_u64(seed);
    let drawn = (0..others).map(|_| Course::draw(&mut random));
    let courses: Vec<Course> = std::iter::once(Course::printed()).chain(drawn).collect();
    let each = (0u64..).map(|index| seed.wrapping_mul(1009).wrapping_add(index));
    let runs = courses.iter().zip(each).map(|(course, seed)| record(course, how, seed)).collect();
    Campaign { courses, runs }
}

impl Campaign {
    /// Returns the log: `time_s` and the columns of each joint, with the number of the joint as suffix.
    pub fn log(&self) -> Log {
        let named = |joint: usize| {
            record::COLUMNS.iter().map(move |column| format!("{column}_{}", joint + 1))
        };
        let columns = std::iter::once("time_s".to_owned()).chain((0..JOINTS).flat_map(named));
        let run = |(index, run): (usize, &Averaged)| LoggedRun {
            name: if index == 0 { "printed".to_owned() } else { format!("other-{index}") },
            columns: std::iter::once(&run.time_s)
                .chain(run.joints.iter().flatten())
                .cloned()
                .collect(),
        };
        Log { columns: columns.collect(), runs: self.runs.iter().enumerate().map(run).collect() }
    }
}
