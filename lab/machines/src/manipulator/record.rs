//! Simulated runs of the arm, with sensor noise, averaged over repeats.
//!
//! The state consists of three angles, three speeds, three friction deflections per joint, and six pressures. It is
//! integrated by the classic Runge-Kutta method. A run starts with a hanging arm and empty muscles, which are filled
//! first.
//!
//! Repeats differ in the regulation error of the valves, the friction level and the initial angles. As in the paper,
//! the log is the average of all repeats, sample by sample.

use super::course::Course;
use super::friction::{ELEMENTS, Friction, JOINTS};
use super::muscle::{PAIRS, Side};
use super::rigid_body::TABLE_2;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Minimum number of integration steps per row. At 1 kHz a step takes 0.5 ms; the stiffest element yields in 3 ms.
const MIN_STEPS_PER_ROW: usize = 2;

/// Standard deviation of the regulation error of a valve, Pa.
const VALVE_DEVIATION_PA: f64 = 2e3;
/// Relative standard deviation of the friction level.
const LEVEL_DEVIATION: f64 = 0.03;
/// Standard deviation of the initial angles, rad.
const INITIAL_ANGLE_DEVIATION_RAD: f64 = 2e-3;
/// Noise of an angle, rad, as of an encoder with 0.02 degrees.
const ANGLE_NOISE_RAD: f64 = 3.5e-4;
/// Noise of a speed, rad/s.
const SPEED_NOISE_RAD_S: f64 = 5e-3;
/// Noise of a pressure, Pa.
const PRESSURE_NOISE_PA: f64 = 500.0;

/// Columns of a joint, in the order of [`Averaged::joints`].
pub const COLUMNS: [&str; 5] =
    ["velocity_rad_s", "torque_nm", "position_rad", "pressure_left_pa", "pressure_right_pa"];

/// Recording parameters of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recording {
    /// Length, s.
    pub seconds: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Number of averaged repeats.
    pub repeats: usize,
    /// Standard deviation of the torque noise of each joint, Nm.
    pub noise_nm: f64,
}

impl Default for Recording {
    fn default() -> Self {
        Self { seconds: super::course::SECONDS, rate_hz: 1000.0, repeats: 10, noise_nm: 0.05 }
    }
}

/// Log of a run, averaged over its repeats.
#[derive(Clone, Debug, PartialEq)]
pub struct Averaged {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// The columns of each joint, in the order of [`COLUMNS`].
    pub joints: [[Vec<f64>; COLUMNS.len()]; 3],
}

const STATES: usize = 6 + 3 * ELEMENTS + 6;
type State = [f64; STATES];

/// Parameters of one repeat.
struct Repeat<'a> {
    course: &'a Course,
    friction: [Friction; 3],
    valves_pa: [[f64; 2]; 3],
}

/// Returns three consecutive states.
fn triple(state: &State, from: usize) -> [f64; 3] {
    [state[from], state[from + 1], state[from + 2]]
}

const SIDES: [Side; 2] = [Side::Left, Side::Right];

impl Repeat<'_> {
    /// Returns the gauge pressures of a joint (left, right), Pa.
    fn pressures(state: &State, joint: usize) -> [f64; 2] {
        let at = 6 + 3 * ELEMENTS + 2 * joint;
        [state[at], state[at + 1]]
    }

    /// Returns the pull of both muscles of a joint relative to that of 550 kPa in both.
    fn pull(state: &State, joint: usize) -> f64 {
        let [left, right] = Self::pressures(state, joint);
        ((left + right) / (2.0 * super::course::FILLED_PA)).max(0.0)
    }

    /// Returns the friction torque of a joint, Nm.
    fn friction_nm(&self, state: &State, joint: usize) -> f64 {
        self.friction[joint].torque_nm(triple(state, 6 + ELEMENTS * joint), state[3 + joint])
    }

    /// Returns the time derivative of the state.
    fn rates(&self, time_s: f64, state: &State) -> State {
        let (q, v) = (triple(state, 0), triple(state, 3));
        let torque = std::array::from_fn(|i| {
            PAIRS[i].torque_nm(Self::pressures(state, i), q[i]) - self.friction_nm(state, i)
        });
        let mut rates = [0.0; STATES];
        rates[..3].copy_from_slice(&v);
        rates[3..6].copy_from_slice(&TABLE_2.forward_dynamics(q, v, torque));
        for joint in 0..3 {
            let at = 6 + ELEMENTS * joint;
            let bent =
                self.friction[joint].rates(triple(state, at), v[joint], Self::pull(state, joint));
            rates[at..at + ELEMENTS].copy_from_slice(&bent);
            for (index, side) in SIDES.into_iter().enumerate() {
                let pressure = Self::pressures(state, joint)[index];
                let set = self.course.set_pa(joint, side, time_s) + self.valves_pa[joint][index];
                rates[6 + 3 * ELEMENTS + 2 * joint + index] =
                    PAIRS[joint].pressure_rate(side, pressure, set, q[joint], v[joint]);
            }
        }
        rates
    }

    /// Integrates one Runge-Kutta step. The commands change only at rows, so they are constant within a step.
    fn advance(&self, time_s: f64, state: &State, dt: f64) -> State {
        let moved =
            |rates: &State, h: f64| -> State { std::array::from_fn(|i| state[i] + h * rates[i]) };
        let a = self.rates(time_s, state);
        let b = self.rates(time_s, &moved(&a, 0.5 * dt));
        let c = self.rates(time_s, &moved(&b, 0.5 * dt));
        let d = self.rates(time_s, &moved(&c, dt));
        std::array::from_fn(|i| state[i] + dt / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]))
    }
}

