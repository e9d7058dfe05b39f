//! The network of a joint on its own sensors: evaluated in the background at the rate of its training.
//!
//! Its inputs are the last report of the current loop and the covariates. Its factors are sent with the
//! commands. A tick comes every millisecond, so an evaluation is at most that late. A joint in HIL has its own
//! network ([`crate::hil`]), in step with the samples.

use super::Device;
use crate::control::covariates::{Covariates, MotionReadings};
use crate::driver::loop_data::LoopReport;
use crate::hil::network_object;
use crate::node::dictionary::records::NetworkObject;
use crate::node_settings::{InputSource, NodeSettings};
use crate::parameter_set::ParameterSet;
use compensator_core::network::{FactorSupplier, Factors};
use compensator_core::{Flags, Inputs, compensator::Reading};
use embedded_storage::nor_flash::NorFlash;

/// A network and the time of its next evaluation.
#[derive(Debug, Default)]
pub(super) struct LiveNetwork {
    supplier: Option<FactorSupplier<f32>>,
    due_us: u64,
    /// Friction was compensated at the last call.
    is_on: bool,
}

impl LiveNetwork {
    /// Creates the network of a set, for a joint on its own sensors. A network that cannot be built was refused
    /// at its commit.
    pub(super) fn of(set: &ParameterSet, settings: &NodeSettings) -> Self {
        let network = set.network.as_ref().filter(|_| !settings.is_in_hil());
        let hold_s = set.friction.compensator.hold_s;
        let supplier = network.and_then(|network| FactorSupplier::build(network, hold_s).ok());
        Self { supplier, ..Self::default() }
    }

    /// Returns the state of the input guard, as flags of the compensator.
    pub(super) fn flags(&self) -> Flags {
        let is_outside = |supplier: &FactorSupplier<f32>| supplier.state().is_outside;
        match &self.supplier {
            Some(supplier) if self.is_on && is_outside(supplier) => Flags::NETWORK_OUTSIDE,
            _ => Flags::empty(),
        }
    }

    fn supply(
        &mut self,
        compensates: bool,
        report: &LoopReport,
        covariates: &Covariates,
        now_us: u64,
    ) -> Option<Factors<f32>> {
        let supplier = self.supplier.as_mut()?;
        if !compensates {
            if self.is_on {
                supplier.rest();
            }
            self.is_on = false;
            return None;
        }
        let period_us = (supplier.period_s() * 1e6) as u64;
        let is_first = !self.is_on;
        self.is_on = true;
        if is_first || now_us >= self.due_us {
            // Missed evaluations are skipped.
            let on_time = !is_first && now_us < self.due_us.saturating_add(period_us);
            self.due_us = if on_time { self.due_us } else { now_us }.saturating_add(period_us);
            supplier.evaluate(&inputs(report, covariates), report.bristle_torque_nm);
        }
        Some(supplier.state().factors)
    }
}

/// Returns the inputs of the network; the velocity is that of the observer.
fn inputs(report: &LoopReport, covariates: &Covariates) -> Inputs<f32> {
    let aged = |value: f32| match report.sample_age_us {
        Some(age_us) => Reading { value, age_s: age_us as f32 * 1e-6 },
        None => Reading::missing(),
    };
    let motion = MotionReadings {
        velocity_rad_s: aged(report.velocity_rad_s),
        velocity_reference_rad_s: Reading::missing(),
        position_rad: aged(report.position_rad),
        acceleration_rad_s2: Reading::missing(),
    };
    // The campaign time is not an input of a network.
    Inputs { campaign_time_h: 0.0, ..covariates.inputs(motion) }
}

impl<F: NorFlash> Device<F> {
    /// Returns the network's factors for the law, if there is a network. It is evaluated at its own rate while friction is
    /// compensated.
    pub fn supply(&mut self, covariates: &Covariates, now_us: u64) -> Option<Factors<f32>> {
        let compensates = self.base.supervisor.is_bridge_allowed()
            && self.base.supervisor.is_compensation_allowed();
        self.network.supply(compensates, self.base.report(), covariates, now_us)
    }

    /// Returns the network object: zeros and factors of 1 if there is no network.
    pub(crate) fn network_state(&self) -> NetworkObject {
        let state = match self.base.settings.source {
            InputSource::Bus => self.samples.hil.network_object(),
            InputSource::Sensors => self.network.supplier.as_ref().map(network_object),
        };
        let one = 1f32.to_bits();
        state.unwrap_or(NetworkObject {
            present: self.set().network.is_some().into(),
            coulomb_factor: one,
            static_factor: one,
            stiffness_factor: one,
            ..NetworkObject::default()
        })
    }
}
