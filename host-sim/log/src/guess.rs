//! Suggestion of the column that probably holds a quantity, for error messages only.
//!
//! A message `expected --columns velocity_rad_s=NAME` sends the user to the file to find the name. If exactly one column
//! has a typical name of the quantity (`dq_3`, `speed_rpm`, `effort`), the message names it, with the unit at the end
//! of its name.

use super::contract;
use super::name_words::{is_among, parts};
use super::other_unit::{OtherUnit, other_unit};
use super::unit;
use compensator_core::quantity::Quantity;

/// Words that name a quantity in logs of drives, ROS and MATLAB.
const WORDS: [(&str, &str); 3] = [
    ("time", "time timestamp stamp t clock secs %time zeit uhrzeit temps heure ts millis micros"),
    (
        "velocity",
        "velocity velo vel speed omega dq qd qdot dtheta w v rpm drehzahl geschwindigkeit istgeschwindigkeit vitesse gyro \
         gyroscope",
    ),
    ("torque", "torque tau effort moment force trq drehmoment kraft istmoment couple"),
];

/// Words that name the other quantities in a description of columns.
const OTHER_WORDS: [(&str, &str); 4] = [
    ("position_rad", "position pos angle theta q"),
    ("temperature_c", "temperature temp"),
    ("pressure_diff_pa", "pressure druck"),
    ("acceleration_rad_s2", "acceleration accel ddq"),
];

/// Words of a value that is not measured.
const NOT_MEASURED: &str = "des desired cmd command ref reference target goal setpoint limit max min err error std cov filt";

/// Minimum length of a word that is recognised inside another word (`ActVelo` has none, `motorspeed` has one).
const MIN_INNER_CHARS: usize = 4;

/// Returns how well a name fits a quantity: 0 does not fit.
pub(super) fn score(contract_name: &str, name: &str) -> u32 {
    let about = if contract_name.starts_with("force") { "torque" } else { contract_name };
    let words = WORDS.iter().find(|(of, _)| about.starts_with(of)).map(|(_, words)| *words);
    let other = OTHER_WORDS.iter().find(|(of, _)| *of == contract_name).map(|(_, words)| *words);
    let Some(words) = words.or(other) else { return 0 };
    let parts = parts(name);
    let is_measured = !parts.iter().any(|part| is_among(NOT_MEASURED, part));
    if is_current(name) {
        return if about.starts_with("torque") && is_measured { 3 } else { 0 };
    }
    let fits = |part: &String| is_among(words, part);
    let inner = |word: &str| {
        let is_long = word.len() >= MIN_INNER_CHARS;
        // The beginning of a long word, too: `Velo`, `Temp`.
        let begins = |part: &String| part.len() >= MIN_INNER_CHARS && word.starts_with(&**part);
        is_long && parts.iter().any(|part| part.contains(word) || begins(part))
    };
    let fit = match (parts.last().is_some_and(fits), parts.iter().any(fits)) {
        (true, _) => 6,
        (false, true) => 4,
        _ if words.split(' ').any(inner) => 2,
        _ => return 0,
    };
    if is_measured { fit } else { 1 }
}

/// Returns true if a name is that of a commanded position: `q_des`, `target_position`.
pub(super) fn is_position_target(name: &str) -> bool {
    const TARGETS: &str = "des desired cmd command ref reference target goal setpoint";
    let parts = parts(name);
    let is_position = |part: &String| is_among("position pos angle theta q", part);
    parts.iter().any(is_position) && parts.iter().any(|part| is_among(TARGETS, part))
}

/// Returns true if a column is a current by its name or unit.
pub(super) fn is_current(name: &str) -> bool {
    matches!(other_unit(name), Some(OtherUnit::Ampere | OtherUnit::Milliampere))
}

/// Returns the contract name of the quantity that a name fits best; that of a rotary joint.
pub(super) fn quantity(name: &str) -> Option<&'static str> {
    if let Some(own) = contract::names().find(|known| *known == name) {
        return Some(own);
    }
    let all = ["time_s", "velocity_rad_s", "torque_nm"].into_iter();
    let all = all.chain(OTHER_WORDS.iter().map(|(of, _)| *of));
    let scored = all.map(|of| (score(of, name), of)).filter(|(score, _)| *score > 0);
    // Of equal scores, the first: `max_by_key` would return the last.
    scored.rev().max_by_key(|(score, _)| *score).map(|(_, of)| of)
}

/// Returns true if both contract names are of one quantity, of either joint kind.
pub(super) fn is_same_quantity(one: &str, other: &str) -> bool {
    let quantity = |name: &str| Quantity::parse(name).map(|(quantity, _)| quantity);
    one == other || quantity(one).is_some() && quantity(one) == quantity(other)
}

/// Returns the unit at the end of a name, of any quantity of the contract. Units of one letter are too common.
pub(super) fn any_unit(name: &str) -> Option<&'static str> {
    unit::any_in_name(name).filter(|unit| unit.len() > 1)
}

/// Returns the contract name of the motion or torque of a rotary joint that a name's unit fits: `bucket_deg_s`.
pub(super) fn by_unit(name: &str) -> Option<&'static str> {
    let unit = any_unit(name)?;
    ["velocity_rad_s", "position_rad", "torque_nm"]
        .into_iter()
        .find(|of| unit::conversion(of, unit).is_ok())
}

