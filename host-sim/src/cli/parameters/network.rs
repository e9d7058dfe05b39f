//! A driver's network as a file beside the one `params get` prints.

use compensator_core::network::JointNetwork;
use friction_identification::data::JointKind;
use friction_identification::network::NetworkFile;
use std::path::Path;

/// Writes a driver's network as a file; gives the name it has beside `params.toml`, and its text.
pub(super) fn write_network(
    network: &JointNetwork,
    joint: JointKind,
    path: &Path,
) -> Result<(String, String), String> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| format!("--network {}: is no file", path.display()))?;
    let text = NetworkFile::of_driver(network, joint).emit(serde_json::Value::Null);
    crate::report::write_atomically(path, text.as_bytes())
        .map_err(|error| format!("{}: {error}", path.display()))?;
    Ok((name, text))
}
