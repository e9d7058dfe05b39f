//! A holding brake at the output: springs close it, and power to its coil releases it.
//!
//! A closed brake is dry friction with a constant torque. It closes and opens some time after the coil is switched.

/// A holding brake.
#[derive(Clone, Copy, Debug)]
pub struct HoldingBrake {
    /// Torque of the closed brake, Nm.
    torque_nm: f64,
    /// Time from the switched coil until the brake is closed, and until it is open, s.
    closing_s: f64,
    opening_s: f64,
    is_energised: bool,
    /// Time since the coil was switched, s.
    since_s: f64,
}

impl HoldingBrake {
    /// Creates a closed brake with this torque (Nm), and these times until it is closed and open (s).
    pub fn new(torque_nm: f64, closing_s: f64, opening_s: f64) -> Self {
        Self { torque_nm, closing_s, opening_s, is_energised: false, since_s: f64::INFINITY }
    }

    /// Switches the coil.
    pub fn energise(&mut self, is_energised: bool) {
        if is_energised != self.is_energised {
            (self.is_energised, self.since_s) = (is_energised, 0.0);
        }
    }

    /// Advances the time by `dt` (s) and returns the torque of the brake, Nm.
    pub fn step(&mut self, dt: f64) -> f64 {
        self.since_s += dt;
        let is_closed = if self.is_energised {
            self.since_s < self.opening_s
        } else {
            self.since_s >= self.closing_s
        };
        if is_closed { self.torque_nm } else { 0.0 }
    }
}
