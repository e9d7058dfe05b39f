//! What the valves are told over a run: a set pressure for each muscle, in steps.
//!
//! The paper's course (its figures 3 and 5): all muscles at 550 kPa, then one of each pair let down for thirty
//! seconds and filled again, then the other. Other courses have the same pattern with times and depths of
//! their own, so that what was fitted on one can be judged on another.

use super::muscle::Side;
use rand::{Rng, RngExt};

/// Pressure of a filled muscle, Pa.
pub const FILLED_PA: f64 = 550e3;

/// Length of the paper's runs, s.
pub const SECONDS: f64 = 110.0;

/// A muscle is let down for a while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Release {
    /// Which of the pair.
    pub side: Side,
    /// From when, s.
    pub from_s: f64,
    /// Until when, s.
    pub until_s: f64,
    /// By how much, Pa.
    pub by_pa: f64,
}

/// A run's commands: what each joint's pair does.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// Releases of each joint, in any order.
    pub joints: [Vec<Release>; 3],
}

impl Course {
    /// Figures 3 (joints 1 and 3) and 5 (joint 2) of the paper.
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

    /// The same pattern with other times and depths, each joint by itself.
    pub fn drawn(random: &mut impl Rng) -> Self {
        let mut joint = || {
            let sides =
                if random.random() { [Side::Left, Side::Right] } else { [Side::Right, Side::Left] };
            // Between releases all comes to rest, as in the paper: ten seconds and more.
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

    /// Set pressure of a muscle at a time, Pa.
    pub fn set_pa(&self, joint: usize, side: Side, time_s: f64) -> f64 {
        let released = |of: &&Release| of.side == side && (of.from_s..of.until_s).contains(&time_s);
        let down: f64 = self.joints[joint].iter().filter(released).map(|of| of.by_pa).sum();
        (FILLED_PA - down).max(0.0)
    }
}