/// Symbol of a torque. It is a time only if no other column is.
pub(super) const TORQUE_SYMBOL: &str = "T";

/// Maximum length of a suggested name, bytes.
const MAX_NAME_BYTES: usize = 60;

/// Returns the column that probably holds a contract name, with its unit, if exactly one does.
pub(super) fn column(contract_name: &str, columns: &[&str]) -> Option<String> {
    let about = if contract_name.starts_with("force") { "torque" } else { contract_name };
    let (_, words) = WORDS.iter().find(|(of, _)| about.starts_with(of))?;
    let is_alike =
        |name: &str| !is_current(name) && parts(name).iter().any(|part| is_among(words, part));
    let all: Vec<&&str> = columns.iter().filter(|name| is_alike(name)).collect();
    // Of several times, the one with a unit: `ts_us` beside `T`.
    let with_unit = all.iter().filter(|name| unit::stated(contract_name, name).is_some());
    let with_unit: Vec<&&str> = with_unit.copied().collect();
    let likely = if all.len() > 1 && about.starts_with("time") { with_unit } else { all };
    let is_torque_symbol = |name: &&&str| about.starts_with("torque") && **name == TORQUE_SYMBOL;
    let symbol = columns.iter().find(is_torque_symbol).or_else(|| {
        let is_likely = |name: &&&str| score(contract_name, name) > 1 && is_current(name);
        let mut currents = columns.iter().filter(is_likely);
        currents.next().filter(|_| about.starts_with("torque") && currents.next().is_none())
    });
    let name = match (likely.as_slice(), symbol) {
        ([name], _) => *name,
        ([], Some(symbol)) => symbol,
        _ => return None,
    };
    // A name that cannot be typed does not help, and a file that is not a table may hold anything.
    if name.len() > MAX_NAME_BYTES || name.contains(char::is_control) {
        return None;
    }
    Some(match unit::in_name(contract_name, name).filter(|_| *name != "%time") {
        Some(unit) => format!("{name}:{unit}"),
        None => match other_unit(name) {
            Some(other) => format!("{name}:{}", other.suggestion()),
            None => (*name).to_owned(),
        },
    })
}

/// Returns the contract name of a quantity and the unit that `name` ends in, as for `pressure_diff_bar`.
pub(super) fn quantity_in_unit(name: &str) -> Option<(&'static str, &'static str)> {
    let mut names = contract::names().filter(|name| !contract::is_joint_position(name));
    names.find_map(|contract_name| {
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
    fn column_with_time_and_torque_symbol_tells_them_apart() {
        let columns = ["ts_us", "w", "T"];
        assert_eq!(column("time_s", &columns).as_deref(), Some("ts_us:us"));
        assert_eq!(column("torque_nm", &columns).as_deref(), Some("T"));
        assert_eq!(column("torque_nm", &["I [A]", "Torque [%]"]).as_deref(), Some("Torque [%]:%"));
        assert_eq!(column("torque_nm", &["I [A]", "w"]).as_deref(), Some("I [A]:A"));
        assert_eq!(column("torque_nm", &["i_q", "i_q_ref", "q"]).as_deref(), Some("i_q:A"));
        assert_eq!(column("torque_nm", &["i_1 [A]", "i_2 [A]"]), None);
    }

    #[test]
    fn quantity_of_current_is_torque() {
        for name in ["i_q", "Iq_measured", "current", "motor_current [mA]", "I [A]", "MotorCurrent"]
        {
            assert_eq!(quantity(name), Some("torque_nm"), "{name}");
        }
        assert_eq!(quantity("q"), Some("position_rad"));
        assert_eq!(quantity("current_position"), Some("position_rad"));
        assert_eq!(quantity("currentVelocity"), Some("velocity_rad_s"));
        assert_eq!(quantity("i_d [A]"), Some("torque_nm"), "by its unit");
    }

    #[test]
    fn unit_of_two_words_is_not_its_last_letter() {
        assert_eq!(any_unit("bucket_deg_s"), Some("deg/s"));
        assert_eq!(any_unit("bucket_deg"), Some("deg"));
        assert_eq!(any_unit("bucket_s"), None);
        assert_eq!(
            (by_unit("bucket_deg_s"), by_unit("boom_nm")),
            (Some("velocity_rad_s"), Some("torque_nm"))
        );
        assert_eq!(unit::stated("time_s", "bucket_deg_s"), None);
        assert_eq!(unit::stated("time_s", "stamp_s"), Some("s"));
    }

    #[test]
    fn quantity_in_unit_with_covariate_in_known_unit_returns_it() {
        assert_eq!(quantity_in_unit("pressure_diff_bar"), Some(("pressure_diff_pa", "bar")));
        assert_eq!(quantity_in_unit("temperature_k"), Some(("temperature_c", "K")));
        assert_eq!(quantity_in_unit("position_deg"), Some(("position_rad", "deg")));
        assert_eq!(quantity_in_unit("flow_bar"), None);
        assert_eq!(quantity_in_unit("pressure_diff_pa"), None);
    }
}
