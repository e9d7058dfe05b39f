//! `identify --model lugre-lstm`: a LuGre model whose friction levels and stiffness are scaled by a network.
//!
//! 1. `lugre-asymmetric` is fitted. Its parameters are the constants that the network's factors multiply. Outside the
//!    range of the training data they apply alone.
//! 2. The network is trained on the training runs.
//!
//! `params.toml` holds the constants, and the name and checksum of `network.json`, which holds the network
//! ([`NetworkFile`]). Every command that reads `params.toml` also reads the network. The network is written only if it
//! reduces the error on held-out rows.

use super::each_joint::JointResult;
use super::error::{CommandError, Result, found, unfit};
use super::fit_arguments::{FitArguments, LossChoice};
use compensator_core::Quantity;
use compensator_core::network::MAX_INPUTS;
use friction_diagnose::prepare::Prepared;
use friction_fit::network::{
    BASE, NetworkFile, NetworkInput, NetworkLaw, TrainOptions, TrainedNetwork, TrainingProgress,
    law_substeps, predict, train,
};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Metrics, Outcome, Track, identify};
pub(super) use friction_results::network::MODEL;
use friction_results::network::{TrainingResult, network_files};
use joint_log::number::significant;
use joint_log::work;
use joint_log::{Dataset, contract};
use serde_json::json;

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
    unfit(
        MODEL,
        format!(
            "{command} supports only laws with constant parameters; `identify --model {MODEL}` trains the network and \
         compares it with {BASE}"
        ),
    )
}

/// Rate of the network evaluations, Hz. The fastest feature of the damper data, its gap at 1 Hz, lasts 74 ms.
const EVALUATION_RATE_HZ: f64 = 128.0;

/// A network input with its name.
type NamedInput = (String, NetworkInput);

/// Returns all inputs that a log has: `velocity`, `held`, its additional columns, and the standard quantities that are present
/// in every run.
fn known_inputs(data: &Dataset) -> Vec<NamedInput> {
    let has = |quantity: &Quantity| data.runs.iter().all(|run| run.get(*quantity).is_some());
    let quantities = contract::covariates().filter(has);
    let quantities =
        quantities.map(|of| (of.name(data.joint).to_owned(), NetworkInput::Quantity(of)));
    let columns = data.covariates.iter().enumerate();
    let columns = columns.map(|(place, name)| (name.clone(), NetworkInput::Covariate(place)));
    let always = [("velocity", NetworkInput::Velocity), ("held", NetworkInput::Held)];
    always
        .map(|(name, input)| (name.to_owned(), input))
        .into_iter()
        .chain(columns)
        .chain(quantities)
        .collect()
}

/// Parses the network inputs by their names. An empty list selects all additional columns of the log.
fn parse_inputs(names: &[String], known: &[NamedInput]) -> Result<Vec<NamedInput>> {
    if names.is_empty() {
        let is_column = |(_, input): &&NamedInput| matches!(input, NetworkInput::Covariate(_));
        let all: Vec<NamedInput> = known.iter().filter(is_column).cloned().collect();
        if !(1..=MAX_INPUTS).contains(&all.len()) {
            let found = all.len();
            let reason = format!("the log has {found} covariates, name 1 to {MAX_INPUTS} inputs");
            return Err(unfit("--inputs", reason));
        }
        return Ok(all);
    }
    if names.len() > MAX_INPUTS {
        let most = format!("at most {MAX_INPUTS}");
        return Err(found("--inputs", names.len().to_string(), most));
    }
    let input = |name: &String| {
        known.iter().find(|(known, _)| known == name).cloned().ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
            found("--inputs", format!("{name:?}"), format!("one of {}", names.join(", ")))
        })
    };
    names.iter().map(input).collect()
}

