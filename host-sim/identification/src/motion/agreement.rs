//! The velocity column beside the derivative of the position column.
//!
//! The position is smoothed alone, and the logged velocity is regressed on the velocity and the acceleration
//! found: `v_logged = gain v + (-gain lag) a`. A smoothed value is the mean of the truth given the log, so such a
//! regression is not biased by its noise. What is left over is the noise of the column, or that of the position.

use super::filter::{Series, smooth};
use super::levels::{Levels, likeliest};
use nalgebra::{DMatrix, DVector};

/// Rows looked at, at most, spread over the log.
const ROWS: usize = 20_000;

/// Rows a regression needs.
const FEWEST: usize = 30;

/// What the position's derivative leaves of the velocity, as a share of it, where the two are one motion; and
/// the relative standard error of a gain that is known.
const SCATTER: f64 = 0.1;
const GAIN_ERROR: f64 = 0.01;

/// A velocity later (or earlier) than the position's derivative by more than so many rows lags.
const LAG_ROWS: f64 = 0.35;

/// Standard errors of a lag that is one.
const LAG_ERRORS: f64 = 4.0;

/// Rows by which a difference from row to row is late, and how near a lag must be to that to be it.
const DIFFERENCE: (f64, f64) = (0.5, 0.1);

/// What the shifted derivative leaves of a velocity that is merely late, as a share of it. A drive's own
/// velocity, 1.1 rows late, leaves 0.001; a filtered difference of 16 bits 0.01.
const MERELY: f64 = 3e-3;

/// What a filtered velocity leaves hangs together from row to row: a lag-one correlation above this. White noise
/// leaves 0; a difference through a low-pass of 2 Hz, logged at 73 Hz, 0.9.
const COLOURED: f64 = 0.5;

/// What is left is the velocity's own, and not the position's, from so many standard deviations on that the position
/// alone leaves open. Those are a model's, hence not 2.
const OWN: f64 = 4.0;

/// Standard errors beyond which a sign is sure.
const SURE: f64 = 2.0;

/// A velocity beside the derivative of its position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Logged velocity over the position's derivative.
    pub gain: f64,
    /// Its standard error.
    pub gain_error: f64,
    /// Rows by which the logged velocity is late.
    pub lag_rows: f64,
    /// Its standard error.
    pub lag_error_rows: f64,
    /// Standard deviation of what is left, per median step.
    pub scatter: f64,
    /// RMS of the position's derivative, per median step.
    pub speed: f64,
    /// Variance of the position's noise by itself, its rounding aside.
    pub position_variance: f64,
    /// Correlation of what is left from one row to the next.
    pub left_correlation: f64,
    /// Standard deviation of the velocity as the position alone leaves it, per median step.
    pub open: f64,
    /// Whether the logged velocity has more of what changes fast than the position knows of: it was not made from it.
    pub is_its_own: bool,
}

impl Agreement {
    /// Whether the two are one motion, whatever its scale, and the gain is known to a percent.
    pub fn is_clear(&self) -> bool {
        let moves = self.scatter < SCATTER * self.gain.abs() * self.speed;
        moves && self.gain_error < GAIN_ERROR * self.gain.abs()
    }

    /// Whether the velocity is late or early beyond doubt.
    pub fn lags(&self) -> bool {
        let lag = self.lag_rows.abs();
        self.is_clear() && lag > LAG_ROWS && lag > LAG_ERRORS * self.lag_error_rows
    }
}

impl Agreement {
    /// Whether the velocity was low-passed, so that what it is off by lasts: no white noise, and to be averaged with
    /// nothing. The position alone then knows the motion better.
    pub fn is_filtered(&self) -> bool {
        self.left_correlation > COLOURED && self.scatter > OWN * self.open
    }

    /// Whether the velocity is as good as the position, and only its clock is another. Which of the two clocks is the
    /// torque's the log does not say. Differences of the position through a filter are late and the position is not; a drive's
    /// own velocity, which knows more than the logged position, comes out of one loop with its torque.
    pub fn is_merely_late(&self) -> bool {
        let is_difference = (self.lag_rows - DIFFERENCE.0).abs() < DIFFERENCE.1;
        let is_known = self.lags() && !is_difference && self.is_its_own;
        is_known && self.scatter < MERELY * self.gain.abs() * self.speed
    }
}

