//! The diagnoses of many joints over many campaigns.
//!
//! A *campaign* is one measurement of a joint: a day, a dive, a service interval. Each joint and campaign has one
//! [`FleetRow`], also if its diagnosis failed. `fleet.parquet` holds all rows with a fixed schema, and `fleet.html` shows
//! what a maintainer asks: which joints need attention and why, which causes occur, which levels change over the campaigns, and
//! which joint's seal ages by the trend that the joint itself has learnt ([`Ageing`]).
//!
//! A trend compares numbers of one fixed model. The models that the diagnosis selects may differ between campaigns, and the
//! level of one is then not comparable with the level of the other.

mod ageing;
mod comparison;
mod error;
mod jobs;
mod joint;
mod mirror;
mod page;
pub mod statistics;
mod table;
mod task;

pub use ageing::{Ageing, read_ageing};
pub use error::FleetError;
pub use jobs::{FleetJob, find_jobs, jobs_of_files, mixed_forms};
pub use joint::{FleetSummary, JointSummary, SharedCause, summarise};
pub use page::page;
pub use table::jobs_of_table;
pub use task::{FleetOptions, ROW_FILE, ReadEarlierRow, run_task, run_task_beside, write_fleet};

use crate::table_file::{TableColumn, TableFile};
use comparison::{Compared, Distance, comparisons};
use serde::{Deserialize, Serialize};

/// Ends of the names of log files.
const LOG_ENDS: [&str; 15] = [
    ".csv", ".tsv", ".txt", ".parquet", ".mcap", ".log", ".asc", ".trc", ".gz", ".zip", ".arrow",
    ".feather", ".jsonl", ".ndjson", ".pq",
];

/// Columns of a table with the names of joints and campaigns.
const JOINT: &str = "joint";
const CAMPAIGN: &str = "campaign";

/// Names of the levels of the fixed model, in the order of [`FleetRow::levels`].
pub const LEVELS: [&str; 3] = ["coulomb_torque", "static_torque", "viscous_friction"];

/// Names of the parts of the rigid body whose sign is that of the direction, in the order of [`FleetRow::signed`].
pub const SIGNED: [&str; 3] = ["torque_offset", "gravity_sine", "gravity_cosine"];

/// A parameter of the fixed model, or another estimate of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Value, in Nm or Nm s/rad; N or N s/m for a prismatic joint.
    pub value: f64,
    /// Standard error in the same unit, from the residual of this campaign alone.
    pub std_error: f64,
}

/// Result of one joint and campaign.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FleetRow {
    /// Name of the joint.
    pub joint: String,
    /// Name of the campaign; empty if the fleet has only one.
    pub campaign: String,
    /// Log files.
    pub files: Vec<String>,
    /// Why there is no result, in one line; `None` if the diagnosis succeeded.
    pub error: Option<String>,
    /// Name of the extended model.
    pub model: String,
    /// Cause that the diagnosis names; `none` if there is none.
    pub cause: String,
    /// Kind of the log's fault that explains most of the error, such as `sign-suspect`; empty if there is none.
    #[serde(default)]
    pub leading_fault: String,
    /// Columns that the cause follows.
    pub columns: Vec<String>,
    /// Calibrated probability of the cause, 0 to 1.
    pub probability: Option<f64>,
    /// Size of the cause, in `size_unit`.
    pub size: Option<f64>,
    /// Unit of the size.
    pub size_unit: String,
    /// Ends of the size's 95 % interval.
    pub size_ci95: Option<[f64; 2]>,
    /// RMS of what the cause takes, as a share of the standard deviation of the held-out torque.
    pub effect: Option<f64>,
    /// `1 - RMSE of the extended model / RMSE of the base model`, on held-out rows.
    pub gain: Option<f64>,
    /// Ends of the gain's 95 % interval.
    pub gain_ci95: Option<[f64; 2]>,
    /// Held-out RMSE of the extended model, in `unit`.
    pub test_rmse: Option<f64>,
    /// RMSE of the best possible model, in `unit`.
    pub noise_floor: Option<f64>,
    /// Unit of the torque or force.
    pub unit: String,
    /// Number of rows of the log.
    pub rows: Option<u64>,
    /// Duration of the diagnosis, s.
    pub seconds: Option<f64>,
    /// Name of the fixed model.
    pub fixed_model: String,
    /// Levels of the fixed model, as [`LEVELS`]; `None` if the data do not determine one.
    pub levels: [Option<Level>; LEVELS.len()],
    /// The same of the linear law with the terms of the fixed model. All joints have them, as this law needs no slow motion.
    pub linear_levels: [Option<Level>; LEVELS.len()],
    /// Signed parts of the rigid body beside the linear law, as [`SIGNED`]; `None` without the part in `--rigid-body`.
    pub signed: [Option<Level>; SIGNED.len()],
    /// Path of the joint's report, relative to the folder of the fleet; empty if there is none.
    pub report: String,
}

impl FleetRow {
    /// Returns true if the diagnosis succeeded.
    pub fn is_ok(&self) -> bool {
        self.error.is_none()
    }
}

