//! Export as Rust constants: every number of the model by its name, exact in `f32`.

use super::ExportedModel;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::Envelope;
use friction_fit::params::{ParameterFile, unit};
use std::fmt::Write as _;

/// How the state of a law with bristles starts.
const BRISTLE_START: &str = "at the start of a run and after a gap in the samples, [`start`] returns a state for the first\n\
     //! measured torque. A joint at rest holds any torque up to its static level, and only a measured torque\n\
     //! indicates which one. From a state of zero (`ModelState::default()`, as in a `Compensator`), the torque is wrong\n\
     //! until the joint leaves presliding.";
/// How the state of a law without bristles starts.
const STATIC_START: &str =
    "the law has no bristles, so [`start`] returns a state of zero (`ModelState::default()`).";

/// The functions of an exported file.
const FUNCTIONS: &str = include_str!("functions.rs.in");

/// Writes a struct of named numbers as a constant.
fn fields(text: &mut String, [doc, name, kind]: [&str; 3], names: &[&str], values: &[f32]) {
    let _ = writeln!(text, "\n/// {doc}\npub const {name}: {kind} = {kind} {{");
    for (field, value) in names.iter().zip(values) {
        let _ = writeln!(text, "    {field}: {value:?},");
    }
    text.push_str("};\n");
}

/// Exports the model as Rust constants.
pub(super) fn export(file: &ParameterFile, source: &str) -> ExportedModel {
    let configuration = file.friction();
    let model = &configuration.model;
    let mut text = format!(
        "//! Friction model `{}`, written by `host-sim export {source} --to rust`.\n\
         //!\n\
         //! `Compensator::<f32>::build(&configuration(), period_s)` validates and builds it. The numbers are\n\
         //! exact in `f32`, so the result is bit-identical to that of the parameter file.\n\
         //!\n\
         //! Start: {}\n\n\
         use compensator_core::compensator::CompensatorParameters;\n\
         use compensator_core::configuration::Configuration;\n\
         use compensator_core::parameters::{{Choices, Envelope, ParameterError}};\n\
         use compensator_core::{{FrictionModel, LawKind, ModelState, ParameterId, Parameters, Sample, TermKind}};\n\n\
         /// Friction law.\n\
         pub const LAW: LawKind = LawKind::{:?};\n\n",
        file.compensated_name(),
        if model.law.has_bristles() { BRISTLE_START } else { STATIC_START },
        model.law
    );
    let terms: Vec<String> = model.terms.iter().map(|term| format!("TermKind::{term:?}")).collect();
    let _ = writeln!(
        text,
        "/// Terms of the model, in the order of evaluation.\npub const TERMS: [TermKind; {}] = [{}];\n",
        terms.len(),
        terms.join(", ")
    );
    let active: Vec<_> = model.active().collect();
    let _ = writeln!(
        text,
        "/// Parameters of the model, each in the unit beside it.\npub const VALUES: [(ParameterId, f32); {}] = [",
        active.len()
    );
    for id in &active {
        let unit = unit(*id, file.joint);
        let _ = writeln!(text, "    (ParameterId::{id:?}, {:?}), // {unit}", model.get(*id));
    }
    text.push_str("];\n");
    let choices = model.choices;
    let _ = write!(
        text,
        "\n/// Options of the law.\npub const CHOICES: Choices = Choices {{\n    damping_fades: {},\n    \
         printed_extended: {},\n    allow_active: {},\n}};\n",
        choices.damping_fades, choices.printed_extended, choices.allow_active
    );
    let constant = ["Valid range of the inputs.", "ENVELOPE", "Envelope"];
    fields(&mut text, constant, &Envelope::NAMES, &model.envelope.to_array());
    let constant = ["Parameters of the compensator.", "COMPENSATOR", "CompensatorParameters"];
    let compensator = configuration.compensator.to_array();
    fields(&mut text, constant, &CompensatorParameters::NAMES, &compensator);
    text.push_str(FUNCTIONS);
    let terms = if terms.is_empty() { "" } else { ", with its feature `terms`" };
    let mut notes = vec![format!(
        "needs the crate compensator-core{terms}: Compensator::<f32>::build(&configuration(), period_s)"
    )];
    if model.law.has_bristles() {
        notes.push(
            "at the start of a run and after a gap, start() takes the first measured torque: a state of zero, as in a Compensator, \
             is wrong until the joint leaves presliding"
                .to_owned(),
        );
    }
    ExportedModel::new(text.into_bytes(), notes)
}
