//! Selection on logs with hidden causes and on a log with none.

use super::*;
use crate::fixtures::{
    HandMadeLog, NAMING_THRESHOLD, cause, extension, linear_torque, names, pressure_torque,
    with_search,
};
use crate::train_test::FollowedColumn;
use compensator_core::ParameterId;
use compensator_core::term::LookupFormula;

/// Returns the selection beside the linear law, with this naming threshold, without these causes.
fn selection(log: &HandMadeLog, naming_threshold: f64, refuted: &[CauseIdentity]) -> Selection {
    let selected = |search: &Search| select(&Search { naming_threshold, ..*search }, refuted);
    with_search(&log.train_test(), selected).expect("few terms")
}

/// Returns the names of the rules that rejected a cause.
fn rules_against(selection: &Selection, name: &str) -> Vec<&'static str> {
    let of_cause = |decision: &&RuleDecision| decision.cause.name() == name;
    selection.decisions.iter().filter(of_cause).map(|d| d.rejection.rule.name).collect()
}

/// Returns a friction level that follows a column along a curve of any shape.
fn level_over(column: &str) -> FollowedColumn {
    let (column, formula) = (column.to_owned(), LookupFormula::None);
    FollowedColumn { column, extra: false, level: true, proportional: false, formula }
}

#[test]
fn select_with_level_over_pressure_returns_pressure_coulomb() {
    let selection = selection(&HandMadeLog::new(pressure_torque), NAMING_THRESHOLD, &[]);
    assert_eq!(names(&selection.found), ["pressure-coulomb"]);
    // 0.5 Nm for each MPa.
    let size = selection.extended.parameters.get(ParameterId::PressureCoulomb);
    assert!((size / 0.5e-6 - 1.0).abs() < 0.1, "{size}");
    assert_eq!(selection.scores[0].columns, ["pressure_diff_pa"]);
    assert!(selection.found[0].probability > 0.5, "{:?}", selection.found[0]);
}

#[test]
fn select_with_level_over_pressure_and_temperature_returns_both() {
    // The level falls by 0.02 for each kelvin.
    let log = HandMadeLog::new(|row| {
        pressure_torque(row) - 0.02 * (row.temperature_c - 30.0) * row.direction()
    });
    let selection = selection(&log, NAMING_THRESHOLD, &[]);
    let mut found = names(&selection.found);
    found.sort_unstable();
    assert_eq!(found, ["pressure-coulomb", "temperature-coulomb"]);
    assert!(selection.decisions.is_empty(), "{:?}", selection.decisions);
}

#[test]
fn select_with_torque_offset_in_sliding_returns_asymmetry_with_offset_as_rival() {
    let selection =
        selection(&HandMadeLog::new(|row| linear_torque(row) + 0.2), NAMING_THRESHOLD, &[]);
    assert_eq!(names(&selection.found), ["direction-asymmetry"]);
    let mut rivals = selection.found[0].rivals.iter();
    assert!(rivals.any(|rival| rival.cause.name() == "torque-offset"), "{:?}", selection.found[0]);
}

#[test]
fn select_with_nothing_hidden_returns_base_law() {
    let selection = selection(&HandMadeLog::new(linear_torque), NAMING_THRESHOLD, &[]);
    assert_eq!((names(&selection.found), names(&selection.weighed)), (vec![], vec![]));
    assert!(selection.extended.spec.terms.is_empty());
    assert!(selection.scores.iter().all(|score| score.rejection.is_some()));
}

#[test]
fn select_with_all_causes_of_covariates_refuted_returns_base_law() {
    let of_covariates = ["pressure-coulomb", "temperature-coulomb", "temperature-viscous"];
    let named = of_covariates.map(|name| CauseIdentity::new(cause(name), None));
    let of_curve = |column| CauseIdentity::new(cause("unknown"), Some(&level_over(column)));
    let curves = ["pressure_diff_pa", "temperature_c"].map(of_curve);
    let refuted = [&named[..], &curves[..]].concat();
    let selection = selection(&HandMadeLog::new(pressure_torque), NAMING_THRESHOLD, &refuted);
    assert!(selection.found.is_empty(), "{:?}", selection.found);
    assert!(selection.extended.spec.terms.is_empty());
}

#[test]
fn select_with_refuted_cause_does_not_return_it() {
    let refuted = CauseIdentity::new(cause("pressure-coulomb"), None);
    let selection = selection(&HandMadeLog::new(pressure_torque), NAMING_THRESHOLD, &[refuted]);
    assert!(!names(&selection.found).contains(&"pressure-coulomb"), "{:?}", selection.found);
    assert!(!names(&selection.weighed).contains(&"pressure-coulomb"), "{:?}", selection.weighed);
}

#[test]
fn select_with_cause_below_threshold_removes_it_by_rule() {
    let selection = selection(&HandMadeLog::new(pressure_torque), 1.0, &[]);
    assert!(selection.found.is_empty(), "{:?}", selection.found);
    assert!(selection.extended.spec.terms.is_empty());
    assert_eq!(names(&selection.weighed)[0], "pressure-coulomb");
    assert_eq!(rules_against(&selection, "pressure-coulomb"), [rules::BELOW_THRESHOLD.name]);
    let why = &selection.decisions[0].rejection.why;
    assert!(why.ends_with("is below the naming threshold of 1.00"), "{why}");
}

#[test]
fn at_bound_with_own_parameter_at_upper_bound_returns_it() {
    let id = ParameterId::PressureCoulomb;
    let log = HandMadeLog::new(pressure_torque).train_test();
    with_search(&log, |search| {
        let round = Round::new(search.log, search.base);
        let is_own = |own: &&CauseCandidate| own.cause == cause("pressure-coulomb");
        let candidate = round.candidates.iter().find(is_own).expect("a candidate");
        let mut model = extension(search, &["pressure-coulomb"]).model;
        assert_eq!(at_bound(&model, candidate), None);
        model.parameters.set(id, id.info().upper);
        assert_eq!(at_bound(&model, candidate), Some(id));
        model.free.retain(|own| *own != id);
        assert_eq!(at_bound(&model, candidate), None);
    });
}
