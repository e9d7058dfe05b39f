//! Answers of the contest on logs with a known cause.

use super::*;
use crate::fixtures::{
    HandMadeLog, LogRow, PERIOD_S, bristle_torque, linear_base, linear_torque, pressure_torque,
    stribeck_bristle_torque, stribeck_torque,
};
use compensator_core::{LawKind, ParameterId as Id};
use friction_fit::predict;
use friction_fit::spec::Spec;

fn answer_of(log: TrainTest) -> Answer {
    answer(&log, &DiagnosisOptions::default(), None, &|_| {}).expect("few terms")
}

fn answer_to(torque_nm: impl Fn(&LogRow) -> f64) -> Answer {
    answer_of(HandMadeLog::new(torque_nm).train_test())
}

fn names(found: &Answer) -> Vec<&'static str> {
    found.findings.iter().map(|finding| finding.cause.name()).collect()
}

#[test]
fn answer_to_pressure_names_it_alone_with_size_and_gain() {
    let found = answer_to(pressure_torque);
    // The temperature follows the pressure in part.
    assert_eq!(names(&found), ["pressure-coulomb"]);
    assert_eq!(found.findings[0].columns, ["pressure_diff_pa"]);
    assert!(found.extension.outcome.spec.terms.contains(&TermKind::PressureCoulomb));
    // 0.5 Nm for each MPa.
    let size = found.extension.outcome.parameters.get(Id::PressureCoulomb);
    assert!((size / 0.5e-6 - 1.0).abs() < 0.1, "{size}");
    let rmse = [found.before.metrics.rmse, found.extension.after.metrics.rmse];
    assert!((found.extension.gain.value - (1.0 - rmse[1] / rmse[0])).abs() < 1e-9, "{rmse:?}");
    assert!(found.extension.gain.ci95[0] > 0.5, "{:?}", found.extension.gain);
    assert_eq!(found.left_out, Some(LeftOut::Runs));
    assert!(found.weighed[0].is_named() && found.weighed[0].reason().is_empty());
}

#[test]
fn answer_to_pressure_and_temperature_names_both() {
    // The level falls by 0.04 Nm for each kelvin, or by three quarters of that. Three quarters of the temperature follow the pressure.
    for slope in [0.04, 0.03] {
        let found = answer_to(|row| {
            pressure_torque(row) - slope * (row.temperature_c - 30.0) * row.direction()
        });
        let mut both = names(&found);
        both.sort_unstable();
        assert_eq!(both, ["pressure-coulomb", "temperature-coulomb"], "{slope}");
    }
    // Half as large a slope is too little to be named beside the pressure, which takes its part, but it is the next candidate.
    let found = answer_to(|row| {
        pressure_torque(row) - 0.015 * (row.temperature_c - 30.0) * row.direction()
    });
    assert_eq!(names(&found), ["pressure-coulomb"]);
    let next = &found.weighed[1];
    assert_eq!(next.cause.name(), "temperature-coulomb");
    assert!(next.probability > 0.2, "{}", next.probability);
}

#[test]
fn answer_to_torque_offset_in_sliding_reports_asymmetry_as_indistinguishable() {
    let found = answer_to(|row| linear_torque(row) + 0.2);
    let pair = ["direction-asymmetry", "torque-offset"];
    let first = found.findings.first().expect("a finding");
    assert!(pair.contains(&first.cause.name()), "{:?}", names(&found));
    let mut rivals = first.confusable_with.iter();
    assert!(rivals.any(|rival| pair.contains(&rival.cause.name())), "{first:?}");
}

#[test]
fn answer_to_plain_friction_offers_nothing() {
    let found = answer_to(linear_torque);
    assert!(found.findings.is_empty(), "{:?}", found.findings);
    assert_eq!(found.extension.gain, Gain::default());
    assert_eq!(found.extension.outcome.spec, found.baseline.spec);
    assert_eq!(found.baseline.spec, Spec::law(LawKind::Linear));
    let value = |id| found.baseline.parameters.get(id);
    assert!((value(Id::CoulombTorque) - 1.0).abs() < 0.02, "{}", value(Id::CoulombTorque));
    assert!((value(Id::ViscousFriction) - 0.3).abs() < 0.03, "{}", value(Id::ViscousFriction));
}

