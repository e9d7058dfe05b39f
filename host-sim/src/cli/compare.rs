//! `compare`: fits all model families to the same data and ranks them on held-out rows.

use super::each_joint::{JointResult, each_joint};
use super::identify::choices;
use super::identify_network;
use super::input::{DataArguments, LogInput, spinner};
#[cfg(feature = "papers")]
use super::inside::{self, KnownMachine};
use super::output::OutputArguments;
use super::table;
use compensator_core::LawKind;
use compensator_core::parameters::Choices;
use friction_identification::data::SplitRule;
use friction_identification::fit::{FitOptions, Outcome, identify};
use friction_identification::params;
use friction_identification::spec::Spec;
use friction_results::provenance::Provenance;
use friction_results::{Comparison, FitReport, compare_fits, document};

/// Arguments of `compare`.
#[derive(clap::Args)]
pub struct CompareArguments {
    #[command(flatten)]
    pub(super) data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// Models to compare; all laws by default. Terms are added as in `lugre+pressure-coulomb`
    #[arg(long, value_name = "MODEL,..", value_delimiter = ',')]
    models: Vec<String>,
    /// Options of the laws: damping_fades, printed_extended, allow_active (permits laws that are not passive)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    choices: Vec<String>,
    /// Fit within the known dynamics of this machine: to the angles of all joints at once, with exact gradients (models
    /// linear, extended, atan, lugre)
    #[arg(long, value_name = "MACHINE", value_enum, conflicts_with = "choices")]
    #[cfg(feature = "papers")]
    inside: Option<KnownMachine>,
}

/// Default models for `--inside`.
#[cfg(feature = "papers")]
const MACHINE_MODELS: [&str; 4] = ["linear", "extended", "atan", "lugre"];
/// Number of starting points of each fit for `--inside`.
#[cfg(feature = "papers")]
const MACHINE_FIT_STARTS: usize = 3;

fn specs(arguments: &CompareArguments) -> Result<Vec<Spec>, String> {
    if arguments.models.is_empty() {
        return Ok(LawKind::ALL.iter().copied().map(Spec::law).collect());
    }
    let parse = |name: &String| match name.as_str() {
        identify_network::MODEL => Err(identify_network::unsupported_by("compare")),
        _ => Spec::parse(name).map_err(|error| error.to_string()),
    };
    arguments.models.iter().map(parse).collect()
}

fn fits(specs: Vec<Spec>, input: &LogInput, chosen: Choices) -> Result<Vec<Outcome>, String> {
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
pub fn run(arguments: &CompareArguments) -> Result<(), String> {
    #[cfg(feature = "papers")]
    if let Some(KnownMachine::Manipulator) = arguments.inside {
        let all = || MACHINE_MODELS.map(str::to_owned).to_vec();
        let models = if arguments.models.is_empty() { all() } else { arguments.models.clone() };
        let data = &arguments.data;
        let output = &arguments.output.of_run("compare", &data.data);
        return inside::run(data, output, &models, MACHINE_FIT_STARTS, "compare.json");
    }
    let specs = specs(arguments)?;
    let chosen = choices(Choices::default(), &arguments.choices)?;
    each_joint("compare", &arguments.data, &arguments.output, &SplitRule::default(), |input| {
        compare(arguments, input, specs.clone(), chosen)
    })
}

/// Compares the models on the log of one joint.
fn compare(
    arguments: &CompareArguments,
    input: &LogInput,
    specs: Vec<Spec>,
    chosen: Choices,
) -> Result<JointResult, String> {
    input.print_log_findings();
    let fits = fits(specs, input, chosen)?;
    let mut document = document(&input.data, &input.split, &input.hashes, &fits);
    let study = FitReport {
        data: &input.data,
        split: &input.split,
        hashes: &input.hashes,
        test: input.test_rows(),
        columns: &arguments.data.columns,
        skip: arguments.data.skip,
        fits: &fits,
    };
    let Comparison { page, summary, chosen } = compare_fits(&study);
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
    text += &format!("\nparams.toml contains {}:\n", best.spec);
    best.verdicts.iter().for_each(|verdict| text += &format!("- {verdict}\n"));
    if fits.len() > 1 {
        text += "The remarks on the other models are in compare.html.\n";
    }
    let files = vec![("compare.html", html), ("params.toml", toml)];
    Ok(JointResult { document: ("compare.json", json), files, text })
}
