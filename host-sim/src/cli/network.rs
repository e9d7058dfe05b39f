//! The model `lugre-lstm`, whose friction levels and stiffness a network scales.
//!
//! The package `friction-network` trains, predicts and writes it. A build without the feature `network` refuses it.

#[cfg(feature = "network")]
use super::each_joint::JointResult;
#[cfg(feature = "network")]
use super::error::found;
use super::error::{CommandError, Result, in_file, unfit};
#[cfg(feature = "network")]
use super::fit_arguments::{FitArguments, LossChoice};
#[cfg(not(feature = "network"))]
use super::missing_feature;
use compensator_core::LawKind;
use compensator_core::network::JointNetwork;
#[cfg(feature = "network")]
use friction_diagnose::prepare::Prepared;
use friction_fit::Track;
use friction_fit::params::ParameterFile;
use friction_fit::prediction::{self, LogPrediction, PredictionOptions};
#[cfg(feature = "network")]
use friction_network::{IdentifiedNetwork, IdentifyOptions, NetworkFile};
use joint_log::{Dataset, JointKind};
use std::path::Path;

/// Name of the model.
pub(super) const MODEL: &str = "lugre-lstm";

/// Arguments of the training.
#[derive(clap::Args)]
pub(super) struct NetworkArguments {
    /// Inputs of the network of lugre-lstm
    ///
    /// `velocity`, `held` (the bristle torque), columns by name; by default every additional column of the log.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', hide_short_help = true)]
    inputs: Vec<String>,
    /// Treat strokes (the travel between two reversals) that differ from the training data of lugre-lstm as outside its
    /// range
    #[arg(long, hide_short_help = true)]
    watch_strokes: bool,
    /// Maximum number of training epochs for lugre-lstm
    #[arg(long, value_name = "N", default_value_t = 200, hide_short_help = true)]
    epochs: usize,
}

/// Returns the error message of a command that does not support this model.
pub(super) fn unsupported_by(command: &str) -> CommandError {
    let base = LawKind::LugreAsymmetric.name();
    unfit(
        MODEL,
        format!(
            "{command} supports only laws with constant parameters; `identify --model {MODEL}` trains the network and \
             compares it with {base}"
        ),
    )
}

/// Returns the refusal of a network.
#[cfg(not(feature = "network"))]
pub(super) fn refusal() -> CommandError {
    missing_feature::refusal("a network that scales a model", "network").into()
}

/// Fits the model to the log of one joint.
#[cfg(feature = "network")]
pub(super) fn identify(
    arguments: &NetworkArguments,
    fitting: &FitArguments,
    starts: usize,
    data: &Prepared,
) -> Result<JointResult> {
    if fitting.loss == LossChoice::Huber {
        let expected = format!("squares or auto: {MODEL} is trained with squares");
        return Err(found("--loss", "huber", expected));
    }
    if !data.rigid_body.is_empty() {
        return Err(unfit(
            "--rigid-body",
            format!(
                "cannot be used with --model {MODEL}, which requires a torque column that contains friction only"
            ),
        ));
    }
    let options = IdentifyOptions {
        inputs: arguments.inputs.clone(),
        watches_strokes: arguments.watch_strokes,
        epochs: arguments.epochs,
        seed: fitting.seed,
        starts,
    };
    let IdentifiedNetwork { files, text } = friction_network::identify(&options, data)?;
    Ok(JointResult { files, text })
}

/// Predicts the tracks of a log, with the network if the model has one.
pub(super) fn predict_tracks(
    file: &ParameterFile,
    data: &Dataset,
    tracks: &[Track],
    options: &PredictionOptions,
) -> Result<LogPrediction> {
    match &file.network {
        None => Ok(prediction::predict_tracks(file, data, tracks, options)?),
        #[cfg(feature = "network")]
        Some(text) => {
            let network = NetworkFile::of(text)?;
            Ok(friction_network::predict_tracks(file, &network, data, tracks, options)?)
        }
        #[cfg(not(feature = "network"))]
        Some(_) => Err(refusal()),
    }
}

#[cfg(feature = "network")]
fn text_of(network: &JointNetwork, joint: JointKind) -> Result<String> {
    Ok(NetworkFile::of_driver(network, joint).emit(serde_json::Value::Null))
}

#[cfg(not(feature = "network"))]
fn text_of(_: &JointNetwork, _: JointKind) -> Result<String> {
    Err(refusal())
}

/// Writes a driver's network to a file. Returns the file name and its content.
pub(super) fn write(
    network: &JointNetwork,
    joint: JointKind,
    path: &Path,
) -> Result<(String, String)> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name =
        name.ok_or_else(|| unfit(format!("--network {}", path.display()), "expected a file name"))?;
    let text = text_of(network, joint)?;
    friction_results::write_atomically(path, text.as_bytes()).map_err(in_file(path))?;
    Ok((name, text))
}

/// Returns the network of a model in the form of a driver; `None` if the model has none.
pub(super) fn for_driver(file: &ParameterFile) -> Result<Option<JointNetwork>> {
    match &file.network {
        None => Ok(None),
        #[cfg(feature = "network")]
        Some(text) => Ok(Some(NetworkFile::of(text)?.for_driver()?)),
        #[cfg(not(feature = "network"))]
        Some(_) => Err(refusal()),
    }
}
