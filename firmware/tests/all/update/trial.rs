//! Why the times and the number of trials are what they are: what half and twice each of them does.

use super::bench::{End, confirm, flash_with, package, receive, start};
use super::{order_restart, started};
use firmware::update::trial::{Times, Trial, Verdict};
use std::ops::Range;

/// Time that `host-sim update` waits for the end of a trial, s.
const HOST_TIMEOUT_S: f64 = 30.0;
/// Time of a restart with a check of the signature at 16 MHz, estimated, s.
const RESTART_S: f64 = 3.0;

const fn confirm_times(factor_half: u64) -> Times {
    Times { confirm_us: Times::DEFAULT.confirm_us * factor_half / 2, ..Times::DEFAULT }
}

const fn end_times(factor_half: u64) -> Times {
    Times { end_us: Times::DEFAULT.end_us * factor_half / 2, ..Times::DEFAULT }
}

/// Runs a trial during which these times have a blocking fault, ms; returns its result and its time, ms.
fn run(times: &Times, is_blocked: impl Fn(u64) -> bool) -> (Verdict, u64) {
    let mut trial = Trial::begin(0);
    let verdicts = (0..60_000).map(|ms| (trial.step(times, is_blocked(ms), 1000 * ms), ms));
    let ended = verdicts.filter(|(verdict, _)| *verdict != Verdict::Runs);
    ended.into_iter().next().expect("every trial ends")
}

fn within(faults: Range<u64>) -> impl Fn(u64) -> bool {
    move |ms| faults.contains(&ms)
}

#[test]
fn confirm_time_halved_confirms_a_program_that_fails_in_its_slowest_work() {
    // The work of each second fails when it runs first, and is noticed 100 ms later.
    let fails_after_a_second = within(1100..u64::MAX);
    assert_eq!(run(&confirm_times(1), &fails_after_a_second), (Verdict::Confirm, 1000));
    for factor_half in [2, 4] {
        let result = run(&confirm_times(factor_half), &fails_after_a_second);
        assert_eq!(result, (Verdict::End, 10_000));
    }
}

#[test]
fn confirm_time_doubled_rejects_a_good_program_on_a_disturbed_bus() {
    // The controller is off the bus for 100 ms of every 3 s.
    let is_disturbed = |ms: u64| ms % 3000 < 100;
    assert_eq!(run(&confirm_times(1), is_disturbed).0, Verdict::Confirm);
    assert_eq!(run(&confirm_times(2), is_disturbed), (Verdict::Confirm, 2099));
    assert_eq!(run(&confirm_times(4), is_disturbed), (Verdict::End, 10_000));
}

#[test]
fn trial_time_halved_rejects_a_good_program_whose_bus_comes_late() {
    // Off the bus until the other nodes have restarted, too.
    let comes_late = within(0..4000);
    assert_eq!(run(&end_times(1), &comes_late), (Verdict::End, 5000));
    for factor_half in [2, 4] {
        assert_eq!(run(&end_times(factor_half), &comes_late), (Verdict::Confirm, 5999));
    }
}

#[test]
fn trial_time_doubled_exceeds_the_wait_of_the_host() {
    // The longest way to the old program: a restart that is ordered just before the end, and a second trial.
    let longest_s = |times: &Times| {
        let (verdict, ms) = run(times, |_| true);
        assert_eq!(verdict, Verdict::End);
        2.0 * ms as f64 * 1e-3 + RESTART_S
    };
    assert!(longest_s(&end_times(2)) < HOST_TIMEOUT_S);
    assert!(longest_s(&end_times(4)) > HOST_TIMEOUT_S);
}

/// With half the number, which is one or two starts, this good program is rejected. With twice the number, a program that
/// pulls down the supply restarts six times before the old one returns.
#[test]
fn trial_with_an_ordered_restart_and_a_loss_of_power_needs_its_third_start() {
    let mut flash = flash_with(&package(1, 5));
    assert_eq!(receive(&mut flash, 0, &package(2, 5)), End::Done);
    assert_eq!(start(&mut flash, true), started(1, true));
    order_restart(&mut flash);
    assert_eq!(start(&mut flash, true), started(1, true));
    // The power is lost.
    assert_eq!(start(&mut flash, false), started(1, true));
    confirm(&mut flash, 1).unwrap();
    assert_eq!(start(&mut flash, true), started(1, false));
}
