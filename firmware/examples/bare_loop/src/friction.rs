//! Friction model `improved-lugre`, written by `host-sim export params.toml --to rust`.
//!
//! `Compensator::<f32>::build(&configuration(), period_s)` validates and builds it. The numbers are
//! exact in `f32`, so the result is bit-identical to that of the parameter file.
//!
//! Start: at the start of a run and after a gap in the samples, [`start`] returns a state for the first
//! measured torque. A joint at rest holds any torque up to its static level, and only a measured torque
//! indicates which one. From a state of zero (`ModelState::default()`, as in a `Compensator`), the torque is wrong
//! until the joint leaves presliding.

use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::parameters::{Choices, Envelope, ParameterError};
use compensator_core::{FrictionModel, LawKind, ModelState, ParameterId, Parameters, Sample, TermKind};

/// Friction law.
pub const LAW: LawKind = LawKind::ImprovedLugre;

/// Terms of the model, in the order of evaluation.
pub const TERMS: [TermKind; 0] = [];

/// Parameters of the model, each in the unit beside it.
pub const VALUES: [(ParameterId, f32); 11] = [
    (ParameterId::CoulombTorque, 1.07), // Nm
    (ParameterId::StaticTorque, 1.62), // Nm
    (ParameterId::StribeckVelocity, 0.052), // rad/s
    (ParameterId::BristleStiffness, 4200.0), // Nm/rad
    (ParameterId::BristleDamping, 0.35), // Nm s/rad
    (ParameterId::ViscousFriction, 0.41), // Nm s/rad
    (ParameterId::RadialForceCoulomb, 0.0042), // Nm/N
    (ParameterId::RadialForceStaticExcess, 0.0), // Nm/N
    (ParameterId::PressureCoulomb, 2.4e-6), // Nm/Pa
    (ParameterId::PressureStaticExcess, 0.0), // Nm/Pa
    (ParameterId::RadialForceRate, 1.1e-6), // rad/N
];

/// Options of the law.
pub const CHOICES: Choices = Choices {
    damping_fades: true,
    printed_extended: false,
    allow_active: false,
};

/// Valid range of the inputs.
pub const ENVELOPE: Envelope = Envelope {
    velocity_max_rad_s: 12.0,
    radial_force_max_n: 100.0,
    pressure_diff_max_pa: 300000.0,
    load_torque_max_nm: 26.0,
    position_max_rad: 1000.0,
    acceleration_max_rad_s2: 1000.0,
    campaign_max_h: 2000.0,
};

/// Parameters of the compensator.
pub const COMPENSATOR: CompensatorParameters = CompensatorParameters {
    scale: 0.8,
    torque_limit_nm: 6.0,
    slew_limit_nm_per_s: 2000.0,
    torque_constant_nm_per_a: 0.9,
    current_limit_a: 26.0,
    blend_velocity_rad_s: 0.05,
    hold_s: 0.1,
    fade_s: 0.4,
};

/// Returns the configuration from which a compensator is built.
pub fn configuration() -> Configuration {
    let mut model = Parameters::new(LAW);
    for term in TERMS {
        model.add_term(term);
    }
    for (id, value) in VALUES {
        model.set(id, value);
    }
    model.choices = CHOICES;
    model.envelope = ENVELOPE;
    Configuration { model, compensator: COMPENSATOR }
}

/// Builds the law for a sample period, and a state from which the first step returns the measured friction torque of
/// the first sample, as far as the static level permits.
#[allow(dead_code, reason = "a loop with a `Compensator` does not call it")]
pub fn start(
    period_s: f32,
    sample: &Sample<f32>,
    torque_nm: f32,
) -> Result<(FrictionModel<f32>, ModelState<f32>), ParameterError> {
    let model = configuration().model.build::<f32>(period_s)?;
    let state = model.state_for_torque(ModelState::default(), sample, torque_nm);
    Ok((model, state))
}
