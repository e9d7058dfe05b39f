//! Rows of the manipulator: the paper's tables 3 to 10 beside ours, and tables of torques, which the paper does not have.

use super::arm::JOINTS;
use super::fit::Course;
use super::measured::RobotAxis;
use super::printed::MODELS;
use super::study::{EvaluatedFit, ModelStudy, TorqueStudy};
use crate::{ResultRow, pivot_table};
use compensator_core::ParameterId as Id;
use friction_results::report::Table;

/// Rows of angles: errors of each model and joint, then coefficients.
pub fn angle_rows(
    studies: &[ModelStudy],
    courses: &[Course],
    repeats: &[Vec<[f64; JOINTS]>],
) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    for (index, study) in studies.iter().enumerate() {
        let of_model: Vec<[f64; JOINTS]> = repeats.iter().map(|campaign| campaign[index]).collect();
        rows.extend(errors(study, courses, &of_model));
        rows.extend(coefficients(study));
    }
    rows
}

/// Tables of the errors of all models, on angles and on torques, simulated and measured.
pub fn digest(rows: &[ResultRow]) -> Vec<Table> {
    let errors_of = |row: &ResultRow| row.column.starts_with("RMSE").then(|| row.column.clone());
    let angles = |row: &ResultRow| {
        let model = MODELS.iter().find(|model| {
            row.table.split_once(", ") == Some((model.table.to_string().as_str(), model.name))
        })?;
        Some((format!("{}, {} ({})", row.row, errors_of(row)?, row.unit), model.name.to_owned()))
    };
    let torques = |start: &'static str| {
        move |row: &ResultRow| {
            let whose = row.table.strip_prefix(start).filter(|of| !of.starts_with("the "))?;
            Some((format!("{whose}, {} ({})", errors_of(row)?, row.unit), row.row.clone()))
        }
    };
    let tables = [
        pivot_table("Angles (simulated; tables 4, 6, 8 and 10)", rows, angles),
        pivot_table("Torques of the joints (simulated)", rows, torques("Torques of ")),
        pivot_table(
            "Torques of the industrial arm (measured)",
            rows,
            torques("Torques of the industrial arm, "),
        ),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

/// Fit protocols, by name.
fn protocols(study: &ModelStudy) -> [(&'static str, &EvaluatedFit); 2] {
    [("as printed", &study.printed), ("properly", &study.proper)]
}

/// Fit protocols and the fit to the joints' torques, by name.
fn all_protocols(study: &ModelStudy) -> impl Iterator<Item = (&'static str, &EvaluatedFit)> {
    protocols(study).into_iter().chain([("by torques", &study.by_torques)])
}

/// Returns the standard deviation.
fn spread(numbers: &[f64]) -> f64 {
    let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
    let squares: f64 = numbers.iter().map(|number| (number - mean).powi(2)).sum();
    (squares / (numbers.len() as f64 - 1.0).max(1.0)).sqrt()
}

/// Rows of errors. `repeats` holds the errors of the printed protocol in other campaigns.
fn errors(study: &ModelStudy, courses: &[Course], repeats: &[[f64; JOINTS]]) -> Vec<ResultRow> {
    let model = study.model;
    let table = format!("{}, {}", model.table, model.name);
    let mut rows = Vec::new();
    for joint in 0..JOINTS {
        let name = format!("joint {}", joint + 1);
        for (way, of) in all_protocols(study) {
            for (index, errors) in of.errors.iter().enumerate() {
                let on =
                    if index == 0 { String::new() } else { format!(", {}", courses[index].name) };
                let put = |what: &str, unit: &str, ours: f64, printed: f64| {
                    let row = ResultRow::simulated(
                        &table,
                        &name,
                        &format!("{what} {way}{on}"),
                        unit,
                        ours,
                    );
                    if index == 0 && way == "as printed" { row.printed(printed) } else { row }
                };
                let mut rmse = put("RMSE", "deg", errors.rmse_deg[joint], model.rmse_deg[joint]);
                if index == 0 && way == "as printed" && !repeats.is_empty() {
                    let all: Vec<f64> =
                        repeats.iter().map(|of| of[joint]).chain([rmse.ours]).collect();
                    rmse = rmse.spread(spread(&all));
                }
                rows.push(rmse);
                rows.push(put("SSE", "deg^2", errors.sse_deg2[joint], model.sse[joint]));
            }
        }
    }
    rows
}

fn coefficients(study: &ModelStudy) -> Vec<ResultRow> {
    let model = study.model;
    let table = format!("{}, coefficients of {}", model.table - 1, model.name);
    let mut rows = Vec::new();
    for joint in 0..JOINTS {
        for of in model.coefficients {
            let name = format!("{}, joint {}", of.symbol, joint + 1);
            for (way, evaluated) in protocols(study) {
                let fitted = &evaluated.fitted;
                let value = of
                    .id
                    .map_or(fitted.deflection_rad[joint], |id| fitted.parameters[joint].get(id));
                let unit = match of.id {
                    Some(Id::QuadraticFriction) if way == "as printed" => "Nm s/rad",
                    Some(id) => id.unit(),
                    None => "rad",
                };
                let row = ResultRow::simulated(&table, &name, way, unit, value);
                rows.push(if way == "as printed" { row.printed(of.values[joint]) } else { row });
            }
        }
        let has_offset = model.coefficients.iter().any(|of| of.id == Some(Id::TorqueOffset));
        if !has_offset {
            let offset = study.proper.fitted.parameters[joint].get(Id::TorqueOffset);
            let name = format!("f_0, joint {}", joint + 1);
            rows.push(ResultRow::simulated(
                &table,
                &name,
                "properly",
                Id::TorqueOffset.unit(),
                offset,
            ));
        }
    }
    rows
}

/// Rows of errors on the torques of each joint of the simulated arm.
pub fn torque_rows(models: &[Vec<TorqueStudy>]) -> Vec<ResultRow> {
    let each = models.iter().zip(&MODELS).flat_map(|(joints, model)| {
        joints.iter().enumerate().flat_map(|(joint, study)| {
            let table = format!("Torques of joint {}", joint + 1);
            model_torque_rows(&table, model.name, study, true)
        })
    });
    each.collect()
}

/// Rows of errors on the torques of an axis of the measured arm.
pub fn axis_rows(axis: &RobotAxis) -> Vec<ResultRow> {
    let table = format!("Torques of the industrial arm, axis {}", axis.number);
    let each = axis.models.iter().zip(&MODELS);
    each.flat_map(|(study, model)| model_torque_rows(&table, model.name, study, false)).collect()
}

fn model_torque_rows(
    table: &str,
    model: &str,
    study: &TorqueStudy,
    simulated: bool,
) -> Vec<ResultRow> {
    let columns = [
        ("as printed", study.printed.train, study.printed.test),
        ("properly", study.proper.train, study.proper.test),
    ];
    let row = |column: &str, unit: &str, ours: f64| ResultRow {
        simulated,
        ..ResultRow::simulated(table, model, column, unit, ours)
    };
    let each = columns.iter().flat_map(|(way, train, test)| {
        [
            row(&format!("RMSE {way}"), "Nm", train.rmse),
            row(&format!("SSE {way}"), "Nm^2", train.sse),
            row(&format!("RMSE {way}, held out"), "Nm", test.rmse),
            row(&format!("SSE {way}, held out"), "Nm^2", test.sse),
        ]
    });
    each.collect()
}
