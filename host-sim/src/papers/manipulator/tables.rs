//! The numbers in their tables: the paper's 3 to 10 beside ours, and those of torques, which it does not have.

use super::arm::JOINTS;
use super::fit::Course;
use super::measured::Axis;
use super::printed::MODELS;
use super::study::{Judgement, Study, TorqueStudy};
use crate::papers::{Row, across};
use crate::report::Table;
use compensator_core::ParameterId as Id;

/// Tables of angles: errors of each model and joint, then its coefficients.
pub fn of_angles(studies: &[Study], courses: &[Course], again: &[Vec<[f64; JOINTS]>]) -> Vec<Row> {
    let mut rows = Vec::new();
    for (index, study) in studies.iter().enumerate() {
        let own: Vec<[f64; JOINTS]> = again.iter().map(|campaign| campaign[index]).collect();
        rows.extend(errors(study, courses, &own));
        rows.extend(coefficients(study));
    }
    rows
}

/// Errors of all models beside each other: on angles, and on torques, simulated and measured.
pub fn digest(rows: &[Row]) -> Vec<Table> {
    let errors_of = |row: &Row| row.column.starts_with("RMSE").then(|| row.column.clone());
    let angles = |row: &Row| {
        let model = MODELS.iter().find(|model| {
            row.table.split_once(", ") == Some((model.table.to_string().as_str(), model.name))
        })?;
        Some((format!("{}, {} ({})", row.row, errors_of(row)?, row.unit), model.name.to_owned()))
    };
    let torques = |start: &'static str| {
        move |row: &Row| {
            let whose = row.table.strip_prefix(start).filter(|of| !of.starts_with("the "))?;
            Some((format!("{whose}, {} ({})", errors_of(row)?, row.unit), row.row.clone()))
        }
    };
    let tables = [
        across("Angles (simulated; tables 4, 6, 8 and 10)", rows, angles),
        across("Torques of the joints (simulated)", rows, torques("Torques of ")),
        across(
            "Torques of the industrial arm (measured)",
            rows,
            torques("Torques of the industrial arm, "),
        ),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

/// Columns of a way of fitting: its name, and what was fitted.
fn ways(study: &Study) -> [(&'static str, &Judgement); 2] {
    [("as printed", &study.printed), ("properly", &study.proper)]
}

/// The same, and what the joints' torques gave.
fn all_ways(study: &Study) -> impl Iterator<Item = (&'static str, &Judgement)> {
    ways(study).into_iter().chain([("by torques", &study.by_torques)])
}

/// Standard deviation of some numbers.
fn spread(numbers: &[f64]) -> f64 {
    let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
    let squares: f64 = numbers.iter().map(|number| (number - mean).powi(2)).sum();
    (squares / (numbers.len() as f64 - 1.0).max(1.0)).sqrt()
}

/// `again` are the errors of the printed protocol on other campaigns.
fn errors(study: &Study, courses: &[Course], again: &[[f64; JOINTS]]) -> Vec<Row> {
    let model = study.model;
    let table = format!("{}, {}", model.table, model.name);
    let mut rows = Vec::new();
    for joint in 0..JOINTS {
        let name = format!("joint {}", joint + 1);
        for (way, of) in all_ways(study) {
            for (index, judged) in of.judged.iter().enumerate() {
                let on =
                    if index == 0 { String::new() } else { format!(", {}", courses[index].name) };
                let put = |what: &str, unit: &str, ours: f64, printed: f64| {
                    let row =
                        Row::simulated(&table, &name, &format!("{what} {way}{on}"), unit, ours);
                    if index == 0 && way == "as printed" { row.printed(printed) } else { row }
                };
                let mut rmse = put("RMSE", "deg", judged.rmse_deg[joint], model.rmse_deg[joint]);
                if index == 0 && way == "as printed" && !again.is_empty() {
                    let all: Vec<f64> =
                        again.iter().map(|of| of[joint]).chain([rmse.ours]).collect();
                    rmse = rmse.spread(spread(&all));
                }
                rows.push(rmse);
                rows.push(put("SSE", "deg^2", judged.sse_deg2[joint], model.sse[joint]));
            }
        }
    }
    rows
}

fn coefficients(study: &Study) -> Vec<Row> {
    let model = study.model;
    let table = format!("{}, coefficients of {}", model.table - 1, model.name);
    let mut rows = Vec::new();
    for joint in 0..JOINTS {
        for of in model.coefficients {
            let name = format!("{}, joint {}", of.symbol, joint + 1);
            for (way, judgement) in ways(study) {
                let fitted = &judgement.fitted;
                let value = of
                    .id
                    .map_or(fitted.deflection_rad[joint], |id| fitted.parameters[joint].get(id));
                let unit = match of.id {
                    Some(Id::QuadraticFriction) if way == "as printed" => "Nm s/rad",
                    Some(id) => id.info().unit,
                    None => "rad",
                };
                let row = Row::simulated(&table, &name, way, unit, value);
                rows.push(if way == "as printed" { row.printed(of.values[joint]) } else { row });
            }
        }
        let own = model.coefficients.iter().any(|of| of.id == Some(Id::TorqueOffset));
        if !own {
            let offset = study.proper.fitted.parameters[joint].get(Id::TorqueOffset);
            let name = format!("f_0, joint {}", joint + 1);
            rows.push(Row::simulated(
                &table,
                &name,
                "properly",
                Id::TorqueOffset.info().unit,
                offset,
            ));
        }
    }
    rows
}

/// Errors of the models on the torques of each joint of the simulated arm.
pub fn of_torques(models: &[Vec<TorqueStudy>]) -> Vec<Row> {
    let each = models.iter().zip(&MODELS).flat_map(|(joints, model)| {
        joints.iter().enumerate().flat_map(|(joint, study)| {
            let table = format!("Torques of joint {}", joint + 1);
            torque_rows(&table, model.name, study, true)
        })
    });
    each.collect()
}

/// The same of an axis of the measured arm.
pub fn of_axis(axis: &Axis) -> Vec<Row> {
    let table = format!("Torques of the industrial arm, axis {}", axis.number);
    let each = axis.models.iter().zip(&MODELS);
    each.flat_map(|(study, model)| torque_rows(&table, model.name, study, false)).collect()
}

fn torque_rows(table: &str, model: &str, study: &TorqueStudy, simulated: bool) -> Vec<Row> {
    let columns = [
        ("as printed", study.printed.train, study.printed.test),
        ("properly", study.proper.train, study.proper.test),
    ];
    let row = |column: &str, unit: &str, ours: f64| Row {
        simulated,
        ..Row::simulated(table, model, column, unit, ours)
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
