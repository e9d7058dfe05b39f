//! Suggestion of the column that probably holds a quantity, for error messages only.
//!
//! A message `expected --columns velocity_rad_s=NAME` sends the user to the file to find the name. If exactly one column
//! has a typical name of the quantity (`dq_3`, `speed_rpm`, `effort`), the message names it, with the unit at the end
//! of its name.

use super::column_pair::ColumnPair;
use super::contract;
use super::log_check::nearly_named;
use super::name_words::{is_among, is_voltage, parts};
use super::other_unit::{OtherUnit, other_unit};
use super::unit;
use compensator_core::quantity::{JointKind, Quantity};

/// Quantities: how the contract names begin, the one of a rotary joint, and words that name the quantity in logs of drives, ROS
/// and MATLAB.
const WORDS: [(&str, &str, &str); 7] = [
    (
        "time",
        "time_s",
        "time timestamp stamp t clock secs %time zeit uhrzeit temps heure ts millis micros",
    ),
    (
        "velocity",
        "velocity_rad_s",
        "velocity velo vel speed omega dq qd qdot dtheta w v rpm drehzahl geschwindigkeit istgeschwindigkeit vitesse gyro \
         gyroscope",
    ),
    ("torque", "torque_nm", "torque tau effort moment force trq drehmoment kraft istmoment couple"),
    ("position_rad", "position_rad", "position pos angle theta q"),
    ("temperature_c", "temperature_c", "temperature temp"),
    ("pressure_diff_pa", "pressure_diff_pa", "pressure druck"),
    ("acceleration_rad_s2", "acceleration_rad_s2", "acceleration accel ddq"),
];

/// The rows of [`WORDS`] with columns that an error asks for.
const REQUIRED: std::ops::Range<usize> = 0..4;

/// Words of a value that is not measured.
const NOT_MEASURED: &str = "des desired cmd command ref reference target goal setpoint limit max min err error std cov filt \
                            const constant rated nominal";

/// Minimum length of a word that is recognised inside another word (`ActVelo` has none, `motorspeed` has one).
const MIN_INNER_CHARS: usize = 4;

/// Returns how well a name fits a quantity: 0 does not fit.
pub(super) fn score(contract_name: &str, name: &str) -> u32 {
    let about = if contract_name.starts_with("force") { "torque" } else { contract_name };
    let row = WORDS.iter().find(|(begin, ..)| about.starts_with(begin));
    let Some((.., words)) = row.filter(|_| !is_voltage(name)) else { return 0 };
    // A unit is no word of the name: `Torque (V)`.
    let parts = parts(unit::without_brackets(name));
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
    if let Some(known) = contract::names().find(|known| *known == name) {
        return Some(known);
    }
    let scored =
        WORDS.iter().map(|(_, of, _)| (score(of, name), *of)).filter(|(score, _)| *score > 0);
    // Of equal scores, the first: `max_by_key` would return the last.
    scored.rev().max_by_key(|(score, _)| *score).map(|(_, of)| of)
}

/// Returns true if a word names a measured quantity. One letter is too short: `v2` is a version.
pub(super) fn is_channel(word: &str) -> bool {
    let is_measured = |of: &str| WORDS[1..].iter().any(|(_, known, _)| *known == of);
    word.len() > 1 && quantity(word).is_some_and(is_measured)
}

/// Returns true if both contract names are of one quantity, of either joint kind.
pub(super) fn is_same_quantity(one: &str, other: &str) -> bool {
    let quantity = |name: &str| Quantity::parse(name).map(|(quantity, _)| quantity);
    one == other || quantity(one).is_some() && quantity(one) == quantity(other)
}

/// Returns the unit at the end of a name, of any quantity of the contract. Units of one letter are too common, except for that of
/// a force (`F_N`), and `min` mostly is a minimum.
pub(super) fn any_unit(name: &str) -> Option<&'static str> {
    let last = name.rsplit(['_', ' ', '.', '-']).next().filter(|last| *last != name);
    let is_long = last.unwrap_or(name).len() > 1 && last != Some("min");
    let is_explicit = last == Some("N") || name.ends_with([']', ')', '}']);
    let is_clear = |unit: &&str| is_explicit || unit.contains('/') || is_long && unit.len() > 1;
    unit::any_in_name(name).filter(is_clear)
}

/// Returns the contract name of the quantity that a column's unit, in its name or in the file, fits, except for a time:
/// `bucket_deg_s`.
fn by_unit(name: &str, in_file: &str) -> Option<&'static str> {
    let unit = any_unit(name).unwrap_or(in_file);
    contract::names()
        .skip_while(|of| *of != "velocity_rad_s")
        .find(|of| unit::conversion(of, unit).is_ok())
}

/// Returns the contract names of a quantity: its own, and that of a linear axis.
pub(super) fn of_both_kinds(of: &str) -> [&str; 2] {
    [of, Quantity::parse(of).map_or(of, |(quantity, _)| quantity.name(JointKind::Prismatic))]
}

