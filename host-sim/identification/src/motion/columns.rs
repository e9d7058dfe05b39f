//! Columns of a log in, the motion as it was out.
//!
//! Levels first, over all stretches; then rest; then each stretch smoothed with its own roughness and its rest
//! known. Where the velocity turns out to be exact (no noise to speak of, none at rest, in step with the
//! position) it is handed back as it is, to the bit.

use super::agreement::{Agreement, agreement};
use super::filter::{Noise, Series, draw};
use super::levels::{Levels, adapt, likeliest, noise_alone};
use super::quantum::{quantum, unstepped};
use super::rest::at_rest;

/// Draws of what is left open: three give a row's variance to a factor of two, and all rows together
/// theirs to a percent.
pub const DRAWS: usize = 3;

/// A velocity whose noise is below this share of the 95th percentile of speed is exact, if it is at rest
/// where the joint is.
const EXACT: f64 = 1e-4;

/// Standard deviations of the noise to either side of zero by which a joint turns.
const TURNS: f64 = 5.0;

/// What a sum leaves of the travel, over what the trapezoid leaves, where the position is such a sum.
const SUM: f64 = 0.1;

/// Runs that begin alike, from which it is no chance.
const FEWEST_ALIKE: usize = 3;

/// Rows from which a stretch has a noise of its own.
const LONG_ENOUGH: usize = 100;

/// Variances of two stretches differ by no more than this: a median of zeros is not a noise of zero.
const LOUDEST: f64 = 1e3;

/// A quantile of the size of noise, and where it lies for a normal one of deviation 1.
const NINETY: (f64, f64) = (0.9, 1.645);

/// One unbroken stretch as it is in the log.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<'a> {
    /// Time, s.
    pub time_s: &'a [f64],
    /// Position, rad or m.
    pub position: Option<&'a [f64]>,
    /// Velocity, rad/s or m/s.
    pub velocity: &'a [f64],
}

/// The motion of a stretch.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Position, where there was one.
    pub position: Option<Vec<f64>>,
    /// Velocity; its trapezoid sum is the displacement.
    pub velocity: Vec<f64>,
    /// Draws of the true velocity minus this one.
    pub draws: Vec<Vec<f64>>,
    /// Rows at rest, `true` each.
    pub at_rest: Vec<bool>,
}

impl Motion {
    /// Whether every number of it is one.
    pub fn is_finite(&self) -> bool {
        let mut all = self.position.iter().chain([&self.velocity]).chain(&self.draws).flatten();
        all.all(|value| value.is_finite())
    }
}

/// What was found about the sensors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensors {
    /// Median step, s.
    pub step_s: f64,
    /// 95th percentile of speed, rad/s or m/s.
    pub speed: f64,
    /// Standard deviation of the position's noise, rad or m; 0 without a position.
    pub position_noise: f64,
    /// Step of a quantised position, rad or m; 0 where it is not.
    pub position_quantum: f64,
    /// Standard deviation of the velocity's noise, rad/s or m/s.
    pub velocity_noise: f64,
    /// The same over the rows at rest alone; 0 where none rests.
    pub noise_at_rest: f64,
    /// Rows at rest.
    pub rows_at_rest: usize,
    /// The velocity beside the position's derivative, where there is a position.
    pub agreement: Option<Agreement>,
    /// Whether the velocity column was left out, because it lags the position or was low-passed.
    pub from_position_alone: bool,
    /// Whether the position column was left out: it was integrated from the velocity, or runs by another
    /// clock than a velocity that is as good.
    pub from_velocity_alone: bool,
    /// Whether the position is a sum of the velocity that begins at the same value in each run.
    pub position_integrated: bool,
    /// RMS of the velocity over the rows at rest; [`Sensors::noise_at_rest`] leaves the worst tenth out.
    pub flicker_at_rest: f64,
    /// Whether the velocity is exact, and taken as it stands.
    pub exact: bool,
    /// Whether it is taken as it stands because there is no position and the joint neither rests nor turns: in
    /// one-way sliding no bristle integrates the noise, and what looks like noise may be the motion.
    pub steady: bool,
}

