//! The torque's measuring channel, applied to simulated torques.
//!
//! A first-order low-pass of time constant `tau` with input `T` follows, row by row,
//!
//! ```text
//! y -> y + (T - y) (1 - exp(-dt / tau))
//! ```
//!
//! Filters of a higher order are approximated by several such stages in series, each with its share of the delay. An
//! averaging logger is a moving average, `y = (1 / w) integral of T over the last w`, with delay `w / 2`. Removing the
//! filter from the measured torque would amplify the noise added after it. The filter is therefore applied to the
//! model's torque, to its derivatives and to every column compared with them: the fitted friction is that of the
//! shaft. Before the first row the input is taken as the first measured torque.

use super::torque_low_pass::{LowPassShape, MAX_STAGES, TorqueLowPass};
use super::track::Track;
use compensator_core::Real;

/// State of a track's low-pass filter, advanced row by row.
pub struct TrackLowPass<'a, T> {
    track: &'a Track,
    low_pass: TorqueLowPass,
    /// Gain of a stage for the track's own period, see [`TorqueLowPass::stage_gain`].
    gain: f64,
    outputs: [T; MAX_STAGES],
    mean: RunningMean<T>,
}

/// State of a moving average: the integral of its input at the end of each row.
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

    /// Holds the input at `value` for `period_s` and returns the mean over the last `window_s`.
    fn advance(&mut self, value: T, period_s: f64, window_s: f64) -> T {
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

impl<'a, T: Real<Setting = T>> TrackLowPass<'a, T> {
    /// Creates the filter for a torque, starting from the first measured torque; `None` if the track has no filter.
    pub fn for_torque(track: &'a Track) -> Option<Self> {
        Self::new(track, track.torque_low_pass, T::from_f64(*track.torque.first()?))
    }

    /// Creates the filter for an increment of the torque, starting from 0; `None` if the track has no filter.
    pub fn for_increment(track: &'a Track) -> Option<Self> {
        Self::new(track, track.torque_low_pass, T::zero())
    }

    fn new(track: &'a Track, low_pass: TorqueLowPass, before: T) -> Option<Self> {
        (low_pass.time_s > 0.0).then(|| Self {
            track,
            low_pass,
            gain: low_pass.stage_gain(track.period_s),
            outputs: [before; MAX_STAGES],
            mean: RunningMean::new(before),
        })
    }

    /// Advances by one row with this input and returns the output.
    pub fn filter(&mut self, row: usize, value: T) -> T {
        let ratio = self.track.period_ratio.as_ref().map(|ratios| ratios[row]);
        if self.low_pass.shape == LowPassShape::RunningMean {
            let period_s = self.track.period_s * ratio.unwrap_or(1.0);
            return self.mean.advance(value, period_s, 2.0 * self.low_pass.time_s);
        }
        let row_gain = |ratio: f64| self.low_pass.stage_gain(self.track.period_s * ratio);
        let gain = T::from_f64(ratio.map_or(self.gain, row_gain));
        self.outputs.iter_mut().take(self.low_pass.shape.stages()).fold(value, |value, output| {
            *output = *output + (value - *output) * gain;
            *output
        })
    }
}

/// Returns the autocorrelation of filtered white noise at lags of one and two rows; 0 without a filter.
pub fn noise_autocorrelation(track: &Track) -> [f64; 2] {
    /// Length of the impulse response, in delays of the filter; the remainder is below 1e-6.
    const RESPONSE_DELAYS: f64 = 16.0;
    let even = Track::even(Vec::new(), Vec::new(), track.period_s);
    let Some(mut low_pass) = TrackLowPass::new(&even, track.torque_low_pass, 0.0) else {
        return [0.0; 2];
    };
    let rows =
        (RESPONSE_DELAYS * track.torque_low_pass.time_s / track.period_s).ceil() as usize + 3;
    let response: Vec<f64> =
        (0..rows).map(|row| low_pass.filter(row, if row == 0 { 1.0 } else { 0.0 })).collect();
    let product =
        |lag: usize| response.iter().zip(&response[lag..]).map(|(a, b)| a * b).sum::<f64>();
    [1, 2].map(|lag| product(lag) / product(0))
}

/// Filters a column that is added to the model's torque.
pub fn filter_column(track: &Track, column: Vec<f64>) -> Vec<f64> {
    let Some(mut low_pass) = TrackLowPass::for_increment(track) else { return column };
    column.into_iter().enumerate().map(|(row, value)| low_pass.filter(row, value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use crate::simulate::{Resolution, simulate};
    use compensator_core::{LawKind, ParameterId as Id, Parameters, Sample};

    #[test]
    fn filter_column_with_step_follows_time_constant() {
        let mut track = Track::even(vec![Sample::default(); 500], vec![0.0; 500], 1e-3);
        track.torque_low_pass = TorqueLowPass { time_s: 0.05, shape: LowPassShape::FirstOrder };
        let out = filter_column(&track, vec![2.0; 500]);
        let expected = 2.0 * (1.0 - (-0.1f64 / 0.05).exp());
        assert!((out[99] - expected).abs() < 1e-12, "{}", out[99]);
        // Uneven rows of the same total time.
        track.period_ratio = Some([0.5, 1.5].repeat(250));
        let uneven = filter_column(&track, vec![2.0; 500]);
        assert!((uneven[99] - expected).abs() < 1e-12, "{}", uneven[99]);
    }

    #[test]
    fn filter_column_with_every_shape_has_same_delay_and_own_edge() {
        let step = |shape: LowPassShape, ratios: Option<Vec<f64>>| {
            let mut track = Track::even(vec![Sample::default(); 500], vec![0.0; 500], 1e-3);
            track.torque_low_pass = TorqueLowPass { time_s: 0.03, shape };
            track.period_ratio = ratios;
            filter_column(&track, vec![1.0; 500])
        };
        // The integral of (1 - step response) is the delay, less one row: the response starts within its row.
        let late_s = |out: &[f64]| out.iter().map(|y| 1e-3 * (1.0 - y)).sum::<f64>();
        for shape in LowPassShape::ALL {
            let out = step(shape, None);
            let late = late_s(&out);
            assert!((late - 0.03).abs() < 1.2e-3, "{shape:?}: {late} s");
            let uneven = step(shape, Some([0.5, 1.5].repeat(250)));
            let difference = (uneven[99] - out[99]).abs() + (uneven[9] - out[9]).abs();
            // The second stage holds the first stage's output constant within a row.
            let tolerance = if shape == LowPassShape::SecondOrder { 0.01 } else { 1e-9 };
            assert!(
                difference < tolerance,
                "{shape:?}: uneven rows of the same total time differ by {difference}"
            );
        }
        let [first, second, mean] = LowPassShape::ALL.map(|shape| step(shape, None));
        assert!(first[4] > 2.0 * second[4] && (mean[29] - 0.5).abs() < 1e-9 && mean[59] > 0.999);
        assert!(first[99] < 0.98 && second[99] < 0.995);
    }

    #[test]
    fn simulate_with_low_pass_filters_derivatives() {
        let velocity = |row: usize| 0.5 * (0.02 * row as f64).sin();
        let samples = (0..2000)
            .map(|row| Sample { velocity_rad_s: velocity(row), ..Sample::default() })
            .collect();
        let mut track = Track::even(samples, vec![0.1; 2000], 1e-3);
        track.torque_low_pass = TorqueLowPass { time_s: 0.02, shape: LowPassShape::RunningMean };
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
        // Delayed, and bounded by the friction level.
        assert!(low[0].abs() < 0.2 && low.iter().all(|torque| torque.abs() < 1.66));
    }
}
