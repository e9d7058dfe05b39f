//! Export of a fitted model: for a driver's flash, a user's own control loop, or a simulator.
//!
//! | format | content | accuracy relative to the core |
//! |---|---|---|
//! | `record` | the bytes of the driver's flash record, also accepted over CAN | bit-identical |
//! | `rust` | constants and their `Configuration` | bit-identical |
//! | `c` | one header: state, inputs, one step and a start in `float` | within 1e-4 of the largest torque; four terms unsupported |
//! | `network` | the bytes of the network's record, also accepted over CAN | bit-identical |
//! | `onnx` of a law | graphs of one step and of a start | as `c` |
//! | `onnx` of a network | one evaluation of the network as a graph | `f32` with another order of sums: factors within 1e-5 |
//! | `mujoco`, `urdf` | dry friction and damping of a joint | a line fitted to steady sliding; the largest error is stated |
//!
//! The packages `friction-onnx` and `friction-network` write the formats `onnx` and `network`.
//!
//! `compensator-core` reads the first two. `law` and `terms` write the core's equations (`compensator_core::law`,
//! `compensator_core::effect`) once as statements, which are rendered as C and as ONNX. Tests compare both with the core for
//! every law and every supported term. The joint of a simulator has neither a Stribeck curve nor bristles. Its two parameters
//! are fitted to the core's torque in steady sliding, and a note states what is not represented.
//!
//! What is exported for a control loop is friction: [`ParameterFile::compensated_model`] leaves out the rigid-body parts of the model,
//! and gravity unless the file asks for it. A format that has a current needs settings that only the owner of the joint knows; C and
//! ONNX return a torque.
//!
//! A joint at rest holds any torque up to its static level. `c`, `rust` and `onnx` therefore offer a start from the first
//! measured torque. A driver starts at a bristle torque of 0, because it measures no friction.

mod c;
mod effects;
mod law;
mod program;
mod rust;
mod simulator;
pub mod statements;
mod terms;

use compensator_core::record;
use friction_fit::params::ParameterFile;
use joint_log::setting::Setting;

joint_log::named! {
    /// Format of an exported model.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum ExportFormat {
        /// The model as bytes with a checksum, as a driver keeps it in its flash.
        Record = "record",
        /// Rust constants for a control loop that uses the core.
        Rust = "rust",
        /// A C header with one step of the law.
        C = "c",
        /// The network as such bytes.
        Network = "network",
        /// ONNX graphs: one step and the start of a law, or one evaluation of a network.
        Onnx = "onnx",
        /// Attributes of a MuJoCo joint.
        Mujoco = "mujoco",
        /// The dynamics element of a URDF joint.
        Urdf = "urdf",
    }
}

impl ExportFormat {
    /// Returns a reference to the format, for a message.
    pub fn setting(self) -> String {
        Setting::ExportFormat.given(self.name())
    }

    /// Returns the name of the output file for a model.
    pub fn file_name(self, file: &ParameterFile) -> &'static str {
        match self {
            Self::Record => "friction.bin",
            Self::Rust => "friction.rs",
            Self::C => "friction.h",
            Self::Network => "network.bin",
            Self::Onnx if file.network.is_some() => "network.onnx",
            Self::Onnx => "friction.onnx",
            Self::Mujoco => "friction.mjcf.xml",
            Self::Urdf => "friction.urdf.xml",
        }
    }
}

