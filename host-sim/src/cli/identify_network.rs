//! `identify --model lugre-lstm`: a LuGre whose levels and stiffness a network supplies.
//!
//! First `lugre-asymmetric` is fitted as any law: its parameters are the constants the network's factors multiply, and
//! what remains where the network is asked what it was not trained on. Then the network is trained on the runs to learn
//! from. `params.toml` holds the constants and names `network.json` with its checksum, which holds the network
//! ([`NetworkFile`]); every command that takes `params.toml` takes both. A network that gains nothing on the rows held
//! out is not written.

use super::each_joint::Told;
use super::identify::Arguments;
use super::input::{Input as Data, spinner};
use crate::results::document;
use crate::results::provenance::Provenance;
use compensator_core::Quantity;
use compensator_core::network::MOST_INPUTS;
use friction_identification::data::{Dataset, contract};
use friction_identification::fit::{FitOptions, Metrics, Outcome, Track, identify};
use friction_identification::network::{
    BASE, Input, NetworkFile, Progress, Supplied, TrainOptions, Trained, predict, train,
};
use friction_identification::number::significant;
use friction_identification::params;
use friction_identification::spec::Spec;
use serde_json::json;

/// The name of the model.
pub(super) const MODEL: &str = "lugre-lstm";

/// Why another command does not take this model.
pub(super) fn trained_alone(command: &str) -> String {
    format!(
        "{MODEL}: its network is trained and judged by `identify --model {MODEL}`, beside {BASE}; {command} takes laws of \
         constants"
    )
}

/// Evaluations of the network a second, and steps of the law, at least: the damper at 1 Hz crosses its gap in 74 ms.
const EVALUATIONS_HZ: f64 = 128.0;
const STEPS_HZ: f64 = 512.0;

/// The quantities of the contract that a network can be fed with and every run of a log has.
fn known_quantities(data: &Dataset) -> Vec<Quantity> {
    let has = |quantity: &Quantity| data.runs.iter().all(|run| run.get(*quantity).is_some());
    contract::covariates().filter(has).collect()
}

/// Reads what the network is fed with: `velocity`, `held`, and columns by name; without a list every covariate of the
/// log's own.
fn inputs(
    names: &[String],
    quantities: &[(&str, Quantity)],
    covariates: &[String],
) -> Result<Vec<Input>, String> {
    if names.is_empty() {
        let all: Vec<Input> = (0..covariates.len()).map(Input::Covariate).collect();
        return if (1..=MOST_INPUTS).contains(&all.len()) {
            Ok(all)
        } else {
            let found = covariates.len();
            Err(format!("--inputs: the log has {found} covariates, name 1 to {MOST_INPUTS} inputs"))
        };
    }
    if names.len() > MOST_INPUTS {
        return Err(format!("--inputs: found {}, expected at most {MOST_INPUTS}", names.len()));
    }
    let quantity = |name: &str| quantities.iter().find(|(known, _)| *known == name);
    let columns = || covariates.iter().map(String::as_str).chain(quantities.iter().map(|of| of.0));
    let known = || ["velocity", "held"].into_iter().chain(columns());
    names
        .iter()
        .map(|name| match (name.as_str(), covariates.iter().position(|own| own == name)) {
            ("velocity", _) => Ok(Input::Velocity),
            ("held", _) => Ok(Input::Held),
            (_, Some(place)) => Ok(Input::Covariate(place)),
            (name, None) if quantity(name).is_some() => {
                Ok(quantity(name).map_or(Input::Velocity, |(_, of)| Input::Quantity(*of)))
            }
            _ => {
                let known: Vec<&str> = known().collect();
                Err(format!("--inputs: found {name:?}, expected of {}", known.join(", ")))
            }
        })
        .collect()
}

