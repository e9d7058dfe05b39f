//! Identifies the model `lugre-lstm`: a LuGre model whose friction levels and stiffness are scaled by a network.
//!
//! 1. `lugre-asymmetric` is fitted. Its parameters are the constants that the network's factors multiply. Outside the
//!    range of the training data they apply alone.
//! 2. The network is trained on the training runs.
//!
//! `params.toml` holds the constants, and the name and checksum of `network.json`, which holds the network
//! ([`NetworkFile`]). Every command that reads `params.toml` also reads the network. The network is written only if it
//! reduces the error on held-out rows.

use crate::input::known_quantities;
use crate::result_files::{TrainingResult, network_files};
use crate::{
    BASE, MODEL, NetworkError, NetworkFile, NetworkInput, NetworkLaw, TrainOptions, TrainedNetwork,
    TrainingProgress, law_substeps, predict, train,
};
use compensator_core::Quantity;
use compensator_core::network::MAX_INPUTS;
use friction_diagnose::prepare::{Error, Prepared};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Metrics, Outcome, Track, identify as identify_law};
use friction_results::{Files, ResultError};
use joint_log::Dataset;
use joint_log::number::significant;
use joint_log::work;
use serde_json::json;

/// Options of an identification.
#[derive(Clone, Debug)]
pub struct IdentifyOptions {
    /// Inputs of the network: `velocity`, `held`, columns by name; if empty, every additional column of the log.
    pub inputs: Vec<String>,
    /// Whether strokes that differ from the training data count as outside the range.
    pub watches_strokes: bool,
    /// Maximum number of training epochs.
    pub epochs: usize,
    /// Seed of the training.
    pub seed: u64,
    /// Number of starting points of the law's fit.
    pub starts: usize,
}

/// The identified model.
#[derive(Clone, Debug)]
pub struct IdentifiedNetwork {
    /// `fit.json`, `params.toml`, `rows.parquet`, and `network.json` if the network gains.
    pub files: Files,
    /// Errors and remarks, for people.
    pub text: String,
}

/// Rate of the network evaluations, Hz. The fastest feature of the damper data, its gap at 1 Hz, lasts 74 ms.
const EVALUATION_RATE_HZ: f64 = 128.0;

/// Returns the names of the inputs: the given ones, or all additional columns of the log.
fn input_names(given: &[String], data: &Dataset) -> Result<Vec<String>, NetworkError> {
    let names = if given.is_empty() { &data.covariates } else { given };
    match names.len() {
        1..=MAX_INPUTS => Ok(names.to_vec()),
        found if given.is_empty() => Err(NetworkError::Covariates(found)),
        found => Err(NetworkError::TooManyInputs(found)),
    }
}

/// Finds an input in the log.
fn find_input(name: &str, data: &Dataset) -> Result<NetworkInput, NetworkError> {
    NetworkInput::named(name, data).ok_or_else(|| {
        let quantities = known_quantities(data).map(|quantity| quantity.name(data.joint));
        let columns = data.covariates.iter().map(String::as_str).chain(quantities);
        let known = ["velocity", "held"].into_iter().chain(columns).map(str::to_owned);
        NetworkError::UnknownInput { found: name.to_owned(), known: known.collect() }
    })
}

/// Fits the model to the log of one joint.
///
/// # Errors
/// If an input is unknown, a model is refused, or the caller stops the computation.
pub fn identify(options: &IdentifyOptions, data: &Prepared) -> Result<IdentifiedNetwork, Error> {
    let names = input_names(&options.inputs, &data.data)?;
    let inputs = names.iter().map(|name| find_input(name, &data.data));
    let inputs = inputs.collect::<Result<Vec<NetworkInput>, _>>()?;
    let spec = Spec::parse(BASE)?;
    let base = spec.parameters()?;
    let fitting =
        FitOptions { starts: options.starts.max(1), passive: true, ..FitOptions::default() };
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let training = TrainOptions {
        seed: options.seed,
        epochs: options.epochs,
        rows_per_evaluation: (1.0 / (EVALUATION_RATE_HZ * period_s)).round().max(1.0) as usize,
        substeps: law_substeps(period_s),
        ..TrainOptions::default()
    };
    let progress = |at: TrainingProgress| {
        let group =
            at.group.map_or(String::new(), |group| format!(", group {} held out", group + 1));
        let (epoch, epochs, loss) = (at.epoch, options.epochs, significant(at.loss, 3));
        work::report_stage(&format!("training: epoch {epoch} of {epochs}{group}, loss {loss}"));
    };
    let task = TrainingTask { names, watches_strokes: options.watches_strokes, options: training };
    work::report_stage(&format!("fitting {BASE} to {} rows", data.data.rows));
    let fit = identify_law(&spec, &base, data.train_rows(), data.test_rows(), &fitting);
    let training = match *inputs.as_slice() {
        [a] => train_network(&fit, [a], data, &task, &progress),
        [a, b] => train_network(&fit, [a, b], data, &task, &progress),
        [a, b, c] => train_network(&fit, [a, b, c], data, &task, &progress),
        [a, b, c, d] => train_network(&fit, [a, b, c, d], data, &task, &progress),
        _ => Err(NetworkError::InputCount(inputs.len())),
    }?;
    Ok(result(data, &fit, &training, &task.names)?)
}

