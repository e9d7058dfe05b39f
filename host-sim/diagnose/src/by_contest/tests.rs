//! Answers of the contest on logs with a known cause.

use super::*;
use crate::fixtures::{HandMadeLog, LogRow, linear_torque, pressure_torque};

fn answer_to(torque_nm: impl Fn(&LogRow) -> f64) -> Answer {
    let log = HandMadeLog::new(torque_nm).train_test();
    answer(log, &DiagnosisOptions::default(), &|_| {}).expect("few terms")
}

#[test]
fn answer_to_pressure_names_it_with_a_gain() {
    let found = answer_to(pressure_torque);
    let names: Vec<&str> = found.findings.iter().map(|own| own.cause.name()).collect();
    assert_eq!(names.first(), Some(&"pressure-coulomb"), "{names:?}");
    assert!(found.extended.spec.terms.contains(&TermKind::PressureCoulomb));
    assert!(found.gain.value > 0.3 && found.gain.ci95[0] > 0.0, "{:?}", found.gain);
    assert!(found.findings[0].probability >= NAMED);
}

#[test]
fn answer_to_plain_friction_offers_nothing() {
    let found = answer_to(linear_torque);
    assert!(found.findings.is_empty(), "{:?}", found.findings);
    assert_eq!(found.gain, Gain::default());
    assert_eq!(found.extended.spec, found.baseline.spec);
}

#[test]
fn scores_of_unnamed_causes_hold_the_reason() {
    let found = answer_to(pressure_torque);
    for score in scores(&found.weighed) {
        let weighed = score.weighed.expect("a cause of the contest");
        assert_eq!(weighed.is_named(), score.rejection.is_none());
    }
}
