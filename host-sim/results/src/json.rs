//! `compare.json` and `fit.json`, schema 1.
//!
//! Both files have the same structure: `identify` writes a list of one model. All errors are in the unit of the torque
//! column. `nrmse_std` and `nrmse_range` are the RMSE divided by the standard deviation and by the range of the measured
//! torque on the same rows. `driver_form` is the passive form in `params.toml`, if `params` give an active law. `bic` is `n ln(SSE/n) + k ln n` on the training rows.

use friction_diagnose::prepare::Prepared;
use friction_fit::params::unit;
use friction_fit::{Estimate, Outcome};
use joint_log::Dataset;
use joint_log::log_check::{ColumnOverview, overview};
use serde_json::{Map, Value, json};

pub(super) fn parameter(estimate: &Estimate, data: &Dataset) -> (String, Value) {
    let value = json!({
        "value": estimate.value,
        "unit": unit(estimate.id, data.joint),
        "std_error": estimate.std_error,
        "state": estimate.state.name(),
    });
    (estimate.id.name().to_owned(), value)
}

/// Returns the correlations of the fitted parameters, each pair once.
fn correlation(outcome: &Outcome) -> Map<String, Value> {
    let fitted: Vec<&Estimate> =
        outcome.estimates.iter().filter(|estimate| estimate.std_error.is_some()).collect();
    let row = |i: usize| -> Value {
        let rest = fitted.iter().enumerate().skip(i + 1);
        rest.map(|(j, other)| (other.id.name().to_owned(), json!(outcome.correlation[(i, j)])))
            .collect::<Map<_, _>>()
            .into()
    };
    let all = fitted.iter().enumerate();
    all.map(|(i, estimate)| (estimate.id.name().to_owned(), row(i))).collect()
}

/// Returns the document of fits to a log.
pub fn document(input: &Prepared, fits: &[Outcome]) -> Value {
    let parameters = |estimates: &[Estimate]| -> Map<_, _> {
        estimates.iter().map(|estimate| parameter(estimate, &input.data)).collect()
    };
    let model = |outcome: &Outcome| {
        let mut model = json!({
            "model": outcome.spec.to_string(),
            "rigid_body": outcome.spec.rigid_body.iter().map(|term| term.name()).collect::<Vec<_>>(),
            "seconds": outcome.seconds,
            "bic": outcome.bic,
            "converged": outcome.converged,
            "substeps": outcome.resolution.substeps,
            "extrapolated": outcome.resolution.extrapolated,
            "autocorrelation_time": outcome.autocorrelation_time,
            "verdicts": outcome.verdicts,
            "params": parameters(&outcome.estimates),
            "correlation": correlation(outcome),
            "train": outcome.train,
            "test": outcome.test,
        });
        if let Some(form) = &outcome.driver_form {
            model["driver_form"] = json!({
                "params": parameters(&form.estimates),
                "train": form.train,
                "test": form.test,
            });
        }
        model
    };
    let models: Vec<Value> = fits.iter().map(model).collect();
    json!({ "schema": 1, "data": sources(input), "models": models })
}

/// Describes a column as used, and its source in the file.
fn column(of: &ColumnOverview) -> Value {
    let source = of.source.as_ref();
    json!({
        "name": of.name,
        "unit": of.unit,
        "range": of.range,
        "from": source.map(|source| &source.header),
        "from_unit": source.and_then(|source| source.unit.as_ref()),
        "filled": source.map_or(0, |source| source.filled),
        "fill": source.and_then(|source| source.fill),
    })
}

/// Describes the data and their split.
pub(super) fn sources(input: &Prepared) -> Value {
    let Prepared { data, split, hashes, .. } = input;
    let files: Vec<String> = data.files.iter().map(|file| file.display().to_string()).collect();
    json!({
        "runs": data.runs.len(),
        "rows": data.rows,
        "rows_left_out": data.bad_rows.count,
        "unit": data.joint.torque_unit(),
        "train_runs": split.train_runs(data),
        "test_runs": split.test_runs(data),
        "files": files,
        "sha256": hashes,
        "columns": overview(data).columns.iter().map(column).collect::<Vec<_>>(),
        "notes": data.notes,
    })
}
