//! The diagnosis of files in memory, as the command line makes it.

use friction_diagnose::diagnose;
use friction_diagnose::prepare::{Error, PrepareOptions, Source, prepare};
use friction_diagnose::summary::summary;
use friction_results::diagnosis::{DiagnosedLog, parameter_text};
use friction_results::pretty;
use friction_results::stochastic::StochasticExtension;
use joint_log::setting::{Message, Reference, Setting};
use joint_log::{FileContent, ReadOptions, SplitRule};
use serde_json::json;
use std::fmt;

/// A log, and how it is read.
pub struct Request {
    /// The files of one joint.
    pub files: Vec<FileContent>,
    /// Columns, in the syntax of `--columns`.
    pub columns: String,
    /// Selection of rows, in the syntax of `--where`; selections are separated by spaces.
    pub rows: String,
}

/// The result files, and what the page itself shows.
pub struct Answer {
    /// JSON object: `cause`, the sentences of `summary`, and the lines of `log` about its columns and problems.
    pub digest: String,
    /// `diagnosis.json`
    pub document: String,
    /// `params.toml`
    pub parameters: String,
    /// `report.html`
    pub report: String,
}

/// Why there is no answer; one line that names settings as the page does.
pub enum Refusal {
    /// A field of the page has another form.
    Field { field: &'static str, found: String, expected: &'static str },
    /// The log cannot be read or diagnosed.
    Log(Error),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Log(error)
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Field { field, found, expected } => {
                write!(f, "{field}: found {found:?}, expected {expected}")
            }
            Self::Log(error) => f.write_str(&worded(error)),
        }
    }
}

/// Diagnoses a log. `stage` receives the present stage in words.
///
/// # Errors
/// See [`Refusal`].
pub fn diagnose_log(request: Request, stage: &dyn Fn(&str)) -> Result<Answer, Refusal> {
    let columns = items(&request.columns, ',');
    let options = PrepareOptions {
        read: ReadOptions {
            columns: column_pairs(&columns)?,
            only: row_filters(&request.rows)?,
            ..ReadOptions::default()
        },
        columns,
        split: SplitRule::LeaveOneRunOut,
        ..PrepareOptions::default()
    };
    stage("reading the log");
    let input = prepare(&Source::Contents(request.files), &options)?;
    let found = diagnose(&input.data, &input.split, &input.question(), stage);
    let found = found.map_err(Error::from)?;
    let stochastic = StochasticExtension::new(&found, input.seed, stage);
    stage("writing the report");
    let problems = found.log_findings.iter();
    let problems = problems.map(|found| format!("{}: {}", found.kind.name(), found.in_words));
    let log: Vec<String> = input.overview.iter().cloned().chain(problems).collect();
    let digest = json!({ "cause": found.cause(), "summary": summary(&found), "log": log });
    let diagnosed = DiagnosedLog { found: &found, stochastic: &stochastic, input: &input };
    let document = diagnosed.document().and_then(|document| pretty(&document));
    Ok(Answer {
        digest: digest.to_string(),
        document: document.map_err(|error| Error::from(error.to_string()))?,
        parameters: parameter_text(&found, &input),
        report: diagnosed.page_text(),
    })
}

/// Returns the non-empty items of a list.
fn items(text: &str, separator: char) -> Vec<String> {
    let items = text.split(separator).map(str::trim).filter(|item| !item.is_empty());
    items.map(str::to_owned).collect()
}

/// Returns the pairs of contract name and column name.
fn column_pairs(columns: &[String]) -> Result<Vec<(String, String)>, Refusal> {
    let pair = |text: &String| match text.split_once('=') {
        Some((ours, theirs)) if !ours.is_empty() && !theirs.is_empty() => {
            Ok((ours.trim().to_owned(), theirs.trim().to_owned()))
        }
        _ => Err(Refusal::Field {
            field: "Columns",
            found: text.clone(),
            expected: "NAME=COLUMN or NAME=COLUMN:UNIT",
        }),
    };
    columns.iter().map(pair).collect()
}

/// Returns the columns that select rows, each with its accepted values.
fn row_filters(text: &str) -> Result<Vec<(String, Vec<String>)>, Refusal> {
    let filter = |text: &String| match text.split_once('=') {
        Some((column, values)) if !column.is_empty() => Ok((column.into(), items(values, ','))),
        _ => Err(Refusal::Field { field: "Rows", found: text.clone(), expected: "COLUMN=VALUE" }),
    };
    items(text, ' ').iter().map(filter).collect()
}

/// Returns an error as one line that names settings as the page does.
fn worded(error: &Error) -> String {
    error.worded(&|Reference { setting, value, .. }: Reference| {
        let field = match setting {
            Setting::Columns => "Columns",
            Setting::Where => "Rows",
            other => other.name(),
        };
        if value.is_empty() { field.to_owned() } else { format!("{field}: {value}") }
    })
}
