//! Sessions on drawn joints, as in the table of graded sessions. The seeds are others than those of the table.

use firmware::parameter_set::ParameterSet;
use friction_results::tune::TuneOutcome;
use joint_rig::{JointEvent, service};
use joint_tuning::Master;
use joint_tuning::trial_set::{self, Record, TunedSet};
use tuned_joints::{
    Case, Fault, LARGEST_DISTANCE_RAD, LIMITS, OrderFault, SHOWN_BY_MOTION, Stand, Start, grade,
    grade_fault, joint, options,
};

/// True gains that a session on a commissioned joint reaches at least: half of what most of the table's sessions do.
const LEAST_GAINS: [f64; 2] = [0.4, 0.3];

fn check(seed: u64, hidden: &'static str) {
    let case = Case { seed, hidden: Some(hidden), start: Start::Commissioned };
    let graded = grade(&case).unwrap_or_else(|error| panic!("{hidden}: {error}"));
    assert!(graded.is_saved, "{hidden}: {}", graded.why_not);
    for (found, least) in graded.true_gains.both().into_iter().zip(LEAST_GAINS) {
        assert!((least..1.0).contains(&found.gain), "{hidden}: {:?}", graded.true_gains);
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

/// Asserts that the joint has its stored set when a trial without a host has ended, and after a reset.
fn assert_former(stand: &Stand, set: &ParameterSet) {
    stand.kill_host_at(u64::MAX);
    stand.set_order_fault(OrderFault::None);
    let hub = stand.hub();
    hub.run_until(hub.now_ns() + 11_000_000_000).expect("a bus");
    assert_eq!(stand.active_crc().expect("an answer"), set.crc());
    stand.node().borrow_mut().schedule(hub.now_ns(), JointEvent::ProcessorReset);
    hub.run_until(hub.now_ns() + 500_000_000).expect("a bus");
    assert_eq!(stand.node().borrow().restarts(), 1);
    assert_eq!(stand.active_crc().expect("an answer"), set.crc(), "after a reset");
    assert_eq!(trial_set::record(&mut stand.client()).expect("an answer"), None);
}

#[test]
fn set_that_cannot_be_stored_is_not_left_in_the_joint() {
    let joint = joint(44_000, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = Stand::new(&joint, &set).expect("it starts");
    stand.set_order_fault(OrderFault::Lost);
    let session = stand.tune(&options(1, LIMITS)).expect("a session");
    let report = &session.report;
    assert!(matches!(&report.outcome, TuneOutcome::Returned(_)), "{:?}", report.outcome);
    assert!(!report.gains.is_empty(), "{:?}", report.outcome);
    assert_former(&stand, &set);
}

#[test]
fn host_that_dies_before_its_last_order_leaves_the_stored_set() {
    let joint = joint(44_000, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = Stand::new(&joint, &set).expect("it starts");
    stand.set_order_fault(OrderFault::Killed);
    let options_of_session = options(1, LIMITS);
    let mut master = Master::new(
        stand.client(),
        options_of_session.node,
        options_of_session.limits,
        Box::new(|| false),
    );
    trial_set::open(&mut master).expect("a trial");
    let position_gain = service::drive_settings(&joint).position_gain;
    let mut tried = TunedSet { set: set.clone(), position_gain };
    tried.set.friction.compensator.scale = 0.5;
    trial_set::apply(&mut master, &tried).expect("a set on trial");
    let tuned_crc = tried.set.crc();
    assert_eq!(stand.active_crc().expect("an answer"), tuned_crc);
    let record =
        Record { time_s: 1, runs: 2, before_crc: set.crc(), tuned_crc, gain_permille: 3, cause: 0 };
    assert!(trial_set::keep_and_save(&mut master, &record).is_err());
    assert_former(&stand, &set);
}
