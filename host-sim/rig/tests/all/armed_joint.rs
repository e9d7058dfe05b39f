//! An armed joint: motion under current, faults, and parameters written over the bus.

use compensator_core::can::NodeId;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Code;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::parameters::{ParametersError, read_set, write_set};
use joint_rig::{JointRig, OBSERVER_SETTLING_MS, RigBus, RigFaults, SealSensorFault, run_armed};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters as Plant};

/// Abort code of CiA 301: not in this state of the device.
const WRONG_DEVICE_STATE: u32 = 0x0800_0022;

/// Request to disarm, see [`JointRig::request_state`].
const DISARM: u8 = 0;

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

/// A joint after 1 s of constant current.
struct Pushed {
    position_rad: f64,
    is_armed: bool,
}

fn pushed(set: &ParameterSet, seed: u64, faults: RigFaults) -> Pushed {
    let plant = JointPlant::with_phase(&Plant::default(), Load::Free, [0.1, 0.2], seed);
    let work = |rig: &mut JointRig| {
        (0..1000).for_each(|_| rig.step_with_command(1.2, 1.0));
        assert!((rig.master_view().position_rad as f64 - rig.plant().position_rad()).abs() < 0.05);
        Pushed { position_rad: rig.plant().position_rad(), is_armed: rig.is_armed() }
    };
    run_armed(set, plant, faults, work).expect("a driver that arms")
}

#[test]
fn armed_driver_moves_plant_and_repeats_bit_for_bit() {
    let healthy = RigFaults::default();
    let Pushed { position_rad: compensated, is_armed } = pushed(&set(), 1, healthy);
    assert!(is_armed && compensated > 0.5, "{compensated}");
    let mut off = set();
    off.friction.compensator.scale = 0.0;
    let stuck = pushed(&off, 1, healthy).position_rad;
    assert!(stuck < 0.02, "1.2 A is below the breakaway: {stuck}");
    assert_eq!(pushed(&set(), 1, healthy).position_rad.to_bits(), compensated.to_bits());
    assert_ne!(pushed(&set(), 2, healthy).position_rad.to_bits(), compensated.to_bits());
    let late = RigFaults { delay_ms: 3, encoder_lost: 0.05, ..RigFaults::default() };
    assert!(pushed(&set(), 1, late).is_armed);
}

const STALE: [Code; 2] = [Code::RadialForceStale, Code::PressureStale];
const STUCK: [Code; 2] = [Code::RadialForceStuck, Code::PressureStuck];

/// A loaded joint after 3 s at 1 rad/s with a fault of its side-load and pressure sensors.
#[derive(Debug)]
struct Loaded {
    is_armed: bool,
    /// What it reports of [`STALE`] and [`STUCK`].
    reported: Vec<Code>,
    position_rad: f64,
    velocity_rad_s: f64,
}

fn loaded(set: &ParameterSet, seal: SealSensorFault) -> Loaded {
    let plant = JointPlant::with_phase(&Plant::default(), Load::Free, [0.1, 0.2], 1);
    let work = |rig: &mut JointRig| {
        let plant = &mut rig.stage_mut().plant;
        (plant.side_load_n, plant.around.pressure_diff_pa) = (100.0, 2e5);
        // Two of the faults begin 1.5 s after power-up.
        for _ in 0..3000 {
            let error_rad_s = 1.0 - rig.plant().velocity_rad_s();
            rig.step_with_command((10.0 * error_rad_s) as f32, 1.0);
        }
        let limits = rig.active_limits();
        Loaded {
            is_armed: rig.is_armed(),
            reported: STALE
                .into_iter()
                .chain(STUCK)
                .filter(|code| limits.contains(*code))
                .collect(),
            position_rad: rig.plant().position_rad(),
            velocity_rad_s: rig.plant().velocity_rad_s(),
        }
    };
    run_armed(set, plant, RigFaults::seal_sensor(seal), work).expect("a driver that arms")
}

#[test]
fn joint_with_failed_seal_sensors_reports_them_and_keeps_moving() {
    let mut set = set();
    let model = &mut set.friction.model;
    for term in [TermKind::RadialForceCoulomb, TermKind::PressureCoulomb] {
        assert!(model.add_term(term));
    }
    model.set(ParameterId::RadialForceCoulomb, 0.005);
    model.set(ParameterId::PressureCoulomb, 2e-6);
    model.envelope.radial_force_max_n = 400.0;
    model.envelope.pressure_diff_max_pa = 4e5;
    let healthy = loaded(&set, SealSensorFault::None);
    println!("{healthy:?}");
    assert!(healthy.is_armed && healthy.reported.is_empty());
    for (seal, expected) in [
        (SealSensorFault::Dropped, &[][..]),
        (SealSensorFault::Stale, &STALE),
        // A stuck reading ages from the first equal one on.
        (SealSensorFault::Stuck, &[STALE, STUCK].concat()),
        (SealSensorFault::Absent, &STALE),
    ] {
        let joint = loaded(&set, seal);
        println!("{seal:?}: {joint:?}");
        assert!(joint.is_armed && (0.8..1.1).contains(&joint.velocity_rad_s), "{seal:?}");
        assert_eq!(joint.reported, expected, "{seal:?}");
        // The failed readings reach the model, so the joint moves otherwise.
        assert_ne!(joint.position_rad, healthy.position_rad, "{seal:?}");
    }
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
        let ParametersError::Sdo(SdoError::Refused { code, .. }) = refused else {
            panic!("{refused}")
        };
        assert_eq!(code, WRONG_DEVICE_STATE);
        rig.request_state(DISARM);
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
