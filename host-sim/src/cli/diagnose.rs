//! `diagnose`: what the model gets wrong, why, the extension, the gain.

use super::each_joint::{Told, each_joint};
use super::identify_network;
use super::input::{DataArguments, Input, spinner};
use super::output::OutputArguments;
use crate::driver_file;
use crate::loop_cost;
use crate::results::diagnosis_page::{self, Diagnosed};
use crate::results::provenance::Provenance;
use crate::results::{diagnosis, table};
use compensator_core::Parameters;
use friction_identification::data::SplitRule;
use friction_identification::diagnose::{Question, diagnose};
use friction_identification::params::{self, ParameterFile};
use friction_identification::spec::Spec;
use std::path::PathBuf;

/// Arguments of `diagnose`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    data: DataArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// The base model; without it the simplest of linear, stribeck and lugre the log supports
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// Judge this model as it is, then extend its law
    #[arg(long, value_name = "PARAMS.TOML", conflicts_with = "model")]
    params: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    if arguments.model.as_deref() == Some(identify_network::MODEL) {
        return Err(identify_network::trained_alone("diagnose"));
    }
    let model = arguments.model.as_deref().map(Spec::parse).transpose();
    let given = arguments.params.as_deref().map(driver_file::read).transpose();
    let (model, given) = (model.map_err(|e| e.to_string())?, given.map_err(|e| e.to_string())?);
    if let (Some(path), Some(ParameterFile { network: Some(_), .. })) = (&arguments.params, &given)
    {
        return Err(format!(
            "{}: a network supplies its levels and stiffness, and a diagnosis extends a law of constants; without the \
             section [network] its constants are judged",
            path.display()
        ));
    }
    let given = given.map(|file| (file.spec, file.parameters));
    each_joint("diagnose", &arguments.data, &arguments.output, &SplitRule::EachOut, |input| {
        diagnosed(arguments, input, model.clone(), given.clone())
    })
}

/// The diagnosis of one joint.
fn diagnosed(
    arguments: &Arguments,
    input: &Input,
    model: Option<Spec>,
    given: Option<(Spec, Parameters<f64>)>,
) -> Result<Told, String> {
    let question = Question {
        model,
        given,
        decimate: arguments.data.decimate as usize,
        rigid_body: input.rigid_body.clone(),
        seed: arguments.data.seed,
        log_findings: input.log_findings.clone(),
        as_logged: arguments.data.kinds_as_logged(),
    };
    let bar = spinner("diagnosing".into());
    let progress = |what: &str| bar.set_message(what.to_owned());
    let found = diagnose(&input.data, &input.split, &question, &progress)
        .map_err(|error| error.to_string())?;
    bar.finish_and_clear();

    let document = diagnosis::document(&found, &input.data, &input.split, &input.hashes);
    let json = serde_json::to_string_pretty(&document).map_err(|error| error.to_string())? + "\n";
    let mut handed_out = found.handed_out();
    handed_out.verdicts.extend(loop_cost::warning(&handed_out.spec.terms));
    let from = Provenance {
        command: "diagnose",
        data: &input.data,
        hashes: &input.hashes,
        log_findings: &found.log_findings,
        verdicts: &handed_out.verdicts,
    };
    let toml = from.comments() + &params::emit(&handed_out, input.data.joint);
    let about = Diagnosed {
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
    for (index, sentence) in document.story().iter().enumerate() {
        text += &format!("{}. {sentence}\n", index + 1);
    }
    if let Some(late) = loop_cost::warning(&handed_out.spec.terms) {
        text += &format!("On the joint driver: {late}.\n");
    }
    text += &format!("\n{}\n", table::findings(&found));
    let files = vec![("report.html", html), ("params.toml", toml)];
    Ok(Told { document: ("diagnosis.json", json), files, text })
}
