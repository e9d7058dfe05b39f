//! Every number as a row beside the printed one.

use super::arms::{IMPROVED, PUBLISHED};
use super::estimation::SPEEDS_RPM;
use super::experiments::measures;
use super::tasks::Task;
use super::{Spread, Study};
use crate::papers::Row;
use compensator_core::ParameterId as Id;

/// What the paper prints of an arm: estimation errors, %.
pub const PRINTED_ERRORS: [(&str, [f64; 3]); 2] =
    [(PUBLISHED, [3.54, 5.95, 9.95]), (IMPROVED, [2.19, 1.63, 3.31])];

/// Sums of CV.
pub const PRINTED_SUMS: [(&str, [f64; 3]); 2] =
    [(PUBLISHED, [19.82, 30.19, 48.28]), (IMPROVED, [9.52, 16.55, 33.54])];

/// Table III, plain LuGre; "<0.01" stands as 0.01.
const TABLE_III: [(Id, [f64; 3]); 6] = [
    (Id::BristleStiffness, [17.07, 26.11, 41.56]),
    (Id::BristleDamping, [2.05, 3.05, 5.05]),
    (Id::ViscousFriction, [0.59, 0.87, 1.44]),
    (Id::CoulombTorque, [0.08, 0.13, 0.20]),
    (Id::StaticTorque, [0.01, 0.01, 0.01]),
    (Id::StribeckVelocity, [0.02, 0.02, 0.02]),
];

/// What the paper prints of a task's measure.
pub fn printed(task: Task, arm: &str, measure: usize) -> Option<f64> {
    match (task, measure, arm) {
        (Task::LowSpeed, 0, PUBLISHED) => Some(34.2),
        (Task::LowSpeed, 0, IMPROVED) => Some(18.7),
        (Task::LowSpeed, 1, PUBLISHED) => Some(1.25),
        (Task::LowSpeed, 1, IMPROVED) => Some(0.5),
        (Task::Impact, 0, PUBLISHED) => Some(0.529),
        (Task::Impact, 0, IMPROVED) => Some(0.311),
        _ => None,
    }
}

fn row(place: [&str; 4], ours: Spread, printed: Option<f64>) -> Row {
    let [table, name, column, unit] = place;
    let row = Row::simulated(table, name, column, unit, ours.mean).spread(ours.deviation);
    printed.map_or(row.clone(), |printed| row.printed(printed))
}

/// All of them, in the paper's order.
pub fn rows(study: &Study) -> Vec<Row> {
    let mut rows = Vec::new();
    let of = |table: &[(&str, [f64; 3])], arm: &str, at: usize| {
        table.iter().find(|(own, _)| *own == arm).map(|(_, values)| values[at])
    };
    for (arm, errors) in &study.errors {
        for (at, (rpm, error)) in SPEEDS_RPM.iter().zip(errors).enumerate() {
            let column = format!("estimation error at {rpm} rpm");
            rows.push(row(["Fig. 6", arm, &column, "%"], *error, of(&PRINTED_ERRORS, arm, at)));
        }
    }
    for (arm, certificate) in &study.certificates {
        let table = format!("III, CV of {arm}");
        for (parameter, cv) in certificate.parameters.iter().zip(&certificate.cv) {
            for (at, (class, cv)) in certificate.classes.iter().zip(cv).enumerate() {
                let plain = TABLE_III.iter().find(|(id, _)| id == parameter && *arm == PUBLISHED);
                let row = Row::simulated(&table, parameter.info().name, class, "", *cv);
                rows.push(plain.map_or(row.clone(), |(_, values)| row.printed(values[at.min(2)])));
            }
        }
    }
    for (arm, certificate) in &study.certificates {
        let sums = certificate.classes.iter().zip(&certificate.sum_cv_by_class);
        for (at, (class, sum)) in sums.enumerate() {
            let row = Row::simulated("sum of CV", arm, class, "", *sum);
            let printed = of(&PRINTED_SUMS, arm, at.min(2));
            rows.push(printed.map_or(row.clone(), |printed| row.printed(printed)));
        }
    }
    for (task, results) in &study.tasks {
        for result in results {
            for (at, measure) in measures(*task).iter().enumerate() {
                let place = [task.figure(), result.arm, measure.column, measure.unit];
                rows.push(row(place, result.spread(at), printed(*task, result.arm, at)));
            }
        }
    }
    for of in &study.harm {
        let table = "harm, diagnosed model";
        if let Some(worse) = of.worse {
            let column = "tracking error over that without";
            rows.push(Row::simulated(table, &of.name, column, "", worse));
            let swing = "swing while holding";
            rows.push(Row::simulated(table, &of.name, swing, "mrad", 1e3 * of.swing_rad));
        }
    }
    let wear = &study.wear;
    let watch = |column: &str, unit: &str, value: f64| {
        Row::simulated("watch", "diagnosed", column, unit, value)
    };
    if let Some(day) = wear.flagged_day {
        rows.push(watch("first day out of band", "d", f64::from(day)));
    }
    rows.push(watch("false alarms", "", wear.false_alarms as f64));
    rows.push(watch("sound days", "d", wear.sound_days as f64));
    rows
}
