//! Columns whose names suggest a quantity of the contract: `temperature_gear_c`, `side_load_n`.
//!
//! A column without a name of the contract is tested as any covariate is: by a curve that must gain much. As the
//! temperature it is tested by the laws of temperature. The name alone does not decide, so the option is suggested.

use crate::setting::shell_word;
use crate::{Dataset, unit_in_name};
use compensator_core::quantity::{JointKind, Quantity};

/// A quantity with words of its names. One word of each group must occur.
type Words = (Quantity, &'static [&'static [&'static str]]);

const WORDS: [Words; 6] = [
    (Quantity::Temperature, &[&["temperature", "temperatur", "temp", "thermo"]]),
    (Quantity::Pressure, &[&["pressure", "press", "druck", "dp"]]),
    (Quantity::RadialForce, &[&["side", "radial", "lateral", "transverse"], &["load", "force"]]),
    (Quantity::LoadTorque, &[&["load", "external", "ext"], &["torque", "moment", "tau"]]),
    (Quantity::Acceleration, &[&["acceleration", "accel", "acc"]]),
    (Quantity::Position, &[&["position", "pos", "angle", "theta"]]),
];

/// Words of a value that was not measured at the joint.
const OTHER_WORDS: &str = "set setpoint ref reference cmd command commanded des desired target goal limit max min ambient \
                           room error rate";

/// Maximum number of suggestions.
const MAX_SUGGESTIONS: usize = 3;

/// Returns a note for each column that may be a quantity which the log lacks.
pub fn suggestions(data: &Dataset) -> Vec<String> {
    let is_there = |quantity: Quantity| data.runs.iter().all(|run| run.get(quantity).is_some());
    // Several pressures are those of chambers, of which none is the difference across a seal.
    let is_pressure = |name: &&String| quantity(name) == Some(Quantity::Pressure);
    let pressures = data.covariates.iter().filter(is_pressure).count();
    let suggestion = |name: &String| {
        let quantity = quantity(name).filter(|of| !is_there(*of))?;
        if quantity == Quantity::Pressure && pressures > 1 {
            return None;
        }
        let contract_name = quantity.name(data.joint);
        let unit = unit_in_name(contract_name, name);
        let unit = unit.map_or_else(String::new, |unit| format!(":{unit}"));
        let pair = shell_word(&format!("{contract_name}={name}{unit}"));
        Some(format!("{name} is read as a covariate; --columns {pair} reads it as {contract_name}"))
    };
    let is_varied = |(at, _): &(usize, &String)| {
        data.runs.iter().any(|run| run.extra[*at].iter().any(|value| *value != run.extra[*at][0]))
            || data.runs.len() > 1
    };
    let varied = data.covariates.iter().enumerate().filter(is_varied);
    varied.filter_map(|(_, name)| suggestion(name)).take(MAX_SUGGESTIONS).collect()
}

/// Returns the quantity that a name suggests.
pub(crate) fn quantity(name: &str) -> Option<Quantity> {
    let is_named = [JointKind::Revolute, JointKind::Prismatic]
        .iter()
        .any(|joint| Quantity::ALL.iter().any(|quantity| quantity.name(*joint) == name));
    if is_named {
        // A quantity of the other joint kind.
        return None;
    }
    let lower = name.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphabetic()).collect();
    if OTHER_WORDS.split(' ').any(|other| words.contains(&other)) {
        return None;
    }
    let is_alike = |(_, groups): &&Words| {
        groups.iter().all(|group| words.iter().any(|word| group.contains(word)))
    };
    WORDS.iter().find(is_alike).map(|(quantity, _)| *quantity)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(names: &[&str]) -> Dataset {
        let names: Vec<String> = ["time_s", "velocity_rad_s", "torque_nm"]
            .iter()
            .chain(names)
            .map(|n| (*n).to_owned())
            .collect();
        let columns = names.iter().map(|_| vec![0.0, 1.0, 2.0]).collect();
        Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("columns")
    }

    #[test]
    fn suggestions_with_nearly_known_names_return_the_option() {
        for (name, pair) in [
            ("temperature_gear_c", "temperature_c=temperature_gear_c"),
            ("temp_motor", "temperature_c=temp_motor"),
            ("Oil Temp (F)", "'temperature_c=Oil Temp (F):degF'"),
            ("p_press_bar", "pressure_diff_pa=p_press_bar:bar"),
            ("side_load_n", "radial_force_n=side_load_n"),
            ("load_moment_mNm", "load_torque_nm=load_moment_mNm:mNm"),
            ("theta_deg", "position_rad=theta_deg:deg"),
        ] {
            let notes = suggestions(&log(&[name]));
            assert_eq!(notes.len(), 1, "{name}");
            let option = format!("--columns {pair} ");
            crate::message::require(&notes[0], &[name, &option]);
        }
        let note = &suggestions(&log(&["temp_motor"]))[0];
        crate::message::check("checks", "nearly named", note, &["temperature_c"]);
    }

    #[test]
    fn suggestions_with_known_quantity_or_other_names_return_none() {
        for names in [
            &["temperature_c", "temp_motor"][..],
            &["temperature_ambient_c"],
            &["pressure_left_pa", "pressure_right_pa"],
            &["position_target"],
            &["flow", "current_a", "tension_n", "position_m", "expression"],
        ] {
            assert_eq!(suggestions(&log(names)), [""; 0], "{names:?}");
        }
    }
}