/// Returns all rows as a table with a fixed schema.
pub fn table(rows: &[FleetRow]) -> TableFile {
    let mut table = TableFile::new(rows.len());
    let mut texts = |name: &str, of: &dyn Fn(&FleetRow) -> String| {
        table.push(name, TableColumn::of_texts(rows.iter().map(of).collect()));
    };
    texts("joint", &|row| row.joint.clone());
    texts("campaign", &|row| row.campaign.clone());
    texts("files", &|row| row.files.join(";"));
    texts("status", &|row| if row.is_ok() { "ok" } else { "error" }.to_owned());
    texts("error", &|row| row.error.clone().unwrap_or_default());
    texts("model", &|row| row.model.clone());
    texts("cause", &|row| row.cause.clone());
    texts("leading_fault", &|row| row.leading_fault.clone());
    texts("columns", &|row| row.columns.join(";"));
    texts("size_unit", &|row| row.size_unit.clone());
    texts("unit", &|row| row.unit.clone());
    texts("fixed_model", &|row| row.fixed_model.clone());
    texts("report", &|row| row.report.clone());
    let mut numbers = |name: &str, of: &dyn Fn(&FleetRow) -> Option<f64>| {
        let values = rows.iter().map(|row| of(row).unwrap_or(f64::NAN)).collect();
        table.push(name, TableColumn::Numbers(values));
    };
    numbers("probability", &|row| row.probability);
    numbers("size", &|row| row.size);
    numbers("size_low", &|row| row.size_ci95.map(|ends| ends[0]));
    numbers("size_high", &|row| row.size_ci95.map(|ends| ends[1]));
    numbers("effect", &|row| row.effect);
    numbers("gain", &|row| row.gain);
    numbers("gain_low", &|row| row.gain_ci95.map(|ends| ends[0]));
    numbers("gain_high", &|row| row.gain_ci95.map(|ends| ends[1]));
    numbers("test_rmse", &|row| row.test_rmse);
    numbers("noise_floor", &|row| row.noise_floor);
    numbers("rows", &|row| row.rows.map(|rows| rows as f64));
    numbers("seconds", &|row| row.seconds);
    let mut level = |name: &str, of: &dyn Fn(&FleetRow) -> Option<Level>| {
        numbers(name, &|row| of(row).map(|level| level.value));
        numbers(&format!("{name}_std_error"), &|row| of(row).map(|level| level.std_error));
    };
    for (at, name) in LEVELS.iter().enumerate() {
        level(&format!("fixed_{name}"), &|row| row.levels[at]);
    }
    // The linear law has no static level.
    for (at, name) in LEVELS.iter().enumerate().filter(|(_, name)| **name != "static_torque") {
        level(&format!("linear_{name}"), &|row| row.linear_levels[at]);
    }
    for (at, name) in SIGNED.iter().enumerate() {
        level(name, &|row| row.signed[at]);
    }
    push_distances(rows, &mut table);
    table
}

/// Adds how far the size of each joint's cause is from those of the others.
fn push_distances(rows: &[FleetRow], table: &mut TableFile) {
    let mut distances = vec![None; rows.len()];
    let of_causes = comparisons(rows).each.into_iter().filter(|of| of.what == Compared::Cause);
    of_causes.for_each(|of| distances[of.row] = of.distance);
    let mut push = |name: &str, of: &dyn Fn(&Distance) -> Option<[f64; 3]>| {
        for (part, end) in ["", "_low", "_high"].into_iter().enumerate() {
            let value =
                |distance: &Option<Distance>| distance.as_ref().and_then(of).map(|of| of[part]);
            let values =
                distances.iter().map(|distance| value(distance).unwrap_or(f64::NAN)).collect();
            table.push(format!("{name}{end}"), TableColumn::Numbers(values));
        }
    };
    push("difference", &|distance| Some(distance.difference));
    push("factor", &|distance| distance.factor);
    let differs = |distance: &Option<Distance>| {
        distance.map_or(f64::NAN, |distance| f64::from(distance.differs))
    };
    table.push("differs", TableColumn::Numbers(distances.iter().map(differs).collect()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table_file::TableFormat;

    #[test]
    fn table_of_failed_row_has_the_same_columns() {
        let failed = FleetRow {
            joint: "hip, left".into(),
            error: Some("a.csv: no rows".into()),
            ..FleetRow::default()
        };
        let good = FleetRow {
            joint: "knee".into(),
            cause: "none".into(),
            rows: Some(1200),
            levels: [Some(Level { value: 1.5, std_error: 0.01 }), None, None],
            ..FleetRow::default()
        };
        let csv = table(&[failed.clone(), good]).emit(TableFormat::Csv).unwrap();
        let text = String::from_utf8(csv).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("joint,campaign,files,status,error,"), "{}", lines[0]);
        let cells = ["\"hip, left\"", "", "", "error", failed.error.as_deref().unwrap(), ""];
        assert!(lines[1].starts_with(&cells.join(",")), "{}", lines[1]);
        assert!(lines[2].contains(",1200.0,,1.5,0.01,,,,,"), "{}", lines[2]);
    }
}
