//! Which column is what.
//!
//! The contract puts the unit into the name, so a header says all there is to know: `torque_nm`
//! or `force_n` is the target and decides the joint kind, the velocity must be of that kind, and
//! whatever is not in the contract is an extra covariate under its own name. Foreign logs are
//! translated by pairs of contract name and foreign name (`--columns torque_nm=tau_3`), which win
//! over what a column calls itself: whoever writes them has looked into the file.
//!
//! Several joints side by side are taken one at a time (`joints`). Anything ambiguous is an error rather than a guess: two columns of one name, two targets, a
//! linear velocity with a torque (unless the pairs say so).

use std::path::Path;

use compensator_core::quantity::{JointKind, Quantity};

use super::contract::{POSITIONS, RUN, TARGETS, TIME, VELOCITIES, parse_optional};
use super::dataset::{LeftOutColumn, SourceColumn};
use super::error::{DataError, at_header, listed};
use super::joints::{JOINT, one_joint};
use super::naming::Naming;
use super::read::ReadOptions;
use super::reading::Reading;
use super::unit::conversion;

/// A column beside time, velocity and torque.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OptionalColumn {
    /// What it measures; `None` of an extra covariate.
    pub quantity: Option<Quantity>,
    /// Its name in the contract, or its own.
    pub name: String,
    /// Where it is in the file.
    pub reading: Reading,
    /// Whether `--columns` asks for it.
    pub mapped: bool,
}

/// Rows to be taken: those in which a column is one of some values.
#[derive(Debug, Clone)]
pub(super) struct Only {
    /// The column in the file.
    pub index: usize,
    /// As `--where` gives them.
    pub values: Vec<String>,
}

/// A column whose values may name several joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NameColumn {
    /// Where it is in the file.
    pub index: usize,
    /// Whether it names joints whatever it holds; else only if it changes inside a run.
    pub is_sure: bool,
}

/// The header, understood.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub joint: JointKind,
    /// All names as they are in the file, for messages.
    pub names: Vec<String>,
    /// Where the run's name is.
    pub run: Option<usize>,
    /// Where time, velocity and torque are; in place of the velocity, the position where there is no velocity.
    pub required: [Reading; 3],
    /// Whether the velocity must be derived from the position.
    pub is_position: bool,
    /// The kind of joint the velocity (or position) is in the units of: mostly that of the target.
    velocity_kind: JointKind,
    pub optional: Vec<OptionalColumn>,
    pub only: Vec<Only>,
    pub joint_names: Vec<NameColumn>,
    pub left_out: Vec<LeftOutColumn>,
    pub notes: Vec<String>,
    /// Where each column of the data comes from.
    pub sources: Vec<SourceColumn>,
}

impl Layout {
    /// Columns of the file that must be read.
    #[cfg(any(feature = "mcap", feature = "parquet"))]
    pub fn needed(&self) -> impl Iterator<Item = usize> {
        let required = self.required.iter().map(|reading| reading.index).chain(self.run);
        let optional = self.optional.iter().map(|column| column.reading.index);
        let names = self.joint_names.iter().map(|column| column.index);
        required.chain(optional).chain(names).chain(self.only.iter().map(|only| only.index))
    }

    /// Takes the first row for units, if it is one of units and not of values: at least two of time, velocity and
    /// torque have a unit of theirs there, and no cell is a number. What `--columns` says goes before.
    pub fn take_units(&mut self, cells: &[&[u8]]) -> bool {
        let text = |reading: &Reading| {
            let cell =
                String::from_utf8_lossy(cells.get(reading.index).copied().unwrap_or_default());
            cell.trim_matches(['[', ']', '(', ')', '"', ' ']).to_owned()
        };
        if cells.iter().any(|cell| fast_float2::parse::<f64, _>(cell).is_ok()) {
            return false;
        }
        let kind = if self.is_position { Quantity::Position } else { Quantity::Velocity };
        let names = [TIME, kind.name(self.velocity_kind), Quantity::Torque.name(self.joint)];
        let units = |name: &str, reading: &Reading| conversion(name, &text(reading)).ok();
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
        self.notes.push("the row below the header is taken for units".into());
        true
    }
}

/// Columns that say which of several joints a row is of, in logs as they are met. `name` is mostly the name of
/// something else.
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

