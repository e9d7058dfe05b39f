//! What regressors are made of: functions of the motion, of the friction level and of other columns.
//!
//! A regressor is a product of factors, in all rows of a log. All its constants are numbers in the units of the log, so that it
//! means the same on every log of the joint: it is a form of the torque, not a column of one log.
//!
//! The friction level is the torque of a law's friction part over its RMS where it was fitted: positive in forward sliding,
//! negative in reverse, and between them as the law has it. What scales friction multiplies it.

use super::motion::Motion;
use super::operator::{low_pass, play, rests, shift, slope, stop};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Dwell time below which the static friction does not grow, s.
const DWELL_START_S: f64 = 0.02;

/// Place, from -1 to 1 between the ends of a curve, beyond which the curve is constant: a cubic would soon be large there.
const MOST_BEYOND: f64 = 1.2;

/// A function of each row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[expect(missing_docs, reason = "each variant describes its fields")]
pub enum Factor {
    /// 1.
    One,
    /// Velocity, rad/s or m/s.
    Velocity,
    /// Magnitude of the velocity.
    Speed,
    /// Sign of the velocity; 0 up to a speed.
    Direction { above: f64 },
    /// Acceleration, rad/s^2 or m/s^2.
    Acceleration,
    /// Elastic up to a travel (rad or m), then sliding; -1 to 1. Zero at the start of a run.
    Stop { travel: f64 },
    /// The same behind a gap (rad or m).
    StopBehindGap { gap: f64, travel: f64 },
    /// `exp(-|v| / velocity)`: 1 at rest.
    Falling { velocity: f64 },
    /// Sine of the position times an order, in waves per 2 pi rad or m.
    Sine { order: f64 },
    /// Its cosine.
    Cosine { order: f64 },
    /// Legendre polynomial, of degree 1 to 3, of the place between two positions; constant from a tenth of the range beyond them.
    Curve { degree: u8, from: f64, to: f64 },
    /// A column less its mean, over its spread, both where it was fitted; `late_s` after the motion. Units are the column's.
    Column { name: String, mean: f64, spread: f64, late_s: f64 },
    /// Magnitude of a column.
    ColumnMagnitude { name: String },
    /// Time derivative of a column.
    ColumnSlope { name: String },
    /// Change of a side load, over its spread, while a stop of this travel bends; followed with a time constant.
    BendingRate { name: String, spread: f64, travel: f64, time_constant_s: f64 },
    /// Friction level.
    Level,
    /// Its magnitude.
    LevelMagnitude,
    /// Growth of the breakaway with the last rest, less its mean where it was fitted, fading over a path. A joint rests within
    /// `step`.
    Dwell { step: f64, path: f64, mean: f64 },
    /// Share of a campaign that has passed, 0 to 1, between two times of its clock.
    Passed { from_s: f64, to_s: f64 },
    /// `exp(-share / constant)` of the same share: a run-in.
    RunIn { from_s: f64, to_s: f64, constant: f64 },
    /// `1 - exp(-heat / scale)` of the heat of rubbing, in level times path, which cools with a time constant.
    Warmth { scale: f64, cooling_s: f64 },
    /// Sine of the position with a phase of its own in each run, rad. It means nothing on another log.
    #[serde(skip)]
    SineByRun { order: f64, phases: Vec<f64> },
    /// Its cosine.
    #[serde(skip)]
    CosineByRun { order: f64, phases: Vec<f64> },
}

/// Finds a column of a log by its name.
pub type FindColumn<'a> = dyn Fn(&str) -> Option<&'a [f64]> + Sync + 'a;

/// What factors are computed from.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Motion of the log.
    pub motion: &'a Motion,
    /// Friction level in each row; empty while the law itself is computed.
    pub level: &'a [f64],
    /// The other columns.
    pub column: &'a FindColumn<'a>,
}

impl Factor {
    /// Returns a column in its own unit.
    pub fn of_column(name: &str) -> Self {
        Self::Column { name: name.into(), mean: 0.0, spread: 1.0, late_s: 0.0 }
    }

    /// Returns the column that it needs, if any.
    pub fn column_name(&self) -> Option<&str> {
        match self {
            Self::Column { name, .. }
            | Self::ColumnMagnitude { name }
            | Self::ColumnSlope { name }
            | Self::BendingRate { name, .. } => Some(name),
            _ => None,
        }
    }

    /// Returns true if it means the same on another log.
    pub fn is_transferable(&self) -> bool {
        !matches!(self, Self::SineByRun { .. } | Self::CosineByRun { .. })
    }

