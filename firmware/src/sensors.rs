//! Sensors of a joint, without their board.
//!
//! Drivers over embedded-hal's traits and the arithmetic from what a converter counted to SI units:
//! - [`bus_recovery`]: nine clocks and a stop for an I2C bus that is held;
//! - [`as504x`]: magnetic encoder on SPI, read by the current loop in every period;
//! - [`ms5837`]: water pressure on I2C, in small steps that never wait;
//! - [`shunt`]: phase currents from low-side shunts;
//! - [`strain_gauge`]: side load on the shaft from a Wheatstone bridge;
//! - [`stuck`]: whether a sensor of side load or pressure still measures;
//! - [`thermistor`]: temperature of bridge and motor from a divider.
//!
//! [`Local`] keeps what they gave, with its age. A quantity may come over the bus as well; whichever is younger
//! counts, so a joint without a sensor is told and a joint with one needs no telling.

pub mod as504x;
pub mod bus_recovery;
pub mod ms5837;
pub mod quiet;
pub mod shunt;
pub mod strain_gauge;
pub mod stuck;
pub mod thermistor;

use crate::control::Covariates;
use compensator_core::compensator::Reading;

#[derive(Clone, Copy, Debug)]
struct Seen {
    value: f32,
    at_us: u64,
}

/// What this board's own sensors last gave.
#[derive(Clone, Copy, Debug, Default)]
pub struct Local {
    radial_force_n: Option<Seen>,
    pressure_diff_mpa: Option<Seen>,
    temperature_c: Option<Seen>,
}

impl Local {
    /// Side load on the shaft, N. A value that is not finite is none: the last good one ages.
    pub fn radial_force(&mut self, value: f32, now_us: u64) {
        keep(&mut self.radial_force_n, value, now_us);
    }

    /// Outside minus inside pressure, Pa.
    pub fn pressure_diff(&mut self, value: f32, now_us: u64) {
        keep(&mut self.pressure_diff_mpa, value * 1e-6, now_us);
    }

    /// Temperature at the seal, deg C.
    pub fn temperature(&mut self, value: f32, now_us: u64) {
        keep(&mut self.temperature_c, value, now_us);
    }

    /// Puts these readings where the bus gave none, or an older one.
    pub fn complete(&self, covariates: &mut Covariates, now_us: u64) {
        for (own, reported) in [
            (self.radial_force_n, &mut covariates.radial_force_n),
            (self.pressure_diff_mpa, &mut covariates.pressure_diff_mpa),
            (self.temperature_c, &mut covariates.temperature_c),
        ] {
            let Some(own) = own else { continue };
            let age_s = now_us.saturating_sub(own.at_us) as f32 * 1e-6;
            let never_reported = reported.age_s.is_nan() || reported.age_s < 0.0;
            if never_reported || age_s < reported.age_s {
                *reported = Reading { value: own.value, age_s };
            }
        }
    }
}

fn keep(place: &mut Option<Seen>, value: f32, at_us: u64) {
    if value.is_finite() {
        *place = Some(Seen { value, at_us });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_younger_of_bus_and_board_counts() {
        let mut local = Local::default();
        let mut covariates = Covariates::none();
        local.complete(&mut covariates, 0);
        assert!(covariates.radial_force_n.age_s < 0.0);
        local.radial_force(12.0, 1_000_000);
        local.radial_force(f32::NAN, 2_000_000);
        local.complete(&mut covariates, 3_000_000);
        assert_eq!((covariates.radial_force_n.value, covariates.radial_force_n.age_s), (12.0, 2.0));
        assert!(covariates.pressure_diff_mpa.age_s < 0.0);
        covariates.radial_force_n = Reading { value: 7.0, age_s: 0.5 };
        local.complete(&mut covariates, 3_000_000);
        assert_eq!(covariates.radial_force_n.value, 7.0);
        local.pressure_diff(3e5, 10);
        local.temperature(11.0, 10);
        local.complete(&mut covariates, 10);
        assert!((covariates.pressure_diff_mpa.value - 0.3).abs() < 1e-7);
        assert_eq!(covariates.temperature_c.value, 11.0);
    }
}
