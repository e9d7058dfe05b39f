//! `diagnosis.json`, schema 1.
//!
//! Besides the keys that the schema requires, the document holds a summary, every candidate, the shares of the error by
//! regime and direction, and the hash of each file. All errors are in the unit of the torque column.

pub use super::diagnosed_log::DiagnosedLog;

use super::json::{parameter, sources};
use super::ranking::{RankedCandidate, left_out, ranking};
use crate::ResultError;
use crate::budget::{BudgetStep, budget};
use crate::loop_cost::late_loop_warning;
use crate::predicted::PredictedLog;
use crate::provenance::parameter_file;
#[cfg(feature = "pages")]
use crate::{Files, diagnosis_page, pretty};
use friction_diagnose::contest_calibration::ContestCalibration;
use friction_diagnose::hand_over::Judged;
use friction_diagnose::prepare::Prepared;
use friction_diagnose::{Ceiling, Diagnosis, Finding, NAMED, Share, WeighedCause, summary};
use friction_fit::linear::LinearTerm;
use friction_fit::{Measurement, Outcome};
use joint_log::Dataset;
use joint_log::log_check::LogFinding;
use serde_json::{Map, Value, json};

/// Makes a number finite for JSON: NaN becomes 0, an infinite number the largest finite one.
fn finite(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(-f64::MAX, f64::MAX) }
}

fn finding(finding: &Finding) -> Value {
    let mut confusable: Vec<&str> =
        finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
    confusable.dedup();
    let mut value = json!({
        "cause": finding.cause.name(),
        "remedy": finding.cause.remedy().name(),
        "columns": finding.columns,
        "size": {
            "value": finite(finding.size.value),
            "unit": finding.size.unit,
            "ci95": finding.size.ci95().map(finite),
        },
        "p_value": finite(finding.p_value),
        "probability": finite(finding.probability),
        "stability": finite(finding.stability).clamp(0.0, 1.0),
        "share_of_residual": finite(finding.share_of_residual),
        "confusable_with": confusable,
        "gain": finite(finding.gain.value),
        "gain_ci95": finding.gain.ci95.map(finite),
        "deployable": finding.cause.remedy().term().is_some(),
        "in_words": finding.in_words,
    });
    if let Some(order) = finding.order {
        value["order"] =
            json!({ "value": finite(order.value), "std_error": finite(order.std_error) });
    }
    value
}

fn model(outcome: &Outcome, data: &Dataset) -> Map<String, Value> {
    let params: Map<String, Value> =
        outcome.estimates.iter().map(|estimate| parameter(estimate, data)).collect();
    let mut object = Map::new();
    object.insert("model".into(), json!(outcome.spec.to_string()));
    object.insert("params".into(), params.into());
    object.insert("test_rmse".into(), json!(finite(outcome.test.rmse)));
    object.insert("test_nrmse".into(), json!(finite(outcome.test.nrmse_std)));
    object.insert("train_rmse".into(), json!(finite(outcome.train.rmse)));
    object.insert(
        "test_relative_error_percent".into(),
        json!(finite(outcome.test.relative_error_percent)),
    );
    object.insert("verdicts".into(), json!(outcome.verdicts));
    object
}

/// Sets name and errors of an extended model to those of the linear model if it is handed over.
fn of_linear(extended: &mut Map<String, Value>, found: &Diagnosis) {
    let Some(Judged { model, held_out }) = found.hand_over.extending() else { return };
    extended.insert("model".into(), json!(model.model.name()));
    extended.insert("test_rmse".into(), json!(finite(held_out.metrics.rmse)));
    extended.insert("test_nrmse".into(), json!(finite(held_out.metrics.nrmse_std)));
    extended.insert(
        "test_relative_error_percent".into(),
        json!(finite(held_out.metrics.relative_error_percent)),
    );
    let term = |term: &LinearTerm| json!({ "part": term.part, "size": finite(term.size) });
    let terms: Vec<Value> = model.model.terms.iter().map(term).collect();
    extended.insert("terms".into(), json!(terms));
}

/// The error budget.
fn budget_rows(found: &Diagnosis) -> Vec<Value> {
    let row = |step: BudgetStep| {
        let (name, rmse) = (step.name, finite(step.rmse));
        json!({ "step": name, "test_rmse": rmse, "deployable": step.deployable })
    };
    budget(found).into_iter().map(row).collect()
}

fn share(share: &Share) -> Value {
    json!({
        "name": share.name,
        "of_rows": finite(share.of_rows),
        "of_error": finite(share.of_error),
        "uncertainty": finite(share.uncertainty),
        "rmse": finite(share.rmse),
        "mean": finite(share.mean),
    })
}