    /// Returns false if it divides by a constant that is not positive, or is a curve of another degree than 1 to 3.
    pub(super) fn is_legal(&self) -> bool {
        match self {
            Self::Stop { travel } | Self::StopBehindGap { travel, .. } => *travel > 0.0,
            Self::Falling { velocity } => *velocity > 0.0,
            Self::Curve { degree, .. } => (1..=3).contains(degree),
            Self::Column { spread, .. } => *spread > 0.0,
            Self::BendingRate { spread, travel, .. } => *spread > 0.0 && *travel > 0.0,
            Self::Dwell { path, .. } => *path > 0.0,
            Self::RunIn { constant, .. } => *constant > 0.0,
            Self::Warmth { scale, cooling_s } => *scale > 0.0 && *cooling_s > 0.0,
            _ => true,
        }
    }

    /// Returns its values; `None` if the log lacks its column.
    fn values<'a>(&self, inputs: &Inputs<'a>) -> Option<Cow<'a, [f64]>> {
        let motion = inputs.motion;
        let map = |of: &dyn Fn(usize) -> f64| Cow::Owned((0..motion.len()).map(of).collect());
        let (position, velocity) = (&motion.position, &motion.smooth_velocity);
        Some(match self {
            Self::One => map(&|_| 1.0),
            Self::Velocity => Cow::Borrowed(velocity),
            Self::Speed => map(&|row| velocity[row].abs()),
            Self::Direction { above } => map(&|row| direction(motion.velocity[row], *above)),
            Self::Acceleration => Cow::Borrowed(&motion.acceleration),
            Self::Stop { travel } => Cow::Owned(stop(position, &motion.runs, *travel)),
            Self::StopBehindGap { gap, travel } => {
                let moved = play(position, &motion.runs, 0.5 * gap);
                Cow::Owned(stop(&moved, &motion.runs, *travel))
            }
            Self::Falling { velocity: scale } => map(&|row| (-velocity[row].abs() / scale).exp()),
            Self::Sine { order } => map(&|row| (order * position[row]).sin()),
            Self::Cosine { order } => map(&|row| (order * position[row]).cos()),
            Self::Curve { degree, from, to } => {
                let half = (0.5 * (to - from)).max(1e-12);
                let place = |row: usize| (position[row] - from) / half - 1.0;
                map(&|row| legendre(*degree, place(row).clamp(-MOST_BEYOND, MOST_BEYOND)))
            }
            Self::Column { name, mean, spread, late_s } => {
                let moved = in_time((inputs.column)(name)?, motion, *late_s);
                map(&|row| (moved[row] - mean) / spread)
            }
            Self::ColumnMagnitude { name } => {
                let values = (inputs.column)(name)?;
                map(&|row| values[row].abs())
            }
            Self::ColumnSlope { name } => {
                Cow::Owned(slope((inputs.column)(name)?, &motion.time_s, &motion.runs))
            }
            Self::BendingRate { name, spread, travel, time_constant_s } => {
                let rate = slope((inputs.column)(name)?, &motion.time_s, &motion.runs);
                let stop = stop(position, &motion.runs, *travel);
                let bends = map(&|row| rate[row] / spread * (1.0 - stop[row].abs()));
                Cow::Owned(low_pass(&bends, &motion.runs, time_constant_s / motion.step_s))
            }
            Self::Level => Cow::Borrowed(inputs.level),
            Self::LevelMagnitude => map(&|row| inputs.level[row].abs()),
            Self::Dwell { step, path, mean } => {
                let Breakaway { growth, fading } = breakaway(motion, *step, *path);
                map(&|row| (growth[row] - mean) * fading[row])
            }
            Self::Passed { from_s, to_s } => map(&|row| passed(motion.time_s[row], *from_s, *to_s)),
            Self::RunIn { from_s, to_s, constant } => {
                map(&|row| (-passed(motion.time_s[row], *from_s, *to_s) / constant).exp())
            }
            Self::Warmth { scale, cooling_s } => {
                let heat = heat(motion, inputs.level, *cooling_s);
                map(&|row| 1.0 - (-heat[row] / scale).exp())
            }
            Self::SineByRun { order, phases } => by_run(motion, *order, phases, f64::sin),
            Self::CosineByRun { order, phases } => by_run(motion, *order, phases, f64::cos),
        })
    }
}

/// Returns a Legendre polynomial of degree 1 to 3, which are nearly independent over the travel; NaN for another degree.
fn legendre(degree: u8, x: f64) -> f64 {
    match degree {
        1 => x,
        2 => 1.5 * x * x - 0.5,
        3 => 2.5 * x.powi(3) - 1.5 * x,
        _ => f64::NAN,
    }
}

