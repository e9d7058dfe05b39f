//! The covariates of the current loop, and the watches of the sensors of side load and pressure.

use crate::control::Covariates;
use crate::sensors::stuck::StuckWatch;

with_defaults! {
    /// The last covariates, with the watches of their sensors.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct SealSensors {
        covariates: Covariates = Covariates::MISSING,
        radial_force: StuckWatch,
        pressure: StuckWatch,
    }
}

impl SealSensors {
    /// Marks readings of a stuck sensor as missing, and keeps the covariates.
    pub(crate) fn check(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.radial_force.update(&mut covariates.radial_force_n, now_us);
        self.pressure.update(&mut covariates.pressure_diff_mpa, now_us);
        self.covariates = *covariates;
    }

    /// Returns the covariates that the current loop received last.
    pub(crate) const fn covariates(&self) -> &Covariates {
        &self.covariates
    }

    /// Returns true if the sensor of the side load is stuck.
    pub(crate) const fn is_radial_force_stuck(&self) -> bool {
        self.radial_force.is_stuck()
    }

    /// Returns true if the sensor of the pressure is stuck.
    pub(crate) const fn is_pressure_stuck(&self) -> bool {
        self.pressure.is_stuck()
    }
}
