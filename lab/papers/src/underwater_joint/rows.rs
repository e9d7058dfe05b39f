//! All results as rows, beside the printed ones.

use super::arms::{DriverArm, IMPROVED, PUBLISHED};
use super::estimation::SPEEDS_RPM;
use super::experiments::measures;
use super::tasks::Task;
use super::{JointStudy, Spread, harm};
use crate::{ResultRow, pivot_table};
use compensator_core::ParameterId as Id;
use friction_results::report::Table;
use stochastic_extension::Form;

/// Printed estimation errors of an arm, %.
pub const PRINTED_ERRORS: [(&str, [f64; 3]); 2] =
    [(PUBLISHED, [3.54, 5.95, 9.95]), (IMPROVED, [2.19, 1.63, 3.31])];

/// Printed sums of CV.
pub const PRINTED_SUMS: [(&str, [f64; 3]); 2] =
    [(PUBLISHED, [19.82, 30.19, 48.28]), (IMPROVED, [9.52, 16.55, 33.54])];

/// Table III, plain LuGre; "<0.01" is entered as 0.01.
const TABLE_III: [(Id, [f64; 3]); 6] = [
    (Id::BristleStiffness, [17.07, 26.11, 41.56]),
    (Id::BristleDamping, [2.05, 3.05, 5.05]),
    (Id::ViscousFriction, [0.59, 0.87, 1.44]),
    (Id::CoulombTorque, [0.08, 0.13, 0.20]),
    (Id::StaticTorque, [0.01, 0.01, 0.01]),
    (Id::StribeckVelocity, [0.02, 0.02, 0.02]),
];

/// Returns the printed value of a task's measure.
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

fn row(place: [&str; 4], ours: Spread, printed: Option<f64>) -> ResultRow {
    let [table, name, column, unit] = place;
    let row = ResultRow::simulated(table, name, column, unit, ours.mean).spread(ours.deviation);
    printed.map_or(row.clone(), |printed| row.printed(printed))
}

/// Table of the measures, one line per arm.
pub fn digest(rows: &[ResultRow], arms: &[DriverArm]) -> Table {
    let place = |row: &ResultRow| {
        let column = format!("{} ({})", row.column, row.unit);
        row.table.starts_with("Fig. ").then(|| (row.row.clone(), column.replace(" ()", "")))
    };
    let caption = "Mean and standard deviation over seeds, of the estimation over groups of repeats (simulated)";
    let mut table = pivot_table(caption, rows, place);
    table.rows.sort_by_key(|row| arms.iter().position(|arm| row[0] == arm.name.into()));
    table
}

