//! The result files of `identify` and `compare`.

use crate::files::{Files, pretty};
use crate::page::View;
use crate::predicted::PredictedLog;
use crate::provenance::parameter_file;
use crate::{Comparison, FitReport, ResultError, compare_fits, document};
use friction_diagnose::hand_over::BesidePlain;
use friction_diagnose::prepare::Prepared;
use friction_fit::{Measurement, Outcome};
use serde_json::json;
use std::slice::from_ref;

/// Result files of a comparison, and what a terminal shows of it.
#[derive(Clone, Debug)]
pub struct ComparisonFiles {
    /// `compare.json`, `compare.html`, and `params.toml` and `rows.parquet` of the recommended model.
    pub files: Files,
    /// The result in sentences.
    pub summary: [String; 5],
    /// Index of the recommended fit.
    pub chosen: usize,
}

fn report<'a>(input: &'a Prepared, fits: &'a [Outcome]) -> FitReport<'a> {
    FitReport { input, test: input.test_rows(), fits }
}

/// Returns the index of the recommended fit: the best on held-out rows, or the smallest one that is not significantly worse.
pub(crate) fn recommended(fits: &[Outcome], input: &Prepared) -> usize {
    View::new(&report(input, fits)).chosen()
}

/// Returns `fit.json` of a fit beside plain friction.
///
/// # Errors
/// One line, if a value cannot be represented in JSON, or the core rejects the model.
pub fn fit_json(
    fit: &Outcome,
    beside: &BesidePlain,
    input: &Prepared,
) -> Result<String, ResultError> {
    let toml = fit_parameter_text(beside.model(fit), input);
    let predicted = PredictedLog::of_text(&toml, &input.data)?;
    fit_document_text(fit, beside, input, &predicted)
}

fn fit_document_text(
    fit: &Outcome,
    beside: &BesidePlain,
    input: &Prepared,
    predicted: &PredictedLog,
) -> Result<String, ResultError> {
    let mut document = document(input, from_ref(fit));
    document["prediction"] = predicted.summary.clone();
    document["plain"] = json!({ "test_rmse": beside.plain.test.rmse });
    document["handed_over"] = json!(beside.handed_over.name());
    pretty(&document)
}

/// Returns `params.toml` of a fit.
pub fn fit_parameter_text(fit: &Outcome, input: &Prepared) -> String {
    parameter_file("identify", input, fit, None, &Measurement::default())
}

/// Returns `fit.html` of a fit.
pub fn fit_page(fit: &Outcome, input: &Prepared) -> String {
    compare_fits(&report(input, from_ref(fit))).page.render()
}

/// Returns the result files of one fit: `fit.json`, `fit.html`, and `params.toml` and `rows.parquet` of what is handed over.
///
/// # Errors
/// See [`fit_json`].
pub fn fit_files(
    fit: &Outcome,
    beside: &BesidePlain,
    input: &Prepared,
) -> Result<Files, ResultError> {
    let toml = fit_parameter_text(beside.model(fit), input);
    let predicted = PredictedLog::of_text(&toml, &input.data)?;
    let html = fit_page(fit, input).into_bytes();
    let others = vec![("params.toml", toml.into_bytes()), ("fit.html", html)];
    let document = ("fit.json", fit_document_text(fit, beside, input, &predicted)?);
    let mut files = Files { document, others };
    predicted.add_rows(&input.data, &mut files)?;
    Ok(files)
}

/// Returns the result files of several fits, at least one: `compare.json`, `compare.html`, `params.toml`,
/// `rows.parquet`.
///
/// # Errors
/// One line, if a value cannot be represented in JSON, or the core rejects the recommended model.
pub fn comparison_files(
    fits: &[Outcome],
    input: &Prepared,
) -> Result<ComparisonFiles, ResultError> {
    let mut document = document(input, fits);
    let Comparison { page, summary, chosen } = compare_fits(&report(input, fits));
    let best = &fits[chosen];
    document["chosen"] = json!(best.spec.to_string());
    let html = page.render().into_bytes();
    let toml = parameter_file("compare", input, best, None, &Measurement::default());
    let predicted = PredictedLog::of_text(&toml, &input.data)?;
    document["prediction"] = predicted.summary.clone();
    let others = vec![("compare.html", html), ("params.toml", toml.into_bytes())];
    let mut files = Files { document: ("compare.json", pretty(&document)?), others };
    predicted.add_rows(&input.data, &mut files)?;
    Ok(ComparisonFiles { files, summary, chosen })
}
