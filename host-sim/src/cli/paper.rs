//! `paper`: reproduces the tables and plots of a paper and shows our values beside the printed ones.

use super::error::Result;
use super::output::{OutputArguments, pretty};
use super::progress::{announce, duration_in_words, spinner};
use super::values::one_of;
use clap::builder::TypedValueParser;
use published_experiments::{
    PAPERS, Paper, PaperRequest, Stopwatch, format_rows, page, summary_markdown,
};
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `paper`.
#[derive(clap::Args)]
pub struct PaperArguments {
    /// The paper
    #[arg(value_parser = papers())]
    paper: &'static dyn Paper,
    /// Use fewer repetitions and conditions; takes about one minute
    #[arg(long)]
    quick: bool,
    /// Seed of the random numbers; the same seed gives the same results
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Folder of the measured logs, by default excerpts; results that need a missing log are skipped with a message
    #[arg(long, value_name = "DIR", default_value = "tests/data/measured")]
    data: PathBuf,
    #[command(flatten)]
    output: OutputArguments,
}

/// Returns the parser of the paper's name; the help lists every paper with its description.
fn papers() -> impl TypedValueParser<Value = &'static dyn Paper> {
    one_of(PAPERS.iter().map(|of| (of.name(), of.about(), *of)))
}

/// A value that cannot be computed.
#[derive(Debug, thiserror::Error)]
#[error("{0} is not a finite number")]
struct NotFinite(String);

/// Runs the command.
pub fn run(arguments: &PaperArguments) -> Result {
    let paper = arguments.paper;
    let usual = duration_in_words(60.0 * paper.usual_minutes(arguments.quick));
    announce(&format!("{} takes about {usual} on two cores", paper.name()));
    let bar = spinner(format!("{}: starting", paper.name()));
    let progress =
        |words: &str| bar.set_message(format!("{}: {words}, of about {usual}", paper.name()));
    let request = PaperRequest {
        quick: arguments.quick,
        seed: arguments.seed,
        data: arguments.data.clone(),
        progress: &progress,
    };
    let took = Stopwatch::start();
    let outcome = paper.run(&request)?;
    let summary = summary_markdown(paper, &request, &outcome, &took);
    bar.finish_and_clear();
    if let Some(goal) = outcome.goals.iter().find(|goal| !goal.ours.is_finite()) {
        return Err(NotFinite(goal.what.to_string()).into());
    }
    if let Some(row) = outcome.rows.iter().find(|row| !row.ours.is_finite()) {
        let value = format!("{}: {}, {}", row.table, row.row, row.column);
        return Err(NotFinite(value).into());
    }
    let document = json!({
        "schema": 1, "paper": paper.name(), "quick": arguments.quick, "seed": arguments.seed,
        "goals": outcome.goals, "summary": outcome.summary, "rows": outcome.rows,
    });
    let json = pretty(&document)?;
    let html = page(paper, &request, &outcome).render();
    let mut files = vec![
        ("paper.json", json.as_bytes()),
        ("report.html", html.as_bytes()),
        ("summary.md", summary.as_bytes()),
    ];
    files.extend(outcome.files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())));
    let mut text = format_rows(&outcome.rows);
    outcome.summary.iter().for_each(|sentence| text += &format!("{sentence}\n"));
    arguments.output.finish(&files, &json, &text)
}