/// Returns the share of a campaign that has passed. After its end nothing is known, so the last value holds.
fn passed(time_s: f64, from_s: f64, to_s: f64) -> f64 {
    ((time_s - from_s) / (to_s - from_s).max(1e-9)).clamp(0.0, 1.0)
}

/// Returns the sign of a velocity; 0 up to a speed.
fn direction(velocity: f64, above: f64) -> f64 {
    if velocity.abs() > above { velocity.signum() } else { 0.0 }
}

/// Returns the values of a column that is `late_s` after the motion, at the times of the motion.
fn in_time<'a>(values: &'a [f64], motion: &Motion, late_s: f64) -> Cow<'a, [f64]> {
    match (late_s / motion.step_s).round() as i32 {
        0 => Cow::Borrowed(values),
        rows => Cow::Owned(shift(values, &motion.runs, -rows)),
    }
}

/// Returns a wave of the position with a phase of its own in each run.
fn by_run<'a>(motion: &Motion, order: f64, phases: &[f64], wave: fn(f64) -> f64) -> Cow<'a, [f64]> {
    let mut out = vec![0.0; motion.len()];
    for (run, phase) in motion.runs.iter().zip(phases) {
        for row in run.clone() {
            out[row] = wave(order * motion.position[row] + phase);
        }
    }
    Cow::Owned(out)
}

/// What a rest does to the breakaway after it, in all rows.
struct Breakaway {
    /// Growth with the time of the last rest.
    growth: Vec<f64>,
    /// What is left of it after the path since then, 0 to 1.
    fading: Vec<f64>,
}

fn breakaway(motion: &Motion, step: f64, path: f64) -> Breakaway {
    let found = rests(&motion.position, &motion.time_s, &motion.runs, step);
    Breakaway {
        growth: found.dwell_s.iter().map(|dwell| (dwell / DWELL_START_S).ln_1p()).collect(),
        fading: found.path.iter().map(|since| (-since / path).exp()).collect(),
    }
}

/// Returns the mean growth of the breakaway: a shape of the breakaway, and no effect of the time.
pub fn mean_growth(motion: &Motion, step: f64, path: f64) -> f64 {
    let Breakaway { growth, fading } = breakaway(motion, step, path);
    let sum: f64 =
        growth.iter().zip(&fading).fold(0.0, |sum, (growth, fading)| sum + growth * fading);
    sum / fading.iter().fold(1e-12, |count, fading| count + fading)
}

/// Returns the heat of rubbing that a joint holds, in level times path. On a campaign's clock it cools between the runs and is
/// kept from run to run; else each run begins cold.
pub fn heat(motion: &Motion, level: &[f64], cooling_s: f64) -> Vec<f64> {
    let mut heat = vec![0.0; motion.len()];
    let (mut held, mut then_s) = (0.0, 0.0);
    for run in motion.runs.iter().filter(|run| !run.is_empty()) {
        if !motion.has_campaign_clock || cooling_s.is_infinite() {
            (held, then_s) = (0.0, motion.time_s[run.start]);
        }
        for row in run.clone() {
            let seconds = (motion.time_s[row] - then_s).max(0.0);
            let moving = if row > run.start { seconds } else { 0.0 };
            let power = level[row].abs() * motion.velocity[row].abs();
            held = held * (-seconds / cooling_s).exp() + power * moving;
            then_s = motion.time_s[row];
            heat[row] = held;
        }
    }
    heat
}

/// A product of factors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Regressor {
    /// Its factors.
    pub factors: Vec<Factor>,
}

impl<const N: usize> From<[Factor; N]> for Regressor {
    fn from(factors: [Factor; N]) -> Self {
        Self { factors: factors.into() }
    }
}

impl Regressor {
    /// Returns the product with another factor.
    #[must_use]
    pub fn times(mut self, factor: Factor) -> Self {
        self.factors.push(factor);
        self
    }

    /// Returns its values in all rows; `None` if the log lacks one of its columns.
    pub fn values(&self, inputs: &Inputs) -> Option<Vec<f64>> {
        let mut factors = self.factors.iter();
        let Some(first) = factors.next() else { return Some(vec![1.0; inputs.motion.len()]) };
        let mut product = first.values(inputs)?.into_owned();
        for factor in factors {
            let values = factor.values(inputs)?;
            product.iter_mut().zip(values.iter()).for_each(|(product, value)| *product *= value);
        }
        Some(product)
    }
}
