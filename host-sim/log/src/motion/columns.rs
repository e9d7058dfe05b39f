//! Estimation of the motion from the columns of a log.
//!
//! First the noise levels are estimated over all segments, then rest is detected, then each segment is smoothed with
//! its own roughness and its rows at rest. If the velocity is exact (negligible noise, also at rest, and no lag against
//! the position) it is returned bit for bit.

use super::agreement::{Agreement, agreement};
use super::filter::{Noise, Series, draws};
use super::levels::{Levels, adapt, likeliest, noise_alone};
use super::quantum::{quantum, unstepped};
use super::rest::at_rest;
use crate::statistics::{median, quantile};
use crate::work::checkpoint;

/// Number of draws of the uncertain motion. Three give a row's variance to a factor of two, and that of all rows
/// together to a percent.
pub const DRAWS: usize = 3;

/// Maximum noise of an exact velocity, as a share of the 95th percentile of speed.
const MAX_EXACT_NOISE: f64 = 1e-4;

/// Minimum speed in both directions for a joint to reverse, standard deviations of the noise.
const MIN_REVERSAL_SPEED: f64 = 5.0;

/// Maximum residual of a rectangle sum, relative to that of the trapezoid sum, for a position that is such a sum.
const MAX_SUM_RESIDUAL: f64 = 0.1;

/// Minimum number of segments with equal start for it not to be chance.
const MIN_EQUAL_STARTS: usize = 3;

/// Minimum length of a segment with its own noise level, rows.
const MIN_NOISE_ROWS: usize = 100;

/// Maximum ratio of the noise variances of a segment and of the log. It prevents a noise of zero if most differences
/// are zero.
const MAX_VARIANCE_RATIO: f64 = 1e3;

/// Quantile of the magnitude of noise from which its standard deviation is estimated.
const NOISE_QUANTILE: f64 = 0.9;

/// That quantile for a normal distribution of standard deviation 1.
const NORMAL_QUANTILE: f64 = 1.645;

/// One segment of a log.
#[derive(Clone, Copy, Debug)]
pub struct MotionSegment<'a> {
    /// Time, s.
    pub time_s: &'a [f64],
    /// Position, rad or m.
    pub position: Option<&'a [f64]>,
    /// Velocity, rad/s or m/s.
    pub velocity: &'a [f64],
}

/// The reconstructed motion of a segment.
#[derive(Clone, Debug, Default)]
pub struct SegmentMotion {
    /// Position, if it is logged.
    pub position: Option<Vec<f64>>,
    /// Velocity; its trapezoid sum is the displacement.
    pub velocity: Vec<f64>,
    /// Draws of the true velocity minus this one.
    pub draws: Vec<Vec<f64>>,
}

impl SegmentMotion {
    /// Returns true if all values are finite.
    pub fn is_finite(&self) -> bool {
        let mut all = self.position.iter().chain([&self.velocity]).chain(&self.draws).flatten();
        all.all(|value| value.is_finite())
    }
}

/// Properties of the motion sensors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensors {
    /// Median step, s.
    pub step_s: f64,
    /// 95th percentile of speed, rad/s or m/s.
    pub speed: f64,
    /// Step of a quantised position, rad or m; 0 if it is not quantised.
    pub position_quantum: f64,
    /// Standard deviation of the velocity's noise, rad/s or m/s.
    pub velocity_noise: f64,
    /// The same for the rows at rest; 0 if there are none.
    pub noise_at_rest: f64,
    /// Number of rows at rest.
    pub rows_at_rest: usize,
    /// Comparison of the velocity with the position's derivative, if there is a position.
    pub agreement: Option<Agreement>,
    /// True if the velocity is not used, because it lags the position or was low-pass filtered.
    pub from_position_alone: bool,
    /// True if the position is not used, because it was integrated from the velocity, or has another delay than a
    /// velocity of equal accuracy.
    pub from_velocity_alone: bool,
    /// True if the position is a sum of the velocity with the same start value in each run.
    pub position_integrated: bool,
    /// True if the velocity is exact and used as logged.
    pub exact: bool,
    /// True if the velocity is used as logged because there is no position and the joint neither rests nor reverses. In
    /// one-way sliding no bristle integrates the noise, and apparent noise may be motion.
    pub steady: bool,
}

impl Sensors {
    /// Returns the delay of a clean velocity against the position, s (negative: early), if the position is to be
    /// shifted to the velocity's clock.
    pub fn velocity_late_s(&self) -> Option<f64> {
        let late =
            self.agreement.filter(|found| self.from_velocity_alone && found.is_pure_delay())?;
        Some(late.lag_rows * self.step_s)
    }

    /// Returns true if the motion is used as logged.
    pub fn is_as_logged(&self) -> bool {
        self.exact || self.steady
    }
}

