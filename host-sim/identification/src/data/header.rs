//! Interpretation of a header: which column holds which quantity.
//!
//! The contract puts the unit into the name, so the header states everything that is needed. `torque_nm` or `force_n`
//! is the target and sets the joint kind. The velocity must be of that kind. A name that the contract does not define
//! is an extra covariate under its own name. Logs with other names are mapped by pairs of contract name and file name
//! (`--columns torque_nm=tau_3`), which take precedence over the column's own name.
//!
//! Joints side by side are read one at a time (`joints`). An ambiguous header is an error, not a guess: two columns
//! of one name, two targets, or a linear velocity with a torque (unless the pairs say so).

use std::path::Path;

use compensator_core::quantity::{JointKind, Quantity};

use super::cell::CellReader;
use super::contract::{POSITIONS, RUN, TARGETS, TIME, VELOCITIES, parse_optional};
use super::dataset::{LeftOutColumn, SourceColumn};
use super::error::{DataError, asked_rows, at_header, listed};
use super::joints::{JOINT, OneJoint, one_joint};
use super::naming::Naming;
use super::options::ReadOptions;
use super::unit::conversion;
use crate::setting::Setting;

/// A column other than time, velocity and torque.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OptionalColumn {
    /// Its quantity; `None` for an extra covariate.
    pub quantity: Option<Quantity>,
    /// Its name in the contract, or its own name.
    pub name: String,
    /// Its position in the file.
    pub reading: CellReader,
    /// True if `--columns` names it.
    pub is_mapped: bool,
}

/// A row selection: rows in which a column holds one of some values.
#[derive(Debug, Clone)]
pub(super) struct RowSelection {
    /// The column in the file.
    pub index: usize,
    /// The values, as given with `--where`.
    pub values: Vec<String>,
}

/// A column whose values may name joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct JointNameColumn {
    /// The column in the file.
    pub index: usize,
    /// True if it names joints whatever it holds. Otherwise it does so only if it changes inside a run.
    pub is_certain: bool,
}

/// The interpreted header.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub joint: JointKind,
    /// All names as in the file, for messages.
    pub names: Vec<String>,
    /// The column of the run's name.
    pub run: Option<usize>,
    /// The columns of time, velocity and torque. Without a velocity, the position takes its place.
    pub required: [CellReader; 3],
    /// Whether the velocity must be derived from the position.
    pub is_position: bool,
    /// The joint kind of the velocity's (or position's) unit. It mostly equals that of the target.
    velocity_kind: JointKind,
    pub optional: Vec<OptionalColumn>,
    pub only: Vec<RowSelection>,
    pub joint_names: Vec<JointNameColumn>,
    pub left_out: Vec<LeftOutColumn>,
    pub notes: Vec<String>,
    /// The origin of each column of the data.
    pub sources: Vec<SourceColumn>,
}

impl Layout {
    /// Returns the columns of the file that must be read.
    #[cfg(any(feature = "mcap", feature = "parquet"))]
    pub fn needed(&self) -> impl Iterator<Item = usize> {
        let required = self.required.iter().map(|reading| reading.index).chain(self.run);
        let optional = self.optional.iter().map(|column| column.reading.index);
        let names = self.joint_names.iter().map(|column| column.index);
        required.chain(optional).chain(names).chain(self.only.iter().map(|only| only.index))
    }

