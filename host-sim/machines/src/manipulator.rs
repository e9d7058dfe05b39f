//! The manipulator of three joints driven by fluidic muscles, simulated.
//!
//! The arm of the third paper (see `docs/references.md`): three joints, the masses and lengths of its Table 2, a
//! pair of muscles at each joint, driven through valves by the control signals of its figures 3 and 5, 110 s at
//! 1 kHz, ten repeats averaged. What the paper does not print is chosen here and said where it stands: how the
//! arm hangs ([`rigid_body`]), the size of its muscles ([`muscle`]), and how its joints rub ([`friction`]), which
//! is richer than any model that is fitted to it.
//!
//! [`rigid_body`] and [`muscle`] are what an experimenter knows of such an arm; [`friction`] is the truth to be
//! found; [`course`] is what the valves are told; [`mod@record`] puts them together.

pub mod course;
pub mod friction;
pub mod muscle;
pub mod record;
pub mod rigid_body;

pub use course::Course;
pub use record::{Averaged, Recording, record};

use crate::log::{Log, LoggedRun};
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// Number of joints.
pub const JOINTS: usize = 3;

/// A campaign: the printed course first, courses of its own after it.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// What the valves were told in each run.
    pub courses: Vec<Course>,
    /// What was logged in each.
    pub runs: Vec<Averaged>,
}

/// Records the printed course and `others` more; the same seed, the same campaign.
pub fn campaign(seed: u64, others: usize, how: &Recording) -> Campaign {
    let mut random = Pcg64::seed_from_u64(seed);
    let drawn = (0..others).map(|_| Course::drawn(&mut random));
    let courses: Vec<Course> = std::iter::once(Course::printed()).chain(drawn).collect();
    let each = (0u64..).map(|index| seed.wrapping_mul(1009).wrapping_add(index));
    let runs = courses.iter().zip(each).map(|(course, seed)| record(course, how, seed)).collect();
    Campaign { courses, runs }
}

impl Campaign {
    /// Its log: `time_s` and each joint's columns, named by the joint's number at their end.
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
