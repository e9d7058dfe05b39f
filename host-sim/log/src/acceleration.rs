//! Acceleration as the derivative of the velocity, on the original time stamps.
//!
//! A plain difference of two neighbours multiplies the noise by 1/dt and the jitter of the clock. The method of Savitzky
//! and Golay is better: fit a parabola to a window of samples by least squares, and use *its* slope. Its fixed weights
//! need a uniform grid, which logs do not have. So the parabola is fitted at every sample, in polynomials that are
//! orthogonal on the time stamps of the window (Forsythe's recurrence). That needs no matrix, and stays accurate where a
//! matrix of powers of time would be ill-conditioned.
//!
//! At the ends of a segment the window stops, and the slope is evaluated off its centre. It never crosses a gap. A
//! velocity without noise ([`Run::velocity_is_smooth`]) needs no window: its slope is that of a spline.

use std::borrow::Cow;

use compensator_core::quantity::Quantity;

use super::dataset::Run;
use super::segment::segments;

/// Samples in the window of the derivative: the sample and seven on either side.
const DERIVATIVE_WINDOW: usize = 15;

impl Run {
    /// Returns the measured acceleration, or else the derivative of the velocity, rad/s2 or m/s2. It is zero in a
    /// segment of one sample.
    pub fn acceleration_or_derived(&self) -> Cow<'_, [f64]> {
        if let Some(known) = self.get(Quantity::Acceleration) {
            return Cow::Borrowed(known);
        }
        let mut slope = Vec::with_capacity(self.len());
        for rows in segments(self) {
            let (time, velocity) = (&self.time_s[rows.clone()], &self.velocity[rows]);
            slope.extend(if self.velocity_is_smooth {
                spline_derivative(time, velocity)
            } else {
                derivative(time, velocity)
            });
        }
        Cow::Owned(slope)
    }
}

/// Returns the time derivative of values without noise over one segment: the slope of their natural cubic spline. Rows
/// with repeated stamps get one slope.
///
/// At six rows a period, the spline keeps 99 % of the acceleration. A parabola over fifteen rows would span two and a
/// half periods and lose it.
fn spline_derivative(time: &[f64], values: &[f64]) -> Vec<f64> {
    let knots: Vec<usize> =
        (0..time.len()).filter(|&at| at == 0 || time[at] > time[at - 1]).collect();
    if knots.len() < 3 {
        return derivative(time, values);
    }
    let step = |k: usize| time[knots[k + 1]] - time[knots[k]];
    let rise = |k: usize| (values[knots[k + 1]] - values[knots[k]]) / step(k);
    let last = knots.len() - 1;
    // The slopes m of the spline solve a tridiagonal system, by elimination and back substitution:
    // m[k-1] / h[k-1] + 2 m[k] (1 / h[k-1] + 1 / h[k]) + m[k+1] / h[k] = 3 (rise[k-1] / h[k-1] + rise[k] / h[k]).
    let (mut above, mut slopes) = (vec![0.0; knots.len()], vec![0.0; knots.len()]);
    (above[0], slopes[0]) = (0.5, 1.5 * rise(0));
    for k in 1..=last {
        let before = 1.0 / step(k - 1);
        let after = if k < last { 1.0 / step(k) } else { 0.0 };
        let sum = 3.0 * (rise(k - 1) * before + if k < last { rise(k) * after } else { 0.0 });
        let pivot = 2.0 * (before + after) - before * above[k - 1];
        above[k] = after / pivot;
        slopes[k] = (sum - before * slopes[k - 1]) / pivot;
    }
    for k in (0..last).rev() {
        slopes[k] -= above[k] * slopes[k + 1];
    }
    let mut knot = 0;
    (0..time.len())
        .map(|at| {
            knot += usize::from(knots.get(knot + 1).is_some_and(|&next| at >= next));
            slopes[knot]
        })
        .collect()
}

/// Returns the time derivative of values over one segment, by a local parabola.
///
/// `time` must not decrease; stamps may repeat. With two different stamps in the window the parabola becomes a line,
/// and with one the slope is zero.
fn derivative(time: &[f64], values: &[f64]) -> Vec<f64> {
    let n = time.len().min(values.len());
    let window = DERIVATIVE_WINDOW.min(n);
    (0..n)
        .map(|at| {
            let start = at.saturating_sub(window / 2).min(n - window);
            let rows = start..start + window;
            slope(&time[rows.clone()], &values[rows], time[at])
        })
        .collect()
}

