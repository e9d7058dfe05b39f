//! The feed-forward as JSON, CSV and text.

use super::FeedForward;
use super::steady::Estimated;
use friction_diagnose::Gain;
use joint_log::number::significant;
use serde_json::{Value, json};
use std::fmt::Write;

/// Returns `feed-forward.csv`: speed, torque and its standard error in the drive's units.
pub fn csv(of: &FeedForward) -> String {
    let units = &of.units;
    let speed = units.speed.replace('/', "_per_");
    let mut text = format!("speed_{speed},torque_{0},std_error_{0},rows\n", units.suffix);
    for point in of.rows() {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{:.9},{:.6},{:.6},{}",
            point.velocity, point.torque, point.std_error, point.rows
        );
    }
    text
}

/// Returns `feed-forward.json`.
pub fn json(of: &FeedForward) -> Value {
    let gain = |gain: &Gain| json!({ "value": gain.value, "ci95": gain.ci95 });
    let point = |point: super::TablePoint| {
        json!({
            "speed": point.velocity,
            "torque": point.torque,
            "std_error": point.std_error,
            "rows": point.rows,
        })
    };
    let judged = &of.judged;
    json!({
        "schema": 1,
        "drive": of.drive.name(),
        "model": of.model,
        "files": of.files,
        "units": { "speed": of.units.speed, "torque": of.units.torque },
        "is_sign_reversed": of.is_reversed,
        "held_out": {
            "rows": judged.table.rows,
            "rmse_without": judged.nothing.rmse,
            "rmse_with_table": judged.table.rmse,
            "rmse_with_model": judged.model.rmse,
            "gain_of_table": gain(&judged.table_gain),
            "gain_of_model_over_table": gain(&judged.model_gain),
        },
        "has_gain": judged.has_gain(),
        "table": if judged.has_gain() { of.rows().map(point).collect() } else { Value::Null },
        "inertia": of.inertia.map(|inertia| json!({
            "value": inertia.value, "std_error": inertia.std_error, "unit": of.inertia_unit(),
        })),
        "gravity": of.has_gravity().then(|| json!({
            "sine": of.rigid_body.gravity_sine,
            "cosine": of.rigid_body.gravity_cosine,
            "unit": of.units.torque,
        })),
        "offset": { "value": of.rigid_body.offset, "unit": of.units.torque },
        "remarks": of.remarks,
    })
}

/// Returns the result in sentences.
pub fn text(of: &FeedForward) -> String {
    let (judged, units) = (&of.judged, &of.units);
    let torque = units.torque;
    let error = |rmse: f64| format!("{} {torque}", significant(rmse, 3));
    let mut text = format!(
        "Model {}, on {} held-out rows:\n\
         - without friction feed-forward: RMSE {}\n\
         - with the table: {}\n\
         - with the complete model: {}\n\
         The table reduces the error by {}; the complete model reduces the rest by {}.\n",
        of.model,
        judged.table.rows,
        error(judged.nothing.rmse),
        error(judged.table.rmse),
        error(judged.model.rmse),
        percent(&judged.table_gain),
        percent(&judged.model_gain),
    );
    if !judged.has_gain() {
        text += "The gain of the table is not significant. No parameters are written.\n";
        return text;
    }
    let last = of.rows().last();
    let fastest = last.map_or(0.0, |point| point.velocity);
    let _ = writeln!(
        text,
        "\nTable for {}, {}: {} speeds up to {} {}, torque up to {}.",
        of.drive.title(),
        of.drive.shaft(),
        of.table.len(),
        significant(fastest, 3),
        units.speed,
        error(of.rows().map(|point| point.torque.abs()).fold(0.0, f64::max)),
    );
    if let Some(Estimated { value, std_error }) = of.inertia {
        let value = joint_log::number::with_error(value, std_error);
        let _ = writeln!(text, "Inertia: {value} {}.", of.inertia_unit());
    }
    of.remarks.iter().for_each(|remark| text += &format!("- {remark}\n"));
    text
}

/// Formats a gain with its interval.
fn percent(gain: &Gain) -> String {
    let percent = |share: f64| significant(100.0 * share, 2);
    format!(
        "{} % (95 % interval {} to {} %)",
        percent(gain.value),
        percent(gain.ci95[0]),
        percent(gain.ci95[1])
    )
}