/// The figures of a candidate in the contest, by name.
fn evidence(candidate: &WeighedCause) -> Value {
    let figures = &candidate.figures;
    json!({
        "inclusion": finite(figures.inclusion),
        "is_in_best": figures.is_in_best,
        "last": finite(figures.last),
        "irreplaceable": finite(figures.irreplaceable),
        "last_in_errors": finite(figures.last_in_errors),
        "size_in_errors": finite(figures.size_in_errors),
        "torque_share": finite(figures.torque_share),
        "beside_slip": finite(figures.beside_slip),
        "laws": finite(figures.laws),
        "shortfall": candidate.shortfall.map(finite),
    })
}

/// The rule that lowered the probability of a candidate, if one did.
fn decision(candidate: &WeighedCause) -> Option<Value> {
    let rejection = candidate.rejection.as_ref()?;
    Some(json!({
        "rule": rejection.rule.name,
        "limit": rejection.rule.limit,
        "cause": candidate.cause.name(),
        "columns": candidate.columns(),
        "why": rejection.why,
    }))
}

/// A candidate. `rejected_because` is present only if the candidate is not among the findings.
fn candidate(ranked: &RankedCandidate) -> Value {
    let weighed = ranked.candidate;
    let mut value = json!({
        "cause": weighed.cause.name(),
        "columns": weighed.columns(),
        "detail": weighed.figures.detail.to_string(),
        "gain": finite(weighed.figures.alone),
        "gain_std_error": finite(weighed.gain_error()),
        "probability": finite(ranked.probability),
        "evidence": evidence(weighed),
    });
    if !ranked.rejected_because.is_empty() {
        value["rejected_because"] = json!(ranked.rejected_because);
    }
    value
}

fn log_finding(finding: &LogFinding, found: &Diagnosis) -> Value {
    let gain =
        found.corrected.filter(|correction| correction.kind == finding.kind && finding.corrected);
    json!({
        "gain": gain.map(|correction| finite(correction.gain)),
        "kind": finding.kind.name(),
        "columns": finding.columns,
        "size": { "value": finite(finding.value), "unit": finding.unit },
        "corrected": finding.corrected,
        "in_words": finding.in_words,
    })
}

impl DiagnosedLog<'_> {
    /// Returns the document of `diagnosis.json`.
    ///
    /// # Errors
    /// One line, if the core rejects the extended model.
    pub fn document(&self) -> Result<Value, ResultError> {
        let toml = parameter_text(self.found, self.input);
        Ok(self.document_with(&PredictedLog::of_text(&toml, &self.input.data)?))
    }

    fn document_with(&self, predicted: &PredictedLog) -> Value {
        let mut document = document(self);
        document["prediction"] = predicted.summary.clone();
        document
    }
}

/// Returns `params.toml`.
pub fn parameter_text(found: &Diagnosis, input: &Prepared) -> String {
    let (model, auxiliary) = (transferable_model(found), found.auxiliary_of_driver());
    let of_driver = found.hand_over.measurement_of_driver();
    let file = |measurement| parameter_file("diagnose", input, &model, auxiliary, measurement);
    let Some(linear) = found.hand_over.for_pc() else { return file(of_driver) };
    let mut text = file(&linear.measurement);
    if *of_driver != linear.measurement {
        of_driver.emit(Measurement::OF_DRIVER, &mut text);
    }
    linear.model.emit(&mut text);
    text
}

/// Returns the parameter file of one of the laws of a diagnosis.
pub fn law_text(
    found: &Diagnosis,
    input: &Prepared,
    law: &Outcome,
    auxiliary: Option<&str>,
) -> String {
    parameter_file("diagnose", input, law, auxiliary, &found.hand_over.measurement)
}

/// Returns the model that a diagnosis hands out, with a warning if a driver's current loop may be too slow for it.
pub fn transferable_model(found: &Diagnosis) -> Outcome {
    let mut outcome = found.transferable_model();
    outcome.verdicts.extend(late_loop_warning(&outcome.spec.terms));
    outcome
}

