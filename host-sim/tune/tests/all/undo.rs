//! A tuning that is saved, and the way back.

use super::{Bench, User, options};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use joint_rig::JointEvent;
use joint_tuning::{trial_set, tune};

impl Bench {
    /// Resets the processor and waits until the driver answers again.
    fn reset(&self) {
        let restarts = self.node.borrow().restarts();
        self.node.borrow_mut().schedule(self.hub.now_ns(), JointEvent::ProcessorReset);
        self.run_for_ms(500);
        assert_eq!(self.node.borrow().restarts(), restarts + 1);
    }
}

#[test]
fn tune_that_gains_is_kept_over_a_reset_and_undo_brings_the_former_set_back() {
    let bench = Bench::new(7, "position-ripple", |_| ());
    assert_eq!(bench.active(), bench.stored());
    assert_eq!(trial_set::record(&mut bench.client()).expect("an answer"), None);

    let mut user = User::default();
    let session =
        tune(bench.client(), &options(300.0, 7), Box::new(|| false), &mut user).expect("a session");
    assert!(session.is_saved(), "{:?}", session.report.outcome);
    assert_eq!(user.questions.len(), 1);
    let tuned = (session.tried.as_ref().expect("a set").crc(), session.position_gain);
    assert_eq!(bench.active(), tuned);
    assert_ne!(tuned, bench.stored());
    assert!(!bench.is_armed());

    bench.reset();
    assert_eq!(bench.active(), tuned, "after a reset");
    let record = trial_set::record(&mut bench.client()).expect("an answer").expect("a record");
    assert_eq!(record.time_s, 1_800_000_000);
    assert_eq!((record.before_crc, record.tuned_crc), (bench.stored().0, tuned.0));
    assert!(record.gain_permille > 0);

    trial_set::undo(&mut bench.client()).expect("undone");
    assert_eq!(bench.active(), bench.stored(), "after the undo");
    assert_eq!(trial_set::record(&mut bench.client()).expect("an answer"), None);
    bench.reset();
    assert_eq!(bench.active(), bench.stored(), "after the undo and a reset");
    assert_eq!(trial_set::record(&mut bench.client()).expect("an answer"), None);
    let trial = Address::new(trial_set::TRIAL, 3);
    assert_ne!(bench.client().read_number(trial).expect("an answer"), 1, "no trial is open");
    let error = trial_set::undo(&mut bench.client()).expect_err("nothing to undo").to_string();
    assert!(!error.contains('\n'), "{error}");
    assert_eq!(bench.active(), bench.stored());
    let period = Address::new(index::INTERPOLATION_TIME, 1);
    assert_eq!(bench.client().read_number(period).expect("an answer"), 1, "time between targets");
}
