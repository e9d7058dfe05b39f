//! Prediction by a law whose levels and stiffness a network supplies.

use crate::{NetworkError, NetworkFile, NetworkInput, NetworkLaw, law_substeps, predict};
use compensator_core::Flags;
use compensator_core::network::MAX_INPUTS;
use friction_fit::Track;
use friction_fit::params::ParameterFile;
use friction_fit::prediction::{
    LogPrediction, PredictionOptions, RunPrediction, predict_tracks_by,
};
use joint_log::Dataset;

/// Predicts the tracks of a log with a law and its network, as [`friction_fit::prediction::predict_tracks`] does with a law.
///
/// # Errors
/// If the log lacks an input of the network.
pub fn predict_tracks(
    file: &ParameterFile,
    network: &NetworkFile,
    data: &Dataset,
    tracks: &[Track],
    options: &PredictionOptions,
) -> Result<LogPrediction, NetworkError> {
    let predict =
        |track: &Track, run: &mut RunPrediction| predict_track(file, network, data, track, run);
    predict_tracks_by(file, data, tracks, options, predict)
}

/// Predicts a track as a joint driver does. The start is the first measured torque.
fn predict_track(
    file: &ParameterFile,
    network: &NetworkFile,
    data: &Dataset,
    track: &Track,
    run: &mut RunPrediction,
) -> Result<(), NetworkError> {
    // An unused input has weights of 0 and a wide range, so that any input may stand there.
    let mut inputs = [NetworkInput::Unused; MAX_INPUTS];
    for (input, name) in inputs.iter_mut().zip(&network.inputs) {
        let found = NetworkInput::named(name, data);
        *input = found.ok_or_else(|| NetworkError::NoColumn(name.to_owned()))?;
    }
    let law = NetworkLaw {
        base: file.parameters.clone(),
        inputs,
        network: network.network.clone(),
        strokes: network.strokes,
        rows_per_evaluation: (network.period_s / track.period_s).round().max(1.0) as usize,
        substeps: law_substeps(track.period_s),
    };
    let predicted = predict(&law, track);
    for (row, torque) in predicted.torque.iter().enumerate() {
        let place = track.first_row + row;
        run.torque[place] = *torque;
        run.bristle_torque[place] = predicted.bristle_torque[row];
        if predicted.is_outside[row] {
            run.flags[place] |= Flags::NETWORK_OUTSIDE;
        }
    }
    Ok(())
}
