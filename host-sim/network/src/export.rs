//! Export of a network as the record of a driver.

use crate::{NetworkError, NetworkFile};
use compensator_core::network::record;
use friction_results::export::ExportedModel;

/// Returns the record of a network. `source` is the name of its parameter file.
///
/// # Errors
/// If a driver does not measure an input of the network.
pub fn export(file: &NetworkFile, source: &str) -> Result<ExportedModel, NetworkError> {
    let content = record::emit(Some(&file.for_driver()?)).to_vec();
    let notes = vec![
        format!(
            "{} bytes; read them with compensator_core::network::record::parse, or write the model to a driver with `params set {source}`",
            record::LENGTH
        ),
        "a driver starts the network with factors and share at 1 and its cells at 0: the law is unscaled until the network has seen a few evaluations"
            .into(),
    ];
    Ok(ExportedModel::new(content, notes))
}
