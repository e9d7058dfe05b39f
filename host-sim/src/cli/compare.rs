//! `compare`: all families on equal terms.

use super::each_joint::{Told, each_joint};
use super::identify::choices;
use super::identify_network;
use super::input::{DataArguments, Input, spinner};
use super::inside::{self, Machine};
use super::output::OutputArguments;
use crate::results::provenance::Provenance;
use crate::results::{Judged, Study, document, judged, table};
use compensator_core::LawKind;
use compensator_core::parameters::Choices;
use friction_identification::data::SplitRule;
use friction_identification::fit::{FitOptions, Outcome, identify};
use friction_identification::params;
use friction_identification::spec::Spec;

/// Arguments of `compare`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// Only these models instead of all laws; terms as in `lugre+pressure-coulomb`
    #[arg(long, value_name = "MODEL,..", value_delimiter = ',')]
    models: Vec<String>,
    /// Choices about the laws: damping_fades, printed_extended, allow_active (also laws that can give out energy)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    choices: Vec<String>,
    /// Compare inside the known dynamics of this machine: on the angles of all its joints at once, with exact gradients
    /// (linear, extended, atan, lugre)
    #[arg(long, value_name = "MACHINE", value_enum, conflicts_with = "choices")]
    inside: Option<Machine>,
}

/// Models inside a machine unless told, and starts of each.
const INSIDE: [&str; 4] = ["linear", "extended", "atan", "lugre"];
const INSIDE_STARTS: usize = 3;

fn specs(arguments: &Arguments) -> Result<Vec<Spec>, String> {
    if arguments.models.is_empty() {
        return Ok(LawKind::ALL.iter().copied().map(Spec::law).collect());
    }
    let parse = |name: &String| match name.as_str() {
        identify_network::MODEL => Err(identify_network::trained_alone("compare")),
        _ => Spec::parse(name).map_err(|error| error.to_string()),
    };
    arguments.models.iter().map(parse).collect()
}

fn fits(specs: Vec<Spec>, input: &Input, chosen: Choices) -> Result<Vec<Outcome>, String> {
    let options = FitOptions { passive: true, ..FitOptions::default() };
    let mut fits = Vec::new();
    for spec in specs {
        let spec = spec.on(&input.rigid_body);
        let bar = spinner(format!("fitting {spec} to {} rows", input.data.rows));
        let mut base = spec.parameters().map_err(|error| error.to_string())?;
        base.choices = chosen;
        let fit = identify(&spec, &base, input.train_rows(), input.test_rows(), &options);
        fits.push(fit.map_err(|error| error.to_string())?);
        bar.finish_and_clear();
    }
    Ok(fits)
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    if let Some(Machine::Manipulator) = arguments.inside {
        let all = || INSIDE.map(str::to_owned).to_vec();
        let models = if arguments.models.is_empty() { all() } else { arguments.models.clone() };
        let data = &arguments.data;
        let output = &arguments.output.of_run("compare", &data.data);
        return inside::run(data, output, &models, INSIDE_STARTS, "compare.json");
    }
    let specs = specs(arguments)?;
    let chosen = choices(Choices::default(), &arguments.choices)?;
    each_joint("compare", &arguments.data, &arguments.output, &SplitRule::default(), |input| {
        compare(arguments, input, specs.clone(), chosen)
    })
}

/// The models on one joint.
fn compare(
    arguments: &Arguments,
    input: &Input,
    specs: Vec<Spec>,
    chosen: Choices,
) -> Result<Told, String> {
    input.warn();
    let fits = fits(specs, input, chosen)?;
    let mut document = document(&input.data, &input.split, &input.hashes, &fits);
    let study = Study {
        data: &input.data,
        split: &input.split,
        hashes: &input.hashes,
        test: input.test_rows(),
        columns: &arguments.data.columns,
        skip: arguments.data.skip,
        fits: &fits,
    };
    let Judged { page, summary, chosen } = judged(&study);
    let best = &fits[chosen];
    document.choose(&best.spec);
    let json = serde_json::to_string_pretty(&document).map_err(|error| error.to_string())? + "\n";
    let html = page.render();
    let from = Provenance {
        command: "compare",
        data: &input.data,
        hashes: &input.hashes,
        log_findings: &input.log_findings,
        verdicts: &best.verdicts,
    };
    let toml = from.comments() + &params::emit(best, input.data.joint);
    let mut text = table::models(&fits, &input.data) + "\n";
    summary.iter().for_each(|sentence| text += &format!("{sentence}\n"));
    text += &format!("\nparams.toml is {}:\n", best.spec);
    best.verdicts.iter().for_each(|verdict| text += &format!("- {verdict}\n"));
    if fits.len() > 1 {
        text += "What is to be said of the others is in compare.html.\n";
    }
    let files = vec![("compare.html", html), ("params.toml", toml)];
    Ok(Told { document: ("compare.json", json), files, text })
}
