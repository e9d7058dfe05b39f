//! Rules that reject an accepted cause by its fit to all rows.

use super::*;
use crate::fixtures::{
    HandMadeLog, LogRow, cause, extension, linear_torque, pressure_torque, with_search,
};
use crate::outcome;
use crate::rules::Rule;
use compensator_core::ParameterId;

/// Returns a log, a cause that was added to the linear law, and the fit of both to all rows.
fn fitted(torque_nm: impl Fn(&LogRow) -> f64, cause: &str) -> (TrainTest, AcceptedCause, Outcome) {
    let log = HandMadeLog::new(torque_nm).train_test();
    let (found, outcome) = with_search(&log, |search| {
        let extension = extension(search, &[cause]);
        let outcome = outcome(&log, &extension.model).expect("few terms");
        (extension.found[0].clone(), outcome)
    });
    (log, found, outcome)
}

fn rule((log, found, outcome): &(TrainTest, AcceptedCause, Outcome)) -> Option<&'static Rule> {
    found.rejection(outcome, log).map(|rejection| rejection.rule)
}

/// Returns friction with a part that grows with the square of the speed, in Nm s^2/rad^2.
fn drag_torque(drag: f64) -> impl Fn(&LogRow) -> f64 {
    move |row| linear_torque(row) + drag * row.velocity_rad_s.powi(2) * row.direction()
}

#[test]
fn rejection_of_real_cause_is_none() {
    assert_eq!(rule(&fitted(pressure_torque, "pressure-coulomb")), None);
    assert_eq!(rule(&fitted(drag_torque(0.2), "quadratic-drag")), None);
}

#[test]
fn rejection_of_drag_that_drives_is_unphysical_size() {
    assert_eq!(rule(&fitted(drag_torque(-0.2), "quadratic-drag")), Some(&rules::UNPHYSICAL));
}

#[test]
fn rejection_of_cause_without_effect_spans_no_effect() {
    let fitted = fitted(linear_torque, "pressure-coulomb");
    assert_eq!(rule(&fitted), Some(&rules::SPANS_NO_EFFECT));
}

#[test]
fn rejection_with_own_parameter_at_bound_names_it() {
    let mut fitted = fitted(pressure_torque, "pressure-coulomb");
    let mut set_state = |id: ParameterId, state: State| {
        let estimate = fitted.2.estimates.iter_mut().find(|own| own.id == id);
        estimate.expect("an estimate").state = state;
        fitted.1.rejection(&fitted.2, &fitted.0)
    };
    // A parameter of the law does not belong to the cause.
    assert_eq!(set_state(ParameterId::ViscousFriction, State::AtBound), None);
    let rejection = set_state(ParameterId::PressureCoulomb, State::AtBound).expect("a rejection");
    assert_eq!(rejection.rule, &rules::AT_BOUND);
    assert!(rejection.why.contains(ParameterId::PressureCoulomb.name()), "{}", rejection.why);
}

#[test]
fn finding_with_rival_names_both_and_their_columns() {
    let (log, mut found, outcome) = fitted(pressure_torque, "pressure-coulomb");
    let rival = cause("temperature-coulomb");
    let columns = vec!["temperature_c".to_owned()];
    found.rivals = vec![ConfoundedCause { cause: rival, columns, share: 0.85 }];
    found.probability = 0.7;
    let finding = found.finding(&outcome, &log);
    assert_eq!((finding.cause.name(), finding.probability), ("pressure-coulomb", 0.7));
    assert_eq!(finding.columns, ["pressure_diff_pa"]);
    let rival = "temperature-coulomb (temperature_c), which would explain 85 % of it";
    assert!(finding.in_words.contains(rival), "{}", finding.in_words);
    let size = finding.size.value;
    assert!((size / 0.5e-6 - 1.0).abs() < 0.1, "{size}");
}
