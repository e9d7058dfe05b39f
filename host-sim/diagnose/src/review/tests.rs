//! Review of causes that are real, redundant or confounded.

use super::*;
use crate::fixtures::{
    HandMadeLog, cause, extension, linear_torque, names, pressure_torque, with_search,
};

/// Returns the causes after a review of an extension by `causes`, and those that it removed.
fn reviewed(log: &HandMadeLog, causes: &[&str]) -> (Extension, Vec<CauseIdentity>) {
    with_search(&log.train_test(), |search| {
        let mut extension = extension(search, causes);
        let lost = review(search, &mut extension, &[]).expect("few terms");
        (extension, lost)
    })
}

#[test]
fn review_with_real_cause_keeps_it_with_its_evidence() {
    let log = HandMadeLog::new(pressure_torque);
    let (extension, lost) = reviewed(&log, &["pressure-coulomb"]);
    assert_eq!((names(&extension.found), lost), (vec!["pressure-coulomb"], vec![]));
    let found = &extension.found[0];
    assert!(found.probability > 0.5 && found.share > 0.5, "{found:?}");
    assert!(found.evidence.reduction_in_errors > 3.0, "{:?}", found.evidence);
    assert!(found.evidence.stability > 0.9, "{:?}", found.evidence);
}

#[test]
fn review_with_cause_that_another_explains_removes_it() {
    // The temperature follows the pressure in part, so that it correlates with the level.
    let log = HandMadeLog::new(pressure_torque);
    let (extension, lost) = reviewed(&log, &["temperature-coulomb", "pressure-coulomb"]);
    assert_eq!(names(&extension.found), ["pressure-coulomb"]);
    assert_eq!(lost, [CauseIdentity::new(cause("temperature-coulomb"), None)]);
    assert_eq!(extension.model.spec.terms, [cause("pressure-coulomb").remedy().term().unwrap()]);
}

#[test]
fn review_with_correlated_cause_alone_replaces_it() {
    let log = HandMadeLog::new(pressure_torque);
    let (extension, lost) = reviewed(&log, &["temperature-coulomb"]);
    assert_eq!(names(&extension.found), ["pressure-coulomb"]);
    assert_eq!(lost, [CauseIdentity::new(cause("temperature-coulomb"), None)]);
}

#[test]
fn review_with_nothing_hidden_removes_all() {
    let log = HandMadeLog::new(linear_torque);
    let (extension, lost) = reviewed(&log, &["pressure-coulomb", "temperature-coulomb"]);
    assert!(extension.found.is_empty() && extension.model.spec.terms.is_empty());
    assert_eq!(lost.len(), 2);
}

#[test]
fn review_with_two_causes_puts_stronger_first() {
    let log = HandMadeLog::new(|row| {
        pressure_torque(row) - 0.01 * (row.temperature_c - 30.0) * row.direction()
    });
    let (extension, lost) = reviewed(&log, &["temperature-coulomb", "pressure-coulomb"]);
    assert_eq!(names(&extension.found), ["pressure-coulomb", "temperature-coulomb"]);
    assert!(lost.is_empty(), "{lost:?}");
    assert!(extension.found[0].share > extension.found[1].share);
}
