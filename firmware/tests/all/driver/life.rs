//! Tests of start, heartbeat and reports of a driver.

use super::bench::{Bench, Flash, NODE, frame};
use super::moving;
use compensator_core::can::{
    Frame, JointKind, Message, MotionFrame, SyncFrame, TorqueFrame, TraceEntry,
};
use firmware::driver::Boot;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::StateObject;
use firmware::node_settings::InputSource;
use firmware::supervisor::{Code, ResetCause, SelfTest};

/// Returns emergency code and manufacturer code of each emergency.
fn emergencies(bench: &mut Bench) -> Vec<(u16, u8)> {
    let frames = bench.sent();
    let emergencies = frames.iter().filter(|frame| frame.identifier() == 0x081);
    emergencies
        .map(|frame| (u16::from_le_bytes([frame.data()[0], frame.data()[1]]), frame.data()[3]))
        .collect()
}

#[test]
fn panic_before_reset_is_reported_and_prevents_arming() {
    let boot = Boot {
        cause: ResetCause::Software,
        panic: Some("panicked at src/x.rs:7: no"),
        ..Boot::default()
    };
    let mut bench = Bench::boot(InputSource::Bus, Flash::new(), &boot);
    let code = Code::PanicBeforeReset;
    assert!(emergencies(&mut bench).contains(&(code.info().emergency, code.number())));
    assert_eq!(Some(&*bench.text(index::LAST_PANIC)), boot.panic);
    bench.start();
    assert_eq!(bench.number(index::STATE, 2), 2);
    assert_eq!(bench.write(index::STATE, 1, &[1]), Err(0x0800_0022));
    bench.check_refusal("panic before reset", &[": panic-before-reset"]);
    assert!(bench.number(index::ERROR_FIELD, 0) > 0);
    bench.write(index::STATE, 1, &[2]).unwrap();
    bench.write(index::STATE, 1, &[1]).unwrap();
    assert!(bench.driver.joint.is_armed());
}

#[test]
fn awaited_heartbeat_that_is_missing_disarms_the_joint() {
    let mut bench = Bench::hil();
    bench.write(index::AWAITED_HEARTBEAT, 1, &(9u32 << 16 | 50).to_le_bytes()).unwrap();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    bench.driver.receive(&frame(0x709, &[5]), bench.now_us);
    bench.pass_ms(50);
    assert!(bench.driver.joint.is_armed());
    emergencies(&mut bench);
    bench.pass_ms(2);
    assert!(!bench.driver.joint.is_armed());
    let code = Code::HeartbeatLost;
    assert!(emergencies(&mut bench).contains(&(code.info().emergency, code.number())));
    assert_eq!(bench.write(index::STATE, 1, &[1]), Err(0x0800_0022));
    bench.driver.receive(&frame(0x709, &[5]), bench.now_us);
    bench.pass_ms(1);
    bench.write(index::STATE, 1, &[2]).unwrap();
    bench.write(index::STATE, 1, &[1]).unwrap();
}

#[test]
fn heartbeat_is_sent_at_the_configured_period() {
    let mut bench = Bench::hil();
    bench.write(index::HEARTBEAT, 0, &200u16.to_le_bytes()).unwrap();
    bench.sent();
    bench.pass_ms(1000);
    let beats = bench.sent().iter().filter(|frame| frame.identifier() == 0x701).count();
    assert_eq!(beats, 5);
}

#[test]
fn nmt_reset_requests_a_restart() {
    let mut bench = Bench::hil();
    assert!(!bench.driver.is_reset_requested());
    bench.driver.receive(&frame(0, &[0x81, 2]), 0);
    assert!(!bench.driver.is_reset_requested());
    bench.driver.receive(&frame(0, &[0x81, 1]), 0);
    assert!(bench.driver.is_reset_requested());
}

#[test]
fn communication_restart_keeps_the_parameters() {
    let mut bench = Bench::hil();
    bench.start();
    bench.write(index::COMPENSATOR, 1, &0.5f32.to_le_bytes()).unwrap();
    bench.driver.receive(&frame(0, &[0x82, 1]), 0);
    assert_eq!(bench.sent(), [frame(0x701, &[0])]);
    assert_eq!(bench.number(index::COMPENSATOR, 1), 0.5f32.to_bits());
}

#[test]
fn trace_entries_set_run_and_sample_number() {
    let mut bench = Bench::hil();
    bench.start();
    bench.sent();
    for entry in
        [TraceEntry::JointKind(JointKind::Prismatic), TraceEntry::Run(41), TraceEntry::Sequence(7)]
    {
        bench.give(Message::Entry(NODE, entry));
        assert_eq!(bench.sent().len(), 1, "an SDO answer");
    }
    assert_eq!(bench.number(index::TRACE, 1), 41);
    assert_eq!(bench.number(index::TRACE, 3), 1);
    bench.give(moving(0));
    bench.give(Message::Sync(SyncFrame { counter: 8 }));
    let status = bench.messages().into_iter().find_map(|message| match message {
        Message::Status(_, status) => Some(status.sequence),
        _ => None,
    });
    assert_eq!(status, Some(7));
}

#[test]
fn residual_beyond_the_band_is_flagged_and_counted() {
    let mut bench = Bench::hil();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let run = |bench: &mut Bench, first: u32, wear_nm: f32| {
        for sequence in first..first + 60_000 {
            // The joint slides back and forth; its friction is that of the model plus wear.
            let velocity_rad_s = if sequence % 2000 < 1000 { 1.0 } else { -1.0 };
            let torque_nm = (1.0 + wear_nm) * velocity_rad_s;
            bench.give(Message::Motion(
                NODE,
                MotionFrame { velocity_rad_s, position_rad: f32::NAN },
            ));
            bench.give(Message::Torque(NODE, TorqueFrame { torque_nm, load_torque_nm: f32::NAN }));
            bench.give(Message::Sync(SyncFrame::of(sequence)));
            bench.sent();
        }
    };
    run(&mut bench, 0, 0.0);
    bench.pass_ms(1);
    assert_eq!(bench.number(index::WATCH, 1), 1, "in band");
    run(&mut bench, 60_000, 0.4);
    bench.pass_ms(1);
    assert_eq!(bench.number(index::WATCH, 1), 0, "out of band");
    assert!(bench.number(index::WATCH, 3) > 0);
}

#[test]
fn failed_self_test_is_reported_by_its_number() {
    let boot = Boot { failed_self_test: Some(SelfTest::Comparator(3)), ..Boot::default() };
    let mut bench = Bench::boot(InputSource::Sensors, Flash::new(), &boot);
    let is_reported = |frame: &Frame| {
        let data = frame.data();
        frame.identifier() == 0x081 && data[3] == Code::SelfTestFailed.number() && data[5] == 13
    };
    assert!(bench.sent().iter().any(is_reported));
    bench.start();
    bench.commission();
    assert_eq!(bench.number(index::STATE, StateObject::FAILED_SELF_TEST), 13);
    for request in [1, 2] {
        assert!(bench.write(index::STATE, 1, &[request]).is_err());
        let why = bench.text(index::REFUSAL);
        assert!(why.contains("self-test-failed") && why.contains("13: comparator 3"), "{why}");
    }
    let mut bench = Bench::on_sensors();
    assert_eq!(bench.number(index::STATE, StateObject::FAILED_SELF_TEST), 0);
}