/// Holds the two against each other; every series has a position.
pub fn agreement(all: &[Series]) -> Agreement {
    let mut alone: Vec<Series> = Vec::new();
    let mut velocities: Vec<Vec<f64>> = Vec::new();
    let rows: usize = all.iter().map(Series::len).sum();
    let stride = rows.div_ceil(ROWS).max(1);
    for series in all.iter().filter(|s| s.len() > 10) {
        let part = series.part(0..(series.len() / stride).max(10));
        velocities.push(part.velocity.clone().unwrap_or_default());
        alone.push(Series { velocity: None, ..part });
    }
    if alone.is_empty() {
        return Agreement { gain: 1.0, ..Agreement::default() };
    }
    let Levels { noise, jump } = likeliest(&alone);
    // Weighted sums of the normal equations, robust by leaving the worst tail out in a second round.
    let mut table: Vec<[f64; 4]> = Vec::new();
    let (mut starts, mut open, mut opened) = (Vec::new(), 0.0, 0.0);
    for (series, logged) in alone.iter().zip(&velocities) {
        let found = smooth(series, &noise, &vec![jump; series.len() - 1]);
        let ends = 4.min(series.len() / 4);
        starts.push(table.len());
        let inner = logged.iter().enumerate().take(series.len() - ends).skip(ends);
        for (row, logged) in inner {
            let state = found.states[row];
            // The polygon's acceleration belongs to the middle of the step after the row.
            let bend = 0.5 * (state[2] + found.states[row - 1][2]);
            let jerk = state[2] - found.states[row - 1][2];
            table.push([*logged, state[1], bend, jerk]);
            open += found.variances[row][1];
            opened += 1.0;
        }
    }
    if table.len() < FEWEST {
        return Agreement { gain: 1.0, ..Agreement::default() };
    }
    let mut limit = f64::INFINITY;
    let mut result = Agreement { gain: 1.0, ..Agreement::default() };
    for _ in 0..3 {
        let (mut vv, mut va, mut aa, mut yv, mut ya, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let lag_slope = -result.gain * result.lag_rows;
        let left = |row: &[f64; 4]| row[0] - result.gain * row[1] - lag_slope * row[2];
        let inside: Vec<&[f64; 4]> = table.iter().filter(|row| left(row).abs() <= limit).collect();
        for [y, v, a, _] in inside.iter().copied() {
            vv += v * v;
            va += v * a;
            aa += a * a;
            yv += y * v;
            ya += y * a;
            count += 1.0;
        }
        let determinant = vv * aa - va * va;
        if determinant.is_nan() || determinant <= 1e-12 * vv * aa {
            break;
        }
        let gain = (yv * aa - ya * va) / determinant;
        let slope = (ya * vv - yv * va) / determinant;
        let left = |row: &[f64; 4]| row[0] - gain * row[1] - slope * row[2];
        let squares: f64 = inside.iter().map(|row| left(row).powi(2)).sum();
        let variance = squares / count;
        result = Agreement {
            gain,
            lag_rows: -slope / gain,
            lag_error_rows: (variance * vv / determinant).sqrt() / gain.abs(),
            gain_error: (variance * aa / determinant).sqrt(),
            scatter: variance.sqrt(),
            speed: (vv / count).sqrt(),
            position_variance: noise.position,
            left_correlation: correlation(&table, &starts, &left),
            open: f64::sqrt(open / f64::max(opened, 1.0)),
            is_its_own: is_its_own(&inside),
        };
        let mut sizes: Vec<f64> = table.iter().map(|row| left(row).abs()).collect();
        let at = sizes.len() * 19 / 20;
        // Twice the 95th percentile is four standard deviations: what lies beyond is another matter.
        limit = 2.0 * *sizes.select_nth_unstable_by(at, f64::total_cmp).1;
    }
    result
}

/// Whether a logged velocity has more of what changes fast than the position's derivative does: in `v_logged = b0 v + b1 a + b2 j`
/// (`j` the third derivative) a factor of `b2 < 0` raises fast waves. Differences of the position through any filter lose
/// them; a mere delay of `d` has `b2 = d^2 / 2`.
fn is_its_own(rows: &[&[f64; 4]]) -> bool {
    let columns = DMatrix::from_fn(rows.len(), 3, |row, column| rows[row][column + 1]);
    let logged = DVector::from_fn(rows.len(), |row, _| rows[row][0]);
    let products = columns.transpose() * &columns;
    let Some(inverse) = products.try_inverse() else { return false };
    let found = &inverse * (columns.transpose() * &logged);
    let left = (&logged - &columns * &found).norm_squared() / rows.len() as f64;
    found[2] * found[0].signum() < -SURE * (left * inverse[(2, 2)]).sqrt()
}

/// Lag-one correlation of what is left, never from one series to the next.
fn correlation(table: &[[f64; 4]], starts: &[usize], left: &impl Fn(&[f64; 4]) -> f64) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (at, row) in table.iter().enumerate() {
        squares += left(row).powi(2);
        if at > 0 && !starts.contains(&at) {
            products += left(row) * left(&table[at - 1]);
        }
    }
    products / f64::max(squares, f64::MIN_POSITIVE)
}
