//! What a parameter file says of a joint driver besides its friction model.

use super::{emit_limits, emit_numbers, fields, unit};
use crate::data::Joint;
use crate::spec::Spec;
use compensator_core::compensator::CompensatorParameters;
use firmware::control::MotorParameters;
use firmware::set::ParameterSet;
use firmware::supervisor::Thresholds;
use firmware::watch::WatchParameters;
use std::fmt::Write;

/// Numbers of motor, thresholds and watch, in the order of their fields; NaN where none is given.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    motor: [f32; MotorParameters::FIELDS],
    thresholds: [f32; Thresholds::FIELDS],
    watch: [f32; WatchParameters::FIELDS],
}

impl Drive {
    pub(super) fn parse(root: &toml_edit::Table) -> Result<Self, String> {
        let mut drive = Self {
            motor: [f32::NAN; MotorParameters::FIELDS],
            thresholds: [f32::NAN; Thresholds::FIELDS],
            watch: [f32::NAN; WatchParameters::FIELDS],
        };
        fields(root, "motor", MotorParameters::NAMES, &mut drive.motor)?;
        fields(root, "thresholds", &Thresholds::NAMES, &mut drive.thresholds)?;
        fields(root, "watch", &WatchParameters::NAMES, &mut drive.watch)?;
        Ok(drive)
    }

    /// Puts what is given in place of what a driver has.
    pub fn apply(&self, set: &mut ParameterSet) {
        fn given<const N: usize>(has: [f32; N], given: &[f32; N]) -> [f32; N] {
            let mut numbers = has;
            for (number, given) in numbers.iter_mut().zip(given) {
                if !given.is_nan() {
                    *number = *given;
                }
            }
            numbers
        }
        let (motor, thresholds) = (set.motor.to_array(), set.thresholds.to_array());
        set.motor = MotorParameters::from_array(given(motor, &self.motor));
        set.thresholds = Thresholds::from_array(given(thresholds, &self.thresholds));
        set.watch = WatchParameters::from_array(given(set.watch.to_array(), &self.watch));
    }
}

/// The file of a joint driver's whole set: read back, it is the same set to the bit.
pub fn emit_set(set: &ParameterSet, joint: Joint) -> String {
    let model = &set.friction.model;
    let spec = Spec { terms: model.terms.to_vec(), ..Spec::law(model.law) };
    let kind = match joint {
        Joint::Revolute => "revolute",
        Joint::Prismatic => "prismatic",
    };
    let name = spec.full_name();
    let mut text = format!("schema = 1\njoint = \"{kind}\"\nmodel = \"{name}\"\n\n[parameters]\n");
    for id in model.active() {
        let (info, value) = (id.info(), model.get(id));
        let unit = unit(info, joint);
        let _ = writeln!(text, "{} = {{ value = {value:?}, unit = \"{unit}\" }}", info.name);
    }
    emit_limits(&model.envelope, model.choices, &mut text);
    let compensator = set.friction.compensator.to_array();
    emit_numbers("compensator", &CompensatorParameters::NAMES, &compensator, &mut text);
    emit_numbers("motor", MotorParameters::NAMES, &set.motor.to_array(), &mut text);
    emit_numbers("thresholds", &Thresholds::NAMES, &set.thresholds.to_array(), &mut text);
    emit_numbers("watch", &WatchParameters::NAMES, &set.watch.to_array(), &mut text);
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::parse;
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
        let file = parse(&emit_set(&set, Joint::Revolute)).unwrap();
        let mut back = ParameterSet { friction: file.friction(), ..ParameterSet::default() };
        file.drive.apply(&mut back);
        assert_eq!(back.emit(), set.emit());
    }

    #[test]
    fn what_is_not_given_stays() {
        let text =
            "schema = 1\njoint = \"revolute\"\nmodel = \"lugre\"\n[motor]\ngear_ratio = 20\n";
        let file = parse(text).unwrap();
        let mut set = ParameterSet::default();
        set.motor.pole_pairs = 11.0;
        file.drive.apply(&mut set);
        assert_eq!((set.motor.pole_pairs, set.motor.gear_ratio), (11.0, 20.0));
        let error = parse(&text.replace("gear_ratio", "gear")).unwrap_err();
        assert!(error.contains("motor.gear: unknown"), "{error}");
    }
}