#[test]
fn answer_to_other_laws_takes_them_as_base_and_names_nothing() {
    let stribeck = answer_to(stribeck_torque);
    assert!(stribeck.baseline.spec.law.has_stribeck_curve(), "{}", stribeck.baseline.spec);
    // The level is 1.6 Nm at rest. Bristles take a part of its fall.
    let value = stribeck.baseline.parameters.get(Id::StaticTorque);
    assert!((1.05..1.7).contains(&value), "{value}");
    let [bristles, curved] = [bristle_torque, stribeck_bristle_torque].map(answer_to);
    for found in [&bristles, &curved] {
        assert!(found.baseline.spec.law.has_bristles(), "{}", found.baseline.spec);
    }
    for found in [stribeck, bristles, curved] {
        println!("{:?}, {} Nm", names(&found), found.before.metrics.rmse);
        assert!(found.findings.is_empty(), "{:?}", found.findings);
        assert!(found.log_findings.is_empty(), "{:?}", found.log_findings);
    }
}

#[test]
fn answer_with_cause_absent_from_held_out_runs_offers_nothing() {
    let early = |row: &LogRow| {
        let slope = if row.run < 4 { -0.02 } else { 0.0 };
        linear_torque(row) + slope * (row.temperature_c - 30.0) * row.direction()
    };
    let found = answer_of(HandMadeLog::new(early).train_test_without(&[4, 5]));
    assert_eq!((found.extension.gain, found.left_out), (Gain::default(), None));
    assert_eq!(found.extension.outcome.spec, found.baseline.spec);
    assert_eq!(found.before.metrics, found.extension.after.metrics);
}

#[test]
fn answer_to_impossible_drag_names_only_the_other_cause() {
    // The torque falls with the square of the speed, as no drag does.
    let found =
        answer_to(|row| pressure_torque(row) - 0.2 * row.velocity_rad_s.powi(2) * row.direction());
    assert!(names(&found).contains(&"pressure-coulomb"), "{:?}", names(&found));
    assert!(!names(&found).contains(&"quadratic-drag"), "{:?}", found.findings);
}

#[test]
fn answer_with_given_model_judges_it_as_it_is() {
    let log = HandMadeLog::new(pressure_torque).train_test();
    let model = linear_base(&log);
    let mut parameters = model.parameters.clone();
    parameters.set(Id::CoulombTorque, 0.5);
    let given = Some((model.spec, parameters.clone()));
    let options = DiagnosisOptions { given, ..DiagnosisOptions::default() };
    let found = answer(&log, &options, None, &|_| {}).expect("few terms");
    let given =
        predict(&parameters, found.extension.log.test_rows(), found.baseline.resolution).metrics;
    let rmse = found.before.metrics.rmse;
    assert!((rmse / given.rmse - 1.0).abs() < 1e-9, "{rmse} {}", given.rmse);
    assert_eq!(found.baseline.parameters.get(Id::CoulombTorque), 0.5);
    assert_eq!(names(&found)[0], "pressure-coulomb");
}

#[test]
fn answer_with_unknown_torque_at_rest_names_nothing() {
    let found = answer_of(HandMadeLog::new(linear_torque).with_rest(60).train_test());
    assert!(found.findings.is_empty(), "{:?}", found.findings);
    let value = found.baseline.parameters.get(Id::CoulombTorque);
    assert!((value - 1.0).abs() < 0.05, "{value}");
}

/// Returns the only finding about the log.
fn log_finding(found: &Answer) -> &LogFinding {
    let [finding] = found.log_findings.as_slice() else { panic!("{:?}", found.log_findings) };
    finding
}

#[test]
fn answer_with_filtered_torque_reports_low_pass_of_its_time() {
    let time_s = 4.0 * PERIOD_S;
    let found =
        answer_of(HandMadeLog::new(bristle_torque).with_filtered_torque(time_s).train_test());
    assert_eq!(log_finding(&found).kind, LogFindingKind::TorqueLag);
    assert!((log_finding(&found).value / time_s - 1.0).abs() < 0.2, "{:?}", found.log_findings);
    // What a filter leaves resembles an inertia.
    assert!(found.findings.iter().all(|finding| finding.probability < 0.6), "{:?}", found.findings);
}

#[test]
fn answer_with_late_velocity_reports_its_delay() {
    let found = answer_of(HandMadeLog::new(bristle_torque).with_delayed_velocity(3).train_test());
    assert_eq!(log_finding(&found).kind, LogFindingKind::VelocityLag);
    // Other bristles describe a part of the delay on so short a log.
    let ratio = log_finding(&found).value / (3.0 * PERIOD_S);
    assert!((0.4..1.2).contains(&ratio), "{:?}", found.log_findings);
}

#[test]
fn answer_with_delayed_torque_names_delay_and_no_low_pass() {
    let found = answer_of(HandMadeLog::new(bristle_torque).with_delayed_torque(4).train_test());
    assert!(found.log_findings.is_empty(), "{:?}", found.log_findings);
    assert_eq!(names(&found), ["channel-delay"]);
    let ratio = found.findings[0].size.value / (4.0 * PERIOD_S);
    assert!((ratio - 1.0).abs() < 0.2, "{:?}", found.findings[0].size);
}
