//! `identify`: one model, fitted.

use super::each_joint::{Told, each_joint};
use super::identify_network;
use super::input::{DataArguments, Input, spinner};
use super::inside::{self, Machine};
use super::output::OutputArguments;
use crate::driver_file;
use crate::results::provenance::Provenance;
use crate::results::{Study, document, page, table};
use compensator_core::parameters::Choices;
use compensator_core::{ParameterId, Parameters};
use friction_identification::data::SplitRule;
use friction_identification::fit::{FitOptions, identify};
use friction_identification::params;
use friction_identification::spec::Spec;
use std::path::PathBuf;

/// Arguments of `identify`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    pub(super) data: DataArguments,
    #[command(flatten)]
    pub(super) output: OutputArguments,
    /// The model: linear, extended, atan, stribeck, dahl, lugre, lugre-asymmetric, improved-lugre,
    /// with terms as in `lugre+pressure-coulomb`; or lugre-lstm, whose levels and stiffness a network supplies
    #[arg(long, value_name = "MODEL")]
    model: String,
    /// Start from these parameters, and from nowhere else
    #[arg(long, value_name = "PARAMS.TOML")]
    start: Option<PathBuf>,
    /// Parameters to keep where they start
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    keep: Vec<String>,
    /// Parameters to fit that are otherwise kept (static excesses, references)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    free: Vec<String>,
    /// Choices about the law: damping_fades, printed_extended, allow_active (also a law that can give out energy)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    choices: Vec<String>,
    /// Starting points that go all the way
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(super) starts: usize,
    /// Fit inside the known dynamics of this machine: to the angles of all its joints at once, with exact gradients (linear,
    /// extended, atan, lugre)
    #[arg(long, value_name = "MACHINE", value_enum, conflicts_with_all = ["start", "keep", "free", "choices", "substeps"])]
    inside: Option<Machine>,
    /// Simulation steps per sample; chosen by the fit unless given
    #[arg(long, value_name = "N")]
    substeps: Option<usize>,
    /// What the network of lugre-lstm is fed with: `velocity`, `held` (the torque its bristles hold), columns by
    /// name; without it, every column of the log's own
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    pub(super) inputs: Vec<String>,
    /// Let strokes (the way from reversal to reversal) unlike those lugre-lstm was trained on count as outside
    #[arg(long)]
    pub(super) watch_strokes: bool,
    /// Most passes over the runs when lugre-lstm is trained
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub(super) epochs: usize,
}

fn ids(option: &str, names: &[String]) -> Result<Vec<ParameterId>, String> {
    let id = |name: &String| {
        ParameterId::parse(name).ok_or_else(|| format!("{option}: unknown parameter {name:?}"))
    };
    names.iter().map(id).collect()
}

/// Choices, and those that are asked for by name.
pub(super) fn choices(given: Choices, names: &[String]) -> Result<Choices, String> {
    let mut choices = given.to_array();
    for name in names {
        let place = Choices::NAMES.iter().position(|known| known == name);
        let place = place.ok_or_else(|| {
            format!("--choices: unknown choice {name:?}, expected of {}", Choices::NAMES.join(", "))
        })?;
        choices[place] = true;
    }
    Ok(Choices::from_array(choices))
}

/// The model's parameters, with those another set has too taken from it.
fn merged(base: &Parameters<f64>, other: &Parameters<f64>) -> Parameters<f64> {
    let shared = base.active().filter(|id| other.active().any(|theirs| theirs == *id));
    let mut base = base.clone();
    base.choices = other.choices;
    shared.fold(base.clone(), |merged, id| merged.with(id, other.get(id)))
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    if let Some(Machine::Manipulator) = arguments.inside {
        let models = std::slice::from_ref(&arguments.model);
        let data = &arguments.data;
        let output = &arguments.output.of_run("identify", &data.data);
        return inside::run(data, output, models, arguments.starts, "fit.json");
    }
    if arguments.model == identify_network::MODEL {
        return each_joint(
            "identify",
            &arguments.data,
            &arguments.output,
            &SplitRule::default(),
            |input| identify_network::run(arguments, input),
        );
    }
    let input_spec = Spec::parse(&arguments.model).map_err(|error| error.to_string())?;
    let (fixed, freed) = (ids("--keep", &arguments.keep)?, ids("--free", &arguments.free)?);
    each_joint("identify", &arguments.data, &arguments.output, &SplitRule::default(), |input| {
        fitted(arguments, input, input_spec.clone(), fixed.clone(), freed.clone())
    })
}

/// The model on one joint.
fn fitted(
    arguments: &Arguments,
    input: &Input,
    input_spec: Spec,
    fixed: Vec<ParameterId>,
    freed: Vec<ParameterId>,
) -> Result<Told, String> {
    input.warn();
    let spec = input_spec.on(&input.rigid_body);
    let mut base = spec.parameters().map_err(|error| error.to_string())?;
    let start = match &arguments.start {
        None => None,
        Some(path) => {
            let file = driver_file::read(path).map_err(|error| error.to_string())?;
            Some(merged(&base, &file.parameters))
        }
    };
    if let Some(start) = &start {
        base = start.clone();
    }
    base.choices = choices(base.choices, &arguments.choices)?;
    let start = start.map(|_| base.clone());
    let options = FitOptions {
        substeps: arguments.substeps,
        starts: arguments.starts.max(1),
        start,
        fixed,
        freed,
        passive: true,
        ..FitOptions::default()
    };
    let bar = spinner(format!("fitting {spec} to {} rows", input.data.rows));
    let fit = identify(&spec, &base, input.train_rows(), input.test_rows(), &options)
        .map_err(|error| error.to_string())?;
    bar.finish_and_clear();

    let document = document(&input.data, &input.split, &input.hashes, std::slice::from_ref(&fit));
    let json = serde_json::to_string_pretty(&document).map_err(|error| error.to_string())? + "\n";
    let from = Provenance {
        command: "identify",
        data: &input.data,
        hashes: &input.hashes,
        log_findings: &input.log_findings,
        verdicts: &fit.verdicts,
    };
    let toml = from.comments() + &params::emit(&fit, input.data.joint);
    let study = Study {
        data: &input.data,
        split: &input.split,
        hashes: &input.hashes,
        test: input.test_rows(),
        columns: &arguments.data.columns,
        skip: arguments.data.skip,
        fits: std::slice::from_ref(&fit),
    };
    let html = page(&study).render();
    let models = table::models(std::slice::from_ref(&fit), &input.data);
    let mut text = format!("{}\n{models}\n", table::parameters(&fit, &input.data));
    fit.verdicts.iter().for_each(|verdict| text += &format!("- {verdict}\n"));
    let files = vec![("params.toml", toml), ("fit.html", html)];
    Ok(Told { document: ("fit.json", json), files, text })
}