#[cfg(feature = "pages")]
impl DiagnosedLog<'_> {
    /// Returns the page of the diagnosis, for another page that contains it.
    pub fn page(&self) -> crate::report::Page {
        diagnosis_page::page(self)
    }

    /// Returns `report.html`.
    pub fn page_text(&self) -> String {
        self.page().render()
    }

    /// Returns the first screen of `report.html` as an HTML fragment, for a notebook.
    pub fn first_screen(&self) -> String {
        diagnosis_page::first_screen(self)
    }

    /// Returns the result files: `diagnosis.json`, `report.html`, `params.toml`, `rows.parquet`.
    ///
    /// # Errors
    /// See [`DiagnosedLog::document`].
    pub fn files(&self) -> Result<Files, ResultError> {
        let (mut files, predicted) = self.files_with(self.page_text(), |predicted| predicted)?;
        predicted.add_rows(&self.input.data, &mut files)?;
        Ok(files)
    }

    /// Returns the result files of one of many diagnoses: `diagnosis.json`, a short `report.html` and `params.toml`. `predict`
    /// gives the rows from `params.toml` and the log.
    ///
    /// # Errors
    /// See [`DiagnosedLog::document`].
    pub fn short_files(&self) -> Result<Files, ResultError> {
        let html = diagnosis_page::short_page(self).render();
        Ok(self.files_with(html, PredictedLog::without_rows)?.0)
    }

    fn files_with(
        &self,
        html: String,
        shown: impl FnOnce(PredictedLog) -> PredictedLog,
    ) -> Result<(Files, PredictedLog), ResultError> {
        let toml = parameter_text(self.found, self.input);
        let predicted = shown(PredictedLog::of_text(&toml, &self.input.data)?);
        let others = vec![("report.html", html.into_bytes()), ("params.toml", toml.into_bytes())];
        let document = ("diagnosis.json", pretty(&self.document_with(&predicted))?);
        Ok((Files { document, others }, predicted))
    }
}

/// Key of the stochastic extension, which is absent without its feature.
const EXTENSION: &str = "stochastic_extension";

/// Returns the document of a diagnosis.
fn document(diagnosed: &DiagnosedLog) -> Value {
    let DiagnosedLog { found, stochastic, input } = *diagnosed;
    let data = &input.data;
    let mut about = sources(input);
    about["noise_floor"] = json!(finite(found.noise_floor));
    about["calibration"] = json!(ContestCalibration::current().name);
    about["naming_threshold"] = json!(NAMED);
    about["left_out"] = json!(left_out(found));
    let mut document = json!({
        "schema": 1,
        "data": about,
        "log": listed(&found.log_findings, |finding| log_finding(finding, found)),
        "leading_fault": found.leading_fault().map(|fault| fault.kind.name()),
        "baseline": model(&found.baseline, data),
        "cause": found.cause(),
        "findings": listed(&found.findings, finding),
        "extended": extended(found, data),
        "plain": { "test_rmse": finite(found.hand_over.plain.held_out.metrics.rmse) },
        "handed_over": found.hand_over.on_pc.name(),
        "driver": {
            "handed_over": found.hand_over.in_driver.name(),
            "model": found.transferable_model().spec.to_string(),
        },
        "budget": budget_rows(found),
        "ceiling": {
            "rmse": finite(found.ceiling.rmse),
            "std_error": finite(found.ceiling.std_error),
            "method": Ceiling::METHOD,
        },
        (EXTENSION): stochastic.json(),
        "next_experiment": summary::next_experiment(found),
        "story": summary::summary(found),
        "residual": residual(found),
        "candidates": listed(&ranking(found), candidate),
        "decisions": found.candidates.iter().filter_map(decision).collect::<Vec<_>>(),
        "notes": found.log.notes,
        "seconds": finite(found.seconds),
    });
    if document[EXTENSION].is_null()
        && let Some(keys) = document.as_object_mut()
    {
        keys.shift_remove(EXTENSION);
    }
    document
}

/// Returns the values of a list.
fn listed<'a, T>(list: &'a [T], value: impl Fn(&'a T) -> Value) -> Value {
    list.iter().map(value).collect()
}

/// Returns the extended model with its gain.
fn extended(found: &Diagnosis, data: &Dataset) -> Map<String, Value> {
    let mut extended = model(&found.extended, data);
    of_linear(&mut extended, found);
    extended.insert("gain".into(), json!(finite(found.gain.value)));
    extended.insert("gain_ci95".into(), json!(found.gain.ci95.map(finite)));
    if let Some(auxiliary) = &found.auxiliary {
        extended.insert("auxiliary".into(), json!(auxiliary));
    }
    extended
}

/// Returns the shares of the squared error.
fn residual(found: &Diagnosis) -> Value {
    let by_column = found.by_column.iter();
    let by_column: Map<String, Value> =
        by_column.map(|of| (of.column.clone(), listed(&of.parts, share))).collect();
    json!({
        "by_regime": listed(&found.by_regime, share),
        "by_direction": listed(&found.by_direction, share),
        "by_column": by_column,
    })
}
