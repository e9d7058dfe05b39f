//! Position, velocity and acceleration from the encoder, as the driver's observer estimates them.
//!
//! The equations are those of the driver: a tracking loop of third order. A reading that is missing or implausible is
//! replaced by the prediction. After 2 ms, or if readings stay the same while the joint moves, the encoder is lost.

use crate::plant::PERIOD_S;
use std::f64::consts::TAU;

/// Bandwidth of the observer, Hz.
const BANDWIDTH_HZ: f64 = 100.0;
/// Largest plausible speed of the joint, rad/s.
const SPEED_MAX_RAD_S: f64 = 12.0;
/// Time without a valid reading before the encoder is lost, periods.
const COAST: u32 = 2;
/// Periods with valid readings before a lost encoder counts again.
const SETTLE: u32 = 50;
/// Identical readings of a frozen encoder: as of the driver, at a twentieth of its rate. Later, the observer would follow the
/// repeated reading.
const FROZEN_READINGS: u32 = 2;
/// Innovation of a frozen encoder, rad of the joint.
const FROZEN_INNOVATION_RAD: f64 = 2.4e-4;

/// The observer.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    /// Position, rad.
    pub position_rad: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
    last_rad: f64,
    missing: u32,
    identical: u32,
    settling: u32,
}

impl Encoder {
    /// Creates an observer at rest.
    pub fn new(position_rad: f64) -> Self {
        Self {
            position_rad,
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
            last_rad: position_rad,
            missing: 0,
            identical: 0,
            settling: 0,
        }
    }

    /// Returns true if the position is unknown.
    pub fn is_lost(&self) -> bool {
        self.settling > 0
    }

    /// Processes a reading, rad.
    pub fn step(&mut self, reading_rad: f64) {
        let dt = PERIOD_S;
        let reach_rad = 2e-3 + f64::from(self.missing + 1) * SPEED_MAX_RAD_S * dt;
        let is_valid = reading_rad.is_finite()
            && (self.missing > COAST || (reading_rad - self.last_rad).abs() <= reach_rad);
        if is_valid && self.missing > COAST {
            *self = Self { settling: SETTLE, ..Self::new(reading_rad) };
        }
        let predicted =
            self.position_rad + dt * self.velocity_rad_s + 0.5 * dt * dt * self.acceleration_rad_s2;
        if !is_valid {
            self.missing = self.missing.saturating_add(1);
            (self.position_rad, self.acceleration_rad_s2) = (predicted, 0.0);
            if self.missing > COAST {
                self.lose();
            }
            return;
        }
        let z = (-TAU * BANDWIDTH_HZ * dt).exp();
        let error = reading_rad - predicted;
        self.position_rad = predicted + (1.0 - z.powi(3)) * error;
        self.velocity_rad_s +=
            dt * self.acceleration_rad_s2 + 1.5 * (1.0 - z).powi(2) * (1.0 + z) / dt * error;
        self.acceleration_rad_s2 += (1.0 - z).powi(3) / (dt * dt) * error;
        self.identical = if reading_rad == self.last_rad { self.identical + 1 } else { 0 };
        self.last_rad = reading_rad;
        self.missing = 0;
        self.settling = self.settling.saturating_sub(1);
        if self.identical >= FROZEN_READINGS && error.abs() > FROZEN_INNOVATION_RAD {
            self.lose();
        }
    }

    fn lose(&mut self) {
        (self.velocity_rad_s, self.acceleration_rad_s2) = (0.0, 0.0);
        (self.missing, self.settling) = (COAST + 1, SETTLE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_follows_motion_and_loses_missing_readings() {
        let mut encoder = Encoder::new(0.0);
        (0..2000).for_each(|k| encoder.step(1.5 * 1e-3 * f64::from(k)));
        assert!((encoder.velocity_rad_s - 1.5).abs() < 1e-6);
        (0..3).for_each(|_| encoder.step(f64::NAN));
        assert!(encoder.is_lost());
        (0..100).for_each(|k| encoder.step(3.0 + 1.5 * 1e-3 * f64::from(k)));
        assert!(!encoder.is_lost());
        // The same reading while the joint moved is a frozen encoder.
        (0..20).for_each(|_| encoder.step(3.15));
        assert!(encoder.is_lost());
    }
}
