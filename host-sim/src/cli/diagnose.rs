//! `diagnose`: finds the effects that a friction model misses, extends the model, and measures the gain.

use super::each_joint::{JointResult, each_joint};
use super::error::{Result, unfit};
use super::input::DataArguments;
use super::network;
use super::output::OutputArguments;
use super::table;
use crate::driver_file;
use compensator_core::Parameters;
use friction_diagnose::prepare::Prepared;
use friction_diagnose::summary::summary;
use friction_diagnose::{DiagnosisOptions, diagnose, hand_over};
use friction_fit::params::ParameterFile;
use friction_fit::spec::Spec;
use friction_results::diagnosis::DiagnosedLog;
use friction_results::loop_cost::late_loop_warning;
use friction_results::stochastic::StochasticExtension;
use joint_log::SplitRule;
use joint_log::log_check::LogFinding;
use joint_log::work;
use std::path::PathBuf;

/// Arguments of `diagnose`.
#[derive(clap::Args)]
pub struct DiagnoseArguments {
    /// Base model; by default the simplest of linear, stribeck and lugre that the log supports
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// Evaluate the model of this file without fitting it, then extend its law
    #[arg(long, value_name = "PARAMS.TOML", conflicts_with = "model")]
    params: Option<PathBuf>,
    #[command(flatten)]
    pub(super) data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
}

/// Runs the command.
pub fn run(arguments: &DiagnoseArguments) -> Result {
    if arguments.model.as_deref() == Some(network::MODEL) {
        return Err(network::unsupported_by("diagnose"));
    }
    let model = arguments.model.as_deref().map(Spec::parse).transpose()?;
    let given = arguments.params.as_deref().map(driver_file::read).transpose()?;
    if let (Some(path), Some(ParameterFile { network: Some(_), .. })) = (&arguments.params, &given)
    {
        return Err(unfit(
            path.display(),
            "this model has a network, but a diagnosis extends a law with constant parameters; remove the \
             section [network] to diagnose the model without its network",
        ));
    }
    let given = given.map(|file| (file.spec, file.parameters));
    each_joint(
        "diagnose",
        &arguments.data,
        &arguments.output,
        &SplitRule::LeaveOneRunOut,
        |input| diagnose_joint(arguments, input, model.clone(), given.clone()),
    )
}

/// Diagnoses the log of one joint.
fn diagnose_joint(
    arguments: &DiagnoseArguments,
    input: &Prepared,
    model: Option<Spec>,
    given: Option<(Spec, Parameters<f64>)>,
) -> Result<JointResult> {
    let question = DiagnosisOptions {
        model,
        given,
        as_logged: arguments.data.log.kinds_as_logged(),
        ..input.question()
    };
    let found = diagnose(&input.data, &input.split, &question, &work::report_stage)?;
    let stochastic = StochasticExtension::new(&found, input.seed, &work::report_stage);
    work::report_stage("writing the report");
    let files = DiagnosedLog { found: &found, stochastic: &stochastic, input }.files()?;
    let mut text = String::new();
    // The others were reported when the log was read.
    let is_new = |finding: &&LogFinding| !input.log_findings.contains(finding);
    for finding in found.log_findings.iter().filter(is_new) {
        text += &format!("log: {}: {}\n", finding.kind.name(), finding.in_words);
    }
    text += &table::numbered(&summary(&found));
    text += &format!("Handed over: {}\n", hand_over::in_words(&found));
    if let Some(late) = late_loop_warning(&found.transferable_model().spec.terms) {
        text += &format!("Computing time on the joint driver: {late}.\n");
    }
    text += &format!("\n{}\n", table::findings(&found));
    Ok(JointResult { files, text })
}
