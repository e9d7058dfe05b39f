//! A user who interrupts: the joint rests, disarmed, with its former set.

use super::{Bench, options};
use canopen_rs::Address;
use friction_results::tune::TuneOutcome;
use joint_tuning::{TuneUser, trial_set, tune};
use std::cell::Cell;
use std::rc::Rc;

/// Interrupts some targets after a line of progress.
struct Interrupter {
    after: &'static str,
    targets_left: Rc<Cell<Option<u32>>>,
}

impl TuneUser for Interrupter {
    fn confirms(&mut self, _: &str) -> bool {
        true
    }

    fn progress(&mut self, line: &str) {
        if line.starts_with(self.after) && self.targets_left.get().is_none() {
            self.targets_left.set(Some(300));
        }
    }
}

/// Interrupts a session 1.5 s of motion after a line of progress.
fn interrupted(after: &'static str) {
    let bench = Bench::new(7, "position-ripple", |_| ());
    let targets_left = Rc::new(Cell::new(None));
    let mut user = Interrupter { after, targets_left: targets_left.clone() };
    let moved_rad_s = Rc::new(Cell::new(0.0));
    let (node, moved) = (bench.node.clone(), moved_rad_s.clone());
    let is_interrupted = move || {
        let Some(left) = targets_left.get() else { return false };
        targets_left.set(Some(left.saturating_sub(1)));
        moved.set(f64::max(moved.get(), node.borrow().plant().velocity_rad_s().abs()));
        left == 0
    };
    let session = tune(bench.client(), &options(300.0, 7), Box::new(is_interrupted), &mut user)
        .expect("a session");
    assert_eq!(session.report.outcome, TuneOutcome::Returned("interrupted".into()), "{after}");
    assert_eq!(session.report.warnings, Vec::<String>::new(), "{after}");
    assert!(moved_rad_s.get() > 0.02, "{after}: {} rad/s", moved_rad_s.get());
    assert!(!bench.is_armed(), "{after}");
    bench.run_for_ms(300);
    assert!(bench.velocity_rad_s().abs() < 0.01, "{after}: {} rad/s", bench.velocity_rad_s());
    assert_eq!(bench.active(), bench.stored(), "{after}");
    let state = Address::new(trial_set::TRIAL, 3);
    assert_ne!(bench.client().read_number(state).expect("an answer"), 1, "{after}: an open trial");
}

#[test]
fn interrupt_in_the_baseline_leaves_the_joint_at_rest_with_its_former_set() {
    interrupted("baseline:");
}

#[test]
fn interrupt_in_the_screening_leaves_the_joint_at_rest_with_its_former_set() {
    interrupted("loop: crossover");
}

#[test]
fn interrupt_in_the_study_leaves_the_joint_at_rest_with_its_former_set() {
    interrupted("candidate:");
}

#[test]
fn interrupt_in_the_trial_leaves_the_joint_at_rest_with_its_former_set() {
    interrupted("trial:");
}
