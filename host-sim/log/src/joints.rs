//! Several joints side by side in one table: `velocity_rad_s_1`, `torque_nm_1`, `velocity_rad_s_2`, ...
//!
//! If a header has no plain target but targets with a number as suffix, each number identifies a joint. The columns
//! of a joint are the contract names with its number, and every other name that occurs with the numbers of all
//! joints. Columns without a number (time, temperature) belong to all joints. Names of any form are told apart by a map
//! with a sign in place of the joint ([`super::joint_pattern`]). One joint is read at a time: `--joint 2` selects it. Of
//! the others, velocity and acceleration stay as covariates, and their other columns are left out.

use std::path::Path;

use super::contract::{self, POSITIONS, TARGETS, VELOCITIES};
use super::error::{DataError, asked_rows, listed};
use super::joint_pattern::JointMap;
use super::options::ReadOptions;
use compensator_core::quantity::{JointKind, Quantity};

/// The name that `--where` uses to select one of several joints side by side.
pub const JOINT: &str = "joint";

/// A header reduced to one joint.
#[derive(Debug, Default)]
pub(super) struct OneJoint {
    /// The names without the joint's number, in the order of the file.
    pub names: Vec<String>,
    /// Indices of the columns that belong to other joints.
    pub others: Vec<usize>,
    /// A note on the other joints, for the report.
    pub note: Option<String>,
    /// True if the header holds joints side by side.
    pub is_chosen: bool,
    /// The pairs of `--columns` of this joint.
    pub pairs: Vec<(String, String)>,
}

/// Splits a name into its stem and its number suffix.
fn numbered(name: &str) -> Option<(&str, &str)> {
    let (head, number) = name.rsplit_once('_')?;
    let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    (is_number && !head.is_empty()).then_some((head, number))
}

fn is_of(table: &[(&str, JointKind)], name: &str) -> bool {
    table.iter().any(|(known, _)| *known == name)
}

/// Returns the numbers of the joints side by side, in their order. Empty if the header has a plain target.
fn numbers(names: &[String], options: &ReadOptions) -> Vec<String> {
    let is_target = |name: &str| is_of(&TARGETS, name);
    let given = options.columns.iter().any(|(ours, _)| is_target(ours));
    if given || names.iter().any(|name| is_target(name)) {
        return Vec::new();
    }
    let moves = |number: &str| {
        names
            .iter()
            .filter_map(|name| numbered(name))
            .any(|(head, of)| of == number && (is_of(&VELOCITIES, head) || is_of(&POSITIONS, head)))
    };
    let mut found: Vec<String> = Vec::new();
    for (head, number) in names.iter().filter_map(|name| numbered(name)) {
        if is_target(head) && moves(number) && !found.iter().any(|known| known == number) {
            found.push(number.to_owned());
        }
    }
    found
}

/// Reduces a header to one joint: the selected one, or the only one.
///
/// # Errors
/// [`DataError::SeveralJoints`] if there are several and none is selected.
pub(super) fn one_joint(
    file: &Path,
    names: &[String],
    options: &ReadOptions,
) -> Result<OneJoint, DataError> {
    let map = JointMap::find(names, &options.columns);
    let joints = match &map {
        Some(map) => map.joints.clone(),
        None => numbers(names, options),
    };
    if joints.is_empty() {
        // A map without a joint is refused where its columns are looked up.
        let pairs = options.columns.clone();
        return Ok(OneJoint { names: names.to_vec(), pairs, ..OneJoint::default() });
    }
    let joint = chosen(file, &joints, options)?;
    let mut taken = match &map {
        Some(map) => by_map(map, names, joint),
        None => by_number(names, &joints, joint, options),
    };
    let others: Vec<&String> = joints.iter().filter(|other| *other != joint).collect();
    taken.note = (!others.is_empty()).then(|| {
        let count = taken.others.len();
        format!("{}: {count} columns belong to other joints ({})", file.display(), listed(&others))
    });
    Ok(taken)
}

/// Returns the joint that is asked for, or the only one.
fn chosen<'j>(
    file: &Path,
    joints: &'j [String],
    options: &ReadOptions,
) -> Result<&'j String, DataError> {
    let asked = options.only.iter().find(|(column, _)| column == JOINT).map(|(_, values)| values);
    let chosen: Vec<&String> = match asked {
        None => joints.iter().collect(),
        Some(values) => {
            let unknown = values.iter().find(|value| !joints.contains(value));
            if let Some(unknown) = unknown {
                return Err(DataError::request(
                    format!("{}: {}", file.display(), asked_rows(JOINT, values)),
                    format!("no joint {unknown}"),
                    format!("one of {}", listed(joints)),
                ));
            }
            joints.iter().filter(|joint| values.contains(joint)).collect()
        }
    };
    match chosen[..] {
        [joint] => Ok(joint),
        _ => Err(DataError::SeveralJoints {
            file: file.into(),
            place: "side by side".into(),
            column: JOINT.into(),
            joints: chosen.into_iter().cloned().collect(),
        }),
    }
}

