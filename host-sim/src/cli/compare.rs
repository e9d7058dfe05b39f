//! `compare`: all families on equal terms.

use super::input::{DataArguments, Input, spinner};
use super::output::{OutputArguments, say};
use crate::results::{Study, document, page, table};
use compensator_core::LawKind;
use friction_identification::data::SplitRule;
use friction_identification::fit::{FitOptions, Outcome, identify};
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
}

fn specs(arguments: &Arguments) -> Result<Vec<Spec>, String> {
    if arguments.models.is_empty() {
        return Ok(LawKind::ALL.iter().copied().map(Spec::law).collect());
    }
    let parse = |name: &String| Spec::parse(name).map_err(|error| error.to_string());
    arguments.models.iter().map(parse).collect()
}

fn fits(specs: Vec<Spec>, input: &Input) -> Result<Vec<Outcome>, String> {
    let options = FitOptions::default();
    let mut fits = Vec::new();
    for spec in specs {
        let spec = spec.on(&input.rigid_body);
        let bar = spinner(format!("fitting {spec} to {} rows", input.data.rows));
        let base = spec.parameters().map_err(|error| error.to_string())?;
        let fit = identify(&spec, &base, input.train_rows(), input.test_rows(), &options);
        fits.push(fit.map_err(|error| error.to_string())?);
        bar.finish_and_clear();
    }
    Ok(fits)
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    let specs = specs(arguments)?;
    let input = arguments.data.read(&SplitRule::default())?;
    input.warn();
    let fits = fits(specs, &input)?;
    let document = document(&input.data, &input.split, &input.hashes, &fits);
    let json = serde_json::to_string_pretty(&document).map_err(|error| error.to_string())? + "\n";
    let study = Study {
        data: &input.data,
        split: &input.split,
        hashes: &input.hashes,
        test: input.test_rows(),
        columns: &arguments.data.columns,
        skip: arguments.data.skip,
        fits: &fits,
    };
    let html = page(&study).render();
    arguments.output.write(&[("compare.json", &json), ("compare.html", &html)])?;
    if arguments.output.json {
        return say(&json);
    }
    let mut text = table::models(&fits, &input.data) + "\n";
    for fit in &fits {
        fit.verdicts.iter().for_each(|verdict| text += &format!("{}: {verdict}\n", fit.spec));
    }
    let out = arguments.output.out.display();
    text += &format!("written: {out}/compare.html, {out}/compare.json\n");
    say(&text)
}
