//! Scales of a torque that no log states: the torque of 100 %, and the torque constant of the motor.
//!
//! A drive logs its torque in percent of the rated one, or logs the current that makes it. With the scale, a column in the unit
//! `%` or `A` of `--columns` is converted to Nm or N.

use super::options::ReadOptions;
use super::torque_constant::EXAMPLE;
use super::unit::{Conversion, parse_value, split_register};
use crate::setting::Setting;
use compensator_core::quantity::{JointKind, Quantity};

/// Returns the amperes in one unit of a column: of `A`, `mA`, `-A`, or `0.00269A` for a count.
pub(super) fn amperes(unit: &str) -> Option<f64> {
    let (count, symbol) = split_factor(split_register(unit).1);
    let size = match symbol.replace([' ', '_'], "").to_lowercase().as_str() {
        "a" | "arms" | "amp" | "amps" | "ampere" | "amperes" => 1.0,
        "ma" | "marms" => 1e-3,
        _ => return None,
    };
    Some(count? * size)
}

/// Returns the share of the rated torque in one unit of a column, percent: of `%`, `-%` or `0.1%`.
fn percent(unit: &str) -> Option<f64> {
    let (count, symbol) = split_factor(unit);
    count.filter(|_| symbol == "%")
}

/// Splits a unit into the number before it, 1 if there is none, and its symbol.
fn split_factor(unit: &str) -> (Option<f64>, &str) {
    let at = unit.find(|c: char| c.is_alphabetic() || c == '%').unwrap_or(unit.len());
    let number = match unit[..at].trim() {
        "" => Some(1.0),
        "-" | "−" => Some(-1.0),
        number => number.parse().ok(),
    };
    (number.filter(|number: &f64| number.is_finite()), unit[at..].trim())
}

/// Returns the conversion of a torque or force in percent or amperes, if the scale is given.
pub(super) fn scaled(contract_name: &str, unit: &str, options: &ReadOptions) -> Option<Conversion> {
    let (quantity, joint) = Quantity::parse(contract_name)?;
    let joint = joint.filter(|_| quantity == Quantity::Torque)?;
    let constant = options.torque_constant.filter(|constant| constant.joint == joint);
    let (register, unit) = split_register(unit);
    let of_ampere = || Some(amperes(unit)? * constant?.value);
    let of_percent = || Some(percent(unit)? / 100.0 * options.rated_torque_nm?);
    let size = of_ampere().or_else(of_percent).filter(|size| size.is_normal())?;
    Some(Conversion::of_count(size, register))
}

/// Returns what to type for a torque column in a unit of amperes; `None` for another quantity or unit.
pub(super) fn expected(contract_name: &str, column: &str, unit: &str) -> Option<String> {
    let is_torque = Quantity::parse(contract_name)?.0 == Quantity::Torque;
    amperes(unit).filter(|_| is_torque)?;
    Some(expected_constant(contract_name, column, unit))
}

/// Returns what to type for a torque column in a unit of force; `None` for another quantity or unit.
pub(super) fn expected_lever(contract_name: &str, column: &str, unit: &str) -> Option<String> {
    let newton = parse_value("force_n", &format!("1{}", unit.trim_start_matches('-'))).ok()?;
    let is_torque =
        Quantity::parse(contract_name)? == (Quantity::Torque, Some(JointKind::Revolute));
    let pair = format!("{contract_name}={column}:{}Nm", 0.2 * newton);
    is_torque.then(|| {
        format!("a torque; for a force on a lever of 0.2 m {}", Setting::Columns.suggested(pair))
    })
}

/// Returns what to type for a torque column in amperes.
pub(super) fn expected_constant(contract_name: &str, column: &str, unit: &str) -> String {
    let newton = contract_name.starts_with("force");
    let (example, direct) = if newton { ("40N/A", "40N") } else { (EXAMPLE, "0.105Nm") };
    let direct = match amperes(unit) {
        Some(1.0) | None => direct,
        Some(_) if newton => "0.04N",
        Some(_) => "0.000105Nm",
    };
    let pair = |unit: &str| Setting::Columns.suggested(format!("{contract_name}={column}:{unit}"));
    format!(
        "the torque constant, from the motor's data sheet: {} with {}, or {}",
        pair(unit),
        Setting::TorqueConstant.suggested(example),
        pair(direct)
    )
}

#[cfg(test)]
mod tests {
    use super::super::torque_constant::TorqueConstant;
    use super::super::unit::conversion;
    use super::*;

    #[test]
    fn expected_lever_of_force_names_a_torque() {
        let found = expected_lever("torque_nm", "F", "kN").map(|text| crate::setting::plain(&text));
        let parts = ["0.2 m", "columns torque_nm=F:200Nm"];
        crate::message::check("units", "force on a lever", &found.expect("a hint"), &parts);
        assert_eq!(expected_lever("torque_nm", "F", "rpm"), None);
        assert_eq!(expected_lever("force_n", "F", "N"), None);
    }

    #[test]
    fn scaled_with_scale_returns_torque() {
        let constant = TorqueConstant { value: 0.5, joint: JointKind::Revolute };
        let options = ReadOptions {
            torque_constant: Some(constant),
            rated_torque_nm: Some(2.0),
            ..ReadOptions::default()
        };
        for (name, unit, expected) in [
            ("torque_nm", "A", Some("0.5Nm")),
            ("torque_nm", "-mA", Some("-0.0005Nm")),
            ("torque_nm", "0.25A", Some("0.125Nm")),
            ("torque_nm", "A rms", Some("0.5Nm")),
            ("torque_nm", "0.1%", Some("0.002Nm")),
            ("torque_nm", "-%", Some("-0.02Nm")),
            ("torque_nm", "sign10 0.1%", Some("sign10 0.002Nm")),
            ("torque_nm", "Nm", None),
            ("force_n", "A", None),
            ("velocity_rad_s", "%", None),
        ] {
            let expected = expected.and_then(|unit| conversion(name, unit).ok());
            assert_eq!(scaled(name, unit, &options), expected, "{name} {unit}");
        }
        assert_eq!(scaled("torque_nm", "A", &ReadOptions::default()), None);
    }
}
