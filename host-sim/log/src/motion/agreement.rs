//! Comparison of the velocity column with the derivative of the position column.
//!
//! The position is smoothed alone, and the logged velocity is regressed on the resulting velocity and acceleration:
//! `v_logged = gain v + (-gain lag) a`. A smoothed value is the mean of the true value given the log, so its noise does
//! not bias the regression. The residual is the noise of the velocity column, or that of the position.

use super::filter::{Series, smooth};
use super::levels::{Levels, likeliest};
use super::low_pass::{Stretch, time_constant};
use nalgebra::{DMatrix, DVector};

/// Maximum number of rows that are evaluated, spread over the log.
const MAX_ROWS: usize = 20_000;

/// Minimum number of rows for the regression.
const MIN_ROWS: usize = 30;

/// Maximum residual of the velocity, as a share of its RMS, for the columns to describe the same motion.
const MAX_RESIDUAL_SHARE: f64 = 0.1;

/// Maximum relative standard error of a gain that counts as known.
const MAX_GAIN_ERROR: f64 = 0.01;

/// Minimum delay between velocity and derivative of the position that counts as a lag, rows.
const MIN_LAG_ROWS: f64 = 0.35;

/// Minimum lag, standard errors.
const MIN_LAG_ERRORS: f64 = 4.0;

/// Delay of a difference from row to row, rows.
const DIFFERENCE_LAG_ROWS: f64 = 0.5;

/// Maximum deviation from that delay, rows.
const DIFFERENCE_LAG_TOLERANCE_ROWS: f64 = 0.1;

/// Maximum residual of a velocity that is only delayed, as a share of its RMS. A drive's own velocity leaves about
/// 0.001, a filtered difference of 16 bits 0.01.
const PURE_DELAY_RESIDUAL: f64 = 3e-3;

/// Minimum lag-one correlation of the residual of a filtered velocity. White noise gives 0; a difference through a
/// low-pass filter of 2 Hz, logged at 73 Hz, gives 0.9.
const MIN_FILTERED_CORRELATION: f64 = 0.5;

/// Minimum residual that is attributed to the velocity and not to the position, in standard deviations of the velocity
/// given the position alone. These depend on a model, so 2 would not be enough.
const MIN_OWN_RESIDUAL: f64 = 4.0;

/// Standard errors at which the sign of a coefficient counts as known.
const SIGN_ERRORS: f64 = 2.0;

/// Comparison of a velocity with the derivative of its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Logged velocity over the position's derivative.
    pub gain: f64,
    /// Its standard error.
    pub gain_error: f64,
    /// Delay of the logged velocity, rows.
    pub lag_rows: f64,
    /// Its standard error.
    pub lag_error_rows: f64,
    /// Standard deviation of the residual, per median step.
    pub scatter: f64,
    /// RMS of the position's derivative, per median step.
    pub speed: f64,
    /// Variance of the position's noise alone, without its rounding.
    pub position_variance: f64,
    /// Correlation of the residual from one row to the next.
    pub left_correlation: f64,
    /// Standard deviation of the velocity given the position alone, per median step.
    pub open: f64,
    /// True if the logged velocity has more fast components than the position: it was not derived from it.
    pub is_independent: bool,
    /// Time constant of the low-pass that the velocity is behind, rows, if that explains it better than a delay.
    pub low_pass_rows: Option<f64>,
}

impl Agreement {
    /// Returns true if both columns describe the same motion, at any scale, and the gain is known to a percent.
    pub fn is_clear(&self) -> bool {
        let moves = self.scatter < MAX_RESIDUAL_SHARE * self.gain.abs() * self.speed;
        moves && self.gain_error < MAX_GAIN_ERROR * self.gain.abs()
    }

    /// Returns true if the velocity is significantly late or early.
    pub fn lags(&self) -> bool {
        let lag = self.lag_rows.abs();
        self.is_clear() && lag > MIN_LAG_ROWS && lag > MIN_LAG_ERRORS * self.lag_error_rows
    }

