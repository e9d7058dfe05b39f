//! Writes a driver's network to a file, to which the file of `params get` refers.

use compensator_core::network::JointNetwork;
use joint_log::JointKind;
use std::path::Path;

/// Refuses to write a network.
#[cfg(not(feature = "network"))]
pub(super) fn write_network(
    _: &JointNetwork,
    _: JointKind,
    _: &Path,
) -> Result<(String, String), String> {
    Err(crate::cli::network::refusal())
}

/// Writes a driver's network to a file. Returns the file name and its content.
#[cfg(feature = "network")]
pub(super) fn write_network(
    network: &JointNetwork,
    joint: JointKind,
    path: &Path,
) -> Result<(String, String), String> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| format!("--network {}: expected a file name", path.display()))?;
    let text =
        friction_network::NetworkFile::of_driver(network, joint).emit(serde_json::Value::Null);
    friction_results::write_atomically(path, text.as_bytes())
        .map_err(|error| format!("{}: {error}", path.display()))?;
    Ok((name, text))
}
