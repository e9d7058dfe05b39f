//! An armed joint: motion under current, faults, and parameters written over the bus.

use compensator_core::can::NodeId;
use compensator_core::{LawKind, ParameterId, Parameters};
use firmware::parameter_set::ParameterSet;
use joint_bus::canopen::Client;
use joint_bus::parameters::{read_set, write_set};
use joint_rig::{JointRig, OBSERVER_SETTLING_MS, RigBus, RigFaults, SealSensorFault, run_armed};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters as Plant};

fn set() -> ParameterSet {
    let mut set = ParameterSet::default();
    set.friction.model = Parameters::<f32>::new(LawKind::Lugre)
        .with(ParameterId::CoulombTorque, 1.6)
        .with(ParameterId::StaticTorque, 2.1)
        .with(ParameterId::StribeckVelocity, 0.2)
        .with(ParameterId::BristleStiffness, 3e3)
        .with(ParameterId::ViscousFriction, 0.1);
    set
}

/// Returns the position after 1 s of constant current, and whether the driver is still armed.
fn pushed(set: &ParameterSet, seed: u64, faults: RigFaults) -> (f64, bool) {
    let plant = JointPlant::with_phase(&Plant::default(), Load::Free, [0.1, 0.2], seed);
    let work = |rig: &mut JointRig| {
        (0..1000).for_each(|_| rig.step_with_command(1.2, 1.0));
        assert!((rig.master_view().position_rad as f64 - rig.plant().position_rad()).abs() < 0.05);
        (rig.plant().position_rad(), rig.is_armed())
    };
    run_armed(set, plant, faults, work).expect("a driver that arms")
}

#[test]
fn armed_driver_moves_plant_and_repeats_bit_for_bit() {
    let healthy = RigFaults::default();
    let (compensated, armed) = pushed(&set(), 1, healthy);
    assert!(armed && compensated > 0.5, "{compensated}");
    let mut off = set();
    off.friction.compensator.scale = 0.0;
    let (stuck, _) = pushed(&off, 1, healthy);
    assert!(stuck < 0.02, "1.2 A is below the breakaway: {stuck}");
    assert_eq!(pushed(&set(), 1, healthy).0.to_bits(), compensated.to_bits());
    assert_ne!(pushed(&set(), 2, healthy).0.to_bits(), compensated.to_bits());
    for seal in [
        SealSensorFault::Stale,
        SealSensorFault::Stuck,
        SealSensorFault::Dropped,
        SealSensorFault::Absent,
    ] {
        assert!(pushed(&set(), 1, RigFaults::seal_sensor(seal)).1, "{seal:?}");
    }
    let late = RigFaults { delay_ms: 3, encoder_lost: 0.05, ..RigFaults::default() };
    assert!(pushed(&set(), 1, late).1);
}

#[test]
fn parameter_set_written_over_bus_takes_effect_after_disarming() {
    let mut slack = set();
    slack.friction.compensator.scale = 0.0;
    let moved = |rig: &mut JointRig| {
        let from = rig.plant().position_rad();
        (0..1000).for_each(|_| rig.step_with_command(1.2, 1.0));
        rig.plant().position_rad() - from
    };
    let work = |rig: &mut JointRig| {
        let before = moved(rig);
        let mut client = Client::new(RigBus::new(rig), NodeId::FIRST);
        let refused = write_set(&mut client, &set()).expect_err("it is armed");
        // Abort code of CiA 301: not in this state of the device.
        assert!(refused.to_string().contains("08000022"), "{refused}");
        rig.request_state(0);
        (0..OBSERVER_SETTLING_MS).for_each(|_| rig.step_idle());
        let mut client = Client::new(RigBus::new(rig), NodeId::FIRST);
        assert_eq!(write_set(&mut client, &set()).expect("a set"), set().crc());
        assert_eq!(read_set(&mut client).expect("a set").emit(), set().emit());
        rig.arm(rig.plant().position_rad()).expect("it arms again");
        (before, moved(rig))
    };
    let plant = JointPlant::with_phase(&Plant::default(), Load::Free, [0.1, 0.2], 1);
    let (before, after) = run_armed(&slack, plant, RigFaults::default(), work).expect("a joint");
    // 1.2 A is below the breakaway: it moves only with compensated friction.
    assert!(before < 0.02 && after > 0.3, "{before} {after}");
}

#[test]
fn run_armed_with_rejected_set_names_parameter() {
    let mut refused = set();
    refused.friction.model.set(ParameterId::StaticTorque, 0.5);
    let plant = JointPlant::new(&Plant::default(), Load::Free, 1);
    let why = run_armed(&refused, plant, RigFaults::default(), |_| ()).unwrap_err();
    assert!(why.to_string().contains("static_torque"), "{why}");
}