    /// Returns true if the velocity was low-pass filtered, so that its error is correlated and cannot be averaged. Then
    /// the position alone gives the better motion.
    pub fn is_filtered(&self) -> bool {
        self.left_correlation > MIN_FILTERED_CORRELATION
            && self.scatter > MIN_OWN_RESIDUAL * self.open
    }

    /// Returns true if the velocity is as accurate as the position and only has a different delay. The log does not
    /// show which of the two clocks the torque has. Filtered differences of the position are late, the position is not.
    /// A drive's own velocity, which is more accurate than the logged position, shares a control loop with its torque.
    pub fn is_pure_delay(&self) -> bool {
        let is_difference =
            (self.lag_rows - DIFFERENCE_LAG_ROWS).abs() < DIFFERENCE_LAG_TOLERANCE_ROWS;
        let is_known = self.lags() && !is_difference && self.is_independent;
        is_known && self.scatter < PURE_DELAY_RESIDUAL * self.gain.abs() * self.speed
    }
}

/// Rounds of the regression. All but the first leave out the largest residuals.
const ROUNDS: usize = 3;

/// A row of the regression, with the smoothed motion per median step.
struct Row {
    logged: f64,
    velocity: f64,
    acceleration: f64,
    jerk: f64,
    /// Variance of the velocity given the position alone.
    variance: f64,
    /// True if the row before is of another series.
    is_first: bool,
}

/// Compares velocity and position. Every series must have a position. Returns `None` if there are too few rows, or their motion
/// does not determine the gain.
pub fn agreement(all: &[Series]) -> Option<Agreement> {
    let rows: usize = all.iter().map(Series::len).sum();
    let stride = rows.div_ceil(MAX_ROWS).max(1);
    let part = |series: &Series| {
        let mut part = series.part(0..(series.len() / stride).max(10));
        let logged = part.velocity.take().unwrap_or_default();
        (part, logged)
    };
    let (alone, velocities): (Vec<Series>, Vec<Vec<f64>>) =
        all.iter().filter(|series| series.len() > 10).map(part).unzip();
    if alone.is_empty() {
        return None;
    }
    let Levels { noise, jump } = likeliest(&alone);
    let (mut rows, mut stretches) = (Vec::new(), Vec::new());
    for (series, logged) in alone.iter().zip(velocities) {
        let found = smooth(series, &noise, &vec![jump; series.len() - 1]);
        let ends = 4.min(series.len() / 4);
        for (row, logged) in logged.iter().enumerate().take(series.len() - ends).skip(ends) {
            let ([_, velocity, after], before) = (found.states[row], found.states[row - 1][2]);
            rows.push(Row {
                logged: *logged,
                velocity,
                // The acceleration of the polygon belongs to the middle of the step after the row.
                acceleration: 0.5 * (after + before),
                jerk: after - before,
                variance: found.variances[row][1],
                is_first: row == ends,
            });
        }
        let derivative = found.states.iter().map(|state| state[1]).collect();
        stretches.push(Stretch { steps: series.steps.clone(), derivative, logged });
    }
    if rows.len() < MIN_ROWS {
        return None;
    }
    let (mut found, mut inside, mut limit) = (Regression::SAME, Vec::new(), f64::INFINITY);
    for _ in 0..ROUNDS {
        let rows_within: Vec<&Row> =
            rows.iter().filter(|row| found.residual(row).abs() <= limit).collect();
        let Some(next) = Regression::of(&rows_within) else { break };
        (found, inside) = (next, rows_within);
        let mut sizes: Vec<f64> = rows.iter().map(|row| found.residual(row).abs()).collect();
        let at = sizes.len() * 19 / 20;
        // Twice the 95th percentile is four standard deviations. Residuals beyond it are not noise.
        limit = 2.0 * *sizes.select_nth_unstable_by(at, f64::total_cmp).1;
    }
    if inside.is_empty() {
        return None;
    }
    let variances: f64 = rows.iter().map(|row| row.variance).sum();
    Some(Agreement {
        gain: found.gain,
        gain_error: found.gain_error,
        lag_rows: -found.slope / found.gain,
        lag_error_rows: found.slope_error / found.gain.abs(),
        scatter: found.scatter,
        speed: found.speed,
        position_variance: noise.position,
        left_correlation: correlation(&rows, &found),
        open: (variances / rows.len() as f64).sqrt(),
        is_independent: is_independent(&inside),
        low_pass_rows: time_constant(&stretches),
    })
}

