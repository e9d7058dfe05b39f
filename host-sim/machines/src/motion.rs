//! Motions that excite a seal: smooth functions of time with known derivatives.
//!
//! To identify six parameters, a log needs oscillations within the bristles' travel (stiffness, damping), slow reversals
//! (static level, Stribeck velocity) and fast sliding in both directions (viscous part). [`Motion::Steady`] alone is not
//! sufficient.

use std::f64::consts::TAU;

/// Velocity as a function of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Constant velocity after a start of half a second.
    Steady {
        /// Velocity, rad/s.
        velocity: f64,
    },
    /// `peak sin(2 pi t / period)`.
    Sine {
        /// Largest speed, rad/s.
        peak: f64,
        /// Period, s.
        period: f64,
    },
    /// Small fast oscillations whose amplitude grows from within the bristles' travel to well beyond it.
    Presliding {
        /// Travel of the largest oscillation, rad.
        travel: f64,
        /// Frequency, Hz.
        frequency: f64,
        /// Length of the growth, s.
        growth: f64,
    },
}

impl Motion {
    /// Returns the velocity at a time from the start of the run, rad/s.
    pub fn velocity(&self, t: f64) -> f64 {
        match *self {
            Motion::Steady { velocity } => velocity * smooth(t / 0.5),
            Motion::Sine { peak, period } => peak * (TAU * t / period).sin(),
            Motion::Presliding { travel, frequency, growth } => {
                // Time derivative of the position travel (t/growth)^2 sin(w t).
                let (w, share) = (TAU * frequency, (t / growth).min(1.0));
                let rising = if t < growth { 2.0 * share / growth } else { 0.0 };
                travel * (rising * (w * t).sin() + share * share * w * (w * t).cos())
            }
        }
    }
}

/// Smooth step from 0 to 1 with zero slope at both ends.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
