//! Errors as the exceptions of `friction`, with the settings in a message named as keyword arguments.

use friction_diagnose::prepare::Error;
use joint_log::setting::{Message, Reference, Setting, worded};
use joint_log::{BadCell, DataError};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// Returns a setting as a keyword argument.
fn keyword(reference: Reference) -> String {
    let value = reference.value;
    let quoted = |text: &str| format!("{text:?}");
    // `a=b,c=d` as a dictionary.
    let pairs = |text: &str| {
        let pairs = text.split(',').filter_map(|pair| pair.split_once('='));
        let pairs: Vec<String> =
            pairs.map(|(a, b)| format!("{}: {}", quoted(a), quoted(b))).collect();
        format!("{{{}}}", pairs.join(", "))
    };
    match (reference.setting, value) {
        (Setting::RatedTorque, _) => format!("rated_torque_nm={}", value.trim_end_matches("Nm")),
        (Setting::TorqueConstant, _) => format!("torque_constant={}", quoted(value)),
        (Setting::AsLogged, _) => format!("as_logged=[{}]", quoted(value)),
        (Setting::TorqueFrom, "") => "torque_from=".into(),
        (Setting::TorqueFrom, _) => format!("torque_from={}", quoted(value)),
        (Setting::BadRows, _) => match value.trim_end_matches('%').parse::<f64>() {
            Ok(percent) => format!("bad_rows={}", percent / 100.0),
            Err(_) => format!("bad_rows={value}"),
        },
        (Setting::Columns, "") => "columns=".into(),
        // The command line lists the columns of a file; a data frame lists them itself.
        (Setting::Columns, "help") => "the header".into(),
        (Setting::Columns, _) => format!("columns={}", pairs(value)),
        (Setting::Where, _) => {
            let (column, values) = value.split_once('=').unwrap_or((value, ""));
            format!("where={{{}: {}}}", quoted(column), quoted(values))
        }
        (Setting::Skip, _) => format!("skip={value}"),
        (Setting::Model, _) => format!("model={}", quoted(value)),
        (Setting::RigidBody, _) => "rigid_body=".into(),
        (Setting::With, _) => format!("{value}=True"),
        (Setting::Compensator, _) => "compensator=".into(),
        (Setting::Preset, _) => format!("preset={}", quoted(value)),
        (Setting::Join, _) => "join=True".into(),
        (Setting::Rate, _) => format!("rate_hz={}", value.trim_end_matches("Hz")),
        (Setting::SkipLines, _) => format!("skip_lines={value}"),
        (Setting::ExportFormat, _) => format!("to={}", quoted(value)),
        (Setting::Feature, _) => format!("feature {value}"),
    }
}

/// Returns a message with every setting as a keyword.
pub fn in_keywords(error: Error) -> String {
    error.worded(&keyword)
}

/// Returns a text with every setting as a keyword.
pub fn text_in_keywords(text: &str) -> String {
    worded(text, &keyword)
}

/// Returns an error as an exception of `friction`.
pub fn to_python(py: Python<'_>, error: Error) -> PyErr {
    let message = error.worded(&keyword);
    let class = match &error {
        Error::Data(_) => "DataError",
        Error::Model(_) => "ModelError",
        _ => "FrictionError",
    };
    raised(py, class, &message, |details| match &error {
        Error::Data(error) => add_details(details, error),
        _ => Ok(()),
    })
}

/// Returns a `FrictionError` with a message.
pub fn refused(py: Python<'_>, message: &str) -> PyErr {
    raised(py, "FrictionError", &worded(message, &keyword), |_| Ok(()))
}

/// Returns a `ModelError` with a message.
pub fn wrong_model(py: Python<'_>, message: &str) -> PyErr {
    raised(py, "ModelError", &worded(message, &keyword), |_| Ok(()))
}

fn raised(
    py: Python<'_>,
    class: &str,
    message: &str,
    add: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>,
) -> PyErr {
    let build = || {
        let details = PyDict::new(py);
        add(&details)?;
        let class = py.import("friction._errors")?.getattr(class)?;
        class.call((message,), Some(&details))
    };
    build().map_or_else(|error| error, PyErr::from_value)
}

fn add_details(details: &Bound<'_, PyDict>, error: &DataError) -> PyResult<()> {
    let place = |file: &Path, found: &str, expected: &str| {
        details.set_item("file", file.display().to_string())?;
        details.set_item("found", worded(found, &keyword))?;
        details.set_item("expected", worded(expected, &keyword))
    };
    let cell = |cell: &BadCell| {
        place(&cell.file, &cell.found, &cell.expected)?;
        details.set_item("row", cell.row)?;
        details.set_item("column", &cell.column)
    };
    match error {
        DataError::Io { file, .. } | DataError::LeftOut { file, .. } => {
            details.set_item("file", file.display().to_string())
        }
        DataError::Cell(bad) => cell(bad),
        DataError::TooManyBad { first, .. } => cell(first),
        DataError::File { file, found, expected }
        | DataError::MissingColumns { file, found, expected, .. } => place(file, found, expected),
        DataError::SeveralJoints { file, column, joints, .. } => {
            details.set_item("file", file.display().to_string())?;
            details.set_item("column", column)?;
            details.set_item("joints", joints)
        }
        DataError::Request { found, expected, .. } => {
            details.set_item("found", worded(found, &keyword))?;
            details.set_item("expected", worded(expected, &keyword))
        }
    }
}

/// Converts an error of serialisation, which needs a value that JSON cannot represent.
pub fn unserialised(error: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}
