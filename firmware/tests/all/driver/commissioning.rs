//! Tests of commissioning as a tool commands it: refusals, reasons for its end, and the state after it.

use super::bench::Bench;
use compensator_core::can::{CommandFrame, Message};
use firmware::driver::LoopReport;
use firmware::driver::commissioning::{AbortReason, CommissioningStep};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRunObject as Run;

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
        bench.driver.joint.report(&measured());
        bench.pass_ms(1);
    }
}

fn order(bench: &mut Bench, order: u8) -> Result<(), u32> {
    bench.write(RUN, Run::ORDER, &[order])
}

/// Creates a joint without commissioning that measures its sensors.
fn blank() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.start();
    pass(&mut bench, 20);
    bench.sent();
    bench
}

#[test]
fn motor_measurement_arms_an_uncommissioned_joint_for_itself_only() {
    let mut bench = blank();
    order(&mut bench, 1).unwrap();
    let commands = bench.driver.joint.loop_commands(bench.now_us);
    assert!(commands.bridge && !commands.compensation && commands.probe.is_some());
    // Commands, arming and writes have no effect during the run.
    let command = CommandFrame::new(20.0, 1.0, 7);
    bench.give(Message::Command(super::NODE, command));
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a, 0.0);
    assert_eq!(bench.write(index::STATE, 1, &[1]), REFUSED);
    bench.check_refusal("commissioning is running", &[]);
    assert_eq!(bench.write(RUN, Run::CURRENT, &5.0f32.to_le_bytes()), REFUSED);
    assert_eq!(bench.write(index::COMMIT, 3, &[0; 4]), REFUSED);
    assert_eq!(order(&mut bench, 1), REFUSED, "it runs already");
    // After the stop the joint is still not commissioned.
    order(&mut bench, 0).unwrap();
    let commands = bench.driver.joint.loop_commands(bench.now_us);
    assert!(!commands.bridge && commands.probe.is_none());
    assert_eq!(bench.number(RUN, Run::REASON), AbortReason::Stopped as u32);
    assert_eq!(bench.write(index::STATE, 1, &[1]), REFUSED);
    assert!(bench.text(index::REFUSAL).contains("not-commissioned"));
    assert_eq!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2), "nothing is staged");
    // "Continue" after the end does not start a run.
    order(&mut bench, 2).unwrap();
    assert!(!bench.driver.joint.loop_commands(bench.now_us).bridge);
    assert_eq!(order(&mut bench, 4), OUT_OF_RANGE);
    // A friction run needs a commissioned joint.
    assert_eq!(bench.write(index::COMMISSIONING_RUN, Run::ORDER, &[3]), REFUSED);
    assert!(bench.text(index::REFUSAL).contains("not-commissioned"));
}

/// Creates a commissioned joint in a friction run, with a travel of 0.3 rad, up to 1 rad/s and 4 A.
fn in_friction_run() -> Bench {
    let mut bench = blank();
    bench.commission();
    for (place, value) in [(Run::CURRENT, 4.0f32), (Run::TRAVEL, 0.3), (Run::SPEED, 1.0)] {
        bench.write(RUN, place, &value.to_le_bytes()).unwrap();
    }
    order(&mut bench, 3).unwrap();
    bench
}

/// Advances the time with the joint at position `at` and a velocity, while the master confirms the run.
fn pass_in_run(bench: &mut Bench, milliseconds: u32, velocity_rad_s: f32, at: impl Fn(u32) -> f32) {
    for ms in 0..milliseconds {
        let report = LoopReport { turned_rad: at(ms), velocity_rad_s, ..measured() };
        bench.driver.joint.report(&report);
        bench.pass_ms(1);
        if ms % 20 == 0 {
            order(bench, 2).unwrap();
        }
    }
}

