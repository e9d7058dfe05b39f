//! Sessions of `tune` on drawn joints that the image drives.
//!
//! The short form sets a trial on the image, and sees the stored set return at its deadline and after a reset. `LONG_TESTS=1`
//! tunes ten joints of three families of friction, compares their errors by the true position of the output with limits, and
//! writes them to `target/figures/tuning.tsv`. One session has a reset in its middle.

use crate::common::{image, write_figures};
use emulated_board::BoardDriver;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::TrialObject;
use firmware::parameter_set::ParameterSet;
use joint_rig::{JointEvent, MotorNode, RigFaults, service, stage_at_power_up};
use joint_tuning::Master;
use joint_tuning::master::TRIAL_DEADLINE_MS;
use joint_tuning::trial_set::{self, TunedSet};
use rayon::prelude::*;
use simulated_machines::joint_plant::DrawnJoint;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use tuned_joints::summary::median;
use tuned_joints::{
    Case, Fault, Grade, GradeError, LIMITS, SHOWN_BY_MOTION, Stand, Start, grade_fault_on,
    grade_on, joint, options,
};

/// Seeds of the joints: others than those of the table of graded sessions.
const FIRST_SEED: u64 = 46_000;
/// Number of joints, each with another hidden effect.
const JOINTS: usize = 10;
/// Median gains of the error at reversals and of the tracking error that the joints reach at least.
const LEAST_GAINS: [f64; 2] = [0.9, 0.9];
/// Gain that each saved session reaches at least, in both: a third below that of the joint with the least.
const LEAST_GAIN_OF_A_JOINT: f64 = 0.35;
/// Sessions that end with a saved set, at least: another image may measure noise that decides one.
const LEAST_SAVED: usize = 9;
/// Time after the deadline of a trial until the stored set must be back, and from a reset until the image answers, ms.
const RETURN_MS: u64 = 500;
const MILLISECOND_NS: u64 = 1_000_000;
/// Age of what the image reports at the arrival of the frame, ms: half a millisecond on average in the loop, and a
/// millisecond until the bus of the test takes the frame.
const REPORT_AGE_MS: f64 = 1.57;
/// Largest distance of the reported positions from the true ones, rad. The phase between loop and background depends on the
/// image, by up to a millisecond; a report that is two milliseconds older than assumed would be 1.1e-3 off.
const LARGEST_PHASE_DISTANCE_RAD: f64 = 7e-4;
/// State of a trial whose host was late (2042h:3).
const HOST_WAS_LATE: u32 = 4;

const HEAD: &str = "seed\tfamily\thidden\tsaved\treversal before, mrad\treversal after, mrad\tRMS before, mrad\tRMS after, mrad\tworse\n";

/// Starts the image on a drawn joint with this set in its flash.
fn start(joint: &DrawnJoint, set: &ParameterSet) -> Result<Stand, GradeError> {
    let start = MotorNode::power_up(joint, set);
    let stage = stage_at_power_up(&start, joint.plant(), &RigFaults::default());
    let driver = BoardDriver::start(image(), &start, stage);
    let driver = driver.map_err(|error| GradeError::OtherDriver(error.into()))?;
    Ok(Stand::with_node(MotorNode::drawn_on(Box::new(driver), joint), REPORT_AGE_MS))
}

/// What a joint uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct InUse {
    /// CRC of the active set.
    set_crc: u32,
    position_gain: u32,
}

fn in_use(stand: &Stand) -> InUse {
    InUse {
        set_crc: stand.active_crc().expect("an answer"),
        position_gain: stand.position_gain().expect("an answer"),
    }
}

/// Sets half of the compensation and another position gain on trial. Returns what was in use before, and is on trial.
fn begin_trial(stand: &Stand, set: &ParameterSet) -> [InUse; 2] {
    let before = in_use(stand);
    let joint = options(1, LIMITS);
    let mut master = Master::new(stand.client(), joint.node, joint.limits, Box::new(|| false));
    trial_set::open(&mut master).expect("an open trial");
    let mut tried = TunedSet { set: set.clone(), position_gain: before.position_gain / 2 };
    tried.set.friction.compensator.scale = 0.5;
    trial_set::apply(&mut master, &tried).expect("a set on trial");
    let on_trial = in_use(stand);
    let wanted = InUse { set_crc: tried.set.crc(), position_gain: tried.position_gain };
    assert_eq!(on_trial, wanted);
    [before, on_trial]
}

fn run_for(stand: &Stand, milliseconds: u64) {
    let hub = stand.hub();
    hub.run_until(hub.now_ns() + milliseconds * MILLISECOND_NS).expect("a bus");
}

