//! A fitted model for other hands: a loop of one's own, a driver's flash, a simulator.
//!
//! | form | what it holds | how close to the core |
//! |---|---|---|
//! | `record` | the bytes a driver keeps in flash and takes over CAN | the same bits |
//! | `rust` | constants, and the `Configuration` of them | the same bits |
//! | `c` | one header: state, inputs, one step in `float` | within 1e-4 of the largest torque; refuses four terms |
//! | `network` | the network's bytes, as a driver keeps them and takes them over CAN | the same bits |
//! | `onnx` | one evaluation of the network as a graph | `f32` in another order of sums: within 1e-5 of 1 |
//! | `mujoco`, `urdf` | a joint's dry friction and damping | a line through the sliding torque, its largest error stated |
//!
//! The first two are read by `compensator-core` itself. The C step is written from the core's own equations,
//! quantity by quantity (`compensator_core::law`, `compensator_core::effect`), and a test compiles it and holds
//! it against the core for every law and every term it takes. A simulator's joint knows neither a Stribeck curve
//! nor bristles, so its two numbers are fitted to what the core gives in steady sliding, and what is lost is said.

mod c;
mod c_terms;
mod onnx;
mod rust;
mod simulator;

use compensator_core::network::record as network_record;
use compensator_core::record;
use friction_identification::params::ParameterFile;

/// For whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Form {
    /// The bytes a driver keeps in flash.
    Record,
    /// Constants for a loop over the core.
    Rust,
    /// A header with the law's step.
    C,
    /// The bytes of the network that supplies the law, as a driver keeps them.
    Network,
    /// That network as an ONNX graph of one evaluation.
    Onnx,
    /// Attributes of a MuJoCo joint.
    Mujoco,
    /// The dynamics of a URDF joint.
    Urdf,
}

impl Form {
    /// The name of the file it is written to.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Record => "friction.bin",
            Self::Rust => "friction.rs",
            Self::C => "friction.h",
            Self::Network => "network.bin",
            Self::Onnx => "network.onnx",
            Self::Mujoco => "friction.mjcf.xml",
            Self::Urdf => "friction.urdf.xml",
        }
    }
}

/// A model in a form, and what a person should know of it.
#[derive(Clone, Debug)]
pub struct Export {
    /// The file's content.
    pub content: Vec<u8>,
    /// One sentence each: what was left out, what to do with it.
    pub notes: Vec<String>,
}

/// Writes a model in a form. `source` is the name of the file it came from, for the heading.
///
/// # Errors
/// One line: which term the form cannot hold, and which form can.
pub fn export(file: &ParameterFile, form: Form, source: &str) -> Result<Export, String> {
    let mut export = in_form(file, form, source)?;
    if file.network.is_some() && !matches!(form, Form::Network | Form::Onnx) {
        export.notes.push(
            "the network that supplies its levels and stiffness is left out: this is the law at its constants \
             (--to network and --to onnx hold it)"
                .into(),
        );
    }
    Ok(export)
}

fn in_form(file: &ParameterFile, form: Form, source: &str) -> Result<Export, String> {
    let network = || {
        let why =
            "no section [network]: `identify --model lugre-lstm` writes one where a network gains";
        file.network.as_ref().ok_or_else(|| why.to_owned())
    };
    match form {
        Form::Network => Ok(Export {
            content: network_record::emit(Some(&network()?.for_driver()?)).to_vec(),
            notes: vec![format!(
                "{} bytes, read by compensator_core::network::record::parse; a driver takes them over CAN with `params set {source}`",
                network_record::LENGTH
            )],
        }),
        Form::Onnx => Ok(Export {
            content: onnx::model(network()?, source),
            notes: vec![
                format!(
                    "one evaluation, every {} s, fed with {}; what comes out goes back in, factors and share begin at 1",
                    network()?.period_s,
                    network()?.inputs.join(", ")
                ),
                "its factors multiply coulomb_torque, static_torque and bristle_stiffness of the law, whose step is not in the graph"
                    .into(),
            ],
        }),
        Form::Record => Ok(Export {
            content: record::emit(&file.friction()).to_vec(),
            notes: vec![format!(
                "{} bytes, read by compensator_core::record::parse; a driver takes them over CAN with `params set {source}`",
                record::LENGTH
            )],
        }),
        Form::Rust => Ok(rust::export(file, source)),
        Form::C => c::export(file, source),
        Form::Mujoco => Ok(simulator::mujoco(file, source)),
        Form::Urdf => Ok(simulator::urdf(file, source)),
    }
}
