//! Faults and refusals of the compact node of small chips. Scenario 29 runs it in closed loop.

use crate::closed_loop::rig::{Joint, Master, set};
use compensator_core::can::NodeId;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::supervisor::{Code, CodeSet};
use joint_bus::canopen::Client;
use joint_rig::{EncoderFault, RigBus, run_compact_from_power_up};

/// Powers a joint with a compact node up.
fn run<R>(joint: &Joint, work: impl FnOnce(&mut Master) -> R) -> R {
    let plant = joint.plant();
    let inertia = plant.inertia_kg_m2();
    run_compact_from_power_up(&joint.start(), plant, joint.faults, |rig| {
        work(&mut Master::new(rig, inertia))
    })
    .expect("a set that builds")
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
    assert!(reason.to_string().contains("not-commissioned"), "{reason}");
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
