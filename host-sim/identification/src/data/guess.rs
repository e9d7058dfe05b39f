//! Suggestion of the column that probably holds a quantity, for error messages only.
//!
//! A message `expected --columns velocity_rad_s=NAME` sends the user to the file to find the name. If exactly one column
//! has a typical name of the quantity (`dq_3`, `speed_rpm`, `effort`), the message names it, with the unit at the end
//! of its name.

use super::contract;
use super::unit;

/// Words that name a quantity in logs of drives, ROS and MATLAB.
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

/// Maximum length of a suggested name, bytes.
const MAX_NAME_BYTES: usize = 60;

/// Returns the column that probably holds a contract name, with its unit, if exactly one does.
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
    // A name that cannot be typed does not help, and a file that is not a table may hold anything.
    if name.len() > MAX_NAME_BYTES || name.contains(char::is_control) {
        return None;
    }
    Some(match unit::in_name(contract_name, name).filter(|_| *name != "%time") {
        Some(unit) => format!("{name}:{unit}"),
        None => (*name).to_owned(),
    })
}

/// Returns the contract name of a quantity and the unit that `name` ends in, as for `pressure_diff_bar`.
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
    fn column_with_one_probable_name_returns_it() {
        let columns = ["t (ms)", "speed_rpm", "tau_3", "dq_des", "note"];
        assert_eq!(column("time_s", &columns).as_deref(), Some("t (ms):ms"));
        assert_eq!(column("velocity_rad_s", &columns), None, "speed_rpm or dq_des");
        assert_eq!(column("velocity_rad_s", &columns[..3]).as_deref(), Some("speed_rpm:rpm"));
        assert_eq!(column("torque_nm", &columns).as_deref(), Some("tau_3"));
        assert_eq!(column("time_s", &["%time", "field.velocity0"]).as_deref(), Some("%time"));
    }

    #[test]
    fn other_unit_with_covariate_in_known_unit_returns_it() {
        assert_eq!(other_unit("pressure_diff_bar"), Some(("pressure_diff_pa", "bar")));
        assert_eq!(other_unit("temperature_k"), Some(("temperature_c", "K")));
        assert_eq!(other_unit("position_deg"), Some(("position_rad", "deg")));
        assert_eq!(other_unit("flow_bar"), None);
        assert_eq!(other_unit("pressure_diff_pa"), None);
    }
}
