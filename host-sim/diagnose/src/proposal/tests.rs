//! Proposals with and without a gain on held-out rows.

use super::*;
use crate::fixtures::{
    HandMadeLog, LogRow, cause, extension, linear_base, linear_torque, names, pressure_torque,
    with_search,
};

/// Returns the proposal of an extension by `causes`.
fn proposed(log: &TrainTest, causes: &[&str]) -> Proposal {
    let propose = |search: &Search| propose(search, log, extension(search, causes), None);
    with_search(log, propose).expect("few terms")
}

/// Returns friction whose level depends on the temperature in the first four runs only.
fn early_torque(row: &LogRow) -> f64 {
    let slope = if row.run < 4 { -0.02 } else { 0.0 };
    linear_torque(row) + slope * (row.temperature_c - 30.0) * row.direction()
}

#[test]
fn propose_with_real_cause_keeps_it_with_its_gain() {
    let proposal = proposed(&HandMadeLog::new(pressure_torque).train_test(), &["pressure-coulomb"]);
    assert_eq!(names(&proposal.extension.found), ["pressure-coulomb"]);
    assert!(proposal.taken_back.is_empty() && proposal.decisions.is_empty());
    let rmse = [proposal.before.metrics.rmse, proposal.after.metrics.rmse];
    assert!((proposal.gain.value - (1.0 - rmse[1] / rmse[0])).abs() < 1e-9, "{rmse:?}");
    assert!(proposal.gain.ci95[0] > 0.5, "{:?}", proposal.gain);
    assert_eq!(proposal.left_out, Some(LeftOut::Runs));
    assert!(proposal.extended.is_some());
}

#[test]
fn propose_with_cause_absent_from_held_out_runs_withdraws_it() {
    let log = HandMadeLog::new(early_torque).train_test_without(&[4, 5]);
    let proposal = proposed(&log, &["temperature-coulomb"]);
    assert!(proposal.extension.found.is_empty() && proposal.extended.is_none());
    assert!(proposal.extension.model.spec.terms.is_empty());
    assert_eq!(proposal.taken_back, [CauseIdentity::new(cause("temperature-coulomb"), None)]);
    assert_eq!(proposal.decisions[0].rejection.rule, &rules::NO_GAIN);
    assert_eq!((proposal.gain, proposal.left_out), (Gain::default(), None));
    assert_eq!(proposal.before.metrics, proposal.after.metrics);
}

#[test]
fn propose_with_impossible_cause_withdraws_only_that_one() {
    // The torque falls with the square of the speed, as no drag does.
    let log = HandMadeLog::new(|row| {
        pressure_torque(row) - 0.2 * row.velocity_rad_s.powi(2) * row.direction()
    });
    let proposal = proposed(&log.train_test(), &["quadratic-drag", "pressure-coulomb"]);
    assert_eq!(names(&proposal.extension.found), ["pressure-coulomb"]);
    assert_eq!(proposal.taken_back, [CauseIdentity::new(cause("quadratic-drag"), None)]);
    assert_eq!(proposal.decisions[0].rejection.rule, &rules::UNPHYSICAL);
}

#[test]
fn propose_with_cause_without_effect_withdraws_only_that_one() {
    let log = HandMadeLog::new(pressure_torque).train_test();
    let proposal = proposed(&log, &["pressure-coulomb", "temperature-coulomb"]);
    assert_eq!(names(&proposal.extension.found), ["pressure-coulomb"]);
    assert_eq!(proposal.decisions[0].rejection.rule, &rules::SPANS_NO_EFFECT);
    assert_eq!(proposal.decisions[0].columns, ["temperature_c"]);
    assert!(proposal.gain.ci95[0] > 0.5, "{:?}", proposal.gain);
}

#[test]
fn propose_with_given_prediction_compares_with_it() {
    let log = HandMadeLog::new(pressure_torque).train_test();
    let mut given = linear_base(&log).on_test(&log);
    given.metrics.rmse = 1.0;
    let propose = |search: &Search| {
        propose(search, &log, extension(search, &["pressure-coulomb"]), Some(given))
    };
    let proposal = with_search(&log, propose).expect("few terms");
    assert_eq!(proposal.before.metrics.rmse, 1.0);
}

#[test]
fn gains_too_little_depends_on_interval_and_share() {
    let log = HandMadeLog::new(pressure_torque).train_test();
    let before = linear_base(&log).on_train(&log);
    let rule = |value: f64, low: f64| {
        let gain = Gain { value, ci95: [low, 2.0 * value - low] };
        gains_too_little(&log, &before, &gain).map(|rejection| rejection.rule)
    };
    assert_eq!(rule(0.3, -0.01), Some(&rules::NO_GAIN));
    assert_eq!(rule(0.003, 0.001), Some(&rules::NEGLIGIBLE));
    assert_eq!(rule(0.3, 0.2), None);
}
