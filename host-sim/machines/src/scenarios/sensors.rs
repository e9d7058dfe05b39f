//! Sensors of a planned campaign: uneven samples, lost packets, and a good encoder.

use crate::motion::Motion;
use crate::sampler::Sampler;
use crate::sampling::{Sensors, TrueRows};
use std::f64::consts::TAU;
use std::ops::Range;

/// Encoder steps per radian: 21 bits per turn.
const ENCODER_STEPS_PER_RAD: f64 = (1 << 21) as f64 / TAU;

/// Relative error of the velocity by uneven encoder lines. It is zero at rest.
const RELATIVE_VELOCITY_ERROR: f64 = 1e-3;

/// Error of the acceleration, as a share of the largest one of a run.
const RELATIVE_ACCELERATION_ERROR: f64 = 2e-3;

/// Sensors of a campaign. By default, they are exact.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PlannedSensors {
    /// Maximum jitter of a sample time, in sample periods.
    pub jitter: f64,
    /// True if packets are lost in some runs.
    pub gaps: bool,
    /// True if the motion has encoder errors, false if it is exact.
    pub encoder: bool,
    /// Standard deviation of the torque noise, Nm.
    pub noise_nm: f64,
}

impl PlannedSensors {
    /// Draws the sensors. Their torque noise is set later, when the size of the effects is known.
    pub fn draw(sampler: &mut Sampler) -> Self {
        let jitter = if sampler.chance(0.5) { sampler.between(0.0, 0.1) } else { 0.0 };
        let gaps = sampler.chance(1.0 / 3.0);
        Self { jitter, gaps, encoder: sampler.chance(0.4), noise_nm: 0.0 }
    }

    /// Draws the sample times of a run, s from its start.
    ///
    /// The first sample has no jitter, so that it is taken at rest. The bristle torque of a started motion would be
    /// unknown.
    pub fn times(&self, sampler: &mut Sampler, rate_hz: f64, seconds: f64) -> Vec<f64> {
        let rows = ((seconds * rate_hz).round() as usize).max(2);
        let time = |row: usize| {
            let has_jitter = self.jitter > 0.0 && row > 0;
            let shift = if has_jitter { self.jitter * sampler.between(-0.5, 0.5) } else { 0.0 };
            (row as f64 + shift) / rate_hz
        };
        (0..rows).map(time).collect()
    }

    /// Draws the time range of lost packets of a run, s. It is mostly empty.
    ///
    /// The log resumes while the joint slides, so that the bristle torque is known again.
    pub fn lost_s(
        &self,
        sampler: &mut Sampler,
        motion: &Motion,
        limits: &LossLimits,
    ) -> Range<f64> {
        if !self.gaps || !sampler.chance(0.4) {
            return 0.0..0.0;
        }
        let LossLimits { rate_hz, seconds, sliding_rad } = *limits;
        let length = sampler.log_between(0.05, 0.06 + 0.1 * seconds).max(12.0 / rate_hz);
        let resumes = (0..20).map(|_| sampler.between(0.3, 0.9) * seconds).find(|&end| {
            let (before, now) = (motion.at(end - SLIDING_S), motion.at(end));
            let travel = (now.angle - before.angle).abs();
            before.velocity * now.velocity > 0.0 && travel > sliding_rad
        });
        resumes.map_or(0.0..0.0, |end| (end - length).max(0.1 * seconds)..end)
    }
}

impl Sensors for PlannedSensors {
    fn angles(&self, rows: &TrueRows) -> Vec<f64> {
        let line = |angle: &f64| (angle * ENCODER_STEPS_PER_RAD).round() / ENCODER_STEPS_PER_RAD;
        if self.encoder { rows.angles.iter().map(line).collect() } else { rows.angles.clone() }
    }

    fn velocities(&self, sampler: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        let share = if self.encoder { RELATIVE_VELOCITY_ERROR } else { 0.0 };
        rows.velocities.iter().map(|v| v * (1.0 + share * sampler.normal())).collect()
    }

    fn accelerations(&self, sampler: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        let share = if self.encoder { RELATIVE_ACCELERATION_ERROR } else { 0.0 };
        let largest = rows.accelerations.iter().map(|a| a.abs()).fold(0.0, f64::max);
        rows.accelerations.iter().map(|a| a + share * largest * sampler.normal()).collect()
    }

    fn torques(&self, sampler: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        rows.torques.iter().map(|torque| torque + self.noise_nm * sampler.normal()).collect()
    }
}

/// Quantities that limit a packet loss.
pub(super) struct LossLimits {
    pub rate_hz: f64,
    pub seconds: f64,
    /// Travel after which bristles slide, whatever their initial torque.
    pub sliding_rad: f64,
}

/// Minimum sliding time before a log resumes, s.
const SLIDING_S: f64 = 0.05;
