//! The error of a header without a required column, with the pairs of `--columns` to type.
//!
//! A user whose columns have other names mostly does not know those of the contract. For several joints, the error shows the
//! pattern of all ([`suggested_map`]); else the only column with a typical name ([`guess::column`]); else `NAME`. It adds the
//! position, which checks and causes need, and the scale of a torque that is a current or the law of a servo.

use super::Naming;
use crate::column_pair::ColumnPair;
use crate::contract::{POSITIONS, TARGETS, VELOCITIES};
use crate::error::{DataError, listed};
use crate::joint_pattern::suggested_map;
use crate::setting::Setting;
use crate::{guess, servo_torque, torque_constant};
use compensator_core::quantity::{JointKind, Quantity};
use std::path::Path;

/// A required column that a header lacks.
pub(crate) struct MissingColumn {
    /// Its contract name.
    pub name: &'static str,
    /// Its name in the message.
    pub in_words: &'static str,
}

/// Stands for a column that the user must know.
const PLACEHOLDER: &str = "NAME";

const POSITION: &str = POSITIONS[0].0;

impl Naming<'_> {
    /// Returns the error for missing columns. If a column of the file probably matches, the message suggests the pair.
    pub fn missing(&self, file: &Path, missing: &[MissingColumn]) -> DataError {
        let free: Vec<&str> = self.columns().map(|(_, name)| name).collect();
        let joints = suggested_map(&free).unwrap_or_default();
        let pair = |name: &'static str| {
            // The position is a motion, too.
            let is_velocity = VELOCITIES.iter().any(|(known, _)| *known == name);
            let position = || is_velocity.then(|| guess::column(POSITION, &free)).flatten();
            let found = joints.pair(name).or_else(|| guess::column(name, &free)).or_else(position);
            found.unwrap_or_else(|| ColumnPair::new(name, PLACEHOLDER, None))
        };
        let mut pairs: Vec<ColumnPair> = missing.iter().map(|column| pair(column.name)).collect();
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
        let names: Vec<&str> = missing.iter().map(|column| column.in_words).collect();
        let names = names.join(" and ");
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
            missing: missing.iter().map(|column| column.name).collect(),
            count: self.names.len(),
        }
    }
}

/// Returns what gives the torque, as the end of what an error expects: of a current the torque constant, and beside a target
/// the gains of the servo.
fn torque_hint(pairs: &[ColumnPair], free: &[&str]) -> String {
    let kind = |pair: &ColumnPair| match Quantity::parse(pair.quantity) {
        Some((Quantity::Torque, kind)) => kind,
        _ => None,
    };
    let Some((torque, kind)) = pairs.iter().find_map(|pair| Some((pair, kind(pair)?))) else {
        return String::new();
    };
    if torque.is_current() {
        let example = if kind == JointKind::Prismatic { "40N/A" } else { torque_constant::EXAMPLE };
        let constant = Setting::TorqueConstant.suggested(example);
        return format!(" with the motor's torque constant, {constant}");
    }
    match free.iter().find(|name| guess::is_position_target(name)) {
        Some(target) if torque.column == PLACEHOLDER => {
            let law = Setting::TorqueFrom.suggested(servo_torque::example(target));
            format!("; without a torque, the gains of the servo give it: {law}")
        }
        _ => String::new(),
    }
}
