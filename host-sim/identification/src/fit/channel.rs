//! What the torque's channel makes of a torque.
//!
//! A current or a load cell is filtered before it is logged. A first-order low-pass of time constant `tau` answers a
//! torque `T` with
//!
//! ```text
//! y -> y + (T - y) (1 - exp(-dt / tau))
//! ```
//!
//! row by row. Filters of a higher order are nearer to several such stages one behind the other, each with its part of the
//! lateness; an averaging logger is a running mean, `y = (1 / w) integral of T over the last w`, late by `w / 2`. Taken off
//! the measured torque any of them would blow up whatever noise came after it; so it is put on the model's torque instead,
//! on its derivatives and on every column that is held beside them, and what is fitted remains the friction at the shaft.
//! What came before a track is the first measured torque.

use super::track::Track;
use compensator_core::Real;

/// Most stages of a low-pass.
const MOST_STAGES: usize = 2;

/// How a low-pass answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// One stage of first order.
    #[default]
    FirstOrder,
    /// Two of them, each half as late.
    SecondOrder,
    /// The mean of the last moments.
    RunningMean,
}

impl Shape {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::FirstOrder, Self::SecondOrder, Self::RunningMean];

    fn stages(self) -> usize {
        match self {
            Self::FirstOrder => 1,
            Self::SecondOrder => MOST_STAGES,
            Self::RunningMean => 0,
        }
    }
}

/// What a torque went through before it was logged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueLowPass {
    /// How late it makes a torque, s; 0 for none.
    pub time_s: f64,
    /// How it answers.
    pub shape: Shape,
}

/// A low-pass on its way along a track.
pub struct LowPass<'a, T> {
    track: &'a Track,
    low_pass: TorqueLowPass,
    /// Share of the way to its input that a stage goes in one of the track's own periods.
    share: f64,
    held: [T; MOST_STAGES],
    mean: RunningMean<T>,
}

/// What a running mean remembers: the integral of what went in, at the end of each row.
struct RunningMean<T> {
    before: T,
    times_s: Vec<f64>,
    integrals: Vec<T>,
    from: usize,
}

impl<T: Real<Setting = T>> RunningMean<T> {
    fn new(before: T) -> Self {
        Self { before, times_s: Vec::new(), integrals: Vec::new(), from: 0 }
    }

    /// The mean over the last `window_s` where `value` goes in for `period_s`.
    fn pass(&mut self, value: T, period_s: f64, window_s: f64) -> T {
        let (then_s, integral) = match (self.times_s.last(), self.integrals.last()) {
            (Some(time_s), Some(integral)) => (*time_s, *integral),
            _ => (0.0, T::zero()),
        };
        let now_s = then_s + period_s;
        let now = integral + value * T::from_f64(period_s);
        self.times_s.push(now_s);
        self.integrals.push(now);
        let begin_s = now_s - window_s;
        let begin = if begin_s <= 0.0 {
            self.before * T::from_f64(begin_s)
        } else {
            while self.times_s[self.from] < begin_s {
                self.from += 1;
            }
            let row = self.from;
            let (earlier_s, earlier) = if row == 0 {
                (0.0, T::zero())
            } else {
                (self.times_s[row - 1], self.integrals[row - 1])
            };
            let share = (begin_s - earlier_s) / (self.times_s[row] - earlier_s);
            earlier + (self.integrals[row] - earlier) * T::from_f64(share)
        };
        (now - begin) * T::from_f64(1.0 / window_s)
    }
}

impl<'a, T: Real<Setting = T>> LowPass<'a, T> {
    /// The low-pass of a track's torque, if it has one, from its first measured torque.
    pub fn of_torque(track: &'a Track) -> Option<Self> {
        Self::new(track, track.torque_low_pass, T::from_f64(*track.torque.first()?))
    }

    /// The same for what is added to a torque, from nothing.
    pub fn of_changes(track: &'a Track) -> Option<Self> {
        Self::new(track, track.torque_low_pass, T::zero())
    }

    fn new(track: &'a Track, low_pass: TorqueLowPass, before: T) -> Option<Self> {
        (low_pass.time_s > 0.0).then(|| Self {
            track,
            low_pass,
            share: share(track.period_s, low_pass),
            held: [before; MOST_STAGES],
            mean: RunningMean::new(before),
        })
    }

    /// What comes out in a row into which this goes.
    pub fn pass(&mut self, row: usize, value: T) -> T {
        let ratio = self.track.period_ratio.as_ref().map(|ratios| ratios[row]);
        if self.low_pass.shape == Shape::RunningMean {
            let period_s = self.track.period_s * ratio.unwrap_or(1.0);
            return self.mean.pass(value, period_s, 2.0 * self.low_pass.time_s);
        }
        let of_row = |ratio: f64| share(self.track.period_s * ratio, self.low_pass);
        let share = T::from_f64(ratio.map_or(self.share, of_row));
        self.held.iter_mut().take(self.low_pass.shape.stages()).fold(value, |value, held| {
            *held = *held + (value - *held) * share;
            *held
        })
    }
}

/// Share of the way to its input that a stage goes in a period.
fn share(period_s: f64, low_pass: TorqueLowPass) -> f64 {
    let of_stage_s = low_pass.time_s / low_pass.shape.stages().max(1) as f64;
    -(-period_s / of_stage_s).exp_m1()
}

