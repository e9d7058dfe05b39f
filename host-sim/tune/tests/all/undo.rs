//! A tuning that is saved, and the way back.

use super::{Bench, User, options};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use friction_results::tune::TuneArm;
use joint_rig::JointEvent;
use joint_tuning::{Session, trial_set, tune};

impl Bench {
    /// Resets the processor and waits until the driver answers again.
    fn reset(&self) {
        let restarts = self.node.borrow().restarts();
        self.node.borrow_mut().schedule(self.hub.now_ns(), JointEvent::ProcessorReset);
        self.run_for_ms(500);
        assert_eq!(self.node.borrow().restarts(), restarts + 1);
    }
}

/// Checks that the law is passive, that all sets were compared in a balanced order, and that the parts make up the whole.
fn check_report(session: &Session) {
    let report = &session.report;
    let tried = session.tried.as_ref().expect("a set");
    assert!(!tried.friction.model.choices.allow_active, "{:?}", report.parameters);
    assert_eq!(tried.validate(), Ok(()));
    assert_eq!((report.arm, report.trial.arms().len()), (TuneArm::New, 3));
    let places = TuneArm::ALL.map(|arm| {
        let blocks = report.trial.blocks.iter().enumerate();
        blocks.filter(|(_, block)| block.arm == arm).map(|(at, _)| at).sum::<usize>()
    });
    assert!(places.iter().all(|place| *place == places[0]), "{}", report.trial.order());
    let parts = report.parts.loop_gains.iter().zip(&report.parts.friction_model);
    for (whole, (of_loop, of_model)) in report.gains.iter().zip(parts) {
        let left = (1.0 - of_loop.gain) * (1.0 - of_model.gain);
        assert!((1.0 - whole.gain - left).abs() < 1e-9, "{whole:?}");
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
    check_report(&session);
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
    let window = Address::new(index::FOLLOWING_WINDOW, 0);
    let following = bench.client().read_number(window).expect("an answer");
    assert_eq!(following, session.before.following.error_micro_rad, "following error");
    let period = Address::new(index::INTERPOLATION_TIME, 1);
    assert_eq!(bench.client().read_number(period).expect("an answer"), 1, "time between targets");
}
