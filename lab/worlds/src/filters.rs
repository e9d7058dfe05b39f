//! Filters of the simulated sensors, for rows at uneven times.
//!
//! They run at the log's rate, as those of a drive that logs what it filters. The initial state is rest at the first value.

use super::devices::SecondOrder;
use std::f64::consts::TAU;

/// Type of the torque's low-pass.
#[derive(Clone, Copy, Debug)]
pub(super) enum FilterShape {
    /// First order.
    First,
    /// Two first-order filters in series with the same total corner frequency.
    Second,
    /// Moving average of the last rows.
    Mean,
    /// Strain gauge with this damping ratio. The corner is its natural frequency.
    Gauge(f64),
}

impl FilterShape {
    /// Filters values at uneven times.
    pub fn filter(self, times: &[f64], values: &[f64], corner_hz: f64) -> Vec<f64> {
        match self {
            Self::First => low_pass(times, values, corner_hz),
            Self::Second => {
                // Two equal filters in series have their -3 dB point at sqrt(sqrt(2) - 1) of the corner of one.
                let each_hz = corner_hz / (2f64.sqrt() - 1.0).sqrt();
                low_pass(times, &low_pass(times, values, each_hz), each_hz)
            }
            Self::Mean => running_mean(times, values, 0.443 / corner_hz),
            Self::Gauge(damping) => {
                SecondOrder { natural_hz: corner_hz, damping }.low_pass(times, values)
            }
        }
    }

    /// Returns the end of its description.
    pub const fn words(self) -> &'static str {
        match self {
            Self::First => "",
            Self::Second => ", second order",
            Self::Mean => ", running mean",
            Self::Gauge(_) => ", strain gauge",
        }
    }
}

/// Returns the velocity from row to row, rad/s. That of the first row is `start`.
pub(super) fn differences(times: &[f64], angles: &[f64], start: f64) -> Vec<f64> {
    let rows = times.windows(2).zip(angles.windows(2));
    let velocities =
        rows.map(|(time, angle)| (angle[1] - angle[0]) / (time[1] - time[0]).max(1e-9));
    std::iter::once(start).chain(velocities).collect()
}

/// First-order low-pass for uneven times. The initial state is the first value.
pub(super) fn low_pass(times: &[f64], values: &[f64], corner_hz: f64) -> Vec<f64> {
    let mut passed = Vec::with_capacity(values.len());
    let mut last = values.first().copied().unwrap_or(0.0);
    for (at, value) in values.iter().enumerate() {
        let seconds = if at == 0 { 0.0 } else { times[at] - times[at - 1] };
        last -= (value - last) * (-TAU * corner_hz * seconds).exp_m1();
        passed.push(last);
    }
    passed
}

/// Moving average of all values within the last `seconds`.
fn running_mean(times: &[f64], values: &[f64], seconds: f64) -> Vec<f64> {
    let (mut from, mut sum) = (0, 0.0);
    (0..values.len())
        .map(|at| {
            sum += values[at];
            while times[at] - times[from] >= seconds {
                sum -= values[from];
                from += 1;
            }
            sum / (at + 1 - from) as f64
        })
        .collect()
}

/// Holds each value over `rows` rows.
pub(super) fn hold(values: &[f64], rows: usize) -> Vec<f64> {
    (0..values.len()).map(|at| values[at - at % rows.max(1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_pass_after_step_follows_its_time_constant() {
        let times: Vec<f64> = (0..1000).map(|at| f64::from(at) * 1e-3).collect();
        let step: Vec<f64> = (0..1000).map(|at| f64::from(u8::from(at > 0))).collect();
        let passed = low_pass(&times, &step, 5.0);
        let expected = 1.0 - (-TAU * 5.0 * 0.05f64).exp();
        assert!((passed[50] - expected).abs() < 1e-9, "{}", passed[50]);
    }

    #[test]
    fn filter_of_each_shape_passes_half_the_power_at_its_corner() {
        let (corner_hz, rate_hz) = (10.0, 2000.0);
        let times: Vec<f64> = (0..8000).map(|at| f64::from(at) / rate_hz).collect();
        let wave: Vec<f64> = times.iter().map(|time| (TAU * corner_hz * time).sin()).collect();
        for shape in [FilterShape::First, FilterShape::Second, FilterShape::Mean] {
            let passed = shape.filter(&times, &wave, corner_hz);
            let power = passed[4000..].iter().map(|value| value * value).sum::<f64>() / 4000.0;
            assert!((power / 0.5 - 0.5).abs() < 0.02, "{shape:?}: {power}");
        }
    }

    #[test]
    fn hold_repeats_the_first_of_each_group_of_rows() {
        assert_eq!(hold(&[1.0, 2.0, 3.0, 4.0, 5.0], 2), [1.0, 1.0, 3.0, 3.0, 5.0]);
        assert_eq!(hold(&[1.0, 2.0], 1), [1.0, 2.0]);
    }
}
