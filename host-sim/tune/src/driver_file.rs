//! Parameter files of a joint driver: the friction model and the driver's other settings.
//!
//! ```toml
//! [motor]                                 # follows the sections of the model
//! gear_ratio = 51.0
//! [thresholds]
//! [watch]
//! [sensors]
//! ```
//!
//! Every command reads its parameter files with this module, so that the file of a whole driver is accepted wherever a
//! model is required. The library that fits models does not depend on the motor's parameters.

use compensator_core::TermKind;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::network::JointNetwork;
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use firmware::sensors::SensorParameters;
use firmware::supervisor::Thresholds;
use firmware::watch::WatchParameters;
use friction_fit::params::{
    self, CompensatorSection, ParameterFile, ParameterFileError, Section, emit_model, emit_section,
};
use joint_log::JointKind;
use std::path::Path;

/// Sections of a driver's file that follow those of the model.
const SECTIONS: [Section; 4] = [
    Section { name: "motor", fields: &MotorParameters::NAMES },
    Section { name: "thresholds", fields: &Thresholds::NAMES },
    Section { name: "watch", fields: &WatchParameters::NAMES },
    Section { name: "sensors", fields: &SensorParameters::NAMES },
];

/// Reads and validates a file.
///
/// # Errors
/// See [`params::read`].
pub fn read(path: &Path) -> Result<ParameterFile, ParameterFileError> {
    params::read(path, &SECTIONS)
}

/// Reads and validates the text of a file.
///
/// # Errors
/// See [`params::parse`].
pub fn parse(text: &str) -> Result<ParameterFile, ParameterFileError> {
    params::parse(text, &SECTIONS)
}

/// Applies a file to a driver's parameter set. The friction model and its network are replaced as a whole; the model's rigid-body
/// parts are left out. Of the other sections, only the values in the file are replaced. `network` is that of the file, in the
/// driver's form.
pub fn apply(file: &ParameterFile, network: Option<JointNetwork>, set: &mut ParameterSet) {
    // A value that the file does not contain is NaN.
    fn merge<const N: usize>(mut values: [f32; N], from_file: Option<&Vec<f32>>) -> [f32; N] {
        for (value, new) in values.iter_mut().zip(from_file.into_iter().flatten()) {
            if !new.is_nan() {
                *value = *new;
            }
        }
        values
    }
    set.network = network;
    set.friction.model = file.compensated_model();
    set.friction.compensator = file.compensator.over(&set.friction.compensator);
    let [motor, thresholds, watch, sensors] = [0, 1, 2, 3].map(|at| file.sections.get(at));
    set.motor = MotorParameters::from_array(merge(set.motor.to_array(), motor));
    set.thresholds = Thresholds::from_array(merge(set.thresholds.to_array(), thresholds));
    set.watch = WatchParameters::from_array(merge(set.watch.to_array(), watch));
    set.sensors = SensorParameters::from_array(merge(set.sensors.to_array(), sensors));
}

/// Returns the file of a driver's parameter set without its network. Reading the file gives the same set, bit for bit.
pub fn emit(set: &ParameterSet, joint: JointKind) -> String {
    let mut text = emit_model(&set.friction.model, joint);
    let compensator = set.friction.compensator.to_array();
    emit_section("compensator", &CompensatorParameters::NAMES, &compensator, &mut text);
    if set.friction.model.terms.contains(&TermKind::GravityImbalance) {
        text += &format!("{} = true\n", CompensatorSection::GRAVITY);
    }
    emit_section("motor", &MotorParameters::NAMES, &set.motor.to_array(), &mut text);
    emit_section("thresholds", &Thresholds::NAMES, &set.thresholds.to_array(), &mut text);
    emit_section("watch", &WatchParameters::NAMES, &set.watch.to_array(), &mut text);
    emit_section("sensors", &SensorParameters::NAMES, &set.sensors.to_array(), &mut text);
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId, Parameters};

    #[test]
    fn emit_then_apply_returns_the_same_set() {
        let mut set = ParameterSet::default();
        set.friction.model = Parameters::new(LawKind::ImprovedLugre)
            .with(ParameterId::CoulombTorque, 1.1)
            .with(ParameterId::StaticTorque, 1.7)
            .with(ParameterId::PressureCoulomb, 2.4e-6);
        set.friction.model.add_term(TermKind::PositionRipple);
        set.friction.model.choices.damping_fades = true;
        set.friction.compensator.scale = 0.7;
        set.motor.inertia_kg_m2 = 0.123_456_7;
        set.watch.band_nm = 0.07;
        set.sensors.strain_zero = 0.47;
        let mut back = ParameterSet::default();
        apply(&parse(&emit(&set, JointKind::Revolute)).unwrap(), None, &mut back);
        assert_eq!(back.emit(), set.emit());
    }

    #[test]
    fn apply_with_partial_file_keeps_other_values() {
        let text =
            "schema = 1\njoint = \"revolute\"\nmodel = \"lugre\"\n[motor]\ngear_ratio = 20\n";
        let mut set = ParameterSet::default();
        set.motor.pole_pairs = 11.0;
        apply(&parse(text).unwrap(), None, &mut set);
        assert_eq!((set.motor.pole_pairs, set.motor.gear_ratio), (11.0, 20.0));
        let error = parse(&text.replace("gear_ratio", "gear")).unwrap_err().to_string();
        assert!(error.contains("motor.gear: unknown"), "{error}");
    }
}
