//! Courses of side load, pressure and water temperature over the time of a joint in service.

use std::f64::consts::TAU;

/// Time in which a step of a course is completed, s: a load is put down, not dropped.
const STEP_RAMP_S: f64 = 2.0;

/// A quantity over time: a constant, a tide of minutes, a wave of seconds, and a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Course {
    /// Constant part.
    pub base: f64,
    /// Amplitude of a slow oscillation.
    pub tide: f64,
    /// Its period, s.
    pub tide_period_s: f64,
    /// Its phase at time 0, rad.
    pub tide_phase_rad: f64,
    /// Amplitude of a fast oscillation.
    pub wave: f64,
    /// Its frequency, Hz.
    pub wave_hz: f64,
    /// Size of a step.
    pub step: f64,
    /// Its time, s.
    pub step_at_s: f64,
}

impl Course {
    /// Returns a constant.
    pub fn constant(base: f64) -> Self {
        Self { base, ..Self::default() }
    }

    /// Returns the value at a time, s.
    pub fn at(&self, time_s: f64) -> f64 {
        let oscillation = |size: f64, turns: f64, phase: f64| match size {
            0.0 => 0.0,
            _ => size * (TAU * turns + phase).sin(),
        };
        self.base
            + oscillation(self.tide, time_s / self.tide_period_s, self.tide_phase_rad)
            + oscillation(self.wave, time_s * self.wave_hz, 0.0)
            + self.step * ((time_s - self.step_at_s) / STEP_RAMP_S).clamp(0.0, 1.0)
    }
}

/// Surroundings of a joint over time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Side load, N.
    pub side_load_n: Course,
    /// Pressure difference, Pa.
    pub pressure_pa: Course,
    /// Water temperature, deg C.
    pub water_c: Course,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn course_is_the_sum_of_its_parts() {
        let course = Course {
            base: 10.0,
            tide: 2.0,
            tide_period_s: 100.0,
            wave: 0.5,
            wave_hz: 1.0,
            step: 4.0,
            step_at_s: 50.0,
            ..Course::default()
        };
        assert!((course.at(0.25) - 10.0 - 2.0 * (TAU * 0.0025).sin() - 0.5).abs() < 1e-12);
        assert!((course.at(51.0) - 12.0 - 2.0 * (TAU * 0.51).sin()).abs() < 1e-9);
        assert!((course.at(75.0) - 12.0).abs() < 1e-9);
        assert_eq!(Course::constant(3.0).at(1e6), 3.0);
    }
}