/// Returns all rows, in the order of the paper.
pub fn rows(study: &JointStudy) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    let of = |table: &[(&str, [f64; 3])], arm: &str, at: usize| {
        table.iter().find(|(known, _)| *known == arm).map(|(_, values)| values[at])
    };
    for (arm, errors) in &study.errors {
        for (at, (rpm, error)) in SPEEDS_RPM.iter().zip(errors).enumerate() {
            let column = format!("estimation error at {rpm} rpm");
            rows.push(row(["Fig. 6", arm, &column, "%"], *error, of(&PRINTED_ERRORS, arm, at)));
        }
    }
    rows.extend(printed_form(study));
    for (arm, certificate) in &study.certificates {
        let table = format!("III, CV (standard deviation over mean) of {arm}");
        for (parameter, cv) in certificate.parameters.iter().zip(&certificate.cv) {
            for (class, cv) in certificate.classes.iter().zip(cv) {
                rows.push(ResultRow::simulated(&table, parameter.name(), class, "", *cv));
            }
        }
    }
    for (arm, certificate) in &study.certificates {
        let sums = certificate.classes.iter().zip(&certificate.sum_cv_by_class);
        for (class, sum) in sums {
            let table = "sum of CV (standard deviation over mean)";
            rows.push(ResultRow::simulated(table, arm, class, "", *sum));
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
    rows.extend(closed_loop(study));
    rows.extend(harm_map(study));
    let wear = &study.wear;
    let watch = |column: &str, unit: &str, value: f64| {
        ResultRow::simulated("watch", "diagnosed", column, unit, value)
    };
    if let Some(day) = wear.flagged_day {
        rows.push(watch("first day out of band", "d", f64::from(day)));
    }
    rows.push(watch("false alarms", "", wear.false_alarms as f64));
    rows.push(watch("sound days", "d", wear.sound_days as f64));
    rows
}

/// CV in the paper's form of each parameter of an arm, `[class][parameter]`: variance over mean, in the parameter's unit.
fn in_print(study: &JointStudy, arm: &str) -> Option<Vec<Vec<f64>>> {
    let certificate = &study.certificates.iter().find(|(known, _)| *known == arm)?.1;
    let fit = study.arms.iter().find(|known| known.name == arm)?.fit.as_ref()?;
    let form = Form::PrintedVarianceOverMean;
    let class = |at: usize| {
        let each = certificate.parameters.iter().zip(&certificate.cv);
        each.map(|(id, cv)| form.of(cv[at], fit.parameters.get(*id))).collect()
    };
    Some((0..certificate.classes.len()).map(class).collect())
}

/// Sums of an arm's CV in the paper's form, by class.
pub fn printed_sums(study: &JointStudy, arm: &str) -> Option<Vec<f64>> {
    Some(in_print(study, arm)?.iter().map(|class| class.iter().sum()).collect())
}

/// Rows of Table III in the paper's form, and its sums.
fn printed_form(study: &JointStudy) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    let mut sums = Vec::new();
    for (arm, certificate) in &study.certificates {
        let table = format!("III, CV as printed (variance over mean) of {arm}");
        let classes = in_print(study, arm).unwrap_or_default();
        for (at, (class, values)) in certificate.classes.iter().zip(&classes).enumerate() {
            for (id, value) in certificate.parameters.iter().zip(values) {
                let row = ResultRow::simulated(&table, id.name(), class, id.unit(), *value);
                let plain = TABLE_III.iter().find(|(known, _)| known == id && *arm == PUBLISHED);
                rows.push(plain.map_or(row.clone(), |(_, all)| row.printed(all[at.min(2)])));
            }
            let table = "sum of CV as printed (variance over mean)";
            let row = ResultRow::simulated(table, arm, class, "", values.iter().sum());
            let printed = PRINTED_SUMS.iter().find(|(known, _)| known == arm);
            sums.push(printed.map_or(row.clone(), |(_, all)| row.printed(all[at.min(2)])));
        }
    }
    rows.extend(sums);
    rows
}

/// Rows before and after the transfer of the diagnosed parameters.
fn closed_loop(study: &JointStudy) -> Vec<ResultRow> {
    let each = study.transfers.iter().flat_map(|of| {
        let measure = &measures(of.task)[0];
        let name = format!("{}, {}", of.task.title(), measure.column);
        let row = |column: &str, spread: Spread| {
            row(["parameters into the running joint", &name, column, measure.unit], spread, None)
        };
        [row("before", of.before), row("after params set", of.after)]
    });
    each.collect()
}

fn harm_map(study: &JointStudy) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    let table = "harm, diagnosed model";
    for of in &study.harm {
        let Some(tracking_ratio) = of.tracking_ratio else { continue };
        for (task, tracking_ratio) in harm::TASKS.iter().zip(tracking_ratio) {
            let column = format!("{}, error over that without", task.title());
            rows.push(ResultRow::simulated(table, &of.name, &column, "", tracking_ratio));
        }
        if let Some(tracking_ratio) = of.jump_position_ratio {
            let column = "Jump with impact, position error over that without";
            rows.push(ResultRow::simulated(table, &of.name, column, "", tracking_ratio));
        }
        let swing = "swing while holding";
        rows.push(ResultRow::simulated(table, &of.name, swing, "mrad", 1e3 * of.swing_rad));
        if let Some(reported_s) = of.reported_s {
            let reported = "out of band reported after";
            rows.push(ResultRow::simulated(table, &of.name, reported, "s", reported_s));
        }
    }
    rows
}