    /// Reads units from the first row and returns true, if that row holds units instead of values. This is so if at
    /// least two of time, velocity and torque have a valid unit there, and no cell is a number. Units given with
    /// `--columns` take precedence.
    pub fn take_units(&mut self, cells: &[&[u8]]) -> bool {
        let text = |reading: &CellReader| {
            let cell =
                String::from_utf8_lossy(cells.get(reading.index).copied().unwrap_or_default());
            cell.trim_matches(['[', ']', '(', ')', '"', ' ']).to_owned()
        };
        if cells.iter().any(|cell| fast_float2::parse::<f64, _>(cell).is_ok()) {
            return false;
        }
        let kind = if self.is_position { Quantity::Position } else { Quantity::Velocity };
        let names = [TIME, kind.name(self.velocity_kind), Quantity::Torque.name(self.joint)];
        let units = |name: &str, reading: &CellReader| conversion(name, &text(reading)).ok();
        let required = self.required.iter().zip(names);
        if required.filter(|(reading, name)| units(name, reading).is_some()).count() < 2 {
            return false;
        }
        let required = self.required.iter_mut().zip(names);
        let optional = self.optional.iter_mut().map(|column| (&mut column.reading, &*column.name));
        for (reading, name) in required.chain(optional) {
            if let (None, Some(conversion)) = (reading.conversion, units(name, reading)) {
                let unit = text(reading);
                reading.conversion = Some(conversion);
                let source = self.sources.iter_mut().find(|source| source.name == name);
                source.into_iter().for_each(|source| source.unit = Some(unit.clone()));
            }
        }
        self.notes.push("the row below the header is read as units".into());
        true
    }
}

/// Names of columns that identify a row's joint. A column `name` mostly names something else and is treated
/// separately.
const JOINT_NAMES: [&str; 14] = [
    "joint",
    "joint_name",
    "joint_id",
    "joint_index",
    "axis",
    "axis_name",
    "axis_id",
    "motor",
    "motor_id",
    "motor_name",
    "actuator",
    "actuator_id",
    "drive",
    "node_id",
];

/// The required columns of a header.
struct RequiredColumns {
    time: CellReader,
    /// The velocity, or the position if there is no velocity.
    motion: KindColumn,
    is_position: bool,
    target: KindColumn,
}

impl RequiredColumns {
    /// Finds the required columns.
    ///
    /// # Errors
    /// If one is missing, or if the header has two targets.
    fn find(file: &Path, naming: &Naming) -> Result<Self, DataError> {
        let ros_time = || {
            let reading = naming.find("%time")?;
            Some(CellReader { conversion: conversion(TIME, "ns").ok(), ..reading })
        };
        let time = naming.find(TIME).or_else(ros_time);
        let target = find_target(file, naming)?;
        let kind = target.map(|target| target.kind);
        let velocity = find_motion(naming, &VELOCITIES, kind);
        let motion = velocity.or_else(|| find_motion(naming, &POSITIONS, kind));
        if let (Some(time), Some(motion), Some(target)) = (time, motion, target) {
            return Ok(Self { time, motion, is_position: velocity.is_none(), target });
        }
        let missing = [
            (time.is_none(), TIME, TIME),
            (
                motion.is_none(),
                "velocity_rad_s (or velocity_m_s)",
                VELOCITIES[usize::from(kind == Some(JointKind::Prismatic))].0,
            ),
            (target.is_none(), "torque_nm (or force_n)", TARGETS[0].0),
        ];
        Err(naming.missing(file, &missing))
    }

    /// Returns a note if motion and target have units of different joint kinds, which `--columns` must allow.
    fn check_kinds(&self, file: &Path, naming: &Naming) -> Result<Option<String>, DataError> {
        if self.motion.kind == self.target.kind {
            return Ok(None);
        }
        let (velocity, target) = (self.motion.name, self.target.name);
        if !naming.is_mapped(velocity) && !naming.is_mapped(target) {
            let fitting = if target == "force_n" { "torque_nm" } else { "force_n" };
            let mapping = Setting::Columns.alone();
            let expected =
                format!("{fitting} for a joint with {velocity} (or {mapping} to map the columns)");
            return Err(at_header(file, target, target, &expected));
        }
        Ok(Some(format!(
            "{target} is read with {velocity}, as given with --columns: units are those of {target}"
        )))
    }
}

