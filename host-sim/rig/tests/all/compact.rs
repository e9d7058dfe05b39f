//! The compact node of small chips, in closed loop with the simulated joint.

use crate::closed_loop::rig::{Joint, Master, set};
use compensator_core::can::NodeId;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::supervisor::{Code, CodeSet};
use joint_bus::canopen::Client;
use joint_bus::parameters::{read_set, write_set};
use joint_rig::{EncoderFault, RigBus, run_compact_from_power_up};
use std::f64::consts::TAU;

/// Half of the friction: a compensation of 0.9 whose model is within 20 % leaves less of the error.
const COMPENSATED_SHARE: f64 = 0.5;

/// Powers a joint with a compact node up.
fn run<R>(joint: &Joint, work: impl FnOnce(&mut Master) -> R) -> R {
    let plant = joint.plant();
    let inertia = plant.inertia_kg_m2();
    run_compact_from_power_up(&joint.start(), plant, joint.faults, |rig| {
        work(&mut Master::new(rig, inertia))
    })
    .expect("a set that builds")
}

/// Returns the root mean square of the velocity error on a sine of ±1 rad/s with reversals, rad/s.
fn velocity_error_rad_s(share: f32) -> f64 {
    run(&Joint::with(set(share)), |master| {
        master.arm().expect("it arms");
        let mut sum = 0.0;
        for k in 0..3000 {
            let (sine, cosine) = (TAU * 0.5 * f64::from(k) * 1e-3).sin_cos();
            master.follow(cosine, -TAU * 0.5 * sine);
            if k >= 1000 {
                sum += (master.rig.plant().velocity_rad_s() - cosine).powi(2);
            }
        }
        assert!(master.rig.is_armed(), "{:?}", master.faults());
        (sum / 2000.0).sqrt()
    })
}

#[test]
fn compact_node_compensates_friction_of_a_joint_with_reversals() {
    let (with, without) = (velocity_error_rad_s(0.9), velocity_error_rad_s(0.0));
    let share = with / without;
    println!("compact node: velocity error {with:.4} rad/s, {without:.4} without: {share:.3}");
    assert!(share < COMPENSATED_SHARE, "{with} {without}");
}

/// Arms a joint, applies this fault and returns the latched faults and whether the bridge is open.
fn faults_after(
    joint: &Joint,
    milliseconds: usize,
    fault: impl FnOnce(&mut Master),
) -> (CodeSet, bool) {
    run(joint, |master| {
        master.arm().expect("it arms");
        master.current(100, 2.0);
        fault(master);
        (0..milliseconds).for_each(|_| master.rig.step_idle());
        let is_open = master.rig.stage_mut().applied_duty().is_none();
        (master.rig.latched_faults(), is_open)
    })
}

#[test]
fn compact_node_without_set_points_opens_the_bridge() {
    let (faults, is_open) = faults_after(&Joint::with(set(0.9)), 200, |_| {});
    assert!(faults.contains(Code::CommandTimeout) && is_open, "{faults:?}");
}

#[test]
fn compact_node_without_encoder_opens_the_bridge() {
    let (faults, is_open) = faults_after(&Joint::with(set(0.9)), 0, |master| {
        let board = master.rig.stage_mut().board.as_mut().expect("a board");
        board.set_encoder(EncoderFault::Low);
        master.current(60, 2.0);
    });
    assert!(faults.contains(Code::EncoderLost) && is_open, "{faults:?}");
}

#[test]
fn compact_node_with_overcurrent_opens_the_bridge() {
    let mut set = set(0.9);
    set.thresholds.overcurrent_a = 6.0;
    let (faults, is_open) = faults_after(&Joint::with(set), 0, |master| master.current(50, 10.0));
    assert!(faults.contains(Code::Overcurrent) && is_open, "{faults:?}");
}

#[test]
fn compact_node_not_commissioned_refuses_to_arm_with_the_reason() {
    let joint = Joint { commissioned: false, ..Joint::with(set(0.9)) };
    let refused = run(&joint, |master| master.arm());
    let reason = refused.expect_err("the wiring is not confirmed");
    assert!(reason.contains("not-commissioned"), "{reason}");
}

#[test]
fn compact_node_keeps_a_set_of_the_host_across_a_reset() {
    let written = set(0.9);
    let joint = Joint { set: None, commissioned: false, ..Joint::with(set(0.0)) };
    run(&joint, |master| {
        let node = NodeId::FIRST;
        let client = &mut Client::new(RigBus::new(master.rig), node);
        let crc = write_set(client, &written).expect("the set is accepted");
        assert_eq!(crc, written.crc());
        let at = |index, sub_index| canopen_rs::Address::new(index, sub_index);
        let wiring = client.read_number(at(index::COMMISSIONING, 2)).expect("the wiring");
        client.write(at(index::COMMISSIONING, 3), &wiring.to_le_bytes()).expect("confirmed");
        client.write(at(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes()).expect("saved");
        master.rig.reset();
        master.rig.restart().expect("a restart");
        master.current(200, 0.0);
        let client = &mut Client::new(RigBus::new(master.rig), node);
        assert_eq!(read_set(client).expect("a set").crc(), written.crc());
        master.arm().expect("a commissioned joint arms");
    });
}

#[test]
fn compact_node_refuses_objects_that_it_does_not_have() {
    run(&Joint::with(set(0.9)), |master| {
        for served in [index::WATCH, index::NETWORK, index::FRAME_COUNTERS] {
            assert!(master.rig.read_object(served, 1).is_some(), "{served:04X}");
        }
        for absent in [index::CONTROLWORD, index::SCOPE, index::PROGRAM_DATA, index::ACCESS] {
            assert_eq!(master.rig.read_object(absent, 0), None, "{absent:04X}");
        }
        assert_eq!(master.rig.read_object(index::DEVICE_TYPE, 0), Some(0));
        let client = &mut Client::new(RigBus::new(master.rig), NodeId::FIRST);
        let node = canopen_rs::Address::new(index::OPERATION, 6);
        let refused = client.write(node, &[128]).expect_err("no node number");
        assert!(refused.to_string().contains("node"), "{refused}");
        assert_eq!(client.read_number(node).expect("unchanged"), 1);
    });
}

#[test]
fn compact_node_that_is_armed_refuses_a_save() {
    run(&Joint::with(set(0.9)), |master| {
        master.arm().expect("it arms");
        let frame = |master: &mut Master, value: u32| {
            master.rig.write_object(index::STORE, 1, value.to_le_bytes());
            master.current(5, 0.0);
            master.rig.take_answers()
        };
        let answers = frame(master, SAVE_SIGNATURE);
        assert!(answers.iter().any(|frame| frame.data().first() == Some(&0x80)), "{answers:?}");
        assert!(master.rig.is_armed());
    });
}
