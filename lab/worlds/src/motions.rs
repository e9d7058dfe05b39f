//! Motions as they occur in operation, not planned for an identification.
//!
//! They are not adapted to the resolution of the log. Reversals may take less than a sample period, a campaign may
//! consist of one kind of motion, and a log may begin in the middle of a motion.

use simulated_machines::motion::{Motion, Speeds, Wave};
use simulated_machines::sampler::Sampler;
use std::f64::consts::TAU;

/// Kinds of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    Sine,
    MultiSine,
    Stairs,
    OneWay,
    Rests,
    Triangle,
    Presliding,
    Slow,
}

/// All styles.
pub(super) const STYLES: [Style; 8] = [
    Style::Sine,
    Style::MultiSine,
    Style::Stairs,
    Style::OneWay,
    Style::Rests,
    Style::Triangle,
    Style::Presliding,
    Style::Slow,
];

/// Limits of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Maximum speed, rad/s.
    pub top_rad_s: f64,
    /// Largest acceleration, rad/s^2.
    pub steepest_rad_s2: f64,
    /// Stribeck velocity, rad/s.
    pub stribeck_rad_s: f64,
    /// Presliding travel of the contact, rad.
    pub travel_rad: f64,
    /// Length of a run, s.
    pub seconds: f64,
}

/// Draws a motion of a style.
pub(super) fn draw_motion(sampler: &mut Sampler, drive: &Drive, style: Style) -> Motion {
    let Drive { top_rad_s: top, seconds, .. } = *drive;
    match style {
        Style::Sine => waves(sampler, drive, 1, top),
        Style::Slow => {
            let slow = drive.stribeck_rad_s * sampler.log_between(0.5, 5.0);
            waves(sampler, drive, 1, slow.min(top))
        }
        Style::MultiSine => {
            let count = 2 + sampler.below(4);
            waves(sampler, drive, count, top)
        }
        Style::Presliding => {
            let travel = drive.travel_rad * sampler.log_between(0.5, 8.0);
            // At most the speed of the drive, and at least two periods in a run.
            let fastest =
                (top / (TAU * travel)).min((drive.steepest_rad_s2 / travel).sqrt() / TAU).min(20.0);
            let slowest = 2.0 / seconds;
            let hz =
                if fastest > slowest { sampler.log_between(slowest, fastest) } else { fastest };
            Motion::Presliding { travel, hz, growth: seconds * sampler.between(0.2, 1.0) }
        }
        Style::Stairs => stairs(sampler, drive, false),
        Style::OneWay => stairs(sampler, drive, true),
        Style::Rests => rests(sampler, drive),
        Style::Triangle => triangle(sampler, drive),
    }
}

/// Draws a sum of sines.
fn waves(sampler: &mut Sampler, drive: &Drive, count: usize, top: f64) -> Motion {
    let share = 1.0 / count as f64;
    let waves = (0..count).map(|_| {
        let peak = share * top * sampler.between(0.4, 1.0);
        let fastest = (share * drive.steepest_rad_s2 / (TAU * peak)).min(10.0);
        let slowest = 1.2 / drive.seconds;
        let hz = if fastest > slowest { sampler.log_between(slowest, fastest) } else { slowest };
        // The frequency has priority over the speed, so that a run has at least one period.
        Wave { peak: peak.min(share * drive.steepest_rad_s2 / (TAU * hz)), hz }
    });
    Motion::Waves(waves.collect())
}

/// Draws constant speeds with ramps between them.
fn stairs(sampler: &mut Sampler, drive: &Drive, one_way: bool) -> Motion {
    let mut speeds = Speeds::from_rest(sampler.chance(0.5));
    let mut side = sampler.sign();
    while speeds.end() < drive.seconds {
        let slowest = (0.3 * drive.stribeck_rad_s).min(0.5 * drive.top_rad_s);
        let size = sampler.log_between(slowest, drive.top_rad_s);
        if !one_way && sampler.chance(0.7) {
            side = -side;
        }
        ramp(sampler, drive, &mut speeds, side * size);
        speeds.hold(drive.seconds * sampler.between(0.04, 0.25));
    }
    Motion::Speeds(speeds)
}

/// Draws short movements and rests of very different lengths.
fn rests(sampler: &mut Sampler, drive: &Drive) -> Motion {
    let mut speeds = Speeds::from_rest(sampler.chance(0.5));
    let mut side = sampler.sign();
    while speeds.end() < drive.seconds {
        speeds.hold(drive.seconds * sampler.log_between(0.005, 0.4));
        if sampler.chance(0.5) {
            side = -side;
        }
        let size = (drive.stribeck_rad_s * sampler.log_between(0.5, 20.0)).min(drive.top_rad_s);
        ramp(sampler, drive, &mut speeds, side * size);
        speeds.hold(drive.seconds * sampler.log_between(0.01, 0.15));
        ramp(sampler, drive, &mut speeds, 0.0);
    }
    Motion::Speeds(speeds)
}

/// Draws linear velocity ramps through zero.
fn triangle(sampler: &mut Sampler, drive: &Drive) -> Motion {
    let mut speeds = Speeds::from_rest(false);
    let mut peak = drive.top_rad_s * sampler.log_between(0.05, 1.0) * sampler.sign();
    let slope = drive.steepest_rad_s2 * sampler.log_between(0.02, 1.0);
    while speeds.end() < drive.seconds {
        let rise = (peak - speeds.velocity()).abs();
        speeds.ramp(peak, (rise / slope).clamp(5e-3, 0.6 * drive.seconds));
        peak = -peak;
    }
    Motion::Speeds(speeds)
}

/// Appends a ramp to a velocity, with a drawn acceleration of up to 65 % of the maximum.
fn ramp(sampler: &mut Sampler, drive: &Drive, speeds: &mut Speeds, velocity: f64) {
    let steep = drive.steepest_rad_s2 * sampler.log_between(0.1, 0.65);
    let seconds = (velocity - speeds.velocity()).abs() / steep;
    speeds.ramp(velocity, seconds.clamp(5e-3, 0.4 * drive.seconds));
}
