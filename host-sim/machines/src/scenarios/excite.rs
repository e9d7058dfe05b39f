//! Selection of the motions of a campaign.
//!
//! A hidden effect can only be identified if the seal itself is identifiable. Every campaign therefore
//! contains the motions that determine LuGre: oscillations within the bristles' travel, slow reversals,
//! fast sliding in both directions, and rests. The remaining runs prefer motions in which the hidden
//! effect is visible, as in a planned measurement.

use super::hidden_cause::HiddenCause;
use crate::friction::Seal;
use crate::motion::{Motion, Speeds, Wave};
use crate::sampler::Sampler;
use std::f64::consts::TAU;

/// Kinds of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Style {
    Fast,
    Presliding,
    Slow,
    Stairs,
    Rests,
    MultiSine,
    OneWay,
    Triangle,
}

/// All styles. The first ones are part of every campaign.
const STYLES: [Style; 8] = [
    Style::Fast,
    Style::Presliding,
    Style::Slow,
    Style::Stairs,
    Style::Rests,
    Style::MultiSine,
    Style::OneWay,
    Style::Triangle,
];

/// Returns the styles in which an effect is visible.
fn preferred_styles(effect: HiddenCause) -> &'static [Style] {
    use Style::{Fast, MultiSine, OneWay, Presliding, Rests, Slow, Stairs, Triangle};
    match effect {
        HiddenCause::RadialForceRate => &[Rests, Presliding, Slow],
        HiddenCause::TemperatureViscous | HiddenCause::QuadraticDrag => &[Fast, Stairs, OneWay],
        HiddenCause::PositionRipple | HiddenCause::GravityImbalance => &[Stairs, Fast, OneWay],
        HiddenCause::TorqueRipple => &[Stairs, Slow, OneWay],
        HiddenCause::DwellTimeStatic => &[Rests],
        HiddenCause::Backlash => &[Triangle, Slow, Rests],
        HiddenCause::StribeckShape => &[Slow, Triangle, Rests],
        HiddenCause::UnmodelledInertia => &[Fast, MultiSine],
        HiddenCause::ChannelDelay => &[MultiSine, Triangle, Fast],
        _ => &STYLES,
    }
}

/// Limits of the drive and of the time resolution of the log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Maximum speed, rad/s.
    pub top_rad_s: f64,
    /// Largest acceleration, rad/s^2.
    pub steepest_rad_s2: f64,
    /// Maximum duration of a rest, s.
    pub longest_rest_s: f64,
    pub rate_hz: f64,
    /// Length of a run, s.
    pub seconds: f64,
}

/// Minimum number of samples in which a reversal crosses the bristles' travel. A faster reversal would be a jump at an
/// unknown time, which no friction law can explain.
const MIN_REVERSAL_SAMPLES: f64 = 3.0;

impl Drive {
    /// Returns the maximum acceleration at which the log resolves the bristle deflection, rad/s^2.
    pub fn steepest(seal: &Seal, rate_hz: f64) -> f64 {
        let crossing = 2.0 * seal.static_nm / seal.k0;
        let seconds = MIN_REVERSAL_SAMPLES / rate_hz;
        let resolved = 2.0 * crossing / (seconds * seconds);
        // The damping torque at a reversal stays in the order of the level.
        let damped = 2.0 * seal.static_nm * seal.k0 / (seal.k1 * seal.k1);
        resolved.min(damped).min(15.0)
    }
}

/// Draws a motion for each run.
pub(super) fn draw_motions(
    sampler: &mut Sampler,
    seal: &Seal,
    drive: &Drive,
    effects: &[HiddenCause],
    runs: usize,
) -> Vec<Motion> {
    let mut styles: Vec<Style> = STYLES.into_iter().take(runs).collect();
    while styles.len() < runs {
        let effect = sampler.pick(effects);
        let candidates =
            effect.filter(|_| sampler.chance(0.65)).map_or(&STYLES[..], preferred_styles);
        styles.extend(sampler.pick(candidates));
    }
    // Random order of the runs, so that the motion is not confounded with a drift.
    sampler.shuffle(&mut styles);
    styles.into_iter().map(|style| motion(sampler, seal, drive, style)).collect()
}

/// Draws a motion of a style.
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
            // A movement through the whole bristle travel takes at least four samples.
            let resolved = drive.rate_hz / (2.0 * TAU * share);
            let hz = resolved.min(4.0) * sampler.between(0.6, 1.0);
            let travel = share * seal.static_nm / seal.k0;
            Motion::Presliding { travel, hz, growth: drive.seconds * sampler.between(0.6, 1.0) }
        }
        Style::MultiSine => multi_sine(sampler, drive),
        Style::Stairs => stairs(sampler, stribeck, drive, false),
        Style::OneWay => stairs(sampler, stribeck, drive, true),
        Style::Rests => rests(sampler, stribeck, drive),
        Style::Triangle => triangle(sampler, stribeck, drive),
    }
}

/// Returns one sine with at least one period in the run, within the acceleration limit of the drive.
fn sine(drive: &Drive, peak: f64, hz: f64) -> Motion {
    let slowest = 1.2 / drive.seconds;
    let hz = hz.min(drive.steepest_rad_s2 / (TAU * peak)).max(slowest);
    let peak = peak.min(drive.steepest_rad_s2 / (TAU * hz));
    Motion::Waves(vec![Wave { peak, hz }])
}

/// Draws a sum of three or four sines.
fn multi_sine(sampler: &mut Sampler, drive: &Drive) -> Motion {
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

/// Draws constant speeds with ramps between them.
fn stairs(sampler: &mut Sampler, stribeck: f64, drive: &Drive, one_way: bool) -> Motion {
    let mut speeds = Speeds::from_rest(sampler.chance(0.5));
    let mut side = sampler.sign();
    while speeds.end() < drive.seconds {
        let size = sampler.log_between(0.4 * stribeck, drive.top_rad_s);
        if !one_way && sampler.chance(0.7) {
            side = -side;
        }
        let steepest = drive.steepest_rad_s2 * sampler.between(0.4, 0.65);
        // The speed is limited to what the drive reaches within 40 % of the run.
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

/// Draws short movements and rests of very different lengths.
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

/// Draws slow linear velocity ramps through zero.
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
