//! An absolute encoder at the output of the gear, with BiSS C.
//!
//! Its ring is not centred on the shaft, which gives an error once per turn, and its zero is anywhere.

use super::serial_encoder::{SerialEncoder, SerialFault};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Errors of rings on hollow shafts that are centred by hand: 20 to 100 seconds of arc, rad.
const ECCENTRICITY_RAD: std::ops::Range<f64> = 1e-4..5e-4;

/// The encoder.
#[derive(Clone, Debug)]
pub struct OutputEncoder {
    serial: SerialEncoder,
    /// Its angle at the output position 0, turns.
    pub zero_turns: f64,
    /// Amplitude of the error once per turn, rad.
    pub eccentricity_rad: f64,
    eccentric_phase_rad: f64,
    /// It falls while the output moves in its positive direction.
    pub is_reversed: bool,
}

impl OutputEncoder {
    /// An encoder of 18 bits that counts no turns. The seed determines its zero and its error.
    pub fn new(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed ^ 0x0e2c);
        let mut serial = SerialEncoder::new(seed ^ 0x51de);
        serial.turn_bits = 0;
        Self {
            serial,
            zero_turns: random.random_range(0.0..1.0),
            eccentricity_rad: random.random_range(ECCENTRICITY_RAD),
            eccentric_phase_rad: random.random_range(0.0..TAU),
            is_reversed: false,
        }
    }

    /// Sets the fault from now on.
    pub fn set_fault(&mut self, fault: SerialFault) {
        self.serial.set_fault(fault);
    }

    /// Sets the standard deviation of its position, rad.
    pub fn set_noise(&mut self, noise_rad: f64) {
        self.serial.noise_counts = noise_rad / TAU * (1u64 << self.serial.bits) as f64;
    }

    /// Latches the output at this position, rad. Returns the levels of the line, as [`SerialEncoder::frame`].
    pub fn frame(&mut self, position_rad: f64) -> u64 {
        let error_rad = self.eccentricity_rad * (position_rad + self.eccentric_phase_rad).sin();
        let shown_rad = position_rad + error_rad;
        let direction = if self.is_reversed { -1.0 } else { 1.0 };
        self.serial.frame(direction * shown_rad / TAU + self.zero_turns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turns(encoder: &mut OutputEncoder, position_rad: f64) -> f64 {
        // Two clocks idle, two busy, start and CDS.
        f64::from((encoder.frame(position_rad) << 6 >> 46) as u32) / 262_144.0
    }

    #[test]
    fn output_encoder_is_off_once_per_turn_by_its_eccentricity() {
        let mut encoder = OutputEncoder::new(3);
        encoder.set_noise(0.0);
        encoder.zero_turns = 0.25;
        (encoder.eccentricity_rad, encoder.eccentric_phase_rad) = (1e-3, 0.0);
        let quarter = turns(&mut encoder, TAU / 4.0) - 0.25;
        assert!((TAU * quarter - TAU / 4.0 - 1e-3).abs() < 3e-5, "{quarter}");
        encoder.is_reversed = true;
        let back = turns(&mut encoder, TAU / 8.0);
        assert!((back - 0.125 + 1e-3 / TAU * 0.5f64.sqrt()).abs() < 1e-5, "{back}");
    }
}