/// Understands a header.
pub(super) fn layout(
    file: &Path,
    names: Vec<String>,
    options: &ReadOptions,
) -> Result<Layout, DataError> {
    let one = one_joint(file, &names, options)?;
    let naming = Naming::new(file, &one.names, &options.columns)?;
    let ros_time = || {
        let reading = naming.find("%time")?;
        Some(Reading { conversion: conversion(TIME, "ns").ok(), ..reading })
    };
    let time = naming.find(TIME).or_else(ros_time);
    let target = target(file, &naming)?;
    let kind = target.map(|target| target.kind);
    let velocity = motion(&naming, &VELOCITIES, kind);
    let position = motion(&naming, &POSITIONS, kind);
    let is_position = velocity.is_none();
    let (Some(time), Some(velocity), Some(target)) = (time, velocity.or(position), target) else {
        let missing = [
            (time.is_none(), TIME, TIME),
            (
                velocity.or(position).is_none(),
                "velocity_rad_s (or velocity_m_s)",
                VELOCITIES[usize::from(kind == Some(JointKind::Prismatic))].0,
            ),
            (target.is_none(), "torque_nm (or force_n)", TARGETS[0].0),
        ];
        return Err(naming.missing(file, &missing));
    };
    let mut notes: Vec<String> = one.note.into_iter().collect();
    if velocity.kind != target.kind {
        let (velocity, target) = (velocity.name, target.name);
        if !naming.is_mapped(velocity) && !naming.is_mapped(target) {
            let fitting = if target == "force_n" { "torque_nm" } else { "force_n" };
            let expected =
                format!("{fitting} for a joint with {velocity} (or --columns to say what it is)");
            return Err(at_header(file, target, target, &expected));
        }
        notes.push(format!(
            "{target} is read with {velocity}, as --columns says: units are those of {target}"
        ));
    }
    let run = naming.find(RUN).map(|reading| reading.index);
    let only = only(file, &naming, &names, options, one.is_chosen)?;
    let used = [time.index, velocity.reading.index, target.reading.index];
    let source = |name: &str, reading: Reading| SourceColumn {
        name: name.into(),
        header: names[reading.index].clone(),
        unit: naming.unit(name).map(str::to_owned),
        ..SourceColumn::default()
    };
    let velocity_name = Quantity::Velocity.name(velocity.kind);
    let mut sources = vec![source(TIME, time)];
    if !is_position {
        sources.push(source(velocity_name, velocity.reading));
    }
    sources.push(source(target.name, target.reading));
    let mut optional = Vec::new();
    let mut left_out = naming.replaced();
    for (reading, name) in naming.columns() {
        let index = reading.index;
        let is_used = used.contains(&index) && !naming.is_mapped(name) || run == Some(index);
        let is_required = [TIME, velocity_name, target.name].contains(&name);
        if one.others.contains(&index) {
            continue;
        }
        if (is_used || is_required) && !(is_position && name == velocity.name) {
            continue;
        }
        match no_covariate(name) {
            None => {
                // In the unit of another joint kind, position is a quantity of its own.
                let quantity = parse_optional(name, velocity.kind);
                let mapped = naming.is_mapped(name);
                sources.push(source(name, reading));
                optional.push(OptionalColumn { quantity, name: name.into(), reading, mapped });
            }
            Some(why) => {
                let nameless = || format!("number {}", index + 1);
                let name = if name.is_empty() { nameless() } else { name.into() };
                left_out.push(LeftOutColumn { name, why: why.into() });
            }
        }
    }
    notes.extend(naming.hints());
    let joint_names = joint_names(&names, &only, run);
    let required = [time, velocity.reading, target.reading];
    let joint = target.kind;
    Ok(Layout {
        joint,
        run,
        required,
        is_position,
        velocity_kind: velocity.kind,
        optional,
        only,
        joint_names,
        left_out,
        notes,
        sources,
        names,
    })
}