/// Interprets a header.
///
/// # Errors
/// If a required column is missing or the header is ambiguous.
pub(super) fn layout(
    file: &Path,
    names: Vec<String>,
    options: &ReadOptions,
) -> Result<Layout, DataError> {
    let one = one_joint(file, &names, options)?;
    let naming = Naming::new(file, &one.names, &options.columns)?;
    let required = RequiredColumns::find(file, &naming)?;
    let kind_note = required.check_kinds(file, &naming)?;
    let run = naming.find(RUN).map(|reading| reading.index);
    let only = row_selections(file, &naming, &names, options, one.is_chosen)?;
    let RequiredColumns { time, motion, is_position, target } = required;
    let mut layout = Layout {
        joint: target.kind,
        run,
        required: [time, motion.reading, target.reading],
        is_position,
        velocity_kind: motion.kind,
        optional: Vec::new(),
        joint_names: joint_name_columns(&names, &only, run),
        only,
        left_out: naming.replaced(),
        notes: one.note.iter().cloned().chain(kind_note).collect(),
        sources: Vec::new(),
        names: Vec::new(),
    };
    let sources = [
        Some((TIME, time)),
        (!is_position).then_some((Quantity::Velocity.name(motion.kind), motion.reading)),
        Some((target.name, target.reading)),
    ];
    let sources = sources.into_iter().flatten();
    layout.sources = sources.map(|(name, of)| source_column(&names, &naming, name, of)).collect();
    add_optional_columns(&mut layout, &names, &naming, &one, &required);
    layout.notes.extend(naming.hints());
    layout.names = names;
    Ok(layout)
}

/// Returns the origin of a column.
fn source_column(
    names: &[String],
    naming: &Naming,
    name: &str,
    reading: CellReader,
) -> SourceColumn {
    SourceColumn {
        name: name.into(),
        header: names[reading.index].clone(),
        unit: naming.unit(name).map(str::to_owned),
        ..SourceColumn::default()
    }
}

/// Adds every column that is not required, as an optional column or with the reason why it is left out.
fn add_optional_columns(
    layout: &mut Layout,
    names: &[String],
    naming: &Naming,
    one: &OneJoint,
    required: &RequiredColumns,
) {
    let RequiredColumns { time, motion, is_position, target } = required;
    let used = [time.index, motion.reading.index, target.reading.index];
    let velocity_name = Quantity::Velocity.name(motion.kind);
    for (reading, name) in naming.columns() {
        let index = reading.index;
        let is_used = used.contains(&index) && !naming.is_mapped(name) || layout.run == Some(index);
        let is_required = [TIME, velocity_name, target.name].contains(&name);
        if one.others.contains(&index) {
            continue;
        }
        if (is_used || is_required) && !(*is_position && name == motion.name) {
            continue;
        }
        match covariate_error(name) {
            None => {
                // A position in the unit of the other joint kind is an extra covariate.
                let quantity = parse_optional(name, motion.kind);
                let is_mapped = naming.is_mapped(name);
                layout.sources.push(source_column(names, naming, name, reading));
                let name = name.into();
                layout.optional.push(OptionalColumn { quantity, name, reading, is_mapped });
            }
            Some(why) => {
                let nameless = || format!("number {}", index + 1);
                let name = if name.is_empty() { nameless() } else { name.into() };
                layout.left_out.push(LeftOutColumn { name, why: why.into() });
            }
        }
    }
}

/// Resolves the columns of `--where`: by contract name first, then by the file's own name.
fn row_selections(
    file: &Path,
    naming: &Naming,
    names: &[String],
    options: &ReadOptions,
    joint_is_chosen: bool,
) -> Result<Vec<RowSelection>, DataError> {
    let find = |(column, values): &(String, Vec<String>)| {
        let own = || names.iter().position(|name| name == column);
        let index = naming.find(column).map(|reading| reading.index).or_else(own);
        index.map(|index| RowSelection { index, values: values.clone() }).ok_or_else(|| {
            DataError::Request {
                what: format!("{}: {}", file.display(), asked_rows(column, values)),
                found: format!("no column {column}"),
                expected: format!("one of {}", listed(names)),
            }
        })
    };
    let by_row = options.only.iter().filter(|(column, _)| !(joint_is_chosen && column == JOINT));
    by_row.map(find).collect()
}

