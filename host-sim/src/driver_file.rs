//! A parameter file as a joint driver sees it: the friction model, and what the driver needs besides.
//!
//! ```toml
//! [motor]                                 # after the sections of a model
//! gear_ratio = 51.0
//! [thresholds]
//! [watch]
//! ```
//!
//! Every command reads its files here, so that a driver's whole set can be given wherever a model is
//! wanted; the library that fits models knows nothing of motors.

use compensator_core::compensator::CompensatorParameters;
use compensator_core::network::JointNetwork;
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Thresholds;
use firmware::watch::WatchParameters;
use friction_identification::data::JointKind;
use friction_identification::network::NetworkFile;
use friction_identification::params::{
    self, ParameterFile, ParameterFileError, Section, emit_model, emit_section,
};
use std::path::Path;

/// What a driver's file holds besides a model.
const SECTIONS: [Section; 3] = [
    Section { name: "motor", fields: &MotorParameters::NAMES },
    Section { name: "thresholds", fields: &Thresholds::NAMES },
    Section { name: "watch", fields: &WatchParameters::NAMES },
];

/// Reads and validates a file.
///
/// # Errors
/// As [`params::read`].
pub fn read(path: &Path) -> Result<ParameterFile, ParameterFileError> {
    params::read(path, &SECTIONS)
}

/// Reads and validates the text of a file.
///
/// # Errors
/// As [`params::parse`].
pub fn parse(text: &str) -> Result<ParameterFile, String> {
    params::parse(text, &SECTIONS)
}

/// The network a file's model is supplied by, as a driver takes it.
///
/// # Errors
/// One line: an input no driver can feed.
pub fn network(file: &ParameterFile) -> Result<Option<JointNetwork>, String> {
    file.network.as_ref().map(NetworkFile::for_driver).transpose()
}

/// Puts what a file says in place of what a driver has. The friction model is taken whole, with its network or none;
/// of the rest what is given.
///
/// # Errors
/// As [`network`]; nothing is put then.
pub fn apply(file: &ParameterFile, set: &mut ParameterSet) -> Result<(), String> {
    fn given<const N: usize>(mut has: [f32; N], given: Option<&Vec<f32>>) -> [f32; N] {
        for (number, given) in has.iter_mut().zip(given.into_iter().flatten()) {
            if !given.is_nan() {
                *number = *given;
            }
        }
        has
    }
    set.network = network(file)?;
    set.friction = file.friction();
    let [motor, thresholds, watch] = [0, 1, 2].map(|at| file.sections.get(at));
    set.motor = MotorParameters::from_array(given(set.motor.to_array(), motor));
    set.thresholds = Thresholds::from_array(given(set.thresholds.to_array(), thresholds));
    set.watch = WatchParameters::from_array(given(set.watch.to_array(), watch));
    Ok(())
}

/// The file of a joint driver's whole set but its network: read back, it is the same set to the bit.
pub fn emit(set: &ParameterSet, joint: JointKind) -> String {
    let mut text = emit_model(&set.friction.model, joint);
    let compensator = set.friction.compensator.to_array();
    emit_section("compensator", &CompensatorParameters::NAMES, &compensator, &mut text);
    emit_section("motor", &MotorParameters::NAMES, &set.motor.to_array(), &mut text);
    emit_section("thresholds", &Thresholds::NAMES, &set.thresholds.to_array(), &mut text);
    emit_section("watch", &WatchParameters::NAMES, &set.watch.to_array(), &mut text);
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId, Parameters, TermKind};

    #[test]
    fn a_set_is_read_back_to_the_bit() {
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
        let mut back = ParameterSet::default();
        apply(&parse(&emit(&set, JointKind::Revolute)).unwrap(), &mut back).unwrap();
        assert_eq!(back.emit(), set.emit());
    }

    #[test]
    fn what_is_not_given_stays() {
        let text =
            "schema = 1\njoint = \"revolute\"\nmodel = \"lugre\"\n[motor]\ngear_ratio = 20\n";
        let mut set = ParameterSet::default();
        set.motor.pole_pairs = 11.0;
        apply(&parse(text).unwrap(), &mut set).unwrap();
        assert_eq!((set.motor.pole_pairs, set.motor.gear_ratio), (11.0, 20.0));
        let error = parse(&text.replace("gear_ratio", "gear")).unwrap_err();
        assert!(error.contains("motor.gear: unknown"), "{error}");
    }
}
