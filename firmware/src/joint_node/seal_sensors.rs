//! The covariates of the current loop, and the watches of the sensors of side load and pressure.

use crate::control::Covariates;
use crate::sensors::stuck::StuckWatch;

with_defaults! {
    /// The last covariates, with the watches of their sensors.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct SealSensors {
        /// The covariates that the current loop received last.
        pub(crate) covariates: Covariates = Covariates::MISSING,
        pub(crate) radial_force: StuckWatch,
        pub(crate) pressure: StuckWatch,
    }
}

impl SealSensors {
    /// Marks readings of a stuck sensor as missing, and keeps the covariates.
    pub(crate) fn check(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.radial_force.update(&mut covariates.radial_force_n, now_us);
        self.pressure.update(&mut covariates.pressure_diff_mpa, now_us);
        self.covariates = *covariates;
    }
}
