//! Which motions a campaign consists of.
//!
//! Hidden structure can only be found where the seal itself is known, so every campaign has what
//! determines LuGre: oscillations within the bristles' travel, slow reversals, fast sliding both
//! ways, rests. The remaining runs lean towards the motions in which the hidden effect shows, as
//! whoever plans measurements of a joint with a problem would choose them.

use super::dice::Dice;
use super::effect::Effect;
use super::motion::{Motion, Speeds, Wave};
use crate::friction::Seal;
use std::f64::consts::TAU;

/// Kinds of run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Style {
    Fast,
    Presliding,
    Slow,
    Stairs,
    Rests,
    Several,
    OneWay,
    Triangle,
}

/// What every campaign has at least, and then the others.
const STYLES: [Style; 8] = [
    Style::Fast,
    Style::Presliding,
    Style::Slow,
    Style::Stairs,
    Style::Rests,
    Style::Several,
    Style::OneWay,
    Style::Triangle,
];

/// Motions in which an effect shows.
fn favoured(effect: Effect) -> &'static [Style] {
    use Style::{Fast, OneWay, Presliding, Rests, Several, Slow, Stairs, Triangle};
    match effect {
        Effect::RadialForceRate => &[Rests, Presliding, Slow],
        Effect::TemperatureViscous | Effect::QuadraticDrag => &[Fast, Stairs, OneWay],
        Effect::PositionRipple | Effect::GravityImbalance => &[Stairs, Fast, OneWay],
        Effect::DwellTimeStatic => &[Rests],
        Effect::Backlash => &[Triangle, Slow, Rests],
        Effect::StribeckShape => &[Slow, Triangle, Rests],
        Effect::UnmodelledInertia => &[Fast, Several],
        Effect::ChannelDelay => &[Several, Triangle, Fast],
        _ => &STYLES,
    }
}

/// Limits of the drive and of what a log of this rate can resolve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Fastest speed, rad/s.
    pub top_rad_s: f64,
    /// Largest acceleration, rad/s^2.
    pub steepest_rad_s2: f64,
    /// Longest rest, s.
    pub longest_rest_s: f64,
    pub rate_hz: f64,
    /// Length of a run, s.
    pub seconds: f64,
}

/// Fewest samples in which a reversal crosses the bristles' travel. Faster ones would leave in
/// the log a jump at an unknown time, which no law could explain.
const SAMPLES_IN_REVERSAL: f64 = 3.0;

impl Drive {
    /// The steepest acceleration with which bristles can be followed, rad/s^2.
    pub fn steepest(seal: &Seal, rate_hz: f64) -> f64 {
        let crossing = 2.0 * seal.static_nm / seal.k0;
        let seconds = SAMPLES_IN_REVERSAL / rate_hz;
        let resolved = 2.0 * crossing / (seconds * seconds);
        // The damping's torque at a reversal stays of the size of the level.
        let damped = 2.0 * seal.static_nm * seal.k0 / (seal.k1 * seal.k1);
        resolved.min(damped).min(15.0)
    }
}

/// A motion for each of so many runs.
pub(super) fn motions(
    dice: &mut Dice,
    seal: &Seal,
    drive: &Drive,
    effects: &[Effect],
    runs: usize,
) -> Vec<Motion> {
    let mut styles: Vec<Style> = STYLES.into_iter().take(runs).collect();
    while styles.len() < runs {
        let effect = dice.pick(effects);
        let leaning = effect.filter(|_| dice.chance(0.65)).map_or(&STYLES[..], favoured);
        styles.extend(dice.pick(leaning));
    }
    // The order of the runs must say nothing about their motion, or drift would look like it.
    dice.shuffle(&mut styles);
    styles.into_iter().map(|style| motion(dice, seal, drive, style)).collect()
}

