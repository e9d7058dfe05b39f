//! Kalman filter, fixed-interval smoother, and random draws of the remaining uncertainty.
//!
//! The state is position, velocity and acceleration. The velocity is a polygon, as a simulation interpolates a log:
//! linear from row to row. So the position is *exactly* the trapezoid sum of the velocity, and a bristle driven by the
//! smoothed velocity moves by the smoothed displacement:
//!
//! ```text
//! q' = q + v dt + a dt^2/2      v' = v + a dt      a' = a + w,  w ~ N(0, lambda)
//! ```
//!
//! The backward pass is the smoother of Bryson and Frazier in de Jong's form. It inverts no matrix, and also gives the
//! smoothed `w` with its variance. Time is counted in median steps, and velocity and acceleration are per such step, so
//! that all three states have similar size.

use crate::work::checkpoint_at;

/// Position, velocity and acceleration, per median step.
pub type State = [f64; 3];

type Matrix = [[f64; 3]; 3];

/// Minimum step, as a share of the median step. Shorter steps come from a coarse clock that repeats stamps.
const MIN_STEP: f64 = 0.01;

/// The measurements of one segment.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Steps between rows, relative to the median step; one fewer than rows.
    pub steps: Vec<f64>,
    /// Measured position relative to the first one, if there is one.
    pub position: Option<Vec<f64>>,
    /// Variance of each position due to rounding; empty if positions are not rounded.
    pub rounding: Vec<f64>,
    /// Measured velocity per median step, if it is used.
    pub velocity: Option<Vec<f64>>,
    /// Variance of the velocity's noise in this series, relative to that of all series.
    pub loudness: f64,
    /// True for rows at rest.
    pub at_rest: Vec<bool>,
}

impl Series {
    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.steps.len() + 1
    }

    /// Returns the variance of a row's position from noise and rounding.
    pub fn position_variance(&self, row: usize, noise: &Noise) -> f64 {
        noise.position + self.rounding.get(row).copied().unwrap_or_default()
    }

    /// Returns the variance of the velocities.
    pub fn velocity_variance(&self, noise: &Noise) -> f64 {
        self.loudness * noise.velocity
    }

    /// Returns a step as the filter uses it, at least a hundredth of the median step.
    pub fn step(&self, row: usize) -> f64 {
        self.steps[row].max(MIN_STEP)
    }

    /// Returns consecutive rows as a series.
    pub fn part(&self, rows: std::ops::Range<usize>) -> Self {
        let cut = |column: &Option<Vec<f64>>| column.as_ref().map(|all| all[rows.clone()].to_vec());
        Self {
            steps: self.steps[rows.start..rows.end - 1].to_vec(),
            position: cut(&self.position),
            rounding: self.rounding.get(rows.clone()).unwrap_or_default().to_vec(),
            velocity: cut(&self.velocity),
            loudness: self.loudness,
            at_rest: self.at_rest[rows.clone()].to_vec(),
        }
    }
}

/// Variances of the measurement noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Variance of the position without its rounding.
    pub position: f64,
    /// Variance of the velocity, per median step.
    pub velocity: f64,
}

/// Result of the smoother.
#[derive(Clone, Debug, Default)]
pub struct Smoothed {
    /// Means, row by row.
    pub states: Vec<State>,
    /// Variances of position and velocity, row by row.
    pub variances: Vec<[f64; 2]>,
    /// Expected squares of the jumps `w` after each row, divided by the step; one fewer than rows.
    pub jumps: Vec<f64>,
}

/// The update of the filter by one scalar measurement.
#[derive(Clone, Copy, Default)]
struct MeasurementUpdate {
    entry: usize,
    error: f64,
    variance: f64,
    gain: State,
    /// `1 - gain[entry]`, computed without that difference.
    left: f64,
}

impl MeasurementUpdate {
    /// `(I - gain e') P`, row by row.
    #[inline(always)]
    fn less(&self, p: &Matrix) -> Matrix {
        let of = p[self.entry];
        let row = |i: usize| {
            if i == self.entry {
                entries(|j| self.left * of[j])
            } else {
                entries(|j| p[i][j] - self.gain[i] * of[j])
            }
        };
        [row(0), row(1), row(2)]
    }

    /// `(I - gain e')' r`.
    #[inline(always)]
    fn back(&self, r: &State) -> State {
        let others: f64 = (0..3).filter(|i| *i != self.entry).map(|i| self.gain[i] * r[i]).sum();
        let mut back = *r;
        back[self.entry] = self.left * r[self.entry] - others;
        back
    }
}

/// Returns three entries. `array::map` is not always inlined, and this is the innermost loop.
#[inline(always)]
fn entries<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

#[inline(always)]
fn transposed(p: &Matrix) -> Matrix {
    entries(|i| [p[0][i], p[1][i], p[2][i]])
}

/// Returns the measurements of a row, at most two. At rest the velocity is known to be zero.
fn measured(series: &Series, noise: &Noise, row: usize) -> [Option<(usize, f64, f64)>; 2] {
    let position =
        series.position.as_ref().map(|q| (0, q[row], series.position_variance(row, noise)));
    let velocity = if series.at_rest[row] {
        Some((1, 0.0, AT_REST * series.velocity_variance(noise)))
    } else {
        series.velocity.as_ref().map(|v| (1, v[row], series.velocity_variance(noise)))
    };
    [position, velocity]
}

