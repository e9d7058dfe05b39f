//! Play of a gear between two encoders: drawn joints with play are named with its size, and joints with torsion, an eccentric
//! encoder, a late sample or a drift are not.

use crate::is_long;
use friction_diagnose::{Diagnosis, DiagnosisOptions, diagnose};
use friction_grading::gear_play::{PlayCase, TOLERANCE, cases, log};
use joint_log::{SplitRule, split};
use unkind_worlds::two_sided_joint::{GearFault, draw};

/// First seed of the joints; neither that of the calibration nor that of the grades.
const SEED: u64 = 70_000;

/// Least play over the torsion and over the step of the encoder that must be found.
const FINDABLE: [f64; 2] = [2.0, 10.0];

fn is_findable(case: &&PlayCase) -> bool {
    let play = case.joint.gear.play_rad;
    let torsion = 2.0 * case.joint.frictions[1].coulomb_nm / case.joint.gear.stiffness_nm_per_rad;
    case.fault == GearFault::Play
        && case.found.is_some()
        && play > FINDABLE[0] * torsion
        && play > FINDABLE[1] * case.joint.encoder.step_rad
}

#[test]
fn two_positions_of_drawn_joints_show_play_and_nothing_else_as_play() {
    let cases = cases(SEED, if is_long() { 400 } else { 60 }).expect("logs");
    let findable: Vec<&PlayCase> = cases.iter().filter(is_findable).collect();
    let found: Vec<f64> = findable
        .iter()
        .filter_map(|case| Some(case.named()?.play.value / case.joint.gear.play_rad))
        .collect();
    let share = found.len() as f64 / findable.len() as f64;
    assert!(findable.len() > cases.len() / 6 && share > 0.75, "{share} of {}", findable.len());
    let right = found.iter().filter(|ratio| (**ratio - 1.0).abs() <= TOLERANCE).count();
    assert!(right as f64 > 0.85 * found.len() as f64, "{found:?}");
    let others = cases.iter().filter(|case| case.fault != GearFault::Play);
    let wrong: Vec<(&str, u64)> = others
        .filter(|case| case.named().is_some())
        .map(|case| (case.fault.name(), case.seed))
        .collect();
    assert!(wrong.len() * 20 <= cases.len(), "{wrong:?}");
}

fn diagnosed(fault: GearFault, seed: u64) -> Diagnosis {
    let checked = log(&draw(fault, seed), seed).expect("a log");
    let parts = split(&checked.data, &SplitRule::LeaveOneRunOut, 0).expect("runs to split");
    let question =
        DiagnosisOptions { log_findings: checked.findings, ..DiagnosisOptions::default() };
    diagnose(&checked.data, &parts, &question, &|_| {}).expect("an answer")
}

#[test]
fn diagnose_with_position_beyond_the_gear_names_its_play_with_its_column() {
    let seed = SEED + 1000;
    let found = diagnosed(GearFault::Play, seed);
    let backlash = found.findings.iter().find(|finding| finding.cause.name() == "backlash");
    let backlash = backlash.expect("play");
    let play = draw(GearFault::Play, seed).gear.play_rad;
    assert_eq!(backlash.columns, ["joint_position_rad"]);
    assert!(
        (backlash.size.value / play - 1.0).abs() < TOLERANCE,
        "{} for {play}",
        backlash.size.value
    );
    let parts = ["joint_position_rad"];
    crate::message::check("findings", "play beyond the gear", &backlash.in_words, &parts);
    let named = |column: &str| found.findings.iter().any(|f| f.columns.iter().any(|c| c == column));
    assert!(
        !found.candidates.iter().any(|c| c.columns().iter().any(|c| c == "joint_position_rad"))
    );
    assert!(named("joint_position_rad"));
}

#[test]
fn diagnose_with_torsion_between_two_positions_notes_it_and_names_no_backlash() {
    let found = diagnosed(GearFault::Elasticity, SEED + 2000);
    assert!(
        found.findings.iter().all(|finding| finding.cause.name() != "backlash"),
        "{:?}",
        found.findings
    );
    let notes = &found.log.notes;
    assert!(notes.iter().any(|note| note.contains("lags the motor")), "{notes:?}");
}