#[test]
fn trial_without_renewal_returns_image_to_its_stored_set() {
    let joint = joint(FIRST_SEED, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = start(&joint, &set).expect("the image starts");
    let [before, on_trial] = begin_trial(&stand, &set);
    // A change of the set has five times the usual deadline.
    let deadline_ms = 5 * u64::from(TRIAL_DEADLINE_MS);
    run_for(&stand, deadline_ms - RETURN_MS);
    assert_eq!(in_use(&stand), on_trial);
    run_for(&stand, 2 * RETURN_MS);
    assert_eq!(in_use(&stand), before);
    let state = canopen_rs::Address::new(index::TRIAL, TrialObject::STATE);
    assert_eq!(stand.client().read_number(state).expect("an answer"), HOST_WAS_LATE);
}

#[test]
fn image_that_is_reset_in_a_trial_starts_with_its_stored_set() {
    let joint = joint(FIRST_SEED, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = start(&joint, &set).expect("the image starts");
    let [before, _] = begin_trial(&stand, &set);
    let now_ns = stand.hub().now_ns();
    stand.node().borrow_mut().schedule(now_ns, JointEvent::ProcessorReset);
    run_for(&stand, RETURN_MS);
    assert_eq!(stand.node().borrow().restarts(), 1);
    assert_eq!(in_use(&stand), before);
}

#[test]
fn truth_at_the_age_of_the_reports_of_image_agrees_with_the_encoder() {
    let joint = joint(FIRST_SEED, None).expect("a joint");
    let set = service::starting_set(&joint);
    let stand = start(&joint, &set).expect("the image starts");
    let recording = stand.performed(&set).expect("a motion");
    let distance_rad = stand.truth().distance_rad(&recording);
    assert!(distance_rad < LARGEST_PHASE_DISTANCE_RAD, "{distance_rad}");
}

fn cases() -> Vec<Case> {
    let hidden = SHOWN_BY_MOTION.into_iter().take(JOINTS);
    let case = |(seed, hidden)| Case { seed, hidden: Some(hidden), start: Start::Commissioned };
    (FIRST_SEED..).zip(hidden).map(case).collect()
}

fn emit(grades: &[Grade]) -> String {
    let mut text = HEAD.to_owned();
    for grade in grades {
        let (before, after) = (grade.former_errors_rad, grade.final_errors_rad);
        let _ = writeln!(
            text,
            "{}\t{}\t{}\t{}\t{:.3}\t{:.3}\t{:.3}\t{:.3}\t{}",
            grade.case.seed,
            grade.family,
            grade.case.hidden.unwrap_or("none"),
            grade.is_saved,
            1e3 * before.reversal,
            1e3 * after.reversal,
            1e3 * before.rms,
            1e3 * after.rms,
            grade.is_worse(),
        );
    }
    text
}

#[test]
fn sessions_on_image_move_the_outputs_of_their_joints_better() {
    if std::env::var_os("LONG_TESTS").is_none() {
        return;
    }
    let grades: Vec<Grade> = cases()
        .par_iter()
        .map(|case| {
            let graded = grade_on(case, start);
            let graded = graded.unwrap_or_else(|error| panic!("seed {}: {error}", case.seed));
            println!("{}{}", emit(std::slice::from_ref(&graded)), graded.why_not);
            graded
        })
        .collect();
    let worse: Vec<u64> =
        grades.iter().filter(|grade| grade.is_worse()).map(|grade| grade.case.seed).collect();
    assert!(worse.is_empty(), "worse than before: {worse:?}");
    let saved: Vec<&Grade> = grades.iter().filter(|grade| grade.is_saved).collect();
    assert!(saved.len() >= LEAST_SAVED, "{} saved", saved.len());
    for grade in saved {
        let gains = grade.true_gains.both();
        let is_enough = gains.iter().all(|found| found.gain >= LEAST_GAIN_OF_A_JOINT);
        assert!(is_enough, "{}: {:?}", grade.case.seed, grade.true_gains);
    }
    let families: BTreeSet<&str> = grades.iter().map(|grade| grade.family).collect();
    assert_eq!(families.len(), 3, "{families:?}");
    for (place, least) in LEAST_GAINS.into_iter().enumerate() {
        let gain = median(grades.iter().map(|grade| grade.true_gains.both()[place].gain));
        println!("measured: median gain {gain:.3} on the image, of {} joints", grades.len());
        assert!((least..1.0).contains(&gain), "quantity {place}: {gain}");
    }
    write_figures("tuning.tsv", &emit(&grades));
}

#[test]
fn reset_in_a_session_leaves_image_and_joint_as_before() {
    if std::env::var_os("LONG_TESTS").is_none() {
        return;
    }
    let seed = FIRST_SEED + JOINTS as u64;
    let graded = grade_fault_on(seed, Fault::Reset, 0.2, start).expect("the image starts");
    assert!(graded.is_noticed && graded.is_safe && graded.is_former, "{graded:?}");
}
