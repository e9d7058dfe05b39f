//! The columns that every log has: time, velocity or position, and torque or force.

use crate::cell::CellReader;
use crate::contract::{POSITIONS, TARGETS, TIME, VELOCITIES};
use crate::error::{DataError, at_header};
use crate::naming::Naming;
use crate::row_clock::Timing;
use crate::setting::Setting;
use crate::unit::conversion;
use compensator_core::quantity::JointKind;
use std::path::Path;

/// The required columns of a header.
pub(super) struct RequiredColumns {
    pub time: CellReader,
    /// The velocity, or the position if there is no velocity.
    pub motion: KindColumn,
    pub is_position: bool,
    pub target: KindColumn,
}

impl RequiredColumns {
    /// Finds the required columns.
    ///
    /// # Errors
    /// If one is missing, or if the header has two targets.
    pub fn find(file: &Path, naming: &Naming, timing: Timing) -> Result<Self, DataError> {
        let ros_time = || {
            let reading = naming.find("%time")?;
            Some(CellReader { conversion: conversion(TIME, "ns").ok(), ..reading })
        };
        let target = find_target(file, naming)?;
        let kind = target.map(|target| target.kind);
        let velocity = find_motion(naming, &VELOCITIES, kind);
        let motion = velocity.or_else(|| find_motion(naming, &POSITIONS, kind));
        let time = match timing {
            Timing::Rate(_) => motion.map(|motion| CellReader::plain(motion.reading.index)),
            _ => naming.find(TIME).or_else(ros_time),
        };
        if let (Some(time), Some(motion), Some(target)) = (time, motion, target) {
            return Ok(Self { time, motion, is_position: velocity.is_none(), target });
        }
        let is_timed = time.is_some() || matches!(timing, Timing::Rate(_));
        let (velocity, _) = VELOCITIES[usize::from(kind == Some(JointKind::Prismatic))];
        let missing = [
            (!is_timed).then_some(TIME),
            motion.is_none().then_some(velocity),
            target.is_none().then_some(TARGETS[0].0),
        ];
        Err(naming.missing(file, missing.into_iter().flatten().collect()))
    }

    /// Returns a note if motion and target have units of different joint kinds, which `--columns` must allow.
    pub fn check_kinds(&self, file: &Path, naming: &Naming) -> Result<Option<String>, DataError> {
        if self.motion.kind == self.target.kind {
            return Ok(None);
        }
        let (velocity, target) = (self.motion.name, self.target.name);
        if !naming.is_mapped(velocity) && !naming.is_mapped(target) {
            let fitting = if target == "force_n" { "torque_nm" } else { "force_n" };
            let expected = match target {
                "force_n" => {
                    let lever = Setting::Columns.suggested("torque_nm=force_n:0.2Nm");
                    format!(
                        "{fitting} for a joint with {velocity}; for a force on a lever of 0.2 m {lever}"
                    )
                }
                _ => {
                    let mapping = Setting::Columns.alone();
                    format!(
                        "{fitting} for a joint with {velocity} (or {mapping} to map the columns)"
                    )
                }
            };
            return Err(at_header(file, target, target, &expected));
        }
        Ok(Some(format!(
            "{target} is read with {velocity}, as given with --columns: units are those of {target}"
        )))
    }
}

/// A column whose name states the joint kind.
#[derive(Debug, Clone, Copy)]
pub(super) struct KindColumn {
    pub reading: CellReader,
    pub name: &'static str,
    pub kind: JointKind,
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