/// This model on one joint.
pub(super) fn run(arguments: &Arguments, data: &Data) -> Result<Told, String> {
    data.warn();
    let quantities: Vec<(&str, Quantity)> = known_quantities(&data.data)
        .into_iter()
        .map(|quantity| (quantity.name(data.data.joint), quantity))
        .collect();
    let fed = inputs(&arguments.inputs, &quantities, &data.data.covariates)?;
    if !data.rigid_body.is_empty() {
        return Err(format!(
            "--rigid-body: not with --model {MODEL}, whose column is friction alone"
        ));
    }
    let spec = Spec::parse(BASE).map_err(|error| error.to_string())?;
    let base = spec.parameters().map_err(|error| error.to_string())?;
    let options =
        FitOptions { starts: arguments.starts.max(1), passive: true, ..FitOptions::default() };
    let bar = spinner(format!("fitting {BASE} to {} rows", data.data.rows));
    let fit = identify(&spec, &base, data.train_rows(), data.test_rows(), &options)
        .map_err(|error| error.to_string())?;
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let training = TrainOptions {
        seed: arguments.data.seed,
        epochs: arguments.epochs,
        every: (1.0 / (EVALUATIONS_HZ * period_s)).round().max(1.0) as usize,
        substeps: (STEPS_HZ * period_s).ceil().max(1.0) as usize,
        ..TrainOptions::default()
    };
    let progress = |at: Progress| {
        let group =
            at.group.map_or(String::new(), |group| format!(", group {} held out", group + 1));
        let loss = significant(at.loss, 3);
        bar.set_message(format!(
            "training: pass {} of {}{group}, loss {loss}",
            at.epoch, arguments.epochs
        ));
    };
    let names: Vec<String> = fed
        .iter()
        .map(|input| match input {
            Input::Velocity => "velocity".into(),
            Input::Held => "held".into(),
            Input::Covariate(place) => data.data.covariates[*place].clone(),
            Input::Quantity(quantity) => quantity.name(data.data.joint).into(),
        })
        .collect();
    let asked = Asked { names, watches: arguments.watch_strokes, options: training };
    let learnt = match *fed.as_slice() {
        [a] => learn(&fit, [a], data, &asked, &progress),
        [a, b] => learn(&fit, [a, b], data, &asked, &progress),
        [a, b, c] => learn(&fit, [a, b, c], data, &asked, &progress),
        [a, b, c, d] => learn(&fit, [a, b, c, d], data, &asked, &progress),
        _ => Err("--inputs: none".into()),
    }?;
    bar.finish_and_clear();
    told(data, &fit, &learnt, &asked.names)
}

/// What is asked of training.
struct Asked {
    /// The inputs' names.
    names: Vec<String>,
    /// Whether strokes unlike those of training count as outside.
    watches: bool,
    options: TrainOptions,
}

/// What training left: the network's file, and its errors.
struct Learnt {
    network: String,
    train: Metrics,
    test: Metrics,
    outside: f64,
    epochs: usize,
}