/// Returns the slope at time `at` of the least-squares parabola.
fn slope(time: &[f64], values: &[f64], at: f64) -> f64 {
    // In units of the window's length, the recurrence works on numbers near one.
    let length = time[time.len() - 1] - time[0];
    if length <= 0.0 {
        return 0.0;
    }
    let u = |t: f64| (t - at) / length;
    let count = time.len() as f64;
    let mean_u = time.iter().map(|&t| u(t)).sum::<f64>() / count;

    // p1 = u - mean, p2 = (u - a) p1 - b, each orthogonal to the ones before on these samples.
    let (mut p1_p1, mut u_p1_p1, mut p1_y) = (0.0, 0.0, 0.0);
    for (&t, &y) in time.iter().zip(values) {
        let p1 = u(t) - mean_u;
        p1_p1 += p1 * p1;
        u_p1_p1 += u(t) * p1 * p1;
        p1_y += p1 * y;
    }
    if p1_p1 <= 0.0 {
        return 0.0;
    }
    let (a, b) = (u_p1_p1 / p1_p1, p1_p1 / count);
    let (mut p2_p2, mut p2_y) = (0.0, 0.0);
    for (&t, &y) in time.iter().zip(values) {
        let p2 = (u(t) - a) * (u(t) - mean_u) - b;
        p2_p2 += p2 * p2;
        p2_y += p2 * y;
    }
    let line = p1_y / p1_p1;
    // With two different stamps p2 is zero on all samples, except for rounding.
    let curve = if p2_p2 > 1e-18 * count { p2_y / p2_p2 } else { 0.0 };
    // Derivatives at u = 0: p1' = 1, p2' = 2 u - a - mean.
    (line + curve * (-a - mean_u)) / length
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a non-uniform, deterministic grid with steps between 5 and 15 ms.
    fn uneven(n: usize) -> Vec<f64> {
        let mut t = 1000.0;
        (0..n)
            .map(|i| {
                t += 0.005 + 0.010 * ((i * 7919) % 101) as f64 / 101.0;
                t
            })
            .collect()
    }

    #[test]
    fn derivative_of_parabola_on_uneven_grid_is_exact_up_to_the_ends() {
        let time = uneven(60);
        let values: Vec<f64> = time.iter().map(|t| 3.0 + 2.0 * (t - 1000.0).powi(2)).collect();
        for (slope, t) in derivative(&time, &values).iter().zip(&time) {
            assert!((slope - 4.0 * (t - 1000.0)).abs() < 1e-8, "{slope} at {t}");
        }
    }

    #[test]
    fn spline_derivative_with_six_rows_a_period_and_repeated_stamps_follows_sine() {
        let mut time = uneven(400);
        time.insert(100, time[100]);
        let omega = 2.0 * std::f64::consts::PI / 0.06;
        let values: Vec<f64> = time.iter().map(|t| (omega * (t - 1000.0)).sin()).collect();
        let found = spline_derivative(&time, &values);
        for (slope, t) in found.iter().zip(&time).skip(6).take(388) {
            let error = slope / omega - (omega * (t - 1000.0)).cos();
            assert!(error.abs() < 0.08, "{error} at {t}");
        }
        assert_eq!(found[100], found[101]);
        assert_eq!(spline_derivative(&[0.0, 1.0], &[0.0, 2.0]), [2.0, 2.0]);
    }

    #[test]
    fn derivative_of_noisy_sine_follows_it_and_reduces_noise() {
        let time = uneven(2000);
        let noise = |i: usize| 1e-3 * (((i * 48271) % 1009) as f64 / 504.0 - 1.0);
        let values: Vec<f64> =
            time.iter().enumerate().map(|(i, t)| (3.0 * t).sin() + noise(i)).collect();
        let found = derivative(&time, &values);
        let rms = |error: &dyn Fn(usize) -> f64| {
            (found.iter().enumerate().map(|(i, _)| error(i).powi(2)).sum::<f64>() / 2000.0).sqrt()
        };
        let fitted = rms(&|i| found[i] - 3.0 * (3.0 * time[i]).cos());
        let plain = rms(&|i| {
            let j = i.min(1998);
            (values[j + 1] - values[j]) / (time[j + 1] - time[j]) - 3.0 * (3.0 * time[j]).cos()
        });
        assert!(fitted < 0.04 && fitted < plain / 3.0, "fitted {fitted}, plain {plain}");
    }

    #[test]
    fn acceleration_or_derived_with_gap_does_not_cross_it() {
        let mut run = Run::default();
        for i in 0..40 {
            run.time_s.push(if i < 20 { 0.0 } else { 100.0 } + 0.01 * f64::from(i));
            run.velocity.push(if i < 20 { 1.0 } else { -1.0 });
        }
        assert!(run.acceleration_or_derived().iter().all(|a| a.abs() < 1e-9));
    }

    #[test]
    fn derivative_with_few_or_equal_stamps_is_finite() {
        assert_eq!(derivative(&[], &[]), [] as [f64; 0]);
        assert_eq!(derivative(&[1.0], &[5.0]), [0.0]);
        assert_eq!(derivative(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0]), [0.0; 3]);
        for slope in derivative(&[0.0, 0.0, 1.0, 1.0], &[0.0, 2.0, 4.0, 6.0]) {
            assert!((slope - 4.0).abs() < 1e-9, "{slope}");
        }
    }

    #[test]
    fn acceleration_or_derived_with_measured_acceleration_returns_it() {
        let run = Run { time_s: vec![0.0, 1.0], velocity: vec![0.0, 1.0], ..Run::default() }
            .with(Quantity::Acceleration, vec![7.0, 8.0]);
        assert_eq!(*run.acceleration_or_derived(), [7.0, 8.0]);
    }
}
