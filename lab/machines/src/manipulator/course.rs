//! Set pressures of the muscles over a run, as steps.
//!
//! In the paper's course (figures 3 and 5), all muscles have 550 kPa. Then one muscle of each pair is released for
//! thirty seconds and filled again, and then the other. Random courses have the same pattern with other times and
//! pressures, so that a model fitted on one course can be evaluated on another.

use super::muscle::Side;
use rand::{Rng, RngExt};

/// Pressure of a filled muscle, Pa.
pub const FILLED_PA: f64 = 550e3;

/// Length of the paper's runs, s.
pub const SECONDS: f64 = 110.0;

/// A temporary reduction of the pressure of one muscle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Release {
    /// Muscle of the pair.
    pub side: Side,
    /// Start time, s.
    pub from_s: f64,
    /// End time, s.
    pub until_s: f64,
    /// Pressure reduction, Pa.
    pub by_pa: f64,
}

/// Pressure commands of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// Releases of each joint, in any order.
    pub joints: [Vec<Release>; 3],
}

impl Course {
    /// Returns the course of figures 3 (joints 1 and 3) and 5 (joint 2) of the paper.
    pub fn printed() -> Self {
        let releases = |first: Side, second: Side, kpa: [f64; 2]| {
            vec![
                Release { side: first, from_s: 10.0, until_s: 40.0, by_pa: 1e3 * kpa[0] },
                Release { side: second, from_s: 60.0, until_s: 90.0, by_pa: 1e3 * kpa[1] },
            ]
        };
        let outer = releases(Side::Right, Side::Left, [350.0, 400.0]);
        let middle = releases(Side::Left, Side::Right, [350.0, 300.0]);
        Self { joints: [outer.clone(), middle, outer] }
    }

    /// Draws a course of the same pattern with other times and pressures, independently for each joint.
    pub fn draw(random: &mut impl Rng) -> Self {
        let mut joint = || {
            let sides =
                if random.random() { [Side::Left, Side::Right] } else { [Side::Right, Side::Left] };
            // At least ten seconds between releases, so that the arm comes to rest as in the paper.
            [(8.0, 35.0), (60.0, 85.0)]
                .into_iter()
                .zip(sides)
                .map(|((from, until), side)| Release {
                    side,
                    from_s: from + random.random_range(0.0..8.0),
                    until_s: until + random.random_range(0.0..12.0),
                    by_pa: random.random_range(150e3..400e3),
                })
                .collect()
        };
        Self { joints: [joint(), joint(), joint()] }
    }

    /// Returns the set pressure of a muscle at a time, Pa.
    pub fn set_pa(&self, joint: usize, side: Side, time_s: f64) -> f64 {
        let released = |of: &&Release| of.side == side && (of.from_s..of.until_s).contains(&time_s);
        let down: f64 = self.joints[joint].iter().filter(released).map(|of| of.by_pa).sum();
        (FILLED_PA - down).max(0.0)
    }
}
