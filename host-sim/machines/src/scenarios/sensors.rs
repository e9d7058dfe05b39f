//! Sampling, packet loss and resolution of the log of a simulated run.
//!
//! Values are rounded to the resolution of the file, so that a log in memory equals the one read back
//! from `data.csv`.

use crate::motion::Motion;
use crate::sampler::Sampler;
use std::ops::Range;

/// Sensor properties of a campaign. By default, the sensors are exact.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sensors {
    /// Maximum jitter of a sample time, in sample periods.
    pub jitter: f64,
    /// True if packets are lost in some runs.
    pub gaps: bool,
    /// True if velocity and position have encoder errors, false if they are exact.
    pub encoder: bool,
}

impl Sensors {
    /// Draws the sensor properties.
    pub fn draw(sampler: &mut Sampler) -> Self {
        let jitter = if sampler.chance(0.5) { sampler.between(0.0, 0.1) } else { 0.0 };
        Self { jitter, gaps: sampler.chance(1.0 / 3.0), encoder: sampler.chance(0.4) }
    }

    /// Draws the sample times of a run, s from its start. None are in `lost`.
    ///
    /// The first sample has no jitter, so that it is taken at rest. The bristle torque of a started motion would be
    /// unknown.
    pub fn times(
        &self,
        sampler: &mut Sampler,
        rate_hz: f64,
        seconds: f64,
        lost: &Range<f64>,
    ) -> Vec<f64> {
        let rows = ((seconds * rate_hz).round() as usize).max(2);
        (0..rows)
            .map(|row| {
                let has_jitter = self.jitter > 0.0 && row > 0;
                let shift = if has_jitter { self.jitter * sampler.between(-0.5, 0.5) } else { 0.0 };
                rounded((row as f64 + shift) / rate_hz, MICRO)
            })
            .filter(|t| !lost.contains(t))
            .collect()
    }

    /// Draws the time range of lost packets of a run, s. It is mostly empty.
    ///
    /// The log resumes while the joint slides, so that the bristle torque is known again.
    pub fn lost(&self, sampler: &mut Sampler, motion: &Motion, size: &LossLimits) -> Range<f64> {
        if !self.gaps || !sampler.chance(0.4) {
            return 0.0..0.0;
        }
        let seconds = size.seconds;
        let length = sampler.log_between(0.05, 0.06 + 0.1 * seconds).max(12.0 / size.rate_hz);
        let resumes = (0..20).map(|_| sampler.between(0.3, 0.9) * seconds).find(|&end| {
            let (before, now) = (motion.at(end - SLIDING_S), motion.at(end));
            let travel = (now.angle - before.angle).abs();
            before.velocity * now.velocity > 0.0 && travel > size.sliding_rad
        });
        resumes.map_or(0.0..0.0, |end| (end - length).max(0.1 * seconds)..end)
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

/// Steps per unit of a value with a resolution of 1e-6 or 1e-9.
pub(super) const MICRO: f64 = 1e6;
pub(super) const NANO: f64 = 1e9;

/// Rounds a value to `per_unit` steps per unit.
pub(super) fn rounded(value: f64, per_unit: f64) -> f64 {
    // Adding 0 converts -0 to 0.
    (value * per_unit).round() / per_unit + 0.0
}
