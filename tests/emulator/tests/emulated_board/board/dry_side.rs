//! The dry side of a joint with the image: leak probe, air in the housing, and safe torque off, through the board's pins,
//! converters and sensor bus.

use super::course::{rig, set};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use firmware::sensors::SensorParameters;
use firmware::sensors::bme280::Air;
use firmware::sensors::enclosure::Readings;
use firmware::supervisor::Code;
use joint_rig::JointRig;

/// Current that friction holds, A.
const CURRENT_A: f32 = 0.5;
const DRY: Air = Air { pressure_pa: 9.5e4, temperature_c: 15.0, humidity_percent: 10.0 };
const SOUND: Readings =
    Readings { leak_share: Some(0.9), air: Some(DRY), torque_allowed: Some([true; 2]) };

/// Returns a joint with all sensors of the dry side, whose first measurement of the air is there.
fn joint(leak_stops: f32, readings: Readings) -> JointRig {
    let sensors = SensorParameters {
        leak_connected: 1.0,
        air_connected: 1.0,
        sto_connected: 1.0,
        leak_stops,
        ..SensorParameters::default()
    };
    let mut joint = rig(&ParameterSet { sensors, ..set() }).expect("the image starts");
    joint.board_state_mut().enclosure = readings;
    (0..150).for_each(|_| joint.step_idle());
    joint
}

/// Returns such a joint that drives.
fn driving(leak_stops: f32, readings: Readings) -> JointRig {
    let mut joint = joint(leak_stops, readings);
    let at = joint.plant().position_rad();
    joint.arm(at).expect("it arms");
    drive(&mut joint, 20);
    assert!(joint.stage_mut().applied_duty().is_some());
    joint
}

fn drive(joint: &mut JointRig, milliseconds: usize) {
    (0..milliseconds).for_each(|_| joint.step_with_command(CURRENT_A, 0.0));
}

/// Drives on with these readings. Returns the time until the bridge is open, ms.
fn drive_until_open(joint: &mut JointRig, readings: Readings) -> Option<usize> {
    joint.board_state_mut().enclosure = readings;
    (1..=300).find(|_| {
        drive(joint, 1);
        joint.stage_mut().applied_duty().is_none()
    })
}

fn number(joint: &mut JointRig, sub_index: u8) -> f32 {
    f32::from_bits(joint.read_object(index::ENCLOSURE, sub_index).expect("an answer"))
}

#[test]
fn readings_of_dry_side_are_those_of_its_sensors() {
    let mut joint = joint(1.0, SOUND);
    for (sub_index, expected, tolerance) in
        [(1, 0.9, 1e-3), (2, 10.0, 0.1), (3, 9.5e4, 10.0), (4, 15.0, 0.02)]
    {
        let found = number(&mut joint, sub_index);
        assert!((found - expected).abs() < tolerance, "{sub_index}: {found}, not {expected}");
    }
    for channels in [[true, false], [false, true], [true, true]] {
        joint.board_state_mut().enclosure.torque_allowed = Some(channels);
        (0..3).for_each(|_| joint.step_idle());
        let expected = u32::from(channels[0]) | u32::from(channels[1]) << 1;
        assert_eq!(joint.read_object(index::ENCLOSURE, 5), Some(expected));
    }
}

#[test]
fn leak_stops_the_image_after_200_ms() {
    let mut joint = driving(1.0, SOUND);
    let wet = Readings { leak_share: Some(0.2), ..SOUND };
    let open_ms = drive_until_open(&mut joint, wet).expect("it stops");
    println!("measured: {open_ms} ms from the leak to the open bridge");
    assert!((199..=205).contains(&open_ms), "{open_ms} ms");
    assert!(joint.latched_faults().contains(Code::Leak));
}

#[test]
fn channel_of_safe_torque_off_opens_the_bridge_of_the_image() {
    let mut joint = driving(1.0, SOUND);
    for torque_allowed in [[false, true], [true, false]] {
        let off = Readings { torque_allowed: Some(torque_allowed), ..SOUND };
        let open_ms = drive_until_open(&mut joint, off).expect("it stops");
        println!("measured: {open_ms} ms from safe torque off to the open bridge");
        assert!(open_ms <= 3, "{open_ms} ms");
        assert!(joint.latched_faults().contains(Code::TorqueOff));
        joint.board_state_mut().enclosure = SOUND;
        (0..200).for_each(|_| joint.step_idle());
        joint.write_object_byte(index::STATE, 1, 2);
        drive(&mut joint, 5);
        joint.write_object_byte(index::STATE, 1, 1);
        drive(&mut joint, 60);
        assert!(joint.is_armed(), "{:?}", joint.latched_faults());
    }
}

#[test]
fn damp_or_pressed_housing_and_broken_probe_are_reported_and_do_not_stop() {
    let air = Air { pressure_pa: 1.5e5, humidity_percent: 70.0, ..DRY };
    let damp = Readings { leak_share: Some(0.2), air: Some(air), ..SOUND };
    let mut joint = driving(0.0, damp);
    drive(&mut joint, 3100);
    let limits = joint.active_limits();
    for code in [Code::HousingHumid, Code::HousingPressure, Code::LeakReported] {
        assert!(limits.contains(code), "{limits:?}");
    }
    joint.board_state_mut().enclosure = Readings { leak_share: Some(1.0), ..SOUND };
    drive(&mut joint, 1500);
    let limits = joint.active_limits();
    assert!(limits.contains(Code::EnclosureUnknown), "{limits:?}");
    assert!(!limits.contains(Code::LeakReported) && joint.is_armed(), "{limits:?}");
}