fn motion(dice: &mut Dice, seal: &Seal, drive: &Drive, style: Style) -> Motion {
    let stribeck = seal.stribeck_rad_s;
    match style {
        Style::Fast => {
            let peak = drive.top_rad_s * dice.between(0.5, 1.0);
            sine(drive, peak, dice.between(0.15, 0.4))
        }
        Style::Slow => {
            let (peak, hz) = (stribeck * dice.between(2.0, 5.0), dice.between(0.2, 0.6));
            sine(drive, peak, hz)
        }
        Style::Presliding => {
            let share = dice.between(3.0, 8.0);
            // From end to end of the bristles' travel in no less than four samples.
            let resolved = drive.rate_hz / (2.0 * TAU * share);
            let hz = resolved.min(4.0) * dice.between(0.6, 1.0);
            let travel = share * seal.static_nm / seal.k0;
            Motion::Presliding { travel, hz, growth: drive.seconds * dice.between(0.6, 1.0) }
        }
        Style::Several => several(dice, drive),
        Style::Stairs => stairs(dice, stribeck, drive, false),
        Style::OneWay => stairs(dice, stribeck, drive, true),
        Style::Rests => rests(dice, stribeck, drive),
        Style::Triangle => triangle(dice, stribeck, drive),
    }
}

/// One sine, with at least one period in the run and no steeper than the drive may be.
fn sine(drive: &Drive, peak: f64, hz: f64) -> Motion {
    let slowest = 1.2 / drive.seconds;
    let hz = hz.min(drive.steepest_rad_s2 / (TAU * peak)).max(slowest);
    let peak = peak.min(drive.steepest_rad_s2 / (TAU * hz));
    Motion::Waves(vec![Wave { peak, hz }])
}

fn several(dice: &mut Dice, drive: &Drive) -> Motion {
    let count = 3 + dice.below(2);
    let fastest = (drive.rate_hz / 60.0).min(2.5);
    let share = dice.between(0.5, 1.0) * drive.steepest_rad_s2 / count as f64;
    let waves = (0..count).map(|_| {
        let hz = dice.log_between(1.2 / drive.seconds, fastest.max(2.0 / drive.seconds));
        let peak = (share / (TAU * hz)).min(drive.top_rad_s / count as f64);
        Wave { peak, hz }
    });
    Motion::Waves(waves.collect())
}

/// Constant speeds with ramps between them.
fn stairs(dice: &mut Dice, stribeck: f64, drive: &Drive, one_way: bool) -> Motion {
    let mut speeds = Speeds::from_rest(dice.chance(0.5));
    let mut side = dice.sign();
    while speeds.end() < drive.seconds {
        let size = dice.log_between(0.4 * stribeck, drive.top_rad_s);
        if !one_way && dice.chance(0.7) {
            side = -side;
        }
        let steepest = drive.steepest_rad_s2 * dice.between(0.4, 0.65);
        // What can be reached within a part of the run.
        let reach = speeds.velocity() + side * size;
        let change = (reach - speeds.velocity()).abs().max((side * size - speeds.velocity()).abs());
        let longest = 0.4 * drive.seconds;
        let size =
            if change / steepest > longest { size * longest * steepest / change } else { size };
        let seconds = (side * size - speeds.velocity()).abs() / steepest;
        speeds.ramp(side * size, seconds.max(0.02));
        speeds.hold(dice.between(0.3, 1.5));
    }
    Motion::Speeds(speeds)
}

/// Starts, short ways and rests of very different length.
fn rests(dice: &mut Dice, stribeck: f64, drive: &Drive) -> Motion {
    let mut speeds = Speeds::from_rest(dice.chance(0.5));
    let mut side = dice.sign();
    while speeds.end() < drive.seconds {
        speeds.hold(dice.log_between(0.05, drive.longest_rest_s));
        if dice.chance(0.5) {
            side = -side;
        }
        let size = stribeck * dice.log_between(0.8, 8.0);
        let steepest = dice.log_between(0.15, 1.0) * drive.steepest_rad_s2 * 0.6;
        let seconds = (size / steepest).clamp(0.05, 2.0);
        speeds.ramp(side * size, seconds);
        speeds.hold(dice.between(0.1, 0.8));
        speeds.ramp(0.0, (size / (0.5 * drive.steepest_rad_s2)).max(0.05));
    }
    Motion::Speeds(speeds)
}

/// Slow straight ramps through zero.
fn triangle(dice: &mut Dice, stribeck: f64, drive: &Drive) -> Motion {
    let mut speeds = Speeds::from_rest(false);
    let mut peak = stribeck * dice.between(1.2, 4.0) * dice.sign();
    while speeds.end() < drive.seconds {
        let rise = (peak - speeds.velocity()).abs();
        speeds.ramp(peak, dice.between(0.6, 2.0).max(rise / drive.steepest_rad_s2));
        peak = -peak;
    }
    Motion::Speeds(speeds)
}