/// Analysis of all segments together, from which each can be smoothed.
#[derive(Clone, Debug)]
pub struct MotionAnalysis {
    /// Properties of the sensors.
    pub sensors: Sensors,
    all: Vec<Series>,
    levels: Option<Levels>,
}

impl MotionAnalysis {
    /// Analyses all segments: noise levels, lag, rest.
    pub fn new(stretches: &[MotionSegment]) -> Self {
        let steps = stretches.iter().flat_map(|s| s.time_s.windows(2).map(|w| w[1] - w[0]));
        let step_s = median(&mut steps.filter(|step| *step > 0.0).collect::<Vec<_>>());
        let speeds = stretches.iter().flat_map(|s| s.velocity.iter().map(|v| v.abs()));
        let speed = quantile(&mut speeds.collect::<Vec<_>>(), 0.95).unwrap_or_default();
        let step_s = step_s.unwrap_or_default();
        let sensors = Sensors { step_s, speed, exact: true, ..Sensors::default() };
        let mut study = Self { sensors, all: Vec::new(), levels: None };
        if step_s <= 0.0 || speed <= 0.0 {
            return study;
        }
        study.sensors.position_quantum = quantum(stretches.iter().filter_map(|s| s.position));
        let step = study.sensors.position_quantum;
        study.all = stretches.iter().map(|s| series(s, step_s, step)).collect();
        study.analyse(stretches);
        study
    }

    fn analyse(&mut self, stretches: &[MotionSegment]) {
        let Self { sensors, all, levels: found } = self;
        let step_s = sensors.step_s;
        let has_position = all.iter().all(|s| s.position.is_some());
        if has_position {
            let found = agreement(all);
            sensors.agreement = Some(found);
            let unstepped = sensors.position_quantum == 0.0;
            sensors.position_integrated = unstepped && start_alike(stretches) && is_sum(stretches);
            sensors.from_velocity_alone = sensors.position_integrated || found.is_pure_delay();
            let is_worse = found.lags() || found.is_filtered() || found.low_pass_rows.is_some();
            sensors.from_position_alone = is_worse && !sensors.from_velocity_alone;
        }
        let noise_per_step = noise_alone(all);
        if sensors.from_position_alone {
            all.iter_mut().for_each(|s| s.velocity = None);
        }
        if sensors.from_velocity_alone {
            all.iter_mut().for_each(|s| (s.position, s.rounding) = (None, Vec::new()));
        }
        let step = sensors.position_quantum;
        let levels = likeliest(all);
        sensors.velocity_noise = levels.noise.velocity.sqrt() / step_s;
        // A velocity that is smooth and wrong adds its error to the position's noise. So rest is detected with the
        // noise of the position alone.
        let alone = sensors.agreement.map(|found| found.position_variance).filter(|v| *v > 0.0);
        let position = levels.noise.position.min(alone.unwrap_or(f64::INFINITY));
        let noise = Noise { position, ..levels.noise };
        for series in all.iter_mut() {
            checkpoint();
            series.loudness = loudness(series, noise_per_step);
            series.at_rest = at_rest(series, &noise, step, sensors.speed * step_s);
        }
        let resting = all.iter().zip(stretches).flat_map(|(series, stretch)| {
            // Only inner rows: the start of a rest may be a row off.
            let inside = series.at_rest.windows(3).map(|near| near.iter().all(|rests| *rests));
            inside.zip(&stretch.velocity[1..]).filter(|(rests, _)| *rests)
        });
        let mut speeds: Vec<f64> = resting.map(|(_, v)| v.abs()).collect();
        sensors.rows_at_rest = speeds.len();
        sensors.noise_at_rest =
            quantile(&mut speeds, NOISE_QUANTILE).unwrap_or_default() / NORMAL_QUANTILE;
        let nothing = MAX_EXACT_NOISE * sensors.speed;
        sensors.exact = !sensors.from_position_alone
            && (noise_per_step / step_s).min(sensors.velocity_noise) < nothing
            && sensors.noise_at_rest < nothing;
        let sign = MIN_REVERSAL_SPEED * sensors.velocity_noise;
        let turns = stretches.iter().any(|stretch| {
            let beyond = |side: f64| stretch.velocity.iter().any(|v| side * v > sign);
            beyond(1.0) && beyond(-1.0)
        });
        let alone = !has_position || sensors.from_velocity_alone;
        sensors.steady = alone && !turns && sensors.rows_at_rest == 0;
        *found = Some(levels);
    }

    /// Returns the reconstructed motion of a segment, or the logged one of up to two rows. `normal` returns standard normal numbers.
    pub fn motion(
        &self,
        index: usize,
        stretch: &MotionSegment,
        normal: &mut dyn FnMut() -> f64,
    ) -> SegmentMotion {
        match (&self.levels, self.all.get(index)) {
            (Some(levels), Some(series)) if series.len() > 2 => {
                motion(series, stretch, levels, &self.sensors, normal)
            }
            _ => SegmentMotion {
                position: stretch.position.map(<[f64]>::to_vec),
                velocity: stretch.velocity.to_vec(),
                draws: vec![vec![0.0; stretch.velocity.len()]; DRAWS],
            },
        }
    }
}