/// What white noise remembers behind a track's low-pass, from one row to the next and two rows on, as shares of its variance;
/// nothing without a low-pass.
pub fn autocorrelation(track: &Track) -> [f64; 2] {
    /// So many times the lateness the answer to a blow is followed: what comes after is below 1e-6 of it.
    const FOLLOWED: f64 = 16.0;
    let even = Track::even(Vec::new(), Vec::new(), track.period_s);
    let Some(mut low_pass) = LowPass::new(&even, track.torque_low_pass, 0.0) else {
        return [0.0; 2];
    };
    let rows = (FOLLOWED * track.torque_low_pass.time_s / track.period_s).ceil() as usize + 3;
    let answer: Vec<f64> =
        (0..rows).map(|row| low_pass.pass(row, if row == 0 { 1.0 } else { 0.0 })).collect();
    let after = |rows: usize| answer.iter().zip(&answer[rows..]).map(|(a, b)| a * b).sum::<f64>();
    [1, 2].map(|rows| after(rows) / after(0))
}

/// A column beside a model's torque, as the torque's channel shows it.
pub fn passed(track: &Track, column: Vec<f64>) -> Vec<f64> {
    let Some(mut low_pass) = LowPass::of_changes(track) else { return column };
    column.into_iter().enumerate().map(|(row, value)| low_pass.pass(row, value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use crate::fit::simulate::{Resolution, simulate};
    use compensator_core::{LawKind, ParameterId as Id, Parameters, Sample};

    #[test]
    fn a_step_comes_through_as_the_time_constant_says() {
        let mut track = Track::even(vec![Sample::default(); 500], vec![0.0; 500], 1e-3);
        track.torque_low_pass = TorqueLowPass { time_s: 0.05, shape: Shape::FirstOrder };
        let out = passed(&track, vec![2.0; 500]);
        let expected = 2.0 * (1.0 - (-0.1f64 / 0.05).exp());
        assert!((out[99] - expected).abs() < 1e-12, "{}", out[99]);
        // Uneven rows of the same time in all.
        track.period_ratio = Some([0.5, 1.5].repeat(250));
        let uneven = passed(&track, vec![2.0; 500]);
        assert!((uneven[99] - expected).abs() < 1e-12, "{}", uneven[99]);
    }

    #[test]
    fn every_shape_is_late_by_its_time_and_its_edge_its_own() {
        let step = |shape: Shape, ratios: Option<Vec<f64>>| {
            let mut track = Track::even(vec![Sample::default(); 500], vec![0.0; 500], 1e-3);
            track.torque_low_pass = TorqueLowPass { time_s: 0.03, shape };
            track.period_ratio = ratios;
            passed(&track, vec![1.0; 500])
        };
        // What is missing of a step, summed over time, is how late it comes; a row less, for it answers within its row.
        let late_s = |out: &[f64]| out.iter().map(|y| 1e-3 * (1.0 - y)).sum::<f64>();
        for shape in Shape::ALL {
            let out = step(shape, None);
            let late = late_s(&out);
            assert!((late - 0.03).abs() < 1.2e-3, "{shape:?}: {late} s");
            let uneven = step(shape, Some([0.5, 1.5].repeat(250)));
            let apart = (uneven[99] - out[99]).abs() + (uneven[9] - out[9]).abs();
            // A second stage sees the first one's rows as steps.
            let most = if shape == Shape::SecondOrder { 0.01 } else { 1e-9 };
            assert!(
                apart < most,
                "{shape:?}: uneven rows of the same time in all differ by {apart}"
            );
        }
        let [first, second, mean] = Shape::ALL.map(|shape| step(shape, None));
        assert!(first[4] > 2.0 * second[4] && (mean[29] - 0.5).abs() < 1e-9 && mean[59] > 0.999);
        assert!(first[99] < 0.98 && second[99] < 0.995);
    }

    #[test]
    fn a_models_derivatives_go_through_it_too() {
        let velocity = |row: usize| 0.5 * (0.02 * row as f64).sin();
        let samples = (0..2000)
            .map(|row| Sample { velocity_rad_s: velocity(row), ..Sample::default() })
            .collect();
        let mut track = Track::even(samples, vec![0.1; 2000], 1e-3);
        track.torque_low_pass = TorqueLowPass { time_s: 0.02, shape: Shape::RunningMean };
        let joint = |coulomb: f64| {
            Parameters::<f64>::new(LawKind::Linear)
                .with(Id::CoulombTorque, coulomb)
                .with(Id::ViscousFriction, 0.3)
        };
        let torque = |coulomb: f64| {
            let mut torques = Vec::new();
            simulate(&joint(coulomb), &track, None, Resolution::PLAIN, |_, torque, _| {
                torques.push(torque);
                true
            });
            torques
        };
        let mut dual = joint(1.5).convert::<Dual<1>>();
        dual.set(Id::CoulombTorque, Dual::parameter(1.5, 0));
        let (low, high) = (torque(1.4999), torque(1.5001));
        simulate(&dual, &track, None, Resolution::PLAIN, |row, torque, _| {
            let difference = (high[row] - low[row]) / 2e-4;
            assert!((torque.gradient[0] - difference).abs() < 1e-8, "row {row}");
            true
        });
        // Late, and never further than the friction goes.
        assert!(low[0].abs() < 0.2 && low.iter().all(|torque| torque.abs() < 1.66));
    }
}