/// Variance of the velocity at rest, relative to that of a measured one: almost exact, but not a division by zero.
const AT_REST: f64 = 1e-8;

/// Returns the initial state: the first position, at rest.
fn origin(series: &Series) -> State {
    [series.position.as_ref().and_then(|q| q.first()).copied().unwrap_or_default(), 0.0, 0.0]
}

/// Returns the initial variances: the squares of the largest travel between two rows. The whole travel would be too
/// large: with 200 rad in one direction and a noise of 1e-7 rad, the variance would lose all of its digits.
fn wide(series: &Series) -> State {
    let square = |largest: f64| largest * largest + f64::MIN_POSITIVE;
    let largest = |values: &mut dyn Iterator<Item = f64>| {
        square(values.fold(0.0f64, |most, v| most.max(v.abs())))
    };
    let q = largest(&mut series.position.iter().flat_map(|q| q.windows(2)).map(|q| q[1] - q[0]));
    let v = match &series.velocity {
        Some(velocity) => largest(&mut velocity.iter().copied()),
        None => q,
    };
    [q.max(v), v, v]
}

fn diagonal(of: State) -> Matrix {
    let mut matrix = [[0.0; 3]; 3];
    (0..3).for_each(|i| matrix[i][i] = of[i]);
    matrix
}

/// `F x`
#[inline(always)]
fn forward(x: &State, step: f64) -> State {
    [x[0] + step * x[1] + 0.5 * step * step * x[2], x[1] + step * x[2], x[2]]
}

/// `F' x`
#[inline(always)]
fn backward(x: &State, step: f64) -> State {
    [x[0], x[1] + step * x[0], x[2] + step * x[1] + 0.5 * step * step * x[0]]
}

/// `F P F'`, or `F' N F` where `by` is [`backward`].
#[inline(always)]
fn carried(p: &Matrix, step: f64, by: impl Fn(&State, f64) -> State) -> Matrix {
    let half = transposed(&entries(|i| by(&p[i], step)));
    entries(|i| by(&half[i], step))
}

#[inline(always)]
fn times(p: &Matrix, r: &State) -> State {
    entries(|i| p[i][0] * r[0] + p[i][1] * r[1] + p[i][2] * r[2])
}

/// A forward pass of the filter: predictions and updates.
struct Filtered {
    predicted: Vec<(State, Matrix)>,
    measured: Vec<[Option<MeasurementUpdate>; 2]>,
    log_likelihood: f64,
}

fn filter(series: &Series, noise: &Noise, jumps: &[f64], keep: bool) -> Filtered {
    let rows = series.len();
    let room = if keep { rows } else { 0 };
    let mut pass = Filtered {
        predicted: Vec::with_capacity(room),
        measured: Vec::with_capacity(room),
        log_likelihood: 0.0,
    };
    let (mut x, mut p) = (origin(series), diagonal(wide(series)));
    let mut seen = 0;
    for row in 0..rows {
        checkpoint_at(row);
        if keep {
            pass.predicted.push((x, p));
        }
        let mut here = [None; 2];
        for (slot, given) in here.iter_mut().zip(measured(series, noise, row)) {
            let Some((entry, value, variance)) = given else { continue };
            let total = p[entry][entry] + variance;
            if total <= 0.0 {
                continue;
            }
            let error = value - x[entry];
            let gain = entries(|i| p[entry][i] / total);
            let here =
                MeasurementUpdate { entry, error, variance: total, gain, left: variance / total };
            (0..3).for_each(|i| x[i] += gain[i] * error);
            // Joseph's form, which stays positive for an almost exact measurement.
            p = here.less(&transposed(&here.less(&p)));
            (0..3).for_each(|i| (0..3).for_each(|j| p[i][j] += variance * gain[i] * gain[j]));
            // The first measurements only determine the initial state.
            seen += 1;
            if seen > 3 && !series.at_rest[row] {
                pass.log_likelihood -= 0.5 * (total.ln() + error * error / total);
            }
            *slot = Some(here);
        }
        if keep {
            pass.measured.push(here);
        }
        if let Some(jump) = jumps.get(row) {
            let step = series.step(row);
            x = forward(&x, step);
            p = carried(&p, step, forward);
            p[2][2] += jump * step;
        }
    }
    pass
}

/// Returns the logarithm of the likelihood of the measurements, without rows at rest. `jumps` holds the variance of `w`
/// after each row, per median step.
pub fn log_likelihood(series: &Series, noise: &Noise, jumps: &[f64]) -> f64 {
    filter(series, noise, jumps, false).log_likelihood
}

