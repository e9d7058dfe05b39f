//! The result files of `identify` and `compare`.

use crate::files::{Files, pretty};
use crate::provenance::parameter_file;
use crate::{Comparison, FitReport, compare_fits, document, page};
use friction_identification::fit::Outcome;
use friction_identification::prepare::Prepared;
use std::slice::from_ref;

/// Result files of a comparison, and what a terminal shows of it.
#[derive(Clone, Debug)]
pub struct ComparisonFiles {
    /// `compare.json`, `compare.html`, and `params.toml` of the recommended model.
    pub files: Files,
    /// The result in sentences.
    pub summary: [String; 5],
    /// Index of the recommended fit.
    pub chosen: usize,
}

fn report<'a>(input: &'a Prepared, fits: &'a [Outcome]) -> FitReport<'a> {
    FitReport {
        data: &input.data,
        split: &input.split,
        hashes: &input.hashes,
        test: input.test_rows(),
        columns: &input.columns,
        skip: input.skip,
        fits,
    }
}

/// Returns `fit.json` of a fit.
///
/// # Errors
/// If a value cannot be represented in JSON.
pub fn fit_json(fit: &Outcome, input: &Prepared) -> serde_json::Result<String> {
    pretty(&document(&input.data, &input.split, &input.hashes, from_ref(fit)))
}

/// Returns `fit.html` of a fit.
pub fn fit_page(fit: &Outcome, input: &Prepared) -> String {
    page(&report(input, from_ref(fit))).render()
}

/// Returns the result files of one fit: `fit.json`, `params.toml`, `fit.html`.
///
/// # Errors
/// See [`fit_json`].
pub fn fit_files(fit: &Outcome, input: &Prepared) -> serde_json::Result<Files> {
    let toml = parameter_file("identify", input, fit).into_bytes();
    let html = fit_page(fit, input).into_bytes();
    let others = vec![("params.toml", toml), ("fit.html", html)];
    Ok(Files { document: ("fit.json", fit_json(fit, input)?), others })
}

/// Returns the result files of several fits, at least one: `compare.json`, `compare.html`, `params.toml`.
///
/// # Errors
/// If a value cannot be represented in JSON.
pub fn comparison_files(fits: &[Outcome], input: &Prepared) -> serde_json::Result<ComparisonFiles> {
    let mut document = document(&input.data, &input.split, &input.hashes, fits);
    let Comparison { page, summary, chosen } = compare_fits(&report(input, fits));
    let best = &fits[chosen];
    document.choose(&best.spec);
    let html = page.render().into_bytes();
    let toml = parameter_file("compare", input, best).into_bytes();
    let others = vec![("compare.html", html), ("params.toml", toml)];
    let files = Files { document: ("compare.json", pretty(&document)?), others };
    Ok(ComparisonFiles { files, summary, chosen })
}