fn learn<const INPUTS: usize>(
    fit: &Outcome,
    inputs: [Input; INPUTS],
    data: &Data,
    asked: &Asked,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Learnt, String> {
    let options = &asked.options;
    let trained = train(&fit.parameters, inputs, &data.train, options, progress);
    let Trained { mut supplied, epochs, loss, held_out } = trained;
    if asked.watches {
        supplied.watch_strokes(&data.train);
    }
    supplied.network.validate().map_err(|error| error.to_string())?;
    let (train, _) = judged(&supplied, &data.train);
    let (test, outside) = judged(&supplied, &data.test);
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let file = NetworkFile {
        inputs: asked.names.clone(),
        network: supplied.network.widened(),
        period_s: period_s * options.every as f64,
        strokes: supplied.strokes,
    };
    let network = file.emit(json!({
        "passes": epochs, "seed": options.seed, "loss": loss, "loss_held_out": held_out,
    }));
    Ok(Learnt { network, train, test, outside, epochs })
}

/// Errors on some tracks, and the share of rows outside the trained ranges.
fn judged<const INPUTS: usize>(supplied: &Supplied<INPUTS>, tracks: &[Track]) -> (Metrics, f64) {
    let runs: Vec<_> = tracks.iter().map(|track| predict(supplied, track)).collect();
    let rows = || tracks.iter().zip(&runs);
    let pairs = rows().flat_map(|(track, run)| {
        let weighed = (0..track.len()).map(|row| track.weight(row));
        let both = track.torque.iter().zip(&run.torque);
        both.zip(weighed).map(|((measured, simulated), weight)| (*measured, *simulated, weight))
    });
    let metrics = Metrics::of(pairs.filter(|(.., weight)| *weight > 0.0));
    let outside = runs.iter().flat_map(|run| &run.is_outside).filter(|outside| **outside).count();
    let count: usize = tracks.iter().map(Track::len).sum();
    (metrics, outside as f64 / count.max(1) as f64)
}

fn told(data: &Data, fit: &Outcome, learnt: &Learnt, names: &[String]) -> Result<Told, String> {
    let failed = |error: serde_json::Error| error.to_string();
    let base = document(&data.data, &data.split, &data.hashes, std::slice::from_ref(fit));
    let mut document = serde_json::to_value(&base).map_err(failed)?;
    let model = &mut document["models"][0];
    model["model"] = json!(MODEL);
    model["base"] = json!({"model": BASE, "train": fit.train, "test": fit.test});
    (model["train"], model["test"]) = (json!(learnt.train), json!(learnt.test));
    // What does not gain on rows it has not seen is not handed out.
    let gains = learnt.test.rmse < fit.test.rmse;
    model["network"] = json!({
        "file": gains.then_some("network.json"), "inputs": names, "passes": learnt.epochs,
        "share_of_test_rows_outside": learnt.outside,
    });
    let fit_json = serde_json::to_string_pretty(&document).map_err(failed)? + "\n";
    let from = Provenance {
        command: "identify",
        data: &data.data,
        hashes: &data.hashes,
        log_findings: &data.log_findings,
        verdicts: &fit.verdicts,
    };
    let mut toml = from.comments() + &params::emit(fit, data.data.joint);
    if gains {
        params::emit_network("network.json", &learnt.network, &mut toml);
    }
    let unit = compensator_core::Quantity::Torque.info().units[data.data.joint as usize];
    let number = |value| significant(value, 4);
    let line = |name: &str, train: &Metrics, test: &Metrics| {
        format!(
            "{name}: {} {unit} fitted, {} {unit} held out ({:.1} % of std)\n",
            number(train.rmse),
            number(test.rmse),
            100.0 * test.nrmse_std
        )
    };
    let mut text = line(BASE, &fit.train, &fit.test) + &line(MODEL, &learnt.train, &learnt.test);
    text += &format!(
        "fed with {}; stopped after {} passes; {:.1} % of the rows held out lie outside its ranges\n",
        names.join(", "),
        learnt.epochs,
        100.0 * learnt.outside
    );
    text +=
        "- a network has no parameters with errors; passivity does not hold, |y| <= max g does\n";
    fit.verdicts.iter().for_each(|verdict| text += &format!("- {BASE}: {verdict}\n"));
    let mut files = vec![("params.toml", toml)];
    if gains {
        files.push(("network.json", learnt.network.clone()));
    } else {
        text += &format!(
            "- on the rows held out the network is no better than {BASE}: no network.json is written\n"
        );
    }
    Ok(Told { document: ("fit.json", fit_json), files, text })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_are_named_or_all_covariates() {
        let covariates = ["tension_n".to_owned(), "gap".to_owned()];
        let read = |names: &[&str]| {
            let quantities = [("temperature_c", Quantity::Temperature)];
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            inputs(&names, &quantities, &covariates)
        };
        assert_eq!(read(&[]), Ok(vec![Input::Covariate(0), Input::Covariate(1)]));
        assert_eq!(read(&["held", "gap"]), Ok(vec![Input::Held, Input::Covariate(1)]));
        assert_eq!(read(&["temperature_c"]), Ok(vec![Input::Quantity(Quantity::Temperature)]));
        let error = read(&["gop"]).unwrap_err();
        assert!(error.contains("velocity, held, tension_n, gap, temperature_c"), "{error}");
        assert!(read(&["gap"; 5]).unwrap_err().contains("at most 4"));
        assert!(inputs(&[], &[], &[]).unwrap_err().contains("0 covariates"));
    }
}
