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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

/// Rounds of the regression. The later ones leave out the largest residuals.
const ROUNDS: usize = 3;

/// Compares velocity and position. Every series must have a position.
pub fn agreement(all: &[Series]) -> Agreement {
    let mut result = Agreement { gain: 1.0, ..Agreement::default() };
    let Some(compared) = Comparison::new(all) else { return result };
    let mut limit = f64::INFINITY;
    for _ in 0..ROUNDS {
        let inside = compared.rows.iter().copied().filter(|row| row.left(&result).abs() <= limit);
        let Some(found) = regress(&inside.collect::<Vec<_>>()) else { break };
        result = found;
        let mut sizes: Vec<f64> = compared.rows.iter().map(|row| row.left(&result).abs()).collect();
        let at = sizes.len() * 19 / 20;
        // Twice the 95th percentile is four standard deviations. Residuals beyond it are not noise.
        limit = 2.0 * *sizes.select_nth_unstable_by(at, f64::total_cmp).1;
    }
    Agreement {
        position_variance: compared.position_variance,
        left_correlation: compared.correlation(&result),
        open: compared.open,
        low_pass_rows: time_constant(&compared.stretches),
        ..result
    }
}

/// A row of the regression, per median step.
#[derive(Clone, Copy)]
struct ComparedRow {
    logged: f64,
    /// The first three derivatives of the smoothed position.
    velocity: f64,
    acceleration: f64,
    jerk: f64,
}

impl ComparedRow {
    /// Returns what `gain v - gain lag a` leaves of the logged velocity.
    fn left(&self, found: &Agreement) -> f64 {
        self.logged - found.gain * (self.velocity - found.lag_rows * self.acceleration)
    }
}

/// The logged velocity beside the derivatives of the position.
struct Comparison {
    rows: Vec<ComparedRow>,
    /// The first row of each series.
    starts: Vec<usize>,
    stretches: Vec<Stretch>,
    /// Variance of the position's noise alone.
    position_variance: f64,
    /// See [`Agreement::open`].
    open: f64,
}

impl Comparison {
    /// Smooths the positions alone. Returns `None` if there are too few rows.
    fn new(all: &[Series]) -> Option<Self> {
        let (mut alone, mut velocities) = (Vec::new(), Vec::new());
        let rows: usize = all.iter().map(Series::len).sum();
        let stride = rows.div_ceil(MAX_ROWS).max(1);
        for series in all.iter().filter(|s| s.len() > 10) {
            let mut part = series.part(0..(series.len() / stride).max(10));
            velocities.push(part.velocity.take().unwrap_or_default());
            alone.push(part);
        }
        if alone.is_empty() {
            return None;
        }
        let Levels { noise, jump } = likeliest(&alone);
        let (mut rows, mut starts, mut stretches, mut open) = (vec![], vec![], vec![], 0.0);
        for (series, logged) in alone.into_iter().zip(velocities) {
            let found = smooth(&series, &noise, &vec![jump; series.len() - 1]);
            let ends = 4.min(series.len() / 4);
            starts.push(rows.len());
            let inner = logged.iter().enumerate().take(series.len() - ends).skip(ends);
            for (row, logged) in inner {
                let (before, state) = (found.states[row - 1], found.states[row]);
                rows.push(ComparedRow {
                    logged: *logged,
                    velocity: state[1],
                    // The acceleration of the polygon belongs to the middle of the step after the row.
                    acceleration: 0.5 * (state[2] + before[2]),
                    jerk: state[2] - before[2],
                });
                open += found.variances[row][1];
            }
            let derivative = found.states.iter().map(|state| state[1]).collect();
            stretches.push(Stretch { steps: series.steps, derivative, logged });
        }
        let open = f64::sqrt(open / f64::max(rows.len() as f64, 1.0));
        let position_variance = noise.position;
        let is_enough = rows.len() >= MIN_ROWS;
        is_enough.then_some(Self { rows, starts, stretches, position_variance, open })
    }

    /// Returns the lag-one correlation of the residual. Pairs across two series are excluded.
    fn correlation(&self, found: &Agreement) -> f64 {
        let (mut products, mut squares) = (0.0, 0.0);
        for (at, row) in self.rows.iter().enumerate() {
            squares += row.left(found).powi(2);
            if at > 0 && !self.starts.contains(&at) {
                products += row.left(found) * self.rows[at - 1].left(found);
            }
        }
        products / f64::max(squares, f64::MIN_POSITIVE)
    }
}

/// Regresses the logged velocity on velocity and acceleration by least squares; `None` if these cannot be told apart.
fn regress(rows: &[ComparedRow]) -> Option<Agreement> {
    let (mut vv, mut va, mut aa, mut yv, mut ya) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ComparedRow { logged: y, velocity: v, acceleration: a, .. } in rows {
        vv += v * v;
        va += v * a;
        aa += a * a;
        yv += y * v;
        ya += y * a;
    }
    let determinant = vv * aa - va * va;
    if determinant.is_nan() || determinant <= 1e-12 * vv * aa {
        return None;
    }
    let gain = (yv * aa - ya * va) / determinant;
    let lag_rows = -(ya * vv - yv * va) / determinant / gain;
    let count = rows.len() as f64;
    let found = Agreement { gain, lag_rows, ..Agreement::default() };
    let variance = rows.iter().map(|row| row.left(&found).powi(2)).sum::<f64>() / count;
    Some(Agreement {
        gain_error: (variance * aa / determinant).sqrt(),
        lag_error_rows: (variance * vv / determinant).sqrt() / gain.abs(),
        scatter: variance.sqrt(),
        speed: (vv / count).sqrt(),
        is_independent: is_independent(rows),
        ..found
    })
}

/// Returns true if a logged velocity has more fast components than the position's derivative. In the regression
/// `v_logged = b0 v + b1 a + b2 j` (`j` is the third derivative), `b2 < 0` amplifies fast components. Filtered
/// differences of the position attenuate them; a pure delay of `d` gives `b2 = d^2 / 2`.
fn is_independent(rows: &[ComparedRow]) -> bool {
    let columns = DMatrix::from_fn(rows.len(), 3, |row, column| {
        let ComparedRow { velocity, acceleration, jerk, .. } = rows[row];
        [velocity, acceleration, jerk][column]
    });
    let logged = DVector::from_fn(rows.len(), |row, _| rows[row].logged);
    let products = columns.transpose() * &columns;
    let Some(inverse) = products.try_inverse() else { return false };
    let found = &inverse * (columns.transpose() * &logged);
    let left = (&logged - &columns * &found).norm_squared() / rows.len() as f64;
    found[2] * found[0].signum() < -SIGN_ERRORS * (left * inverse[(2, 2)]).sqrt()
}