/// Returns the smoothed motion.
pub fn smooth(series: &Series, noise: &Noise, jumps: &[f64]) -> Smoothed {
    let pass = filter(series, noise, jumps, true);
    let rows = series.len();
    let mut out = Smoothed {
        states: vec![[0.0; 3]; rows],
        variances: vec![[0.0; 2]; rows],
        jumps: vec![0.0; rows.saturating_sub(1)],
    };
    let (mut r, mut n) = ([0.0; 3], [[0.0; 3]; 3]);
    for row in (0..rows).rev() {
        checkpoint_at(row);
        if row + 1 < rows {
            let step = series.step(row);
            let variance = jumps[row] * step;
            let (mean, left) = (variance * r[2], variance - variance * variance * n[2][2]);
            out.jumps[row] = (mean * mean + left.max(0.0)) / step;
            r = backward(&r, step);
            n = carried(&n, step, backward);
        }
        for given in pass.measured[row].iter().rev().flatten() {
            r = given.back(&r);
            r[given.entry] += given.error / given.variance;
            let half = transposed(&entries(|i| given.back(&n[i])));
            n = entries(|i| given.back(&half[i]));
            n[given.entry][given.entry] += 1.0 / given.variance;
        }
        let (x, p) = &pass.predicted[row];
        let moved = times(p, &r);
        out.states[row] = [x[0] + moved[0], x[1] + moved[1], x[2] + moved[2]];
        out.variances[row] = [0, 1].map(|i| {
            let known = times(&n, &p[i]);
            let less = p[i][0] * known[0] + p[i][1] * known[1] + p[i][2] * known[2];
            (p[i][i] - less).max(0.0)
        });
    }
    out
}

/// Draws the true velocity minus the smoothed one, per median step, row by row, `count` times.
///
/// A motion and its measurements are drawn from the model and smoothed like the log. The error of this smoothing is a
/// draw of the error of the log's smoothing (Durbin and Koopman). `normal` returns independent standard normal numbers.
pub fn draws(
    series: &Series,
    noise: &Noise,
    jumps: &[f64],
    count: usize,
    normal: &mut dyn FnMut() -> f64,
) -> Vec<Vec<f64>> {
    // The filter is linear, so its gains do not depend on the measured values.
    let mut gains = filter(series, noise, jumps, true);
    (0..count).map(|_| draw(series, noise, jumps, &mut gains, normal)).collect()
}

/// Draws once. `gains` is a pass of the filter over the series.
fn draw(
    series: &Series,
    noise: &Noise,
    jumps: &[f64],
    gains: &mut Filtered,
    normal: &mut dyn FnMut() -> f64,
) -> Vec<f64> {
    // The initial state does not affect the error.
    let mut x: State = [0.0; 3];
    let rows = series.len();
    let mut drawn = Series {
        steps: series.steps.clone(),
        rounding: Vec::new(),
        loudness: series.loudness,
        at_rest: vec![false; rows],
        position: series.position.as_ref().map(|_| Vec::with_capacity(rows)),
        velocity: Some(Vec::with_capacity(rows)),
    };
    let mut truth = Vec::with_capacity(rows);
    // Where the log is at rest, the drawn motion is measured with the variance of rest; its velocity is not zero.
    let variance_ratio = |row: usize| if series.at_rest[row] { AT_REST } else { 1.0 };
    for row in 0..rows {
        checkpoint_at(row);
        truth.push(x[1]);
        if let Some(position) = &mut drawn.position {
            position.push(x[0] + series.position_variance(row, noise).sqrt() * normal());
        }
        if let Some(velocity) = &mut drawn.velocity {
            let variance = variance_ratio(row) * series.velocity_variance(noise);
            velocity.push(x[1] + variance.sqrt() * normal());
        }
        if let Some(jump) = jumps.get(row) {
            x = forward(&x, series.step(row));
            x[2] += (jump * series.step(row)).sqrt() * normal();
        }
    }
    let smoothed = smooth_as(series, &drawn, gains);
    truth.iter().zip(smoothed).map(|(truth, found)| truth - found).collect()
}

/// Returns the smoothed velocities of `drawn` with the gains of a pass over `series`, whose states and errors are replaced.
fn smooth_as(series: &Series, drawn: &Series, pass: &mut Filtered) -> Vec<f64> {
    let rows = series.len();
    let (position, velocity) = (drawn.position.as_deref(), drawn.velocity.as_deref());
    let mut x = [0.0; 3];
    for row in 0..rows {
        checkpoint_at(row);
        pass.predicted[row].0 = x;
        for given in pass.measured[row].iter_mut().flatten() {
            let column = if given.entry == 0 { position } else { velocity };
            given.error = column.map_or(0.0, |column| column[row]) - x[given.entry];
            (0..3).for_each(|i| x[i] += given.gain[i] * given.error);
        }
        if row + 1 < rows {
            x = forward(&x, series.step(row));
        }
    }
    let mut out = vec![0.0; rows];
    let mut r = [0.0; 3];
    for row in (0..rows).rev() {
        checkpoint_at(row);
        if row + 1 < rows {
            r = backward(&r, series.step(row));
        }
        for given in pass.measured[row].iter().rev().flatten() {
            r = given.back(&r);
            r[given.entry] += given.error / given.variance;
        }
        let (x, p) = &pass.predicted[row];
        out[row] = x[1] + times(p, &r)[1];
    }
    out
}