/// Returns the contract name of a quantity in the kind of joint that the unit of a column states, in its name or in the file.
pub(super) fn in_stated_kind<'a>(of: &'a str, name: &str, in_file: &str) -> Option<&'a str> {
    let is_stated =
        |of: &&str| unit::stated(of, name).is_some() || unit::conversion(of, in_file).is_ok();
    of_both_kinds(of).into_iter().find(is_stated)
}

/// Returns the contract name that a column's words and unit fit, or its unit alone.
///
/// # Errors
/// Returns the quantity of the words, if the unit contradicts it.
pub(super) fn by_name(name: &str, in_file: &str) -> Result<Option<&'static str>, &'static str> {
    let is_load = |of: &Quantity| matches!(of, Quantity::RadialForce | Quantity::LoadTorque);
    let load = nearly_named::quantity(name).filter(is_load);
    let words = load.map(|of| of.name(JointKind::Revolute)).or_else(|| quantity(name));
    let Some(of) = words else { return Ok(by_unit(name, in_file)) };
    let is_force =
        of == "torque_nm" && parts(name).iter().any(|part| is_among("force kraft", part));
    match (in_stated_kind(of, name, in_file), any_unit(name)) {
        (None, Some(_)) if parts(name)[0].len() > 1 => Err(of),
        // A symbol of one letter has many meanings: `T_degC`.
        (None, Some(_)) => Ok(by_unit(name, in_file)),
        (stated, _) => Ok(stated.or(Some(of_both_kinds(of)[usize::from(is_force)]))),
    }
}

/// Returns true if a name is that of an experiment, and its values are constant over blocks of rows.
pub(super) fn is_run(name: &str, values: &[f64]) -> bool {
    let changes = values.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > 0.0).count();
    let is_named = |first: &String| is_among("run exp experiment trial", first);
    parts(name).first().is_some_and(is_named) && MIN_ROWS_OF_RUN * changes <= values.len()
}

/// Minimum mean number of rows of an experiment.
const MIN_ROWS_OF_RUN: usize = 20;

/// Symbol of a torque. It is a time only if no other column is.
pub(super) const TORQUE_SYMBOL: &str = "T";

/// Maximum length of a suggested name, bytes.
const MAX_NAME_BYTES: usize = 60;

/// Returns the pair of the column that probably holds a contract name, if exactly one does.
pub(super) fn column(contract_name: &'static str, columns: &[&str]) -> Option<ColumnPair> {
    let about = if contract_name.starts_with("force") { "torque" } else { contract_name };
    let (.., words) = WORDS[REQUIRED].iter().find(|(begin, ..)| about.starts_with(begin))?;
    let is_alike = |name: &str| {
        let parts = parts(name);
        let is_other = is_current(name) || is_voltage(name);
        let is_constant = parts.iter().any(|part| is_among("const constant", part));
        !is_other && !is_constant && parts.iter().any(|part| is_among(words, part))
    };
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
    let of = in_stated_kind(contract_name, name, "").unwrap_or(contract_name);
    // The unit of ROS's stamps is known.
    let stated = unit::in_name(of, name).filter(|_| *name != "%time");
    let unit = stated.or_else(|| other_unit(name).map(OtherUnit::suggestion));
    Some(ColumnPair::new(of, name, unit))
}

/// The quantity that a column may hold.
#[derive(Clone, Default)]
pub(super) struct Guess {
    /// Its contract name.
    pub quantity: &'static str,
    /// Its unit, if `--columns` needs one.
    pub unit: Option<String>,
    /// Other units that the sizes of the values allow; `None` for that of the contract.
    pub other_units: Vec<Option<&'static str>>,
    /// True if the column's name states its unit.
    pub is_known: bool,
    /// True if the unit is by the size of the values.
    pub is_by_size: bool,
    /// True if it is a time in steps between rows.
    pub is_step: bool,
    /// True if the file has no names.
    pub is_numbered: bool,
}