#[test]
fn friction_run_stays_in_its_limits_and_ends_at_each() {
    let ends_for = |bench: &mut Bench, reason: AbortReason| {
        let commands = bench.driver.joint.loop_commands(bench.now_us);
        assert!(!bench.driver.joint.is_armed() && !commands.bridge, "{reason:?}");
        assert_eq!(bench.number(RUN, Run::REASON), reason as u32);
    };
    let mut bench = in_friction_run();
    pass_in_run(&mut bench, 100, 0.5, |ms| 5.0 + 5e-4 * ms as f32);
    let commands = bench.driver.joint.loop_commands(bench.now_us);
    assert!(commands.bridge && !commands.compensation && commands.probe.is_none());
    assert_eq!(commands.setpoint.velocity_reference_rad_s, 1.0);
    assert!(commands.setpoint.current_a > 1.0 && commands.setpoint.current_a <= 4.0);
    assert_eq!(bench.number(RUN, Run::STEP), CommissioningStep::Rubbing as u32);
    // Near the end of the range it reverses, and the current too.
    pass_in_run(&mut bench, 100, 0.5, |_| 5.24);
    let reference =
        bench.driver.joint.loop_commands(bench.now_us).setpoint.velocity_reference_rad_s;
    assert!((reference + 1.0).abs() < 1e-5, "{reference}");
    pass_in_run(&mut bench, 1, 0.5, |_| 5.31);
    ends_for(&mut bench, AbortReason::Travel);
    let mut bench = in_friction_run();
    pass_in_run(&mut bench, 800, 0.0, |_| 5.0);
    ends_for(&mut bench, AbortReason::JointHeld);
    let mut bench = in_friction_run();
    pass_in_run(&mut bench, 2, 1.9, |_| 5.0);
    ends_for(&mut bench, AbortReason::TooFast);
    let mut bench = in_friction_run();
    pass_in_run(&mut bench, 2, f32::NAN, |_| 5.0);
    ends_for(&mut bench, AbortReason::NoAnswer);
    let mut bench = in_friction_run();
    pass(&mut bench, 105);
    assert!(!bench.driver.joint.is_armed());
    let mut bench = in_friction_run();
    order(&mut bench, 0).unwrap();
    ends_for(&mut bench, AbortReason::Stopped);
    // The limits have ranges, and the joint cannot be armed meanwhile.
    for (place, value) in [(Run::SPEED, 0.0f32), (Run::SPEED, 13.0), (Run::SPEED, f32::NAN)] {
        assert_eq!(bench.write(RUN, place, &value.to_le_bytes()), OUT_OF_RANGE);
    }
    order(&mut bench, 3).unwrap();
    assert_eq!(bench.write(index::STATE, 1, &[1]), REFUSED);
}

#[test]
fn motor_measurement_without_master_or_loop_ends() {
    let mut bench = blank();
    order(&mut bench, 1).unwrap();
    pass(&mut bench, 99);
    assert!(bench.driver.joint.is_armed());
    pass(&mut bench, 2);
    assert!(!bench.driver.joint.loop_commands(bench.now_us).bridge);
    assert_eq!(bench.number(RUN, Run::REASON), AbortReason::Fault as u32);
    assert!(order(&mut bench, 1).is_err(), "the fault stands");
    order(&mut bench, 2).unwrap();
    pass(&mut bench, 1);
    bench.write(index::STATE, 1, &[2]).unwrap();
    // A loop without measurements ends the run.
    order(&mut bench, 1).unwrap();
    for _ in 0..50 {
        pass(&mut bench, 10);
        order(&mut bench, 2).unwrap();
    }
    assert_eq!(bench.number(RUN, Run::STEP), CommissioningStep::Aborted as u32);
    assert_eq!(bench.number(RUN, Run::REASON), AbortReason::NoAnswer as u32);
    assert!(!bench.driver.joint.is_armed());
}

#[test]
fn motor_measurement_is_refused_like_arming() {
    let mut unmeasured = Bench::on_sensors();
    unmeasured.start();
    unmeasured.pass_ms(5);
    assert_eq!(order(&mut unmeasured, 1), REFUSED);
    let mut hil = Bench::hil();
    assert_eq!(order(&mut hil, 1), REFUSED);
    hil.check_refusal("commissioning in HIL", &[]);
    // Values outside the limits are refused.
    let mut bench = blank();
    for (place, number) in [(Run::CURRENT, 27.0f32), (Run::CURRENT, f32::NAN), (Run::TRAVEL, 0.0)] {
        assert_eq!(bench.write(RUN, place, &number.to_le_bytes()), OUT_OF_RANGE, "{number}");
    }
    bench.write(RUN, Run::CURRENT, &3.0f32.to_le_bytes()).unwrap();
    assert_eq!(f32::from_bits(bench.number(RUN, Run::CURRENT)), 3.0);
    order(&mut bench, 1).unwrap();
    let probe = bench.driver.joint.loop_commands(bench.now_us).probe.expect("a run");
    assert!(probe.trip_a <= 1.5 * 3.0 + 0.5 && probe.along_v == 0.0);
}
