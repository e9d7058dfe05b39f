//! `compare`: fits all model families to the same data and ranks them on held-out rows.

use super::each_joint::{JointResult, each_joint};
use super::error::Result;
use super::identify::{KnownMachine, choices};
use super::input::DataArguments;
use super::network;
use super::output::OutputArguments;
use super::table;
use compensator_core::LawKind;
use compensator_core::parameters::Choices;
use friction_diagnose::prepare::{Prepared, identify_each};
use friction_fit::FitOptions;
use friction_fit::spec::Spec;
use friction_results::fits::{ComparisonFiles, comparison_files};
use joint_log::SplitRule;
use joint_log::work;

/// Arguments of `compare`.
#[derive(clap::Args)]
pub struct CompareArguments {
    /// Models to compare; all laws by default. Terms are added as in `lugre+pressure-coulomb`
    #[arg(long, value_name = "MODEL,..", value_delimiter = ',')]
    models: Vec<String>,
    /// Options of the laws: damping_fades, printed_extended, allow_active (permits laws that are not passive)
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', hide_short_help = true)]
    choices: Vec<String>,
    /// Fit within the known dynamics of this machine
    ///
    /// The fit is to the angles of all joints at once, with exact gradients (models linear, extended, atan, lugre).
    #[arg(
        long,
        value_name = "MACHINE",
        value_enum,
        hide_short_help = true,
        conflicts_with = "choices"
    )]
    inside: Option<KnownMachine>,
    #[command(flatten)]
    pub(super) data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
}

/// Returns the models for `--inside`.
#[cfg(feature = "papers")]
fn machine_models(arguments: &CompareArguments) -> Vec<String> {
    let default = || ["linear", "extended", "atan", "lugre"].map(str::to_owned).to_vec();
    if arguments.models.is_empty() { default() } else { arguments.models.clone() }
}

/// Number of starting points of each fit for `--inside`.
#[cfg(feature = "papers")]
const MACHINE_FIT_STARTS: usize = 3;

fn specs(arguments: &CompareArguments) -> Result<Vec<Spec>> {
    if arguments.models.is_empty() {
        return Ok(LawKind::ALL.iter().copied().map(Spec::law).collect());
    }
    let parse = |name: &String| match name.as_str() {
        network::MODEL => Err(network::unsupported_by("compare")),
        _ => Ok(Spec::parse(name)?),
    };
    arguments.models.iter().map(parse).collect()
}

/// Runs the command.
pub fn run(arguments: &CompareArguments) -> Result {
    let CompareArguments { data, output, .. } = arguments;
    if let Some(KnownMachine::Manipulator) = arguments.inside {
        #[cfg(not(feature = "papers"))]
        return Err(super::missing_feature::refusal("--inside", "papers").into());
        #[cfg(feature = "papers")]
        return super::inside::run(
            data,
            &output.of_run("compare", &data.log.data),
            &machine_models(arguments),
            MACHINE_FIT_STARTS,
            "compare.json",
        );
    }
    let specs = specs(arguments)?;
    let chosen = choices(Choices::default(), &arguments.choices)?;
    each_joint("compare", data, output, &SplitRule::default(), |input| {
        compare(input, &specs, chosen)
    })
}

/// Compares the models on the log of one joint.
fn compare(input: &Prepared, specs: &[Spec], chosen: Choices) -> Result<JointResult> {
    let options = FitOptions { passive: true, ..FitOptions::default() };
    let fits = identify_each(specs, input, chosen, &options)?;
    work::report_stage("writing the report");
    let ComparisonFiles { files, summary, chosen } = comparison_files(&fits, input)?;
    let best = &fits[chosen];
    let mut text = table::models(&fits, &input.data) + "\n" + &table::numbered(&summary);
    text += &format!("\nparams.toml contains {}:\n", best.spec);
    best.verdicts.iter().for_each(|verdict| text += &format!("- {verdict}\n"));
    if fits.len() > 1 {
        text += "The remarks on the other models are in compare.html.\n";
    }
    Ok(JointResult { files, text })
}
