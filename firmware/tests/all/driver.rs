//! Tests of the joint driver on its bus: tools, masters and invalid traffic.

mod access;
mod adaptation;
mod attacks;
mod bench;
mod brake_test;
mod commissioning;
mod damaged_store;
mod drive;
mod drive_settings;
mod eds;
mod fd_telemetry;
mod hostile;
mod joint_encoder;
mod level_trend;
mod life;
mod lss;
mod network;
mod object_observer;
mod object_values;
mod offsets;
mod parameter_trial;
mod parameters;
mod pdos;
mod sensors;
mod start_values;
mod stock_master;
mod stored_home;
mod target_deadline;
mod touch_probe;
mod transfers;
mod trial_isolation;
mod tuning_record;

use bench::{Bench, NODE, frame};
use compensator_core::can::{Message, MotionFrame, SealFrame, SyncFrame};
use compensator_core::{Flags, LawKind, ParameterId};
use firmware::hil::{HilJoint, HilStep};
use firmware::node::dictionary::index;
use firmware::node_settings::NodeSettings;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Code;

const STATE_REFUSED: u32 = 0x0800_0022;

fn moving(sequence: u32) -> Message {
    let velocity_rad_s = 2.0 * (sequence as f32 * 0.05).sin();
    Message::Motion(NODE, MotionFrame { velocity_rad_s, position_rad: f32::NAN })
}

/// Sends one sample to a joint in HIL; returns the frames of its answer.
fn sample(bench: &mut Bench, sequence: u32) -> Vec<Message> {
    bench.give(moving(sequence));
    bench.give(Message::Sync(SyncFrame::of(sequence)));
    bench.messages()
}

#[test]
fn driver_is_silent_until_started_and_compensates_nothing_until_armed() {
    let mut bench = Bench::hil();
    // The start sends the boot-up message and an emergency for the default parameters.
    let begun = bench.sent();
    assert_eq!(begun[0], frame(0x701, &[0]));
    let code = Code::ParametersDefault;
    assert_eq!(begun[1].identifier(), 0x081);
    assert_eq!(begun[1].data()[3], code.number());
    assert_eq!(begun.len(), 2);
    assert!(sample(&mut bench, 0).is_empty());
    bench.start();
    let answers = sample(&mut bench, 0);
    let [Message::Answer(_, answer), Message::Status(_, status), Message::Telemetry(..)] =
        answers[..]
    else {
        panic!("{answers:?}")
    };
    assert_eq!(status.flags, Flags::DISABLED);
    assert_eq!(answer.friction_torque_nm, 0.0);
    assert_eq!(bench.number(index::STATE, 2), 0);
    bench.write(index::STATE, 1, &[1]).unwrap();
    assert_eq!(bench.number(index::STATE, 2), 1);
    let answers = sample(&mut bench, 1);
    let [Message::Answer(_, answer), ..] = answers[..] else { panic!("{answers:?}") };
    assert!(answer.friction_torque_nm != 0.0);
}

#[test]
fn armed_hil_answers_match_the_core_bit_for_bit() {
    let mut bench = Bench::hil();
    let mut set = ParameterSet::default();
    set.friction.model.law = LawKind::ImprovedLugre;
    set.friction.model.set(ParameterId::PressureCoulomb, 2e-6);
    bench.write(index::MODEL, 1, &[LawKind::ImprovedLugre as u8]).unwrap();
    let place = ParameterId::PressureCoulomb as u8 + 1;
    bench.write(index::PARAMETERS, place, &2e-6f32.to_le_bytes()).unwrap();
    bench.write(index::COMMIT, 3, &set.crc().to_le_bytes()).unwrap();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let mut core = HilJoint::build(NODE, &set.friction, None, NodeSettings::default().hil_setup())
        .expect("builds");
    core.set_enabled(true);
    for sequence in 0..2000 {
        // The pressure is received only now and then, so its age matters.
        if sequence % 37 == 0 {
            let pressure_diff_pa = 1e5 + sequence as f32;
            let seal =
                Message::Seal(NODE, SealFrame { radial_force_n: f32::NAN, pressure_diff_pa });
            core.take(&seal);
            bench.give(seal);
        }
        core.take(&moving(sequence));
        let HilStep::Reply(reply, 0) = core.sync(SyncFrame::of(sequence)) else { panic!() };
        let expected = [
            Message::Answer(NODE, reply.answer),
            Message::Status(NODE, reply.status),
            Message::Telemetry(NODE, reply.telemetry),
        ];
        let found: Vec<_> = sample(&mut bench, sequence).iter().map(Message::emit).collect();
        assert_eq!(found, expected.map(|message| message.emit()), "sample {sequence}");
    }
}

#[test]
fn nmt_stop_disarms() {
    for command in [2, 0x80] {
        let mut bench = Bench::hil();
        bench.start();
        bench.write(index::STATE, 1, &[1]).unwrap();
        assert!(bench.driver.joint.is_armed());
        bench.driver.receive(&frame(0, &[command, 0]), 0);
        assert!(!bench.driver.joint.is_armed());
    }
}

#[test]
fn telemetry_is_sent_at_the_configured_rate() {
    for (every, expected) in [(0u8, 0), (1, 100), (10, 10), (255, 1)] {
        let mut bench = Bench::hil();
        bench.write(index::OPERATION, 5, &[every]).unwrap();
        bench.start();
        let telemetry = (0..100)
            .flat_map(|sequence| sample(&mut bench, sequence))
            .filter(|message| matches!(message, Message::Telemetry(..)))
            .count();
        assert_eq!(telemetry, expected);
    }
}
