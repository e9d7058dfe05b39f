//! Base laws of logs with and without bristles, a Stribeck curve and rest.

use super::*;
use crate::fixtures::{
    HandMadeLog, LogRow, base, bristle_torque, extension, linear_torque, stribeck_bristle_torque,
    stribeck_torque, with_search,
};
use crate::search::Search;

/// Returns the base model that is selected for a log.
fn chosen(log: &HandMadeLog) -> Baseline {
    choose(&log.train_test()).expect("a law without terms")
}

#[test]
fn choose_with_coulomb_and_viscous_torque_returns_linear() {
    let baseline = chosen(&HandMadeLog::new(linear_torque));
    assert_eq!(baseline.model.spec, Spec::law(LawKind::Linear));
    let value = |id| baseline.model.parameters.get(id);
    assert!((value(Id::CoulombTorque) - 1.0).abs() < 0.02, "{}", value(Id::CoulombTorque));
    assert!((value(Id::ViscousFriction) - 0.3).abs() < 0.03, "{}", value(Id::ViscousFriction));
}

#[test]
fn choose_with_level_that_falls_with_speed_returns_stribeck() {
    let baseline = chosen(&HandMadeLog::new(stribeck_torque));
    assert_eq!(baseline.model.spec, Spec::law(LawKind::Stribeck));
    let value = baseline.model.parameters.get(Id::StaticTorque);
    assert!((value - 1.6).abs() < 0.1, "{value}");
}

#[test]
fn choose_with_bristles_returns_dahl() {
    let baseline = chosen(&HandMadeLog::new(bristle_torque));
    assert_eq!(baseline.model.spec, Spec::law(LawKind::Dahl));
}

#[test]
fn asked_for_with_unknown_torque_at_rest_excludes_rest() {
    let at_rest = |log: &HandMadeLog| base(&log.train_test(), LawKind::Linear).at_rest;
    // The viscous part depends on the pressure, so that the law is less accurate in motion.
    let log = HandMadeLog::new(|row| linear_torque(row) + row.velocity_rad_s * row.pressure_mpa);
    assert!(at_rest(&log).is_none());
    assert!(at_rest(&log.with_rest(60)).is_some());
}

#[test]
fn reselect_base_law_with_curve_of_bristles_returns_lugre() {
    let of_bristles = |log: &HandMadeLog, law| {
        let log = log.train_test();
        let base = base(&log, law).model;
        let richer = reselect_base_law(&log, &base, &base).expect("a law without terms");
        richer.map(|richer| richer.spec.law)
    };
    let log = HandMadeLog::new(stribeck_bristle_torque);
    assert_eq!(of_bristles(&log, LawKind::Dahl), Some(LawKind::Lugre));
    assert_eq!(of_bristles(&log, LawKind::Linear), None);
}

#[test]
fn reselect_base_law_without_curve_returns_lugre_only_if_no_cause_was_accepted() {
    let log =
        HandMadeLog::new(|row| bristle_torque(row) + 0.6 * row.pressure_mpa * row.bristle_share);
    let log = log.train_test();
    let base = base(&log, LawKind::Dahl).model;
    let extended = with_search(&log, |search| {
        extension(&Search { base: &base, ..*search }, &["pressure-coulomb"]).model
    });
    let law = |extended: &FittedModel| {
        let richer = reselect_base_law(&log, &base, extended).expect("few terms");
        richer.map(|richer| richer.spec.law)
    };
    assert_eq!(law(&base), Some(LawKind::Lugre));
    assert_eq!(law(&extended), None);
}

#[test]
fn independent_rows_with_smooth_residual_are_fewer() {
    let rows = |torque: fn(&LogRow) -> f64| {
        let log = HandMadeLog::new(torque).train_test();
        independent_rows(&log, &base(&log, LawKind::Linear).model)
    };
    let white = rows(linear_torque);
    let smooth = rows(|row| linear_torque(row) + 0.1 * (20.0 * row.time_s).sin());
    assert!(white > 1000.0 && smooth < 0.3 * white, "{white} {smooth}");
}
