//! `identify --model lugre-lstm`: a LuGre whose levels and stiffness a network supplies.
//!
//! First `lugre-asymmetric` is fitted as any law: its parameters are the constants the network's factors multiply, and
//! what remains where the network is asked what it was not trained on. Then the network is trained on the runs to learn
//! from. `params.toml` holds the constants, `network.json` the network: inputs with their trained ranges, bounds, rates,
//! and weights in the order of `Network::set_weights`. A network that gains nothing on the rows held out is not written.

use super::each_joint::Told;
use super::identify::Arguments;
use super::input::{Input as Data, spinner};
use crate::results::document;
use crate::results::provenance::Provenance;
use compensator_core::network::Network;
use friction_identification::fit::{FitOptions, Metrics, Outcome, Track, identify};
use friction_identification::network::{
    CELLS, Input, Progress, Supplied, TrainOptions, Trained, predict, train,
};
use friction_identification::number::significant;
use friction_identification::params;
use friction_identification::spec::Spec;
use serde_json::{Value, json};

/// The name of the model.
pub(super) const MODEL: &str = "lugre-lstm";

/// The law whose constants the network's factors multiply.
const BASE: &str = "lugre-asymmetric";

/// Evaluations of the network a second, and steps of the law, at least: the damper at 1 Hz crosses its gap in 74 ms.
const EVALUATIONS_HZ: f64 = 128.0;
const STEPS_HZ: f64 = 512.0;

/// Most inputs of a network.
const MOST_INPUTS: usize = 4;

/// Reads what the network is fed with: `velocity`, `held`, and covariates by name; without a list every covariate.
fn inputs(names: &[String], covariates: &[String]) -> Result<Vec<Input>, String> {
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
    let known = || ["velocity", "held"].into_iter().chain(covariates.iter().map(String::as_str));
    names
        .iter()
        .map(|name| match (name.as_str(), covariates.iter().position(|own| own == name)) {
            ("velocity", _) => Ok(Input::Velocity),
            ("held", _) => Ok(Input::Held),
            (_, Some(place)) => Ok(Input::Covariate(place)),
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
    let fed = inputs(&arguments.inputs, &data.data.covariates)?;
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
            at.epoch, training.epochs
        ));
    };
    let names: Vec<String> = fed
        .iter()
        .map(|input| match input {
            Input::Velocity => "velocity".into(),
            Input::Held => "held".into(),
            Input::Covariate(place) => data.data.covariates[*place].clone(),
        })
        .collect();
    let learnt = match *fed.as_slice() {
        [a] => learn(&fit, [a], data, &training, &progress),
        [a, b] => learn(&fit, [a, b], data, &training, &progress),
        [a, b, c] => learn(&fit, [a, b, c], data, &training, &progress),
        [a, b, c, d] => learn(&fit, [a, b, c, d], data, &training, &progress),
        _ => Err("--inputs: none".into()),
    }?;
    bar.finish_and_clear();
    told(data, &fit, &learnt, &names)
}

/// What training left: the network as JSON, and its errors.
struct Learnt {
    network: Value,
    train: Metrics,
    test: Metrics,
    outside: f64,
    epochs: usize,
}

fn learn<const INPUTS: usize>(
    fit: &Outcome,
    inputs: [Input; INPUTS],
    data: &Data,
    options: &TrainOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Learnt, String> {
    let trained = train(&fit.parameters, inputs, &data.train, options, progress);
    let Trained { supplied, epochs, loss, held_out } = trained;
    supplied.network.validate().map_err(|error| error.to_string())?;
    let (train, _) = judged(&supplied, &data.train);
    let (test, outside) = judged(&supplied, &data.test);
    let period_s = data.train.first().map_or(1e-3, |track| track.period_s);
    let mut network = written(&supplied.network);
    network["evaluation_period_s"] = json!(period_s * options.every as f64);
    network["training"] = json!({
        "passes": epochs, "seed": options.seed, "loss": loss, "loss_held_out": held_out,
    });
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

/// The network as it is read again: all in `f64`, ranges as their middle and one over half their width.
fn written<const INPUTS: usize>(network: &Network<f64, INPUTS, CELLS>) -> Value {
    let mut weights = Vec::new();
    network.for_each_weight(|weight| weights.push(weight));
    let ranges: Vec<Value> = network
        .inputs
        .iter()
        .map(|range| json!({"middle": range.middle, "per_unit": range.per_unit}))
        .collect();
    let factors: Vec<Value> = ["coulomb", "static", "stiffness"]
        .iter()
        .zip(&network.bounds)
        .map(|(name, bounds)| json!({"factor": name, "least": bounds.least, "most": bounds.most}))
        .collect();
    json!({
        "schema": 1, "cells": CELLS, "ranges": ranges, "factors": factors,
        "slew": network.slew, "fade": network.fade, "weights": weights,
    })
}

fn told(data: &Data, fit: &Outcome, learnt: &Learnt, names: &[String]) -> Result<Told, String> {
    let failed = |error: serde_json::Error| error.to_string();
    let mut network = learnt.network.clone();
    network["inputs"] = json!(names);
    network["base"] = json!({"model": BASE, "params": "params.toml"});
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
    let network_json = serde_json::to_string_pretty(&network).map_err(failed)? + "\n";
    let from = Provenance {
        command: "identify",
        data: &data.data,
        hashes: &data.hashes,
        log_findings: &data.log_findings,
        verdicts: &fit.verdicts,
    };
    let toml = from.comments() + &params::emit(fit, data.data.joint);
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
        files.push(("network.json", network_json));
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
            inputs(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>(), &covariates)
        };
        assert_eq!(read(&[]), Ok(vec![Input::Covariate(0), Input::Covariate(1)]));
        assert_eq!(read(&["held", "gap"]), Ok(vec![Input::Held, Input::Covariate(1)]));
        assert!(read(&["gop"]).unwrap_err().contains("velocity, held, tension_n, gap"));
        assert!(read(&["gap"; 5]).unwrap_err().contains("at most 4"));
        assert!(inputs(&[], &[]).unwrap_err().contains("0 covariates"));
    }
}
