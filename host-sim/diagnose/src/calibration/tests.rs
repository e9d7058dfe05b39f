//! Fits of a calibration to cases with a known law, and its table.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Returns cases whose log odds are `2 x - 1`, where `x` is the first figure. The second figure speaks against the cause
/// although its sign says the opposite.
fn cases(count: u64) -> Vec<Case> {
    let mut random = Pcg64::seed_from_u64(11);
    let case = |log| {
        let mut figures = [0.0; N];
        figures[0] = random.random_range(-2.0..3.0);
        let is_real = random.random::<f64>() < expit(2.0 * figures[0] - 1.0);
        figures[1] = if is_real { -1.0 } else { 1.0 };
        Case { figures, is_real, log }
    };
    (0..count).map(case).collect()
}

#[test]
fn fit_recovers_log_odds_and_keeps_weights_positive() {
    let model = Logistic::fit(&cases(4000));
    assert!((model.weights[0] - 2.0).abs() < 0.25, "{:?}", model.weights);
    assert!((model.intercept + 1.0).abs() < 0.2, "{}", model.intercept);
    assert_eq!(model.weights[1], 0.0);
}

#[test]
fn calibrated_probability_rises_with_log_odds_and_matches_frequency() {
    let cases = cases(4000);
    let model = Logistic::fit(&cases);
    let values: Vec<f64> = (-80..80).map(|at| model.calibrated(0.1 * f64::from(at))).collect();
    assert!(values.windows(2).all(|pair| pair[0] <= pair[1]));
    let likely: Vec<&Case> = cases
        .iter()
        .filter(|case| (0.6..0.9).contains(&model.calibrated(model.log_odds(&case.figures))))
        .collect();
    let real = likely.iter().filter(|case| case.is_real).count() as f64 / likely.len() as f64;
    assert!((0.65..0.85).contains(&real), "{real} of {}", likely.len());
}

#[test]
fn isotonic_of_disorder_is_constant() {
    let sorted: Vec<(f64, bool)> = (0..40).map(|at| (f64::from(at), at % 2 == 0)).collect();
    let steps = isotonic(&sorted);
    assert!(steps.iter().all(|(_, p)| (p - 0.5).abs() < 0.1), "{steps:?}");
}

#[test]
fn parse_of_emitted_table_returns_same_model() {
    let calibration = Calibration {
        name: "test".into(),
        naming_threshold: 0.7,
        finding: Logistic::fit(&cases(400)),
        candidate: Logistic::default(),
    };
    let again = Calibration::parse(&calibration.emit()).expect("a table");
    let figures = [0.7; N];
    assert!(
        (again.finding.log_odds(&figures) - calibration.finding.log_odds(&figures)).abs() < 1e-2
    );
    assert_eq!(again.naming_threshold, 0.7);
}

#[test]
fn parse_without_threshold_returns_its_name() {
    let error = Calibration::parse("name = \"x\"").expect_err("no threshold");
    assert_eq!(error, CalibrationError::Missing("naming_threshold".into()));
}

#[test]
fn current_calibration_has_a_threshold_and_weights() {
    let current = Calibration::current();
    assert!((0.3..1.0).contains(&current.naming_threshold), "{}", current.naming_threshold);
    assert!(current.finding.weights.iter().any(|weight| *weight > 0.0));
}
