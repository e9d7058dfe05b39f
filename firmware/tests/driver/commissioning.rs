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

fn pass(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.report(&LoopReport {
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            sample_age_us: Some(10),
            ..LoopReport::default()
        });
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
    assert_eq!(order(&mut bench, 3), OUT_OF_RANGE);
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