/// An exported model.
#[derive(Clone, Debug)]
pub struct ExportedModel {
    /// Content of the file.
    pub content: Vec<u8>,
    /// Further files with their names, to be written into the same folder.
    pub further_files: Vec<(&'static str, Vec<u8>)>,
    /// Notes for the user, one sentence each: what the file omits and how it is used. They may refer to settings, which a front
    /// end names with [`joint_log::setting::worded`].
    pub notes: Vec<String>,
}

impl ExportedModel {
    /// Creates an exported model of one file.
    pub fn new(content: Vec<u8>, notes: Vec<String>) -> Self {
        Self { content, further_files: Vec::new(), notes }
    }
}

/// Why a model cannot be exported. Each message is one line, and may refer to settings.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The model has a term that a C header cannot have.
    #[error(
        "{term}: the C header does not support this term, which needs a memory or a table: use {} or {}",
        ExportFormat::Rust.setting(),
        ExportFormat::Record.setting()
    )]
    UnsupportedTerm {
        /// Name of the term.
        term: &'static str,
    },
    /// The file lacks settings of a compensator for which no default is right for every joint.
    #[error(
        "[compensator] lacks {}, which {} needs for a current: {}; {} and {} are a torque and need none",
        missing.join(", "),
        format.setting(),
        example(missing),
        ExportFormat::C.setting(),
        ExportFormat::Onnx.setting()
    )]
    MissingSettings {
        /// Names of the settings.
        missing: Vec<String>,
        /// The format.
        format: ExportFormat,
    },
    /// The file has no network.
    #[error(
        "found no section [network]: `identify --model lugre-lstm` writes one if the network reduces the error"
    )]
    NoNetwork,
    /// The program was built without this format.
    #[error("{}: not in this build, which lacks the feature {}", format.setting(), format.name())]
    NotInBuild {
        /// The format.
        format: ExportFormat,
    },
}

crate::error::as_line!(ExportError);

/// Returns how missing settings are given.
fn example(missing: &[String]) -> String {
    let each: Vec<String> = missing.iter().map(|name| format!("{name}=VALUE")).collect();
    Setting::Compensator.suggested(each.join(","))
}

/// How a driver starts, for the notes.
const DRIVER_START: &str = "a driver starts at a bristle torque of 0, because it measures no friction: until the joint leaves \
     presliding, it compensates too little if the joint held a torque";

/// Exports a model. `source` is the name of its parameter file and appears in the header of the output.
///
/// # Errors
/// Returns one line that names a term which the format does not support, and formats that do. It may refer to settings.
pub fn export(
    file: &ParameterFile,
    format: ExportFormat,
    source: &str,
) -> Result<ExportedModel, ExportError> {
    if matches!(format, ExportFormat::Record | ExportFormat::Rust) {
        let missing: Vec<String> = file.compensator.missing().map(Into::into).collect();
        if !missing.is_empty() {
            return Err(ExportError::MissingSettings { missing, format });
        }
    }
    let mut export = export_without_notes(file, format, source)?;
    // A simulator's joint has no place for these parts anyway.
    if matches!(format, ExportFormat::Record | ExportFormat::Rust | ExportFormat::C) {
        export.notes.extend(file.left_out_in_words());
    }
    if file.network.is_some() {
        export.notes.push(format!(
            "the network that scales the levels and the stiffness is not included: this is the law with its constant parameters \
             ({} and {} export the network)",
            ExportFormat::Network.setting(),
            ExportFormat::Onnx.setting(),
        ));
    }
    Ok(export)
}

fn export_without_notes(
    file: &ParameterFile,
    format: ExportFormat,
    source: &str,
) -> Result<ExportedModel, ExportError> {
    match format {
        ExportFormat::Network if file.network.is_none() => Err(ExportError::NoNetwork),
        ExportFormat::Network | ExportFormat::Onnx => Err(ExportError::NotInBuild { format }),
        ExportFormat::Record => Ok(ExportedModel::new(
            record::emit(&file.friction()).to_vec(),
            record_notes(file, source),
        )),
        ExportFormat::Rust => Ok(rust::export(file, source)),
        ExportFormat::C => c::export(file, source),
        ExportFormat::Mujoco => Ok(simulator::mujoco(file, source)),
        ExportFormat::Urdf => Ok(simulator::urdf(file, source)),
    }
}

fn record_notes(file: &ParameterFile, source: &str) -> Vec<String> {
    let mut notes = vec![format!(
        "{} bytes; read them with compensator_core::record::parse, or write the model to a driver with `params set {source}`",
        record::LENGTH
    )];
    if file.parameters.law.has_bristles() {
        notes.push(DRIVER_START.into());
    }
    notes
}