/// The columns `--where` goes by: by the name they answer to, else by their own.
fn only(
    file: &Path,
    naming: &Naming,
    names: &[String],
    options: &ReadOptions,
    joint_is_chosen: bool,
) -> Result<Vec<Only>, DataError> {
    let find = |(column, values): &(String, Vec<String>)| {
        let own = || names.iter().position(|name| name == column);
        let index = naming.find(column).map(|reading| reading.index).or_else(own);
        index.map(|index| Only { index, values: values.clone() }).ok_or_else(|| {
            DataError::Request {
                what: format!("{}: --where {column}={}", file.display(), values.join(",")),
                found: format!("no column {column}"),
                expected: format!("one of {}", listed(names)),
            }
        })
    };
    let by_row = options.only.iter().filter(|(column, _)| !(joint_is_chosen && column == JOINT));
    by_row.map(find).collect()
}

/// Columns that may name several joints, but for those that choose a row or its run.
fn joint_names(names: &[String], only: &[Only], run: Option<usize>) -> Vec<NameColumn> {
    let suspect = |(index, name): (usize, &String)| {
        let name = name.trim_start_matches('#').trim().to_lowercase();
        let is_sure = JOINT_NAMES.contains(&name.as_str());
        let is_free = run != Some(index) && only.iter().all(|only| only.index != index);
        (is_free && (is_sure || name == "name")).then_some(NameColumn { index, is_sure })
    };
    names.iter().enumerate().filter_map(suspect).collect()
}

/// A column that tells the joint kind.
#[derive(Debug, Clone, Copy)]
struct KindColumn {
    reading: Reading,
    name: &'static str,
    kind: JointKind,
}

/// The target column, which decides the joint kind; of two, the one `--columns` gives.
fn target(file: &Path, naming: &Naming) -> Result<Option<KindColumn>, DataError> {
    let found = TARGETS
        .map(|(name, kind)| naming.find(name).map(|reading| KindColumn { reading, name, kind }));
    match found {
        [Some(torque), Some(force)] => {
            match (naming.is_mapped(torque.name), naming.is_mapped(force.name)) {
                (true, false) => Ok(Some(torque)),
                (false, true) => Ok(Some(force)),
                _ => {
                    let expected = "one target: torque_nm for a joint that turns or force_n for one that slides";
                    Err(at_header(file, force.name, "torque_nm as well", expected))
                }
            }
        }
        [torque, force] => Ok(torque.or(force)),
    }
}