/// Regression of the logged velocity: `gain velocity + slope acceleration`.
struct Regression {
    gain: f64,
    gain_error: f64,
    slope: f64,
    slope_error: f64,
    /// Standard deviation of the residual.
    scatter: f64,
    /// RMS of the velocity.
    speed: f64,
}

impl Regression {
    const SAME: Self =
        Self { gain: 1.0, gain_error: 0.0, slope: 0.0, slope_error: 0.0, scatter: 0.0, speed: 0.0 };

    /// Solves the normal equations of some rows; `None` if velocity and acceleration do not differ.
    fn of(rows: &[&Row]) -> Option<Self> {
        let (mut vv, mut va, mut aa, mut yv, mut ya) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for Row { logged, velocity, acceleration, .. } in rows {
            vv += velocity * velocity;
            va += velocity * acceleration;
            aa += acceleration * acceleration;
            yv += logged * velocity;
            ya += logged * acceleration;
        }
        let determinant = vv * aa - va * va;
        if determinant.is_nan() || determinant <= 1e-12 * vv * aa {
            return None;
        }
        let gain = (yv * aa - ya * va) / determinant;
        let slope = (ya * vv - yv * va) / determinant;
        let found = Self { gain, slope, speed: (vv / rows.len() as f64).sqrt(), ..Self::SAME };
        let squares: f64 = rows.iter().map(|row| found.residual(row).powi(2)).sum();
        let variance = squares / rows.len() as f64;
        Some(Self {
            gain_error: (variance * aa / determinant).sqrt(),
            slope_error: (variance * vv / determinant).sqrt(),
            scatter: variance.sqrt(),
            ..found
        })
    }

    fn residual(&self, row: &Row) -> f64 {
        row.logged - self.gain * row.velocity - self.slope * row.acceleration
    }
}

/// Returns true if a logged velocity has more fast components than the position's derivative. In the regression
/// `v_logged = b0 v + b1 a + b2 j` (`j` is the third derivative), `b2 < 0` amplifies fast components. Filtered
/// differences of the position attenuate them; a pure delay of `d` gives `b2 = d^2 / 2`.
fn is_independent(rows: &[&Row]) -> bool {
    let regressors = |row: &Row| [row.velocity, row.acceleration, row.jerk];
    let columns = DMatrix::from_fn(rows.len(), 3, |row, column| regressors(rows[row])[column]);
    let logged = DVector::from_fn(rows.len(), |row, _| rows[row].logged);
    let products = columns.transpose() * &columns;
    let Some(inverse) = products.try_inverse() else { return false };
    let found = &inverse * (columns.transpose() * &logged);
    let left = (&logged - &columns * &found).norm_squared() / rows.len() as f64;
    found[2] * found[0].signum() < -SIGN_ERRORS * (left * inverse[(2, 2)]).sqrt()
}

/// Returns the lag-one correlation of the residual. Pairs across two series are excluded.
fn correlation(rows: &[Row], found: &Regression) -> f64 {
    let (mut products, mut squares, mut before) = (0.0, 0.0, 0.0);
    for row in rows {
        let left = found.residual(row);
        squares += left * left;
        if !row.is_first {
            products += left * before;
        }
        before = left;
    }
    products / f64::max(squares, f64::MIN_POSITIVE)
}
