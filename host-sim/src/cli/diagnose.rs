//! `diagnose`: finds the effects that a friction model misses, extends the model, and measures the gain.

use super::each_joint::{JointResult, each_joint};
use super::identify_network;
use super::input::{DataArguments, LogInput, spinner};
use super::output::OutputArguments;
use super::table;
use crate::driver_file;
use crate::loop_cost;
use compensator_core::Parameters;
use friction_identification::data::SplitRule;
use friction_identification::diagnose::{DiagnosisOptions, diagnose};
use friction_identification::params::{self, ParameterFile};
use friction_identification::spec::Spec;
use friction_results::diagnosis;
use friction_results::diagnosis_page::{self, DiagnosisReport};
use friction_results::provenance::Provenance;
use std::path::PathBuf;

/// Arguments of `diagnose`.
#[derive(clap::Args)]
pub struct DiagnoseArguments {
    #[command(flatten)]
    pub(super) data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// Base model; by default the simplest of linear, stribeck and lugre that the log supports
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// Evaluate the model of this file without fitting it, then extend its law
    #[arg(long, value_name = "PARAMS.TOML", conflicts_with = "model")]
    params: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &DiagnoseArguments) -> Result<(), String> {
    if arguments.model.as_deref() == Some(identify_network::MODEL) {
        return Err(identify_network::unsupported_by("diagnose"));
    }
    let model = arguments.model.as_deref().map(Spec::parse).transpose();
    let given = arguments.params.as_deref().map(driver_file::read).transpose();
    let (model, given) = (model.map_err(|e| e.to_string())?, given.map_err(|e| e.to_string())?);
    if let (Some(path), Some(ParameterFile { network: Some(_), .. })) = (&arguments.params, &given)
    {
        return Err(format!(
            "{}: this model has a network, but a diagnosis extends a law with constant parameters; remove the \
             section [network] to diagnose the model without its network",
            path.display()
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
    input: &LogInput,
    model: Option<Spec>,
    given: Option<(Spec, Parameters<f64>)>,
) -> Result<JointResult, String> {
    let question = DiagnosisOptions {
        model,
        given,
        decimate: arguments.data.decimate as usize,
        rigid_body: input.rigid_body.clone(),
        seed: arguments.data.seed,
        log_findings: input.log_findings.clone(),
        as_logged: arguments.data.kinds_as_logged(),
        only_weighs: false,
    };
    let bar = spinner("diagnosing".into());
    let progress = |what: &str| bar.set_message(what.to_owned());
    let found = diagnose(&input.data, &input.split, &question, &progress)
        .map_err(|error| error.to_string())?;
    bar.finish_and_clear();

    let document = diagnosis::document(&found, &input.data, &input.split, &input.hashes);
    let json = serde_json::to_string_pretty(&document).map_err(|error| error.to_string())? + "\n";
    let mut handed_out = found.transferable_model();
    handed_out.verdicts.extend(loop_cost::late_loop_warning(&handed_out.spec.terms));
    let from = Provenance {
        command: "diagnose",
        data: &input.data,
        hashes: &input.hashes,
        log_findings: &found.log_findings,
        verdicts: &handed_out.verdicts,
    };
    let toml = from.comments() + &params::emit(&handed_out, input.data.joint);
    let about = DiagnosisReport {
        found: &found,
        data: &input.data,
        split: &input.split,
        hashes: &input.hashes,
        columns: &arguments.data.columns,
        skip: arguments.data.skip,
        seed: arguments.data.seed,
    };
    let html = diagnosis_page::page(&about).render();
    let mut text = String::new();
    for finding in &found.log_findings {
        text += &format!("log: {}: {}\n", finding.kind.name(), finding.in_words);
    }
    for (index, sentence) in document.summary().iter().enumerate() {
        text += &format!("{}. {sentence}\n", index + 1);
    }
    if let Some(late) = loop_cost::late_loop_warning(&handed_out.spec.terms) {
        text += &format!("Computing time on the joint driver: {late}.\n");
    }
    text += &format!("\n{}\n", table::findings(&found));
    let files = vec![("report.html", html), ("params.toml", toml)];
    Ok(JointResult { document: ("diagnosis.json", json), files, text })
}