/// Returns the columns that may name several joints, except those that select rows or name the run.
fn joint_name_columns(
    names: &[String],
    only: &[RowSelection],
    run: Option<usize>,
) -> Vec<JointNameColumn> {
    let suspect = |(index, name): (usize, &String)| {
        let name = name.trim_start_matches('#').trim().to_lowercase();
        let is_certain = JOINT_NAMES.contains(&name.as_str());
        let is_free = run != Some(index) && only.iter().all(|only| only.index != index);
        (is_free && (is_certain || name == "name")).then_some(JointNameColumn { index, is_certain })
    };
    names.iter().enumerate().filter_map(suspect).collect()
}

/// A column whose name states the joint kind.
#[derive(Debug, Clone, Copy)]
struct KindColumn {
    reading: CellReader,
    name: &'static str,
    kind: JointKind,
}

/// Finds the target column, which sets the joint kind. Of two, the one that `--columns` names is taken.
fn find_target(file: &Path, naming: &Naming) -> Result<Option<KindColumn>, DataError> {
    let found = TARGETS
        .map(|(name, kind)| naming.find(name).map(|reading| KindColumn { reading, name, kind }));
    match found {
        [Some(torque), Some(force)] => {
            match (naming.is_mapped(torque.name), naming.is_mapped(force.name)) {
                (true, false) => Ok(Some(torque)),
                (false, true) => Ok(Some(force)),
                _ => {
                    let expected =
                        "one target: torque_nm for a rotary joint or force_n for a linear joint";
                    Err(at_header(file, force.name, "torque_nm as well", expected))
                }
            }
        }
        [torque, force] => Ok(torque.or(force)),
    }
}