impl Guess {
    /// Sets the units that the sizes of the values allow, the most probable first. `is_shown` is true if they allow one alone.
    pub fn set_units(&mut self, units: &[Option<&'static str>], is_shown: bool) {
        let [first, others @ ..] = units else { return };
        self.unit = first.map(str::to_owned);
        self.other_units = others.iter().copied().filter(|unit| unit != first).collect();
        self.is_by_size = first.is_some() || !self.other_units.is_empty();
        self.is_known |= is_shown;
    }

    /// Returns the pair that reads a column in a unit.
    pub fn pair(&self, name: &str, unit: Option<&str>) -> ColumnPair {
        let Self { quantity, is_step, is_numbered, .. } = *self;
        ColumnPair { is_step, is_numbered, ..ColumnPair::new(quantity, name, unit) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(contract_name: &'static str, columns: &[&str]) -> Option<String> {
        column(contract_name, columns).map(|pair| pair.to_string())
    }

    #[test]
    fn column_with_one_probable_name_returns_it() {
        let columns = ["t (ms)", "speed_rpm", "tau_3", "dq_des", "note"];
        assert_eq!(pair("time_s", &columns).as_deref(), Some("time_s=t (ms):ms"));
        assert_eq!(pair("velocity_rad_s", &columns), None, "speed_rpm or dq_des");
        assert_eq!(
            pair("velocity_rad_s", &columns[..3]).as_deref(),
            Some("velocity_rad_s=speed_rpm:rpm")
        );
        assert_eq!(pair("torque_nm", &columns).as_deref(), Some("torque_nm=tau_3"));
        assert_eq!(pair("time_s", &["%time", "field.velocity0"]).as_deref(), Some("time_s=%time"));
    }

    #[test]
    fn by_name_follows_the_unit_of_the_name() {
        for (name, expected) in [
            ("v_mm_s", Ok(Some("velocity_m_s"))),
            ("vel_mm_per_s", Ok(Some("velocity_m_s"))),
            ("w_rpm", Ok(Some("velocity_rad_s"))),
            ("x_mm", Ok(Some("position_m"))),
            ("pos_m", Ok(Some("position_m"))),
            ("F_N", Ok(Some("force_n"))),
            ("load_cell_kN", Ok(Some("force_n"))),
            ("force_3", Ok(Some("force_n"))),
            ("side_load_N", Ok(Some("radial_force_n"))),
            ("T_degC", Ok(Some("temperature_c"))),
            ("p_psi", Ok(Some("pressure_diff_pa"))),
            ("t_ms", Ok(Some("time_s"))),
            // A minimum, a motor, a joint.
            ("x_min", Ok(None)),
            ("F", Ok(None)),
            ("tau_a", Ok(Some("torque_nm"))),
            ("pos_nm", Err("position_rad")),
            ("torque_bar", Err("torque_nm")),
        ] {
            assert_eq!(by_name(name, ""), expected, "{name}");
        }
        assert_eq!(by_name("pos", "mm"), Ok(Some("position_m")), "by the file");
        assert_eq!(by_name("Achse 1", "rpm"), Ok(Some("velocity_rad_s")), "by the file alone");
    }

    #[test]
    fn is_run_with_exponent_returns_false() {
        let blocks: Vec<f64> = (0..100).map(|row| f64::from(row / 50)).collect();
        let curve: Vec<f64> = (0..100).map(|row| (0.1 * f64::from(row)).exp()).collect();
        assert!(is_run("exp", &blocks) && is_run("trial_no", &blocks) && is_run("exp", &[]));
        assert!(!is_run("exp", &curve) && !is_run("speed", &blocks));
    }

    #[test]
    fn column_with_time_and_torque_symbol_tells_them_apart() {
        let columns = ["ts_us", "w", "T"];
        assert_eq!(pair("time_s", &columns).as_deref(), Some("time_s=ts_us:us"));
        assert_eq!(pair("torque_nm", &columns).as_deref(), Some("torque_nm=T"));
        assert_eq!(
            pair("torque_nm", &["I [A]", "Torque [%]"]).as_deref(),
            Some("torque_nm=Torque [%]:%")
        );
        assert_eq!(pair("torque_nm", &["I [A]", "w"]).as_deref(), Some("torque_nm=I [A]:A"));
        assert_eq!(pair("torque_nm", &["i_q", "i_q_ref", "q"]).as_deref(), Some("torque_nm=i_q:A"));
        assert_eq!(pair("torque_nm", &["i_1 [A]", "i_2 [A]"]), None);
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
    fn quantity_of_voltage_is_none() {
        for name in [
            "V",
            "voltage",
            "motor_voltage",
            "v_bus",
            "Vdc",
            "u_q [V]",
            "Speed voltage",
            "U_bat",
            "V_supply",
            "volts",
            "bus_voltage_V",
            "v [V]",
            "state.V [V]",
            "Spannung",
        ] {
            assert_eq!(by_name(name, ""), Ok(None), "{name}");
            assert_eq!(pair("velocity_rad_s", &["t", name, "tau"]), None, "{name}");
        }
        for name in ["v", "v_m_s", "v_act", "vel", "Speed (V)", "v_1"] {
            assert!(quantity(name) == Some("velocity_rad_s"), "{name}");
        }
        assert_eq!(quantity("Torque (V)"), Some("torque_nm"), "of a transducer");
    }

    #[test]
    fn unit_of_two_words_is_not_its_last_letter() {
        assert_eq!(any_unit("bucket_deg_s"), Some("deg/s"));
        assert_eq!(any_unit("bucket_deg"), Some("deg"));
        assert_eq!(any_unit("bucket_s"), None);
        assert_eq!(
            (by_unit("bucket_deg_s", ""), by_unit("boom_nm", "")),
            (Some("velocity_rad_s"), Some("torque_nm"))
        );
        assert_eq!(unit::stated("time_s", "bucket_deg_s"), None);
        assert_eq!(unit::stated("time_s", "stamp_s"), Some("s"));
    }
}
