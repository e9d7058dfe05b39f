//! Sessions on drawn joints, as in the table of graded sessions. The seeds are others than those of the table.

use firmware::node::dictionary::index;
use friction_results::tune::TuneOutcome;
use joint_rig::service;
use tuned_joints::{
    Case, Fault, LARGEST_DISTANCE_RAD, LIMITS, SHOWN_BY_MOTION, Stand, Start, grade, grade_fault,
    joint, options,
};

/// True gains that a session on a commissioned joint reaches at least: half of what most of the table's sessions do.
const LEAST_GAINS: [f64; 2] = [0.4, 0.3];

fn check(seed: u64, hidden: &'static str) {
    let case = Case { seed, hidden: Some(hidden), start: Start::Commissioned };
    let graded = grade(&case).unwrap_or_else(|error| panic!("{hidden}: {error}"));
    assert!(graded.is_saved, "{hidden}: {}", graded.why_not);
    for ([gain, ..], least) in graded.true_gains.into_iter().zip(LEAST_GAINS) {
        assert!((least..1.0).contains(&gain), "{hidden}: {:?}", graded.true_gains);
    }
    assert!(!graded.is_worse());
}

/// Every run checks the first effect, `LONG_TESTS=1` all.
#[test]
fn session_on_a_joint_with_a_hidden_effect_moves_its_output_better() {
    let is_long = std::env::var_os("LONG_TESTS").is_some_and(|long| !long.is_empty());
    let count = if is_long { SHOWN_BY_MOTION.len() } else { 1 };
    for (seed, hidden) in (42_000..).zip(SHOWN_BY_MOTION).take(count) {
        check(seed, hidden);
    }
}

#[test]
fn truth_at_the_age_of_the_reports_agrees_with_the_encoder() {
    let joint = joint(46_000, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = Stand::new(&joint, &set).expect("it starts");
    let recording = stand.performed(&set).expect("a motion");
    let distance_rad = stand.truth().distance_rad(&recording);
    assert!(distance_rad < LARGEST_DISTANCE_RAD, "{distance_rad}");
}

#[test]
fn fault_in_a_session_leaves_a_safe_joint_with_its_former_set() {
    // In the baseline, the study and the trial.
    for (at, (fault, share)) in Fault::ALL.into_iter().zip([0.02, 0.1, 0.3, 0.6]).enumerate() {
        let graded = grade_fault(43_000 + at as u64, fault, share).expect("the joint starts");
        assert!(graded.is_noticed && graded.is_safe && graded.is_former, "{graded:?}");
    }
}

#[test]
fn set_that_cannot_be_stored_is_not_left_in_the_joint() {
    let joint = joint(44_000, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = Stand::new(&joint, &set).expect("it starts");
    stand.refuse_writes_of(index::STORE);
    let session = stand.tune(&options(1, LIMITS)).expect("a session");
    assert!(
        matches!(&session.report.outcome, TuneOutcome::Returned(_)),
        "{:?}",
        session.report.outcome
    );
    stand.refuse_writes_of(0);
    assert_eq!(stand.active_crc(), Ok(set.crc()));
}