/// Settings of the training.
struct TrainingTask {
    /// Names of the network inputs.
    names: Vec<String>,
    /// Whether strokes that differ from the training data count as outside the range.
    watches_strokes: bool,
    options: TrainOptions,
}

fn train_network<const INPUTS: usize>(
    fit: &Outcome,
    inputs: [NetworkInput; INPUTS],
    data: &Prepared,
    task: &TrainingTask,
    progress: &(dyn Fn(TrainingProgress) + Sync),
) -> Result<TrainingResult, NetworkError> {
    let options = &task.options;
    let trained = train(&fit.parameters, inputs, &data.train, options, progress)?;
    let TrainedNetwork { mut law, epochs, loss, held_out } = trained;
    if task.watches_strokes {
        law.set_stroke_range(&data.train);
    }
    law.network.validate()?;
    let (train, _) = evaluate(&law, &data.train);
    let (test, outside_share) = evaluate(&law, &data.test);
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let file = NetworkFile {
        inputs: task.names.clone(),
        network: law.network.widened(),
        period_s: period_s * options.rows_per_evaluation as f64,
        strokes: law.strokes,
    };
    let text = file.emit(json!({
        "passes": epochs, "seed": options.seed, "loss": loss, "loss_held_out": held_out,
    }));
    Ok(TrainingResult { file, text, train, test, outside_share, epochs })
}

/// Returns the error metrics on the tracks and the share of rows outside the trained ranges.
fn evaluate<const INPUTS: usize>(law: &NetworkLaw<INPUTS>, tracks: &[Track]) -> (Metrics, f64) {
    let runs: Vec<_> = tracks.iter().map(|track| predict(law, track)).collect();
    let rows = || tracks.iter().zip(&runs);
    let compared = rows().flat_map(|(track, run)| {
        let included = (0..track.len()).filter(|row| track.is_included(*row));
        included.map(|row| track.compared(row, run.torque[row]))
    });
    let metrics = Metrics::of(compared);
    let outside = runs.iter().flat_map(|run| &run.is_outside).filter(|outside| **outside).count();
    let count: usize = tracks.iter().map(Track::len).sum();
    (metrics, outside as f64 / count.max(1) as f64)
}

fn result(
    data: &Prepared,
    fit: &Outcome,
    training: &TrainingResult,
    names: &[String],
) -> Result<IdentifiedNetwork, ResultError> {
    let files = network_files(fit, training, names, data)?;
    let unit = Quantity::Torque.info().units[data.data.joint as usize];
    let number = |value| significant(value, 4);
    let line = |name: &str, train: &Metrics, test: &Metrics| {
        format!(
            "{name}: RMSE {} {unit} on training rows, {} {unit} on held-out rows ({:.1} % of the torque's standard deviation)\n",
            number(train.rmse),
            number(test.rmse),
            100.0 * test.nrmse_std
        )
    };
    let mut text =
        line(BASE, &fit.train, &fit.test) + &line(MODEL, &training.train, &training.test);
    text += &format!(
        "network inputs: {}; trained for {} epochs; {:.1} % of the held-out rows are outside the trained ranges\n",
        names.join(", "),
        training.epochs,
        100.0 * training.outside_share
    );
    text += "- the network's weights have no standard errors; the model can supply energy, but |y| <= max g holds\n";
    fit.verdicts.iter().for_each(|verdict| text += &format!("- {BASE}: {verdict}\n"));
    if !training.gains_on(fit) {
        text += &format!(
            "- network.json is not written: on held-out rows the network is no better than {BASE}\n"
        );
    }
    Ok(IdentifiedNetwork { files, text })
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_log::Run;

    #[test]
    fn inputs_accept_names_or_select_all_covariates() {
        let mut run = Run { time_s: vec![0.0], extra: vec![vec![0.0]; 2], ..Run::default() };
        run.set(Quantity::Temperature, vec![20.0]);
        let covariates = ["tension_n", "gap"].map(str::to_owned).into();
        let mut data = Dataset { runs: vec![run], covariates, ..Dataset::default() };
        let read = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let names = input_names(&names, &data)?;
            names.iter().map(|name| find_input(name, &data)).collect::<Result<Vec<_>, _>>()
        };
        let [tension, gap] = [0, 1].map(NetworkInput::Covariate);
        assert_eq!(read(&[]).unwrap(), [tension, gap]);
        assert_eq!(read(&["held", "gap"]).unwrap(), [NetworkInput::Held, gap]);
        let temperature = NetworkInput::Quantity(Quantity::Temperature);
        assert_eq!(read(&["temperature_c"]).unwrap(), [temperature]);
        let error = read(&["gop"]).unwrap_err().to_string();
        assert!(error.contains("velocity, held, tension_n, gap, temperature_c"), "{error}");
        assert!(read(&["gap"; 5]).unwrap_err().to_string().contains("at most 4"));
        data.covariates.clear();
        let error = input_names(&[], &data).unwrap_err().to_string();
        assert!(error.contains("0 covariates"), "{error}");
    }
}
