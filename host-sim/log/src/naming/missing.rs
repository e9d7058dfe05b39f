//! The error of a header without a required column, with the pairs of `--columns` to type.
//!
//! For several joints, the error shows the pattern of all ([`suggested_map`]); else the only column with a typical name
//! ([`guess::column`]); else `NAME`. It adds the position, which checks need, and what makes a torque of a current or a target.

use super::Naming;
use crate::column_pair::ColumnPair;
use crate::contract::{POSITIONS, TARGETS, VELOCITIES};
use crate::error::{DataError, listed};
use crate::joint_pattern::suggested_map;
use crate::setting::Setting;
use crate::{guess, servo_torque, torque_constant};
use compensator_core::quantity::{JointKind, Quantity};
use std::path::Path;

/// Stands for a column that the user must know.
const PLACEHOLDER: &str = "NAME";

const POSITION: &str = POSITIONS[0].0;

impl Naming<'_> {
    /// Returns the error for missing columns of these contract names. If a column of the file probably matches, the message
    /// suggests the pair.
    pub fn missing(&self, file: &Path, missing: Vec<&'static str>) -> DataError {
        let free: Vec<&str> = self.columns().map(|(_, name)| name).collect();
        let joints = suggested_map(&free).unwrap_or_default();
        let pair = |name: &'static str| {
            // The position is a motion, too.
            let is_velocity = VELOCITIES.iter().any(|(known, _)| *known == name);
            let position = || is_velocity.then(|| guess::column(POSITION, &free)).flatten();
            let found = joints.pair(name).or_else(|| guess::column(name, &free)).or_else(position);
            found.unwrap_or_else(|| ColumnPair::new(name, PLACEHOLDER, None))
        };
        let mut pairs: Vec<ColumnPair> = missing.iter().map(|name| pair(name)).collect();
        // Checks and causes need the position, also beside a velocity.
        let is_there =
            POSITIONS.iter().any(|(name, _)| free.contains(name) || self.is_mapped(name));
        let guessed = || guess::column(POSITION, &free).filter(|_| !is_there);
        let position = joints.pair(POSITION).or_else(guessed);
        let is_read = |of: &ColumnPair| pairs.iter().any(|pair| pair.column == of.column);
        pairs.extend(position.filter(|pair| !is_read(pair)));
        // The current of a linear motor makes a force.
        if pairs.iter().any(|pair| [VELOCITIES[1].0, POSITIONS[1].0].contains(&pair.quantity)) {
            let torques = pairs.iter_mut().filter(|pair| pair.quantity == TARGETS[0].0);
            let currents = torques.filter(|pair| pair.is_current());
            currents.for_each(|pair| pair.quantity = TARGETS[1].0);
        }
        let all: Vec<String> = pairs.iter().map(ColumnPair::to_string).collect();
        let pairs = Setting::Columns.suggested(all.join(",")) + &torque_hint(&pairs, &free);
        let in_words = |name: &&str| match Quantity::parse(name) {
            Some((of, Some(_))) => {
                let [turns, slides] =
                    [JointKind::Revolute, JointKind::Prismatic].map(|kind| of.name(kind));
                format!("{turns} (or {slides})")
            }
            _ => (*name).to_owned(),
        };
        let names = missing.iter().map(in_words).collect::<Vec<_>>().join(" and ");
        DataError::MissingColumns {
            file: file.into(),
            found: format!("only the columns {}", listed(self.names)),
            expected: match joints.joints.len() {
                0 => format!("{names} in the header, or {pairs}"),
                count => format!(
                    "{names} in the header, or, for {count} joints ({}), {pairs}",
                    listed(&joints.joints)
                ),
            },
            pairs: pairs.into(),
            missing: missing.into(),
            count: self.names.len(),
        }
    }
}

/// Returns what gives the torque, as the end of what an error expects: of a current the torque constant, and beside a target
/// the gains of the servo.
fn torque_hint(pairs: &[ColumnPair], free: &[&str]) -> String {
    let [(torque, _), (force, _)] = TARGETS;
    let target = pairs.iter().find(|pair| [torque, force].contains(&pair.quantity));
    let Some(target) = target else { return String::new() };
    if target.is_current() {
        let example = if target.quantity == force { "40N/A" } else { torque_constant::EXAMPLE };
        let constant = Setting::TorqueConstant.suggested(example);
        return format!(" with the motor's torque constant, {constant}");
    }
    match free.iter().find(|name| guess::is_position_target(name)) {
        Some(demand) if target.column == PLACEHOLDER => {
            let law = Setting::TorqueFrom.suggested(servo_torque::example(demand));
            format!("; without a torque, the gains of the servo give it: {law}")
        }
        _ => String::new(),
    }
}