/// Simulates one repeat and returns its columns.
fn simulate_repeat(course: &Course, how: &Recording, seed: u64) -> [[Vec<f64>; COLUMNS.len()]; 3] {
    let mut random = Pcg64::seed_from_u64(seed);
    let of = |size: f64| Normal::new(0.0, size).unwrap_or_else(|_| unreachable!("a size"));
    let mut draw = |size: f64| of(size).sample(&mut random);
    let parameters = Repeat {
        course,
        friction: JOINTS.map(|joint| {
            let level = 1.0 + draw(LEVEL_DEVIATION);
            Friction {
                coulomb_nm: level * joint.coulomb_nm,
                static_nm: level * joint.static_nm,
                ..joint
            }
        }),
        valves_pa: std::array::from_fn(|_| [draw(VALVE_DEVIATION_PA), draw(VALVE_DEVIATION_PA)]),
    };
    let mut state = [0.0; STATES];
    state[..3].iter_mut().for_each(|angle| *angle = draw(INITIAL_ANGLE_DEVIATION_RAD));
    let rows = rows(how);
    let mut columns: [[Vec<f64>; COLUMNS.len()]; 3] =
        std::array::from_fn(|_| std::array::from_fn(|_| Vec::with_capacity(rows)));
    let period = 1.0 / how.rate_hz;
    let steps = MIN_STEPS_PER_ROW.max((period / 5e-4).ceil() as usize);
    let dt = period / steps as f64;
    for row in 0..rows {
        for (joint, columns) in columns.iter_mut().enumerate() {
            let [left, right] = Repeat::pressures(&state, joint);
            let shown = [
                state[3 + joint] + draw(SPEED_NOISE_RAD_S),
                parameters.friction_nm(&state, joint) + draw(how.noise_nm),
                state[joint] + draw(ANGLE_NOISE_RAD),
                left + draw(PRESSURE_NOISE_PA),
                right + draw(PRESSURE_NOISE_PA),
            ];
            columns.iter_mut().zip(shown).for_each(|(column, value)| column.push(value));
        }
        for step in 0..steps {
            state = parameters.advance(row as f64 * period + step as f64 * dt, &state, dt);
        }
    }
    columns
}

/// Returns the number of rows of a run. It includes the start and the end.
fn rows(how: &Recording) -> usize {
    (how.seconds * how.rate_hz).round() as usize + 1
}

/// Records a course. The same seed and recording give the same rows.
pub fn record(course: &Course, how: &Recording, seed: u64) -> Averaged {
    let mut random = Pcg64::seed_from_u64(seed);
    let seeds: Vec<u64> = (0..how.repeats.max(1)).map(|_| random.random()).collect();
    let repeats: Vec<_> =
        seeds.into_par_iter().map(|seed| simulate_repeat(course, how, seed)).collect();
    let count = repeats.len() as f64;
    let joints = std::array::from_fn(|joint| {
        std::array::from_fn(|column| {
            let mean = |row: usize| {
                repeats.iter().map(|repeat| repeat[joint][column][row]).sum::<f64>() / count
            };
            (0..rows(how)).map(mean).collect()
        })
    });
    let time_s = (0..rows(how)).map(|row| row as f64 / how.rate_hz).collect();
    Averaged { time_s, joints }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn short(rate_hz: f64) -> Averaged {
        let how = Recording { seconds: 14.0, rate_hz, repeats: 1, noise_nm: 1e-9 };
        record(&Course::printed(), &how, 3)
    }

    #[test]
    fn record_with_released_muscles_turns_the_joints() {
        let run = short(1000.0);
        let angle = |joint: usize, at_s: usize| run.joints[joint][2][1000 * at_s].to_degrees();
        // The right muscles of joints 1 and 3 and the left one of joint 2 are released.
        assert!(angle(0, 13) < -10.0 && angle(1, 13) > 3.0 && angle(2, 13) < -5.0);
        for joint in 0..3 {
            assert!(angle(joint, 9).abs() < 1.0, "{joint}");
        }
    }

    #[test]
    fn record_with_smaller_step_gives_the_same_angles() {
        // The noise differs between the two rates, so the angles are averaged.
        let mean = |run: &Averaged, rate: usize, joint: usize| {
            let part = &run.joints[joint][2][13 * rate..];
            part.iter().sum::<f64>() / part.len() as f64
        };
        let (coarse, fine) = (short(1000.0), short(2000.0));
        for joint in 0..3 {
            let moved = mean(&coarse, 1000, joint) - mean(&fine, 2000, joint);
            assert!(moved.to_degrees().abs() < 0.05, "{joint} {}", moved.to_degrees());
        }
    }
}
