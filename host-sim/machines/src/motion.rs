//! Motions that excite a seal: smooth functions of time with their derivatives known.
//!
//! A log that is to determine six parameters must contain what each of them does: oscillations
//! within the bristles' travel (stiffness, damping), slow reversals (static level, Stribeck velocity),
//! fast sliding both ways (viscous part). [`Motion::Steady`] alone contains almost none of it.

use std::f64::consts::TAU;

/// A velocity over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Constant speed after a start of half a second, rad/s.
    Steady {
        /// The speed, signed, rad/s.
        velocity: f64,
    },
    /// `peak sin(2 pi t / period)`.
    Sine {
        /// Largest speed, rad/s.
        peak: f64,
        /// Period, s.
        period: f64,
    },
    /// Small fast oscillations that grow from within the bristles' travel to well beyond it.
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
    /// Velocity at a time from the start of the run, rad/s.
    pub fn velocity(&self, t: f64) -> f64 {
        match *self {
            Motion::Steady { velocity } => velocity * smooth(t / 0.5),
            Motion::Sine { peak, period } => peak * (TAU * t / period).sin(),
            Motion::Presliding { travel, frequency, growth } => {
                // d/dt of travel (t/growth)^2 sin(w t), so that the position is the simple one.
                let (w, share) = (TAU * frequency, (t / growth).min(1.0));
                let rising = if t < growth { 2.0 * share / growth } else { 0.0 };
                travel * (rising * (w * t).sin() + share * share * w * (w * t).cos())
            }
        }
    }
}

/// 0 to 1 with zero slope at both ends.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
