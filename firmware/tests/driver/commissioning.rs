//! Commissioning by the driver itself, as a tool orders it: what it refuses, what ends it, and that nothing is left of it.

use super::bench::Bench;
use compensator_core::can::{Command, Message};
use firmware::driver::LoopReport;
use firmware::driver::commissioning::{Reason, Step};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRun as Run;

const RUN: u16 = index::COMMISSIONING_RUN;
const REFUSED: Result<(), u32> = Err(0x0800_0022);
const OUT_OF_RANGE: Result<(), u32> = Err(0x0609_0030);

fn measured() -> LoopReport {
    LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        sample_age_us: Some(10),
        ..LoopReport::default()
    }
}

fn pass(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.report(&measured());
        bench.pass_ms(1);
    }
}

fn order(bench: &mut Bench, order: u8) -> Result<(), u32> {
    bench.write(RUN, Run::ORDER, &[order])
}

/// A blank joint that measures itself.
fn blank() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.start();
    pass(&mut bench, 20);
    bench.sent();
    bench
}

#[test]
fn a_blank_joint_is_armed_for_it_and_for_nothing_else() {
    let mut bench = blank();
    order(&mut bench, 1).unwrap();
    let orders = bench.driver.orders(bench.now_us);
    assert!(orders.bridge && !orders.compensation && orders.probe.is_some());
    // Somebody who commands has no say, nor has who arms; nothing is written either.
    let command = Command::new(20.0, 1.0, 7);
    bench.give(Message::Command(super::NODE, command));
    assert_eq!(bench.driver.orders(bench.now_us).setpoint.current_a, 0.0);
    assert_eq!(bench.write(index::STATE, 1, &[1]), REFUSED);
    assert!(bench.text(index::REFUSAL).contains("commissions itself"));
    assert_eq!(bench.write(RUN, Run::CURRENT, &5.0f32.to_le_bytes()), REFUSED);
    assert_eq!(bench.write(index::COMMIT, 3, &[0; 4]), REFUSED);
    assert_eq!(order(&mut bench, 1), REFUSED, "it runs already");
    // Stopped, it is as it was: nobody has confirmed anything.
    order(&mut bench, 0).unwrap();
    let orders = bench.driver.orders(bench.now_us);
    assert!(!orders.bridge && orders.probe.is_none());
    assert_eq!(bench.number(RUN, Run::REASON), Reason::Stopped as u32);
    assert_eq!(bench.write(index::STATE, 1, &[1]), REFUSED);
    assert!(bench.text(index::REFUSAL).contains("not-commissioned"));
    assert_eq!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2), "nothing is staged");
    // One who goes on with what has ended begins nothing.
    order(&mut bench, 2).unwrap();
    assert!(!bench.driver.orders(bench.now_us).bridge);
    assert_eq!(order(&mut bench, 4), OUT_OF_RANGE);
    // To move by itself it has to be commissioned.
    assert_eq!(bench.write(index::COMMISSIONING_RUN, Run::ORDER, &[3]), REFUSED);
    assert!(bench.text(index::REFUSAL).contains("not-commissioned"));
}

/// A commissioned joint in a friction run, its range 0.3 rad, at up to 1 rad/s and 4 A.
fn rubbing() -> Bench {
    let mut bench = blank();
    bench.commission();
    for (place, value) in [(Run::CURRENT, 4.0f32), (Run::TRAVEL, 0.3), (Run::SPEED, 1.0)] {
        bench.write(RUN, place, &value.to_le_bytes()).unwrap();
    }
    order(&mut bench, 3).unwrap();
    bench
}

/// Milliseconds in which the joint is where `at` says, at a velocity, and the master lives.
fn pass_by(bench: &mut Bench, milliseconds: u32, velocity_rad_s: f32, at: impl Fn(u32) -> f32) {
    for ms in 0..milliseconds {
        let report = LoopReport { turned_rad: at(ms), velocity_rad_s, ..measured() };
        bench.driver.report(&report);
        bench.pass_ms(1);
        if ms % 20 == 0 {
            order(bench, 2).unwrap();
        }
    }
}