impl Sensors {
    /// By how much a clean velocity is late (early: negative) against the position, s, where it keeps its clock and
    /// the position is moved to it.
    pub fn velocity_late_s(&self) -> Option<f64> {
        let late =
            self.agreement.filter(|found| self.from_velocity_alone && found.is_merely_late())?;
        Some(late.lag_rows * self.step_s)
    }

    /// Whether the motion is the one that was logged.
    pub fn is_as_logged(&self) -> bool {
        self.exact || self.steady
    }
}

/// What was found of all stretches together, and each of them ready to be smoothed.
#[derive(Clone, Debug)]
pub struct Study {
    /// What was found about the sensors.
    pub sensors: Sensors,
    all: Vec<Series>,
    levels: Option<Levels>,
}

impl Study {
    /// Looks at all stretches: levels of noise, lag, rest.
    pub fn new(stretches: &[Stretch]) -> Self {
        let steps = stretches.iter().flat_map(|s| s.time_s.windows(2).map(|w| w[1] - w[0]));
        let step_s = median(steps);
        let speed =
            quantile(stretches.iter().flat_map(|s| s.velocity.iter().map(|v| v.abs())), 0.95);
        let sensors = Sensors { step_s, speed, exact: true, ..Sensors::default() };
        let mut study = Self { sensors, all: Vec::new(), levels: None };
        if step_s <= 0.0 || speed <= 0.0 {
            return study;
        }
        study.sensors.position_quantum = quantum(stretches.iter().filter_map(|s| s.position));
        let step = study.sensors.position_quantum;
        study.all = stretches.iter().map(|s| series(s, step_s, step)).collect();
        study.look(stretches);
        study
    }

    fn look(&mut self, stretches: &[Stretch]) {
        let Self { sensors, all, levels: found } = self;
        let step_s = sensors.step_s;
        let has_position = all.iter().all(|s| s.position.is_some());
        if has_position {
            let found = agreement(all);
            sensors.agreement = Some(found);
            let unstepped = sensors.position_quantum == 0.0;
            sensors.position_integrated = unstepped && start_alike(stretches) && is_sum(stretches);
            sensors.from_velocity_alone = sensors.position_integrated || found.is_merely_late();
            let is_worse = found.lags() || found.is_filtered();
            sensors.from_position_alone = is_worse && !sensors.from_velocity_alone;
        }
        let own_noise = noise_alone(all);
        if sensors.from_position_alone {
            all.iter_mut().for_each(|s| s.velocity = None);
        }
        if sensors.from_velocity_alone {
            all.iter_mut().for_each(|s| (s.position, s.rounding) = (None, Vec::new()));
        }
        let step = sensors.position_quantum;
        let levels = likeliest(all);
        if has_position {
            sensors.position_noise = (levels.noise.position + step * step / 12.0).sqrt();
        }
        sensors.velocity_noise = levels.noise.velocity.sqrt() / step_s;
        // A velocity that is smooth and wrong leaves its error with the position; rest is judged by what the
        // position does by itself.
        let alone = sensors.agreement.map(|found| found.position_variance).filter(|v| *v > 0.0);
        let position = levels.noise.position.min(alone.unwrap_or(f64::INFINITY));
        let noise = Noise { position, ..levels.noise };
        for series in all.iter_mut() {
            series.loudness = loudness(series, own_noise);
            series.at_rest = at_rest(series, &noise, step, sensors.speed * step_s);
        }
        let resting = all.iter().zip(stretches).flat_map(|(series, stretch)| {
            // Inside: a start may be a row off.
            let inside = series.at_rest.windows(3).map(|near| near.iter().all(|rests| *rests));
            inside.zip(&stretch.velocity[1..]).filter(|(rests, _)| *rests)
        });
        let speeds: Vec<f64> = resting.map(|(_, v)| v.abs()).collect();
        let squares: f64 = speeds.iter().map(|v| v * v).sum();
        sensors.flicker_at_rest = (squares / speeds.len().max(1) as f64).sqrt();
        sensors.rows_at_rest = speeds.len();
        sensors.noise_at_rest = quantile(speeds.into_iter(), NINETY.0) / NINETY.1;
        let nothing = EXACT * sensors.speed;
        sensors.exact = !sensors.from_position_alone
            && (own_noise / step_s).min(sensors.velocity_noise) < nothing
            && sensors.noise_at_rest < nothing;
        let sign = TURNS * sensors.velocity_noise;
        let turns = stretches.iter().any(|stretch| {
            let beyond = |side: f64| stretch.velocity.iter().any(|v| side * v > sign);
            beyond(1.0) && beyond(-1.0)
        });
        let alone = !has_position || sensors.from_velocity_alone;
        sensors.steady = alone && !turns && sensors.rows_at_rest == 0;
        *found = Some(levels);
    }

