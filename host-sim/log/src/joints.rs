//! Several joints side by side in one table: `velocity_rad_s_1`, `torque_nm_1`, `velocity_rad_s_2`, ...
//!
//! If a header has no plain target but targets with a number as suffix, each number identifies a joint. The columns
//! of a joint are the contract names with its number, and every other name that occurs with the numbers of all
//! joints. Columns without a number (time, temperature) belong to all joints. One joint is read at a time:
//! `--where joint=2` selects it, and the columns of the others are left out.

use std::path::Path;

use super::contract::{self, POSITIONS, TARGETS, VELOCITIES};
use super::error::{DataError, asked_rows, listed};
use super::options::ReadOptions;
use compensator_core::quantity::JointKind;

/// The name that `--where` uses to select one of several joints side by side.
pub(super) const JOINT: &str = "joint";

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
    let joints = numbers(names, options);
    if joints.is_empty() {
        return Ok(OneJoint { names: names.to_vec(), ..OneJoint::default() });
    }
    let asked = options.only.iter().find(|(column, _)| column == JOINT).map(|(_, values)| values);
    let chosen: Vec<&String> = match asked {
        None => joints.iter().collect(),
        Some(values) => {
            let unknown = values.iter().find(|value| !joints.contains(value));
            if let Some(unknown) = unknown {
                return Err(DataError::Request {
                    what: format!("{}: {}", file.display(), asked_rows(JOINT, values)),
                    found: format!("no joint {unknown}"),
                    expected: format!("one of {}", listed(&joints)),
                });
            }
            values.iter().collect()
        }
    };
    let [joint] = chosen[..] else {
        return Err(DataError::SeveralJoints {
            file: file.into(),
            place: "side by side".into(),
            column: JOINT.into(),
            joints: chosen.into_iter().cloned().collect(),
        });
    };
    let of_all = |head: &str| {
        joints.iter().all(|number| names.iter().any(|name| *name == format!("{head}_{number}")))
    };
    let mut taken = OneJoint { is_chosen: true, ..OneJoint::default() };
    for (index, name) in names.iter().enumerate() {
        let of_joint = numbered(name).filter(|(head, number)| {
            let is_known = contract::names().any(|known| known == *head);
            joints.iter().any(|joint| joint == number) && (is_known || of_all(head))
        });
        match of_joint {
            Some((head, number)) if number == joint => taken.names.push(head.to_owned()),
            Some(_) => {
                taken.names.push(name.clone());
                taken.others.push(index);
            }
            None => taken.names.push(name.clone()),
        }
    }
    let others: Vec<&String> = joints.iter().filter(|number| *number != joint).collect();
    taken.note = (!others.is_empty()).then(|| {
        let count = taken.others.len();
        format!("{}: {count} columns belong to other joints ({})", file.display(), listed(&others))
    });
    Ok(taken)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(second.note.unwrap(), "arm.csv: 3 columns belong to other joints (1)");
        assert_eq!(second.names[4..], ["torque_nm", "velocity_rad_s", "tension", "cell_1"]);
        assert_eq!(second.others, [1, 2, 3]);
    }

    #[test]
    fn one_joint_with_several_or_unknown_joint_returns_error() {
        let several = take(ARM, None).unwrap_err();
        assert!(
            several.contains("2 joints side by side (1, 2)")
                && several.contains("one: where joint=1"),
            "{several}"
        );
        assert!(take(ARM, Some("3")).unwrap_err().contains("no joint 3"));
    }

    #[test]
    fn one_joint_with_table_of_one_joint_leaves_names_unchanged() {
        let plain = take("time_s,velocity_rad_s,torque_nm,current_1,torque_nm_2", None).unwrap();
        assert!(!plain.is_chosen && plain.others.is_empty());
        let only = take("time_s,velocity_rad_s_4,torque_nm_4", None).unwrap();
        assert_eq!(only.names, ["time_s", "velocity_rad_s", "torque_nm"]);
    }
}
