//! The calibrated rule of the stochastic extension on simulated logs.

use compensator_core::{LawKind, ParameterId as Id, Parameters};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, Track, fit, tracks};
use friction_grading::calibrated_rule::certify_calibrated;
use joint_rig::simulated;
use simulated_machines::scenarios::draw;
use simulated_machines::{Recording, record};
use stochastic_extension::Settings;

fn fitted(tracks: &[Track]) -> Parameters<f64> {
    let spec = Spec::law(LawKind::Lugre);
    let options = FitOptions { starts: 1, ..FitOptions::default() };
    let base = spec.parameters().expect("a law alone");
    fit(&spec, &base, Rows { tracks, decimate: 1 }, &options).parameters()
}

#[test]
fn calibrated_rule_without_hidden_effect_gives_no_verdict() {
    let scenario = draw(&[], 4);
    let tracks = tracks(&simulated::dataset(&scenario.log));
    let parameters = fitted(&tracks);
    let free = LawKind::Lugre.parameters();
    let (certificate, calibrated) =
        certify_calibrated(&parameters, free, &tracks, &Settings::default());
    assert_eq!(calibrated.verdict, None, "{:?}", calibrated.ratios);
    let coulomb = calibrated.ratios.iter().find(|(id, _)| *id == Id::CoulombTorque);
    assert!(coulomb.is_some_and(|(_, ratio)| (0.85..1.15).contains(ratio)), "{coulomb:?}");
    // The literal rule selects a parameter nevertheless.
    assert!(certificate.sum_cv > 0.0);
}

#[test]
fn calibrated_rule_with_load_and_pressure_gives_a_verdict() {
    let truth = record(5, Recording { runs: 16, rate_hz: 200.0, ..Recording::default() });
    let tracks = tracks(&simulated::dataset(truth.log()));
    let free = LawKind::Lugre.parameters();
    let settings = Settings::default();
    let (_, calibrated) = certify_calibrated(&fitted(&tracks), free, &tracks, &settings);
    assert!(calibrated.verdict.is_some(), "{:?}", calibrated.ratios);
}
