//! Which motions a campaign consists of.
//!
//! Hidden structure can only be found where the seal itself is known, so every campaign has what
//! determines LuGre: oscillations within the bristles' travel, slow reversals, fast sliding both
//! ways, rests. The remaining runs lean towards the motions in which the hidden effect shows, as
//! whoever plans measurements of a joint with a problem would choose them.

use super::hidden_cause::HiddenCause;
use super::motion::{Motion, Speeds, Wave};
use super::sampler::Sampler;
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
fn favoured(effect: HiddenCause) -> &'static [Style] {
    use Style::{Fast, OneWay, Presliding, Rests, Several, Slow, Stairs, Triangle};
    match effect {
        HiddenCause::RadialForceRate => &[Rests, Presliding, Slow],
        HiddenCause::TemperatureViscous | HiddenCause::QuadraticDrag => &[Fast, Stairs, OneWay],
        HiddenCause::PositionRipple | HiddenCause::GravityImbalance => &[Stairs, Fast, OneWay],
        HiddenCause::TorqueRipple => &[Stairs, Slow, OneWay],
        HiddenCause::DwellTimeStatic => &[Rests],
        HiddenCause::Backlash => &[Triangle, Slow, Rests],
        HiddenCause::StribeckShape => &[Slow, Triangle, Rests],
        HiddenCause::UnmodelledInertia => &[Fast, Several],
        HiddenCause::ChannelDelay => &[Several, Triangle, Fast],
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
    sampler: &mut Sampler,
    seal: &Seal,
    drive: &Drive,
    effects: &[HiddenCause],
    runs: usize,
) -> Vec<Motion> {
    let mut styles: Vec<Style> = STYLES.into_iter().take(runs).collect();
    while styles.len() < runs {
        let effect = sampler.pick(effects);
        let leaning = effect.filter(|_| sampler.chance(0.65)).map_or(&STYLES[..], favoured);
        styles.extend(sampler.pick(leaning));
    }
    // The order of the runs must say nothing about their motion, or drift would look like it.
    sampler.shuffle(&mut styles);
    styles.into_iter().map(|style| motion(sampler, seal, drive, style)).collect()
}

fn motion(sampler: &mut Sampler, seal: &Seal, drive: &Drive, style: Style) -> Motion {
    let stribeck = seal.stribeck_rad_s;
    match style {
        Style::Fast => {
            let peak = drive.top_rad_s * sampler.between(0.5, 1.0);
            sine(drive, peak, sampler.between(0.15, 0.4))
        }
        Style::Slow => {
            let (peak, hz) = (stribeck * sampler.between(2.0, 5.0), sampler.between(0.2, 0.6));
            sine(drive, peak, hz)
        }
        Style::Presliding => {
            let share = sampler.between(3.0, 8.0);
            // From end to end of the bristles' travel in no less than four samples.
            let resolved = drive.rate_hz / (2.0 * TAU * share);
            let hz = resolved.min(4.0) * sampler.between(0.6, 1.0);
            let travel = share * seal.static_nm / seal.k0;
            Motion::Presliding { travel, hz, growth: drive.seconds * sampler.between(0.6, 1.0) }
        }
        Style::Several => several(sampler, drive),
        Style::Stairs => stairs(sampler, stribeck, drive, false),
        Style::OneWay => stairs(sampler, stribeck, drive, true),
        Style::Rests => rests(sampler, stribeck, drive),
        Style::Triangle => triangle(sampler, stribeck, drive),
    }
}

/// One sine, with at least one period in the run and no steeper than the drive may be.
fn sine(drive: &Drive, peak: f64, hz: f64) -> Motion {
    let slowest = 1.2 / drive.seconds;
    let hz = hz.min(drive.steepest_rad_s2 / (TAU * peak)).max(slowest);
    let peak = peak.min(drive.steepest_rad_s2 / (TAU * hz));
    Motion::Waves(vec![Wave { peak, hz }])
}

fn several(sampler: &mut Sampler, drive: &Drive) -> Motion {
    let count = 3 + sampler.below(2);
    let fastest = (drive.rate_hz / 60.0).min(2.5);
    let share = sampler.between(0.5, 1.0) * drive.steepest_rad_s2 / count as f64;
    let waves = (0..count).map(|_| {
        let hz = sampler.log_between(1.2 / drive.seconds, fastest.max(2.0 / drive.seconds));
        let peak = (share / (TAU * hz)).min(drive.top_rad_s / count as f64);
        Wave { peak, hz }
    });
    Motion::Waves(waves.collect())
}

/// Constant speeds with ramps between them.
fn stairs(sampler: &mut Sampler, stribeck: f64, drive: &Drive, one_way: bool) -> Motion {
    let mut speeds = Speeds::from_rest(sampler.chance(0.5));
    let mut side = sampler.sign();
    while speeds.end() < drive.seconds {
        let size = sampler.log_between(0.4 * stribeck, drive.top_rad_s);
        if !one_way && sampler.chance(0.7) {
            side = -side;
        }
        let steepest = drive.steepest_rad_s2 * sampler.between(0.4, 0.65);
        // What can be reached within a part of the run.
        let reach = speeds.velocity() + side * size;
        let change = (reach - speeds.velocity()).abs().max((side * size - speeds.velocity()).abs());
        let longest = 0.4 * drive.seconds;
        let size =
            if change / steepest > longest { size * longest * steepest / change } else { size };
        let seconds = (side * size - speeds.velocity()).abs() / steepest;
        speeds.ramp(side * size, seconds.max(0.02));
        speeds.hold(sampler.between(0.3, 1.5));
    }
    Motion::Speeds(speeds)
}

/// Starts, short ways and rests of very different length.
fn rests(sampler: &mut Sampler, stribeck: f64, drive: &Drive) -> Motion {
    let mut speeds = Speeds::from_rest(sampler.chance(0.5));
    let mut side = sampler.sign();
    while speeds.end() < drive.seconds {
        speeds.hold(sampler.log_between(0.05, drive.longest_rest_s));
        if sampler.chance(0.5) {
            side = -side;
        }
        let size = stribeck * sampler.log_between(0.8, 8.0);
        let steepest = sampler.log_between(0.15, 1.0) * drive.steepest_rad_s2 * 0.6;
        let seconds = (size / steepest).clamp(0.05, 2.0);
        speeds.ramp(side * size, seconds);
        speeds.hold(sampler.between(0.1, 0.8));
        speeds.ramp(0.0, (size / (0.5 * drive.steepest_rad_s2)).max(0.05));
    }
    Motion::Speeds(speeds)
}

/// Slow straight ramps through zero.
fn triangle(sampler: &mut Sampler, stribeck: f64, drive: &Drive) -> Motion {
    let mut speeds = Speeds::from_rest(false);
    let mut peak = stribeck * sampler.between(1.2, 4.0) * sampler.sign();
    while speeds.end() < drive.seconds {
        let rise = (peak - speeds.velocity()).abs();
        speeds.ramp(peak, sampler.between(0.6, 2.0).max(rise / drive.steepest_rad_s2));
        peak = -peak;
    }
    Motion::Speeds(speeds)
}
