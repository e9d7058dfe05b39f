//! The words of a column's name.

/// Words that name a motor's current. The current `i_q` makes the torque.
const CURRENT_WORDS: &str = "current iq strom motorstrom courant corriente amps ampere amperes";

/// Words beside which `current` means the present value, or a current that makes no torque.
const NOT_CURRENT_WORDS: &str = "position pos angle velocity vel speed time stamp timestamp temperature temp step state mode \
                                 voltage d id";

/// Names of columns that identify a row's joint. A column `name` mostly names something else and is treated
/// separately.
pub(super) const JOINT_NAMES: &str = "joint joint_name joint_id joint_index axis axis_name axis_id motor motor_id motor_name \
                           actuator actuator_id drive node_id controller controller_id";

/// Names of columns of dates beside a column of times of day.
pub(super) const DATE_NAMES: [&str; 5] = ["date", "datum", "day", "fecha", "data"];

/// Words that name a voltage or the duty cycle that makes it.
const VOLTAGE_WORDS: &str = "voltage volt volts spannung tension voltaje vbus vbat vbatt vdc vin vout vcc vdd vmot vsupply vq vd \
                             valpha vbeta ubat udc ubus uq ud pwm duty emf";

/// Words behind a `v` or `u` that is a voltage: `v_bus`.
const SUPPLY_WORDS: &str =
    "bus bat batt battery dc in out supply motor mot link cc dd q d alpha beta phase";

/// Returns true if a name is that of a voltage: `v_bus`, `Spannung`, `u [V]`, `V`. A transducer's signal is not: `Torque (V)`.
pub(super) fn is_voltage(name: &str) -> bool {
    // A field of an object: `state.v`.
    let last = name.rsplit('.').next().unwrap_or(name).trim();
    let volts = ["[V]", "(V)", "{V}"].iter().find_map(|unit| last.strip_suffix(unit));
    let of_last = parts(volts.unwrap_or(last));
    let has = |parts: &[String], words: &str| parts.iter().any(|part| is_among(words, part));
    let is_symbol = of_last.first().is_some_and(|first| is_among("v u", first));
    last == "V"
        || has(&parts(name), VOLTAGE_WORDS)
        || volts.is_some() && has(&of_last, "v u")
        || is_symbol && has(&of_last[1..], SUPPLY_WORDS)
}

/// Returns true if a word is one of some words.
pub(super) fn is_among(words: &str, word: &str) -> bool {
    words.split(' ').any(|of| of == word)
}

/// Returns the words of a name in lower case. A capital inside a word begins another one.
pub(super) fn parts(name: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    let mut was_lower = false;
    for c in name.chars() {
        if !c.is_alphabetic() && c != '%' || c.is_uppercase() && was_lower {
            parts.push(String::new());
        }
        was_lower = c.is_lowercase();
        if c.is_alphabetic() || c == '%' {
            parts.last_mut().into_iter().for_each(|part| part.extend(c.to_lowercase()));
        }
    }
    parts.retain(|part| !part.is_empty());
    parts
}

/// Returns true if a name is that of a motor's current: `i_q`, `motor_current`, `Strom`.
pub(super) fn is_motor_current(name: &str) -> bool {
    let parts = parts(name);
    let is_iq = parts.windows(2).any(|pair| pair[0] == "i" && pair[1] == "q");
    let is_named = parts.iter().any(|part| is_among(CURRENT_WORDS, part));
    (is_iq || is_named) && !parts.iter().any(|part| is_among(NOT_CURRENT_WORDS, part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_motor_current_with_current_of_the_flux_axis_returns_false() {
        assert!(is_motor_current("MotorCurrent"));
        assert!(!is_motor_current("id_current"));
    }
}
