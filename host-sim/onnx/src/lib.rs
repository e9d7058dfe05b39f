//! Models as ONNX graphs: `export --to onnx`.
//!
//! ```text
//! friction_results::export: a law as statements ─► law ─┐
//! friction_network: a network                ─► network ─┴─► graph (messages of onnx.proto) ─► bytes
//! ```
//! The graphs run in any ONNX runtime. `tests/onnx/run` compares them with the core in onnxruntime. The writer is in Rust,
//! because `host-sim` is one program without Python.

mod graph;
mod law;
#[cfg(feature = "network")]
mod network;

use friction_fit::params::ParameterFile;
use friction_results::export::{ExportFormat, ExportedModel};

/// Why a model has no graph; one line, which may refer to settings.
#[derive(Debug, thiserror::Error)]
pub enum OnnxError {
    /// A term needs a memory or a table.
    #[error(
        "{term}: the ONNX graph does not support this term, which needs a memory or a table: use {} or {}",
        ExportFormat::Rust.setting(),
        ExportFormat::Record.setting()
    )]
    Term {
        /// Its name.
        term: &'static str,
    },
    /// The network of the model cannot be read.
    #[cfg(feature = "network")]
    #[error(transparent)]
    Network(#[from] friction_network::NetworkError),
    /// The model has a network, and this build lacks the feature `network`.
    #[cfg(not(feature = "network"))]
    #[error("a network: not in this build, which lacks the feature network")]
    NoNetworks,
}

/// Exports a model. `source` is the name of its parameter file and appears in the graph.
///
/// # Errors
/// If the format does not support a term, or the network cannot be read.
pub fn export(file: &ParameterFile, source: &str) -> Result<ExportedModel, OnnxError> {
    let mut exported = match &file.network {
        None => law::export(file, source)?,
        #[cfg(feature = "network")]
        Some(text) => network::export(&friction_network::NetworkFile::of(text)?, source),
        #[cfg(not(feature = "network"))]
        Some(_) => return Err(OnnxError::NoNetworks),
    };
    exported.notes.extend(file.left_out_in_words());
    Ok(exported)
}
