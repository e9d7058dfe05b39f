//! Which column of a foreign log is likely meant: for error messages only, never to read by.
//!
//! A user who is told `expected --columns velocity_rad_s=NAME` must open the file to find the name. Where exactly one
//! column is called what such columns are called (`dq_3`, `speed_rpm`, `effort`), the message names it, with
//! the unit its name ends in.

use super::{contract, unit};

/// Words that name a quantity in logs as they are met: drives, ROS, MATLAB.
const WORDS: [(&str, &[&str]); 3] = [
    ("time", &["time", "timestamp", "stamp", "t", "clock", "secs", "%time", "zeit"]),
    (
        "velocity",
        &[
            "velocity", "vel", "speed", "omega", "dq", "qd", "qdot", "dtheta", "w", "v", "rpm",
            "drehzahl",
        ],
    ),
    ("torque", &["torque", "tau", "effort", "moment", "force", "trq", "drehmoment", "kraft"]),
];

/// A longer name is not repeated, bytes.
const LONGEST: usize = 60;

/// A column for that name of the contract, with the unit to be said, where exactly one is likely.
pub(super) fn column(contract_name: &str, columns: &[&str]) -> Option<String> {
    let about = if contract_name.starts_with("force") { "torque" } else { contract_name };
    let (_, words) = WORDS.iter().find(|(of, _)| about.starts_with(of))?;
    let is_alike = |name: &str| {
        let name = name.to_lowercase();
        let mut parts = name.split(|c: char| !c.is_alphabetic() && c != '%');
        parts.any(|part| words.contains(&part))
    };
    let mut likely = columns.iter().filter(|name| is_alike(name));
    let name = likely.next().filter(|_| likely.next().is_none())?;
    // What cannot be typed is no help; a file that is no table may hold anything.
    if name.len() > LONGEST || name.contains(char::is_control) {
        return None;
    }
    Some(match unit::in_name(contract_name, name).filter(|_| *name != "%time") {
        Some(unit) => format!("{name}:{unit}"),
        None => (*name).to_owned(),
    })
}

/// The column of the contract that a name would be but for its unit, and that unit: `pressure_diff_bar`.
pub(super) fn other_unit(name: &str) -> Option<(&'static str, &'static str)> {
    contract::names().find_map(|contract_name| {
        let unit = unit::in_name(contract_name, name)?;
        let stem = contract_name.split('_').next()?;
        name.to_lowercase().starts_with(stem).then_some((contract_name, unit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_named_where_one_alone_is_likely() {
        let columns = ["t (ms)", "speed_rpm", "tau_3", "dq_des", "note"];
        assert_eq!(column("time_s", &columns).as_deref(), Some("t (ms):ms"));
        assert_eq!(column("velocity_rad_s", &columns), None, "speed_rpm or dq_des");
        assert_eq!(column("velocity_rad_s", &columns[..3]).as_deref(), Some("speed_rpm:rpm"));
        assert_eq!(column("torque_nm", &columns).as_deref(), Some("tau_3"));
        assert_eq!(column("time_s", &["%time", "field.velocity0"]).as_deref(), Some("%time"));
    }

    #[test]
    fn a_covariate_in_another_unit_is_seen() {
        assert_eq!(other_unit("pressure_diff_bar"), Some(("pressure_diff_pa", "bar")));
        assert_eq!(other_unit("temperature_k"), Some(("temperature_c", "K")));
        assert_eq!(other_unit("position_deg"), Some(("position_rad", "deg")));
        assert_eq!(other_unit("flow_bar"), None);
        assert_eq!(other_unit("pressure_diff_pa"), None);
    }
}