/// Fits the model to the log of one joint.
pub(super) fn run(
    arguments: &NetworkArguments,
    fitting: &FitArguments,
    starts: usize,
    data: &Prepared,
) -> Result<JointResult> {
    let inputs = parse_inputs(&arguments.inputs, &known_inputs(&data.data))?;
    let (names, inputs): (Vec<String>, Vec<NetworkInput>) = inputs.into_iter().unzip();
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
    let spec = Spec::parse(BASE)?;
    let base = spec.parameters()?;
    let options = FitOptions { starts: starts.max(1), passive: true, ..FitOptions::default() };
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let training = TrainOptions {
        seed: fitting.seed,
        epochs: arguments.epochs,
        every: (1.0 / (EVALUATION_RATE_HZ * period_s)).round().max(1.0) as usize,
        substeps: law_substeps(period_s),
        ..TrainOptions::default()
    };
    let progress = |at: TrainingProgress| {
        let group =
            at.group.map_or(String::new(), |group| format!(", group {} held out", group + 1));
        let loss = significant(at.loss, 3);
        let epochs = arguments.epochs;
        work::report_stage(&format!(
            "training: epoch {} of {epochs}{group}, loss {loss}",
            at.epoch
        ));
    };
    let task = TrainingTask { names, watches_strokes: arguments.watch_strokes, options: training };
    work::report_stage(&format!("fitting {BASE} to {} rows", data.data.rows));
    let fit = identify(&spec, &base, data.train_rows(), data.test_rows(), &options)?;
    let training = match *inputs.as_slice() {
        [a] => train_network(&fit, [a], data, &task, &progress),
        [a, b] => train_network(&fit, [a, b], data, &task, &progress),
        [a, b, c] => train_network(&fit, [a, b, c], data, &task, &progress),
        [a, b, c, d] => train_network(&fit, [a, b, c, d], data, &task, &progress),
        _ => Err(found("--inputs", "none", "at least one")),
    }?;
    joint_result(data, &fit, &training, &task.names)
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
) -> Result<TrainingResult> {
    let options = &task.options;
    let trained = train(&fit.parameters, inputs, &data.train, options, progress);
    let TrainedNetwork { mut supplied, epochs, loss, held_out } = trained;
    if task.watches_strokes {
        supplied.set_stroke_range(&data.train);
    }
    supplied.network.validate()?;
    let (train, _) = evaluate(&supplied, &data.train);
    let (test, outside_share) = evaluate(&supplied, &data.test);
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let file = NetworkFile {
        inputs: task.names.clone(),
        network: supplied.network.widened(),
        period_s: period_s * options.every as f64,
        strokes: supplied.strokes,
    };
    let network = file.emit(json!({
        "passes": epochs, "seed": options.seed, "loss": loss, "loss_held_out": held_out,
    }));
    Ok(TrainingResult { network, train, test, outside_share, epochs })
}

/// Returns the error metrics on the tracks and the share of rows outside the trained ranges.
fn evaluate<const INPUTS: usize>(
    supplied: &NetworkLaw<INPUTS>,
    tracks: &[Track],
) -> (Metrics, f64) {
    let runs: Vec<_> = tracks.iter().map(|track| predict(supplied, track)).collect();
    let rows = || tracks.iter().zip(&runs);
    let pairs = rows().flat_map(|(track, run)| {
        let weights = (0..track.len()).map(|row| track.weight(row));
        let both = track.torque.iter().zip(&run.torque);
        both.zip(weights).map(|((measured, simulated), weight)| (*measured, *simulated, weight))
    });
    let metrics = Metrics::of(pairs.filter(|(.., weight)| *weight > 0.0));
    let outside = runs.iter().flat_map(|run| &run.is_outside).filter(|outside| **outside).count();
    let count: usize = tracks.iter().map(Track::len).sum();
    (metrics, outside as f64 / count.max(1) as f64)
}

fn joint_result(
    data: &Prepared,
    fit: &Outcome,
    training: &TrainingResult,
    names: &[String],
) -> Result<JointResult> {
    let files = network_files(fit, training, names, data)?;
    let unit = compensator_core::Quantity::Torque.info().units[data.data.joint as usize];
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
    Ok(JointResult { files, text })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_inputs_accepts_names_or_selects_all_covariates() {
        let known = [
            ("velocity", NetworkInput::Velocity),
            ("held", NetworkInput::Held),
            ("tension_n", NetworkInput::Covariate(0)),
            ("gap", NetworkInput::Covariate(1)),
            ("temperature_c", NetworkInput::Quantity(Quantity::Temperature)),
        ];
        let known = known.map(|(name, input)| (name.to_owned(), input));
        let read = |names: &[&str]| -> Result<Vec<NetworkInput>> {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let inputs = parse_inputs(&names, &known)?.into_iter().map(|(_, input)| input);
            Ok(inputs.collect())
        };
        assert_eq!(
            read(&[]).unwrap(),
            vec![NetworkInput::Covariate(0), NetworkInput::Covariate(1)]
        );
        assert_eq!(
            read(&["held", "gap"]).unwrap(),
            vec![NetworkInput::Held, NetworkInput::Covariate(1)]
        );
        assert_eq!(
            read(&["temperature_c"]).unwrap(),
            vec![NetworkInput::Quantity(Quantity::Temperature)]
        );
        let error = read(&["gop"]).unwrap_err().to_string();
        assert!(error.contains("velocity, held, tension_n, gap, temperature_c"), "{error}");
        assert!(read(&["gap"; 5]).unwrap_err().to_string().contains("at most 4"));
        assert!(parse_inputs(&[], &[]).unwrap_err().to_string().contains("0 covariates"));
    }
}
