//! Rules of a round, and its order of candidates.

use super::*;
use crate::fixtures::{
    HandMadeLog, LogRow, base, bristle_torque, linear_base, linear_torque, pressure_torque,
};
use crate::rules::Rule;
use compensator_core::LawKind;

/// Returns the round beside the linear law.
fn round(log: &HandMadeLog) -> Round {
    let log = log.train_test();
    Round::new(&log, &linear_base(&log))
}

/// Returns the place of the first candidate of a cause.
fn place(round: &Round, name: &str) -> usize {
    round.candidates.iter().position(|own| own.cause.name() == name).expect("a candidate")
}

/// Returns an improvement by this much in total, Nm^2, with little scatter between ten blocks.
fn improvement(value: f64) -> Improvement {
    let before: Vec<f64> = (0..10).map(|block| 1.0 + 0.01 * f64::from(block)).collect();
    let after: Vec<f64> = before.iter().map(|before| before - 0.1 * value).collect();
    Improvement { describes: ErrorReduction::between(&before, &after), extrapolates: None }
}

/// Returns the torque of bristles of two stiffnesses, without a delay and without play, Nm.
fn two_bristles_torque(row: &LogRow) -> f64 {
    bristle_torque(row) + 0.5 * row.soft_bristle_share
}

#[test]
fn rejection_of_improvement_names_violated_rule() {
    let round = round(&HandMadeLog::new(pressure_torque));
    let rule = |value: f64, probability: f64| -> Option<&'static Rule> {
        let pressure = place(&round, "pressure-coulomb");
        Some(round.rejection(pressure, &improvement(value), probability)?.rule)
    };
    assert_eq!(rule(-1.0, 1e-6), Some(&rules::NO_REDUCTION));
    assert_eq!(rule(0.5 * round.excess, 0.1), Some(&rules::NOT_SIGNIFICANT));
    assert_eq!(rule(0.02 * round.excess, 1e-6), Some(&rules::NEGLIGIBLE));
    assert_eq!(rule(0.5 * round.excess, 1e-6), None);
}

#[test]
fn rejection_of_delay_without_independence_of_hysteresis_is_time_shift() {
    let rule = |log: &HandMadeLog| -> Option<&'static Rule> {
        let log = log.train_test();
        let round = Round::new(&log, &base(&log, LawKind::Dahl).model);
        let is_delay =
            |fit: &&CandidateFit| round.candidates[fit.candidate].cause.name() == "channel-delay";
        let delays = round.fits.iter().filter(is_delay);
        let best = delays.max_by(|a, b| a.unseen.value.total_cmp(&b.unseen.value));
        Some(round.linear_rejection(best.expect("a candidate"))?.rule)
    };
    let delayed = HandMadeLog::new(bristle_torque).with_delayed_torque(3);
    assert_eq!(rule(&delayed), None);
    assert_eq!(rule(&HandMadeLog::new(two_bristles_torque)), Some(&rules::TIME_SHIFT));
}

#[test]
fn explained_by_null_model_with_bristles_of_two_travels_rejects_backlash() {
    let log = HandMadeLog::new(two_bristles_torque).train_test();
    let round = Round::new(&log, &base(&log, LawKind::Dahl).model);
    let rejection = round.explained_by_null_model(place(&round, "backlash"));
    assert_eq!(rejection.expect("a rejection").rule, &rules::NULL_MODEL);
    assert_eq!(round.explained_by_null_model(place(&round, "torque-offset")), None);
}

#[test]
fn passed_with_level_over_pressure_has_pressure_coulomb_first() {
    let round = round(&HandMadeLog::new(pressure_torque));
    let passed = round.passed();
    let merits: Vec<f64> = passed.iter().map(|fit| round.linear_merit(fit)).collect();
    assert!(merits.len() > 1 && merits.is_sorted_by(|a, b| a >= b), "{merits:?}");
    assert_eq!(round.candidates[passed[0].candidate].cause.name(), "pressure-coulomb");
    let scores = round.scores();
    assert!(scores.is_sorted_by(|a, b| a.share >= b.share));
    assert_eq!(scores.iter().filter(|score| score.rejection.is_none()).count(), passed.len());
}

#[test]
fn passed_with_nothing_hidden_is_empty() {
    let round = round(&HandMadeLog::new(linear_torque));
    assert!(round.fits.len() > 5 && round.passed().is_empty());
}