/// Takes one joint by a map with a sign in place of the joint.
fn by_map(map: &JointMap, names: &[String], joint: &str) -> OneJoint {
    let mut taken = OneJoint { is_chosen: true, pairs: map.pairs_of(joint), ..OneJoint::default() };
    for (index, name) in names.iter().enumerate() {
        let mut others = map.joints.iter().filter(|other| *other != joint);
        let motion = others.clone().find_map(|other| map.other_motion(name, other));
        if motion.is_none() && others.any(|other| map.is_of(name, other, joint, names)) {
            taken.others.push(index);
        }
        taken.names.push(motion.unwrap_or_else(|| name.clone()));
    }
    taken
}

/// Takes one joint by the number at the end of the contract names.
fn by_number(names: &[String], joints: &[String], joint: &str, options: &ReadOptions) -> OneJoint {
    let of_all = |head: &str| {
        joints.iter().all(|number| names.iter().any(|name| *name == format!("{head}_{number}")))
    };
    let pairs = options.columns.clone();
    let mut taken = OneJoint { is_chosen: true, pairs, ..OneJoint::default() };
    for (index, name) in names.iter().enumerate() {
        let of_joint = numbered(name).filter(|(head, number)| {
            let is_known = contract::names().any(|known| known == *head);
            joints.iter().any(|joint| joint == number) && (is_known || of_all(head))
        });
        match of_joint {
            Some((head, number)) if number == joint => taken.names.push(head.to_owned()),
            Some((head, _)) => {
                taken.names.push(name.clone());
                if !is_motion(head) {
                    taken.others.push(index);
                }
            }
            None => taken.names.push(name.clone()),
        }
    }
    taken
}

/// Returns true for a velocity or an acceleration: of another joint, it may move this one.
fn is_motion(name: &str) -> bool {
    let quantity = Quantity::parse(name).map(|(quantity, _)| quantity);
    matches!(quantity, Some(Quantity::Velocity | Quantity::Acceleration))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;

    fn take(header: &str, only: Option<&str>) -> Result<OneJoint, String> {
        let names: Vec<String> = header.split(',').map(str::to_owned).collect();
        let only =
            only.map(|value| (JOINT.to_owned(), vec![value.to_owned()])).into_iter().collect();
        let options = ReadOptions { only, ..ReadOptions::default() };
        one_joint(Path::new("arm.csv"), &names, &options).map_err(|error| error.to_string())
    }

    const ARM: &str = "time_s,torque_nm_1,velocity_rad_s_1,tension_1,torque_nm_2,velocity_rad_s_2,tension_2,cell_1";

    #[test]
    fn one_joint_with_selection_keeps_own_and_common_columns() {
        let second = take(ARM, Some("2")).unwrap();
        let parts = ["arm.csv", "2 columns", "(1)"];
        message::check("headers", "columns of other joints", &second.note.unwrap(), &parts);
        assert_eq!(second.names[4..], ["torque_nm", "velocity_rad_s", "tension", "cell_1"]);
        assert_eq!(second.others, [1, 3], "the other joint's velocity stays");
    }

    #[test]
    fn one_joint_with_several_or_unknown_joint_returns_error() {
        let several = take(ARM, None).unwrap_err();
        let parts = ["arm.csv", "2 joints", "(1, 2)", "where joint=1"];
        message::check("headers", "joints side by side", &several, &parts);
        let unknown = take(ARM, Some("3")).unwrap_err();
        message::check("headers", "unknown joint", &unknown, &["joint=3", "joint 3", "1, 2"]);
    }

    #[test]
    fn one_joint_with_table_of_one_joint_leaves_names_unchanged() {
        let plain = take("time_s,velocity_rad_s,torque_nm,current_1,torque_nm_2", None).unwrap();
        assert!(!plain.is_chosen && plain.others.is_empty());
        let only = take("time_s,velocity_rad_s_4,torque_nm_4", None).unwrap();
        assert_eq!(only.names, ["time_s", "velocity_rad_s", "torque_nm"]);
    }
}
