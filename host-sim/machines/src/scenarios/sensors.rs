//! What is logged of a simulated run, when, and how exactly.
//!
//! A sensor's resolution is also that of the number in the file, so a log in memory and one
//! that was read back from `data.csv` are the same.

use super::motion::Motion;
use super::sampler::Sampler;
use std::ops::Range;

/// How a log is taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensors {
    /// Largest shift of a sample from its place in the grid, in periods.
    pub jitter: f64,
    /// Whether packets are lost in some runs.
    pub gaps: bool,
    /// Whether velocity and position have an encoder's errors; else they are exact.
    pub encoder: bool,
}

impl Sensors {
    pub fn draw(sampler: &mut Sampler) -> Self {
        let jitter = if sampler.chance(0.5) { sampler.between(0.0, 0.1) } else { 0.0 };
        Self { jitter, gaps: sampler.chance(1.0 / 3.0), encoder: sampler.chance(0.4) }
    }

    /// When the samples of a run are taken, s from its start. None are in `lost`. The first is taken
    /// at rest: what bristles hold in a motion that has just begun nobody can know.
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
                let jitters = self.jitter > 0.0 && row > 0;
                let shift = if jitters { self.jitter * sampler.between(-0.5, 0.5) } else { 0.0 };
                rounded((row as f64 + shift) / rate_hz, MICRO)
            })
            .filter(|t| !lost.contains(t))
            .collect()
    }

    /// The packets that are lost in a run, s: mostly none. The log resumes where the joint has been
    /// sliding for a while, so that what the bristles hold is known again.
    pub fn lost(&self, sampler: &mut Sampler, motion: &Motion, size: &LossSize) -> Range<f64> {
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

/// What decides where packets may be lost.
pub(super) struct LossSize {
    pub rate_hz: f64,
    pub seconds: f64,
    /// Travel after which bristles slide, whatever they held.
    pub sliding_rad: f64,
}

/// How long a joint has been sliding where a log resumes, s.
const SLIDING_S: f64 = 0.05;

/// Steps of a value per unit: what the last digit in the file stands for.
pub(super) const MICRO: f64 = 1e6;
pub(super) const NANO: f64 = 1e9;

/// A value as its last digit shows it.
pub(super) fn rounded(value: f64, per_unit: f64) -> f64 {
    // The sum with 0 makes of a minus nothing a nothing.
    (value * per_unit).round() / per_unit + 0.0
}