/// Returns true if the position starts at one value in all segments and ends elsewhere: it was integrated.
fn start_alike(stretches: &[MotionSegment]) -> bool {
    let ends: Vec<(f64, f64)> = stretches
        .iter()
        .filter_map(|s| s.position.and_then(|q| Some((*q.first()?, *q.last()?))))
        .collect();
    let Some((first, _)) = ends.first() else { return false };
    let moved = ends.iter().filter(|(start, end)| start != end).count();
    let alike = ends.iter().filter(|(start, _)| start == first).count();
    ends.len() >= MIN_EQUAL_STARTS && alike == ends.len() && 2 * moved > ends.len()
}

/// Returns true if the position is the sum of velocity times step, row by row, to the last digits. A measured position
/// is not: it includes the motion between rows. An encoder's differences are, but they are quantised.
fn is_sum(stretches: &[MotionSegment]) -> bool {
    let mut off: [Vec<f64>; 2] = Default::default();
    for stretch in stretches {
        let Some(q) = stretch.position else { return false };
        for row in 1..q.len() {
            let step = stretch.time_s[row] - stretch.time_s[row - 1];
            let (before, now) = (stretch.velocity[row - 1], stretch.velocity[row]);
            let travel = q[row] - q[row - 1];
            let rectangle = (travel - step * now).abs().min((travel - step * before).abs());
            off[0].push(rectangle);
            off[1].push((travel - 0.5 * step * (now + before)).abs());
        }
    }
    let [rectangle, trapezoid] = off.map(|mut off| quantile(&mut off, 0.9).unwrap_or_default());
    rectangle < MAX_SUM_RESIDUAL * trapezoid
}

/// Returns the noise variance of a segment's velocity relative to that of the log. It differs if the speed or the rate
/// differs. Returns 1 for a short segment.
fn loudness(series: &Series, noise_per_step: f64) -> f64 {
    if series.len() < MIN_NOISE_ROWS || noise_per_step <= 0.0 {
        return 1.0;
    }
    let here = noise_alone(std::slice::from_ref(series));
    (here / noise_per_step).powi(2).clamp(1.0 / MAX_VARIANCE_RATIO, MAX_VARIANCE_RATIO)
}

/// Converts a segment to the input of the filter.
fn series(stretch: &MotionSegment, step_s: f64, quantum: f64) -> Series {
    let origin = stretch.position.and_then(|q| q.first()).copied().unwrap_or_default();
    let from_first: Option<Vec<f64>> =
        stretch.position.map(|q| q.iter().map(|q| q - origin).collect());
    let (position, rounding) = match from_first {
        Some(position) if quantum > 0.0 => {
            let (position, rounding) = unstepped(&position, quantum);
            (Some(position), rounding)
        }
        other => (other, Vec::new()),
    };
    Series {
        steps: stretch.time_s.windows(2).map(|w| (w[1] - w[0]) / step_s).collect(),
        position,
        rounding,
        loudness: 1.0,
        velocity: Some(stretch.velocity.iter().map(|v| v * step_s).collect()),
        at_rest: vec![false; stretch.time_s.len()],
    }
}

fn motion(
    series: &Series,
    stretch: &MotionSegment,
    levels: &Levels,
    sensors: &Sensors,
    normal: &mut dyn FnMut() -> f64,
) -> SegmentMotion {
    let step_s = sensors.step_s;
    let (jumps, smoothed) = adapt(series, levels);
    let still = |row: usize, value: f64| if series.at_rest[row] { 0.0 } else { value };
    let velocity: Vec<f64> =
        smoothed.states.iter().enumerate().map(|(row, x)| still(row, x[1] / step_s)).collect();
    let origin = stretch.position.and_then(|q| q.first()).copied().unwrap_or_default();
    // A position that is not used stays as logged.
    let as_logged = || stretch.position.map(<[f64]>::to_vec);
    let position = series.position.as_ref().map(|_| {
        let mut held = 0.0;
        let each = smoothed.states.iter().enumerate().map(|(row, x)| {
            if row == 0 || !(series.at_rest[row] && series.at_rest[row - 1]) {
                held = x[0] + origin;
            }
            held
        });
        each.collect()
    });
    let position = position.or_else(as_logged);
    let mut draws = draws(series, &levels.noise, &jumps, DRAWS, normal);
    for (row, v) in draws.iter_mut().flat_map(|draw| draw.iter_mut().enumerate()) {
        *v = still(row, *v / step_s);
    }
    SegmentMotion { position, velocity, draws }
}
