//! The reference joint of all measurements: that of Ding et al., with every part of the law active.
//!
//! A parameter of 0 would cost the same instructions (the step has one path) but could hide a wrong bit. So
//! side load, pressure, fading damping and viscous friction are all active.

use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};

/// Returns a configuration with this law and these terms.
///
/// A term that does not fit is left out. The list of a measurement is constant, and its figures would show
/// the omission.
pub fn configuration(law: LawKind, terms: &[TermKind]) -> Configuration {
    let mut model = Parameters::<f32>::new(law)
        .with(ParameterId::CoulombTorque, 1.5)
        .with(ParameterId::StaticTorque, 2.2)
        .with(ParameterId::StribeckVelocity, 0.1)
        .with(ParameterId::BristleStiffness, 1e4)
        .with(ParameterId::BristleDamping, 30.0)
        .with(ParameterId::ViscousFriction, 0.08)
        .with(ParameterId::RadialForceCoulomb, 0.01)
        .with(ParameterId::PressureCoulomb, 2.4e-6)
        .with(ParameterId::RadialForceRate, 1e-6)
        .with(ParameterId::TemperatureViscosity, 0.02)
        .with(ParameterId::RippleSine, 0.05)
        .with(ParameterId::RippleCosine, 0.03)
        .with(ParameterId::RippleOrder, 3.0)
        .with(ParameterId::LookupColumn, 7.0)
        .with(ParameterId::LookupLower, 0.1)
        .with(ParameterId::LookupUpper, 0.8);
    for (index, (torque, level)) in LOOKUP_TORQUES.into_iter().zip(LOOKUP_LEVELS).enumerate() {
        let level_index = index as f32;
        model.set(torque, 0.25 - 0.07 * level_index);
        model.set(level, 0.03 * level_index * (5.0 - level_index) - 0.1);
    }
    model.choices.damping_fades = true;
    // Fixed point holds the angle of a ripple only up to 2048 rad.
    model.envelope.position_max_rad = 100.0;
    for term in terms {
        model.add_term(*term);
    }
    Configuration { model, compensator: CompensatorParameters::default() }
}
