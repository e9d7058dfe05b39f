//! Writes a driver's network to a file, to which the file of `params get` refers.

use crate::cli::error::{Result, in_file, unfit};
use compensator_core::network::JointNetwork;
use friction_fit::network::NetworkFile;
use joint_log::JointKind;
use std::path::Path;

/// Writes a driver's network to a file. Returns the file name and its content.
pub(super) fn write_network(
    network: &JointNetwork,
    joint: JointKind,
    path: &Path,
) -> Result<(String, String)> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name =
        name.ok_or_else(|| unfit(format!("--network {}", path.display()), "expected a file name"))?;
    let text = NetworkFile::of_driver(network, joint).emit(serde_json::Value::Null);
    friction_results::write_atomically(path, text.as_bytes()).map_err(in_file(path))?;
    Ok((name, text))
}
