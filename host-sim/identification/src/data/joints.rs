//! Several joints side by side in one table: `velocity_rad_s_1`, `torque_nm_1`, `velocity_rad_s_2`, ...
//!
//! Where a header has no target of its own but targets with a number behind their names, each number is a joint. Its columns
//! are those of the contract with that number behind them, and any other name that comes with the number
//! of every joint; what has no number (time, temperature) is of all. Reading is of one joint at a time:
//! `--where joint=2` says which, and the others' columns are left out.

use std::path::Path;

use super::contract::{self, POSITIONS, TARGETS, VELOCITIES};
use super::error::{DataError, listed};
use super::read::ReadOptions;
use compensator_core::quantity::JointKind;

/// The column `--where` names where joints stand side by side.
pub(super) const JOINT: &str = "joint";

/// A header of which one joint was taken.
#[derive(Debug, Default)]
pub(super) struct OneJoint {
    /// The names as one joint would have them, in the order of the file.
    pub names: Vec<String>,
    /// Columns of other joints, by their place in the file.
    pub others: Vec<usize>,
    /// The same for a reader, in a line.
    pub note: Option<String>,
    /// Whether the header holds joints side by side at all.
    pub is_chosen: bool,
}

/// A name and the number behind it.
fn numbered(name: &str) -> Option<(&str, &str)> {
    let (head, number) = name.rsplit_once('_')?;
    let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    (is_number && !head.is_empty()).then_some((head, number))
}

fn is_of(table: &[(&str, JointKind)], name: &str) -> bool {
    table.iter().any(|(known, _)| *known == name)
}

/// Numbers of the joints side by side in a header, in their order; none where the header has a target of its own.
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

/// Takes one joint of a header: the one that is asked for, or the only one.
///
/// # Errors
/// [`DataError::SeveralJoints`] where there are several and none is asked for.
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
                    what: format!("{}: --where {JOINT}={}", file.display(), values.join(",")),
                    found: format!("no joint {unknown}"),
                    expected: format!("of {}", listed(&joints)),
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
        format!("{}: {count} columns are of other joints ({})", file.display(), listed(&others))
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
    fn a_joint_has_its_own_columns_and_those_of_all() {
        let second = take(ARM, Some("2")).unwrap();
        assert_eq!(second.note.unwrap(), "arm.csv: 3 columns are of other joints (1)");
        assert_eq!(second.names[4..], ["torque_nm", "velocity_rad_s", "tension", "cell_1"]);
        assert_eq!(second.others, [1, 2, 3]);
    }

    #[test]
    fn several_are_told_and_an_unknown_one_refused() {
        let several = take(ARM, None).unwrap_err();
        assert!(
            several.contains("2 joints side by side (1, 2)") && several.contains("--where joint=1"),
            "{several}"
        );
        assert!(take(ARM, Some("3")).unwrap_err().contains("no joint 3"));
    }

    #[test]
    fn a_table_of_one_joint_is_left_alone() {
        let plain = take("time_s,velocity_rad_s,torque_nm,current_1,torque_nm_2", None).unwrap();
        assert!(!plain.is_chosen && plain.others.is_empty());
        let only = take("time_s,velocity_rad_s_4,torque_nm_4", None).unwrap();
        assert_eq!(only.names, ["time_s", "velocity_rad_s", "torque_nm"]);
    }
}