/// The column of a motion, by its names; of two, the one of the target's kind.
fn motion(
    naming: &Naming,
    names: &[(&'static str, JointKind); 2],
    kind: Option<JointKind>,
) -> Option<KindColumn> {
    let find = |&(name, kind)| naming.find(name).map(|reading| KindColumn { reading, name, kind });
    names.iter().filter_map(find).min_by_key(|of| Some(of.kind) != kind)
}

/// Why a column cannot be a covariate, or `None` if it can.
fn no_covariate(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        Some("it has no name")
    } else if name.starts_with("Unnamed: ") || name == "__index_level_0__" {
        Some("it is the row index of a pandas table")
    } else if TARGETS.iter().any(|(target, _)| *target == name) {
        Some("it is a second target beside the one --columns gives")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn understand(header: &str, columns: &str) -> Result<Layout, String> {
        let names = header.split(',').map(str::to_string).collect();
        let columns: Vec<(String, String)> = columns
            .split(',')
            .filter_map(|pair| pair.split_once('='))
            .map(|(a, b)| (a.to_string(), b.to_string()))
            .collect();
        let options = ReadOptions { columns, ..ReadOptions::default() };
        layout(Path::new("f.csv"), names, &options).map_err(|error| error.to_string())
    }

    fn places(layout: &Layout) -> [usize; 3] {
        layout.required.map(|reading| reading.index)
    }

    #[test]
    fn both_kinds_of_joint_are_known_by_their_target() {
        let turns = understand("time_s,velocity_rad_s,torque_nm,position_rad", "").unwrap();
        assert_eq!((turns.joint, places(&turns)), (JointKind::Revolute, [0, 1, 2]));
        assert_eq!(turns.optional[0].quantity, Some(Quantity::Position));
        let slides = understand("run,force_n,velocity_m_s,time_s,position_m", "").unwrap();
        assert_eq!((slides.joint, places(&slides)), (JointKind::Prismatic, [3, 2, 1]));
        assert_eq!(slides.run, Some(0));
        assert_eq!(slides.optional[0].quantity, Some(Quantity::Position));
    }

    #[test]
    fn what_the_contract_does_not_know_is_an_extra_covariate() {
        let found = understand("time_s,velocity_rad_s,torque_nm,flow,position_m", "").unwrap();
        let extras: Vec<(&str, Option<Quantity>)> =
            found.optional.iter().map(|c| (c.name.as_str(), c.quantity)).collect();
        assert_eq!(extras, [("flow", None), ("position_m", None)]);
    }

    #[test]
    fn missing_columns_are_named_with_what_there_is_and_a_hint() {
        assert_eq!(
            understand("time_s,dq,tau", "").unwrap_err(),
            "f.csv: found only the columns time_s, dq, tau, expected velocity_rad_s (or \
             velocity_m_s) and torque_nm (or force_n) in the header, or --columns \
             velocity_rad_s=dq,torque_nm=tau"
        );
    }

    #[test]
    fn foreign_names_are_translated_and_win() {
        let found =
            understand("t,dq,torque_nm,u", "time_s=t,velocity_rad_s=dq,torque_nm=u").unwrap();
        assert_eq!(places(&found), [0, 1, 3]);
        assert!(found.optional.is_empty());
        assert_eq!(found.left_out[0].name, "torque_nm");
        assert_eq!(found.left_out[0].why, "--columns reads torque_nm from u");
    }

    #[test]
    fn two_names_can_change_places() {
        let found = understand(
            "time_s,velocity_rad_s,torque_nm,load_torque_nm",
            "torque_nm=load_torque_nm,load_torque_nm=torque_nm",
        )
        .unwrap();
        assert_eq!(places(&found), [0, 1, 3]);
        assert_eq!(
            (found.optional[0].quantity, found.optional[0].reading.index),
            (Some(Quantity::LoadTorque), 2)
        );
        assert!(found.left_out.is_empty());
    }

    #[test]
    fn a_pair_with_an_unknown_name_is_an_error_naming_it() {
        let error = understand("t,v,f", "time_s=t,velocity_m_s=speed").unwrap_err();
        assert_eq!(
            error,
            "f.csv: --columns velocity_m_s=speed: found no column speed, expected one of t, v, f"
        );
        let error = understand("t,v,f", "torque_Nm=f").unwrap_err();
        assert!(error.starts_with(
            "--columns torque_Nm=f: found the name torque_Nm, expected one of run, time_s"
        ));
        let error = understand("t,v,f", "time_s=t,time_s=v").unwrap_err();
        assert!(error.contains("found time_s twice"), "{error}");
    }

    #[test]
    fn two_columns_of_one_name_are_an_error() {
        let error = understand("time_s,velocity_rad_s,x,torque_nm,x", "").unwrap_err();
        assert_eq!(
            error,
            "f.csv: row 1, column x: found the name twice (columns 3 and 5), expected each name once"
        );
    }

    #[test]
    fn two_targets_are_an_error_unless_the_pairs_choose() {
        let both = "time_s,velocity_rad_s,torque_nm,force_n";
        assert!(understand(both, "").unwrap_err().contains("expected one target"));
        let chosen = understand("time_s,velocity_rad_s,tau,force_n", "torque_nm=tau").unwrap();
        assert_eq!(chosen.joint, JointKind::Revolute);
        assert_eq!(chosen.left_out[0].name, "force_n");
    }

    #[test]
    fn kinds_are_mixed_only_where_the_pairs_say_so() {
        let error = understand("time_s,velocity_rad_s,force_n", "").unwrap_err();
        assert!(error.contains("expected torque_nm for a joint with velocity_rad_s"), "{error}");
        let mixed = understand("time_s,velocity_m_s,u", "torque_nm=u").unwrap();
        assert_eq!(mixed.joint, JointKind::Revolute);
        assert_eq!(mixed.notes.len(), 1);
    }

    #[test]
    fn a_header_of_numbers_and_nameless_columns_are_told() {
        let error = understand("0.0,1.5,-3e2", "").unwrap_err();
        assert!(error.contains("found numbers, expected the columns' names"), "{error}");
        let found = understand(",time_s,velocity_rad_s,torque_nm", "").unwrap();
        assert_eq!(found.left_out[0].name, "number 1");
    }
}
