//! A stop within the range: the joint does not press against it until the motion ends.

use super::{Bench, User, options, snapshot};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use friction_results::tune::TuneOutcome;
use joint_rig::JointEvent;
use joint_tuning::tune;

/// Distance of the stop from the start, rad.
const STOP_RAD: f64 = 0.15;

#[test]
fn joint_with_a_stop_in_its_range_is_disarmed_and_has_its_former_set() {
    let bench = Bench::new(7, "none", |_| ());
    let following = |bench: &Bench| {
        let window = Address::new(index::FOLLOWING_WINDOW, 0);
        bench.client().read_number(window).expect("an answer")
    };
    let before = following(&bench);
    let start_rad = bench.node.borrow().plant().position_rad();
    let event = JointEvent::Stop(start_rad + STOP_RAD);
    bench.node.borrow_mut().schedule(bench.hub.now_ns(), event);
    let mut user = User::default();
    let session =
        tune(bench.client(), &options(300.0, 7), Box::new(|| false), &mut user).expect("a session");
    let TuneOutcome::Returned(why) = &session.report.outcome else { panic!("it was saved") };
    assert!(why.contains("stop"), "{why}");
    snapshot::check("session", "a stop in the range", why);
    assert!(session.recordings.is_empty(), "it ends in the baseline");
    assert!(!bench.is_armed());
    assert_eq!((bench.active(), following(&bench)), (bench.stored(), before));
}
