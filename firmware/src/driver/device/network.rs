//! The network of a joint on its own sensors: evaluated in the background, at the rate it was trained with.
//!
//! It reads what the current loop last reported and what the compensator is told of the joint; its factors go down with
//! the orders. A tick comes once a millisecond, so an evaluation is late by that at most. A joint in HIL has its own
//! ([`crate::hil`]), in step with the samples.

use super::Device;
use crate::control::Covariates;
use crate::driver::live::LoopReport;
use crate::hil::NetworkGuard;
use crate::node::dictionary::records::NetworkState;
use crate::node_settings::{NodeSettings, Source};
use crate::parameter_set::ParameterSet;
use compensator_core::network::{Factors, Supplier};
use compensator_core::{Flags, Inputs, compensator::Reading};
use embedded_storage::nor_flash::NorFlash;

/// A network and when it is due.
#[derive(Debug, Default)]
pub(super) struct LiveNetwork {
    supplier: Option<Supplier<f32>>,
    due_us: u64,
    /// Friction was compensated at the last look.
    is_on: bool,
}

impl LiveNetwork {
    /// The set's, where the joint is on its own sensors; one that cannot be built was refused at its commit.
    pub(super) fn of(set: &ParameterSet, settings: &NodeSettings) -> Self {
        let network = set.network.as_ref().filter(|_| settings.source == Source::Sensors);
        let hold_s = set.friction.compensator.hold_s;
        let supplier = network.and_then(|network| Supplier::build(network, hold_s).ok());
        Self { supplier, ..Self::default() }
    }

    /// What it last had to say of its inputs, as flags of the compensator.
    pub(super) fn flags(&self) -> Flags {
        let is_outside = |supplier: &Supplier<f32>| supplier.state().is_outside;
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
            // Evaluations missed are not made up for.
            let on_time = !is_first && now_us < self.due_us.saturating_add(period_us);
            self.due_us = if on_time { self.due_us } else { now_us }.saturating_add(period_us);
            supplier.evaluate(&inputs(report, covariates), report.bristle_torque_nm);
        }
        Some(supplier.state().factors)
    }

    fn guard(&self) -> Option<NetworkGuard> {
        let state = self.supplier.as_ref()?.state();
        Some(NetworkGuard {
            is_outside: state.is_outside,
            outside_count: state.outside_count,
            share: state.share,
            factors: state.factors,
        })
    }
}

/// What a network is told; the velocity is the observer's.
fn inputs(report: &LoopReport, covariates: &Covariates) -> Inputs<f32> {
    let aged = |value: f32| match report.sample_age_us {
        Some(age_us) => Reading { value, age_s: age_us as f32 * 1e-6 },
        None => Reading::missing(),
    };
    Inputs {
        velocity_rad_s: aged(report.velocity_rad_s),
        position_rad: aged(report.position_rad),
        radial_force_n: covariates.radial_force_n,
        pressure_diff_mpa: covariates.pressure_diff_mpa,
        temperature_c: covariates.temperature_c,
        load_torque_nm: covariates.load_torque_nm,
        auxiliary: covariates.auxiliary,
        ..Inputs::missing()
    }
}

impl<F: NorFlash> Device<F> {
    /// See [`crate::driver::Driver::supply`].
    pub(in crate::driver) fn supply(
        &mut self,
        covariates: &Covariates,
        now_us: u64,
    ) -> Option<Factors<f32>> {
        let compensates =
            self.supervisor.bridge_allowed() && self.supervisor.compensation_allowed();
        self.network.supply(compensates, &self.report, covariates, now_us)
    }

    /// The network as an object: all zeros and factors of 1 where there is none.
    pub(in crate::driver) fn network_state(&self) -> NetworkState {
        let has = self.set().network.is_some();
        let guard = match self.settings.source {
            Source::Bus => self.hil.network_guard(),
            Source::Sensors => self.network.guard(),
        };
        let none = NetworkGuard {
            is_outside: false,
            outside_count: 0,
            share: 0.0,
            factors: Factors::default(),
        };
        let guard = guard.unwrap_or(none);
        NetworkState {
            present: has.into(),
            outside: guard.is_outside.into(),
            outside_count: guard.outside_count,
            share: guard.share.to_bits(),
            coulomb_factor: guard.factors.coulomb.to_bits(),
            static_factor: guard.factors.static_level.to_bits(),
            stiffness_factor: guard.factors.stiffness.to_bits(),
        }
    }
}