/// Finds a column of the motion by its names. Of two, the one of the target's joint kind is taken.
fn find_motion(
    naming: &Naming,
    names: &[(&'static str, JointKind); 2],
    kind: Option<JointKind>,
) -> Option<KindColumn> {
    let find = |&(name, kind)| naming.find(name).map(|reading| KindColumn { reading, name, kind });
    names.iter().filter_map(find).min_by_key(|of| Some(of.kind) != kind)
}

/// Returns why a column cannot be a covariate, or `None` if it can.
fn covariate_error(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        Some("it has no name")
    } else if name.starts_with("Unnamed: ") || name == "__index_level_0__" {
        Some("it is the row index of a pandas table")
    } else if TARGETS.iter().any(|(target, _)| *target == name) {
        Some("it is a second target, and --columns names the other one")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_header(header: &str, columns: &str) -> Result<Layout, String> {
        let names = header.split(',').map(str::to_string).collect();
        let columns: Vec<(String, String)> = columns
            .split(',')
            .filter_map(|pair| pair.split_once('='))
            .map(|(a, b)| (a.to_string(), b.to_string()))
            .collect();
        let options = ReadOptions { columns, ..ReadOptions::default() };
        layout(Path::new("f.csv"), names, &options).map_err(|error| error.to_string())
    }

    fn required_indices(layout: &Layout) -> [usize; 3] {
        layout.required.map(|reading| reading.index)
    }

    #[test]
    fn layout_with_either_target_sets_joint_kind() {
        let turns = read_header("time_s,velocity_rad_s,torque_nm,position_rad", "").unwrap();
        assert_eq!((turns.joint, required_indices(&turns)), (JointKind::Revolute, [0, 1, 2]));
        assert_eq!(turns.optional[0].quantity, Some(Quantity::Position));
        let slides = read_header("run,force_n,velocity_m_s,time_s,position_m", "").unwrap();
        assert_eq!((slides.joint, required_indices(&slides)), (JointKind::Prismatic, [3, 2, 1]));
        assert_eq!(slides.run, Some(0));
        assert_eq!(slides.optional[0].quantity, Some(Quantity::Position));
    }

    #[test]
    fn layout_with_name_outside_contract_adds_extra_covariate() {
        let found = read_header("time_s,velocity_rad_s,torque_nm,flow,position_m", "").unwrap();
        let extras: Vec<(&str, Option<Quantity>)> =
            found.optional.iter().map(|c| (c.name.as_str(), c.quantity)).collect();
        assert_eq!(extras, [("flow", None), ("position_m", None)]);
    }

    #[test]
    fn layout_with_missing_columns_lists_them_with_a_hint() {
        assert_eq!(
            read_header("time_s,dq,tau", "").unwrap_err(),
            "f.csv: found only the columns time_s, dq, tau, expected velocity_rad_s (or \
             velocity_m_s) and torque_nm (or force_n) in the header, or columns \
             velocity_rad_s=dq,torque_nm=tau"
        );
    }

    #[test]
    fn layout_with_mapped_names_prefers_them() {
        let found =
            read_header("t,dq,torque_nm,u", "time_s=t,velocity_rad_s=dq,torque_nm=u").unwrap();
        assert_eq!(required_indices(&found), [0, 1, 3]);
        assert!(found.optional.is_empty());
        assert_eq!(found.left_out[0].name, "torque_nm");
        assert_eq!(found.left_out[0].why, "--columns reads torque_nm from u");
    }

    #[test]
    fn layout_with_two_swapped_names_swaps_columns() {
        let found = read_header(
            "time_s,velocity_rad_s,torque_nm,load_torque_nm",
            "torque_nm=load_torque_nm,load_torque_nm=torque_nm",
        )
        .unwrap();
        assert_eq!(required_indices(&found), [0, 1, 3]);
        assert_eq!(
            (found.optional[0].quantity, found.optional[0].reading.index),
            (Some(Quantity::LoadTorque), 2)
        );
        assert!(found.left_out.is_empty());
    }

    #[test]
    fn layout_with_unknown_name_in_pair_returns_error_with_name() {
        let error = read_header("t,v,f", "time_s=t,velocity_m_s=speed").unwrap_err();
        assert_eq!(
            error,
            "f.csv: columns velocity_m_s=speed: found no column speed, expected one of t, v, f"
        );
        let error = read_header("t,v,f", "torque_Nm=f").unwrap_err();
        assert!(error.starts_with(
            "columns torque_Nm=f: found the name torque_Nm, expected one of run, time_s"
        ));
        let error = read_header("t,v,f", "time_s=t,time_s=v").unwrap_err();
        assert!(error.contains("found time_s twice"), "{error}");
    }

    #[test]
    fn layout_with_duplicate_name_returns_error() {
        let error = read_header("time_s,velocity_rad_s,x,torque_nm,x", "").unwrap_err();
        assert_eq!(
            error,
            "f.csv: row 1, column x: found the name twice (columns 3 and 5), expected each name once"
        );
    }

    #[test]
    fn layout_with_two_targets_returns_error_unless_mapped() {
        let both = "time_s,velocity_rad_s,torque_nm,force_n";
        assert!(read_header(both, "").unwrap_err().contains("expected one target"));
        let chosen = read_header("time_s,velocity_rad_s,tau,force_n", "torque_nm=tau").unwrap();
        assert_eq!(chosen.joint, JointKind::Revolute);
        assert_eq!(chosen.left_out[0].name, "force_n");
    }

    #[test]
    fn layout_with_mixed_joint_kinds_returns_error_unless_mapped() {
        let error = read_header("time_s,velocity_rad_s,force_n", "").unwrap_err();
        assert!(error.contains("expected torque_nm for a joint with velocity_rad_s"), "{error}");
        let mixed = read_header("time_s,velocity_m_s,u", "torque_nm=u").unwrap();
        assert_eq!(mixed.joint, JointKind::Revolute);
        assert_eq!(mixed.notes.len(), 1);
    }

    #[test]
    fn layout_with_numbers_or_nameless_columns_reports_them() {
        let error = read_header("0.0,1.5,-3e2", "").unwrap_err();
        assert!(error.contains("found numbers, expected the columns' names"), "{error}");
        let found = read_header(",time_s,velocity_rad_s,torque_nm", "").unwrap();
        assert_eq!(found.left_out[0].name, "number 1");
    }
}