#[test]
fn a_friction_run_moves_in_its_bounds_and_ends_at_each() {
    let ends_for = |bench: &mut Bench, reason: Reason| {
        let orders = bench.driver.orders(bench.now_us);
        assert!(!bench.driver.is_armed() && !orders.bridge, "{reason:?}");
        assert_eq!(bench.number(RUN, Run::REASON), reason as u32);
    };
    let mut bench = rubbing();
    pass_by(&mut bench, 100, 0.5, |ms| 5.0 + 5e-4 * ms as f32);
    let orders = bench.driver.orders(bench.now_us);
    assert!(orders.bridge && !orders.compensation && orders.probe.is_none());
    assert_eq!(orders.setpoint.velocity_reference_rad_s, 1.0);
    assert!(orders.setpoint.current_a > 1.0 && orders.setpoint.current_a <= 4.0);
    assert_eq!(bench.number(RUN, Run::STEP), Step::Rubbing as u32);
    // Near the end of the range it turns back, and the current with it.
    pass_by(&mut bench, 100, 0.5, |_| 5.24);
    let reference = bench.driver.orders(bench.now_us).setpoint.velocity_reference_rad_s;
    assert!((reference + 1.0).abs() < 1e-5, "{reference}");
    pass_by(&mut bench, 1, 0.5, |_| 5.31);
    ends_for(&mut bench, Reason::Travel);
    let mut bench = rubbing();
    pass_by(&mut bench, 800, 0.0, |_| 5.0);
    ends_for(&mut bench, Reason::JointHeld);
    let mut bench = rubbing();
    pass_by(&mut bench, 2, 1.9, |_| 5.0);
    ends_for(&mut bench, Reason::TooFast);
    let mut bench = rubbing();
    pass_by(&mut bench, 2, f32::NAN, |_| 5.0);
    ends_for(&mut bench, Reason::NoAnswer);
    let mut bench = rubbing();
    pass(&mut bench, 105);
    assert!(!bench.driver.is_armed());
    let mut bench = rubbing();
    order(&mut bench, 0).unwrap();
    ends_for(&mut bench, Reason::Stopped);
    // Its bounds have bounds, and nobody arms it beside.
    for (place, value) in [(Run::SPEED, 0.0f32), (Run::SPEED, 13.0), (Run::SPEED, f32::NAN)] {
        assert_eq!(bench.write(RUN, place, &value.to_le_bytes()), OUT_OF_RANGE);
    }
    order(&mut bench, 3).unwrap();
    assert_eq!(bench.write(index::STATE, 1, &[1]), REFUSED);
}

#[test]
fn it_ends_with_its_master_and_its_loop() {
    let mut bench = blank();
    order(&mut bench, 1).unwrap();
    pass(&mut bench, 99);
    assert!(bench.driver.is_armed());
    pass(&mut bench, 2);
    assert!(!bench.driver.orders(bench.now_us).bridge);
    assert_eq!(bench.number(RUN, Run::REASON), Reason::Fault as u32);
    assert!(order(&mut bench, 1).is_err(), "the fault stands");
    order(&mut bench, 2).unwrap();
    pass(&mut bench, 1);
    bench.write(index::STATE, 1, &[2]).unwrap();
    // A loop that measures nothing is not waited for.
    order(&mut bench, 1).unwrap();
    for _ in 0..50 {
        pass(&mut bench, 10);
        order(&mut bench, 2).unwrap();
    }
    assert_eq!(bench.number(RUN, Run::STEP), Step::Aborted as u32);
    assert_eq!(bench.number(RUN, Run::REASON), Reason::NoAnswer as u32);
    assert!(!bench.driver.is_armed());
}

#[test]
fn what_stands_against_arming_stands_against_it() {
    let mut unmeasured = Bench::on_sensors();
    unmeasured.start();
    unmeasured.pass_ms(5);
    assert_eq!(order(&mut unmeasured, 1), REFUSED);
    let mut hil = Bench::hil();
    assert_eq!(order(&mut hil, 1), REFUSED);
    assert!(hil.text(index::REFUSAL).contains("no motor"));
    // Bounds are bounds.
    let mut bench = blank();
    for (place, number) in [(Run::CURRENT, 27.0f32), (Run::CURRENT, f32::NAN), (Run::TRAVEL, 0.0)] {
        assert_eq!(bench.write(RUN, place, &number.to_le_bytes()), OUT_OF_RANGE, "{number}");
    }
    bench.write(RUN, Run::CURRENT, &3.0f32.to_le_bytes()).unwrap();
    assert_eq!(f32::from_bits(bench.number(RUN, Run::CURRENT)), 3.0);
    order(&mut bench, 1).unwrap();
    let probe = bench.driver.orders(bench.now_us).probe.expect("a run");
    assert!(probe.trip_a <= 1.5 * 3.0 + 0.5 && probe.along_v == 0.0);
}