    /// The motion of a stretch. `normal` gives independent standard normal numbers for the draws.
    pub fn motion(
        &self,
        index: usize,
        stretch: &Stretch,
        normal: &mut dyn FnMut() -> f64,
    ) -> Motion {
        match (&self.levels, self.all.get(index)) {
            (Some(levels), Some(series)) if !self.sensors.is_as_logged() && series.len() > 2 => {
                motion(series, stretch, levels, &self.sensors, normal)
            }
            _ => Motion {
                position: stretch.position.map(<[f64]>::to_vec),
                velocity: stretch.velocity.to_vec(),
                draws: if self.sensors.is_as_logged() {
                    Vec::new()
                } else {
                    vec![vec![0.0; stretch.velocity.len()]; DRAWS]
                },
                at_rest: vec![false; stretch.velocity.len()],
            },
        }
    }
}

/// Whether the position begins at one value in stretch after stretch, and ends elsewhere: it was integrated.
fn start_alike(stretches: &[Stretch]) -> bool {
    let ends: Vec<(f64, f64)> = stretches
        .iter()
        .filter_map(|s| s.position.and_then(|q| Some((*q.first()?, *q.last()?))))
        .collect();
    let Some((first, _)) = ends.first() else { return false };
    let moved = ends.iter().filter(|(start, end)| start != end).count();
    let alike = ends.iter().filter(|(start, _)| start == first).count();
    ends.len() >= FEWEST_ALIKE && alike == ends.len() && 2 * moved > ends.len()
}

/// Whether the position is the sum of velocity times step, row by row, to the last digits: an exact position is not,
/// as it knows what the velocity does between rows; an encoder's differences are, but come in steps.
fn is_sum(stretches: &[Stretch]) -> bool {
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
    let [rectangle, trapezoid] = off.map(|off| quantile(off.into_iter(), 0.9));
    rectangle < SUM * trapezoid
}

/// Variance of a stretch's velocity noise over that of the log: a sensor that is read at another speed, or another
/// rate, is another sensor. 1 where the stretch is too short to say.
fn loudness(series: &Series, own_noise: f64) -> f64 {
    if series.len() < LONG_ENOUGH || own_noise <= 0.0 {
        return 1.0;
    }
    let here = noise_alone(std::slice::from_ref(series));
    (here / own_noise).powi(2).clamp(1.0 / LOUDEST, LOUDEST)
}

/// A stretch as the filter takes it.
fn series(stretch: &Stretch, step_s: f64, quantum: f64) -> Series {
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
    stretch: &Stretch,
    levels: &Levels,
    sensors: &Sensors,
    normal: &mut dyn FnMut() -> f64,
) -> Motion {
    let step_s = sensors.step_s;
    let (jumps, smoothed) = adapt(series, levels);
    let still = |row: usize, value: f64| if series.at_rest[row] { 0.0 } else { value };
    let velocity: Vec<f64> =
        smoothed.states.iter().enumerate().map(|(row, x)| still(row, x[1] / step_s)).collect();
    let origin = stretch.position.and_then(|q| q.first()).copied().unwrap_or_default();
    // A position that was left out stays as it is.
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
    let draws = (0..DRAWS)
        .map(|_| {
            let drawn = draw(series, &levels.noise, &jumps, normal);
            drawn.iter().enumerate().map(|(row, v)| still(row, v / step_s)).collect()
        })
        .collect();
    Motion { position, velocity, draws, at_rest: series.at_rest.clone() }
}

/// The median of the values above 0; 0 without any.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    quantile(values.filter(|v| *v > 0.0), 0.5)
}

/// A quantile; 0 of nothing.
pub fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut all: Vec<f64> = values.collect();
    if all.is_empty() {
        return 0.0;
    }
    let at = ((all.len() - 1) as f64 * share).round() as usize;
    *all.select_nth_unstable_by(at, f64::total_cmp).1
}
