//! Tests of a joint whose seal fails, or whose torque is switched off from outside, while it drives.

use super::driver::Joint;
use super::plant::Machine;
use firmware::parameter_set::ParameterSet;
use firmware::sensors::SensorParameters;
use firmware::sensors::bme280::Air;
use firmware::sensors::enclosure::Readings;
use firmware::supervisor::Code;

/// Current that friction holds, A: the joint stands, however long it is driven.
const CURRENT_A: f32 = 0.5;

const SOUND: Readings = Readings {
    leak_share: Some(0.9),
    air: Some(Air { pressure_pa: 9.5e4, temperature_c: 15.0, humidity_percent: 10.0 }),
    torque_allowed: Some([true; 2]),
};

/// Returns a joint that drives with all sensors of the dry side.
fn driving(sensors: SensorParameters) -> Joint {
    let sensors =
        SensorParameters { leak_connected: 1.0, air_connected: 1.0, sto_connected: 1.0, ..sensors };
    let mut joint =
        Joint::with(Machine::default(), &ParameterSet { sensors, ..ParameterSet::default() });
    joint.board.enclosure = SOUND;
    joint.run_ms(1200);
    joint.request_state(2);
    joint.drive_ms(0.0, 5);
    joint.request_state(1);
    joint.drive_ms(CURRENT_A, 100);
    assert!(joint.background.node().joint.is_armed() && joint.stage.is_on());
    joint
}

/// Drives on with these readings. Returns the time until the bridge is open, ms.
fn drive_until_open(joint: &mut Joint, readings: Readings) -> Option<usize> {
    joint.board.enclosure = readings;
    (1..=1500).find(|_| {
        joint.drive_ms(CURRENT_A, 1);
        !joint.stage.is_on()
    })
}

fn has_limit(joint: &Joint, code: Code) -> bool {
    joint.background.node().joint.supervisor().limits().contains(code)
}

#[test]
fn leak_stops_the_joint_after_200_ms() {
    let mut joint = driving(SensorParameters::default());
    let wet = Readings { leak_share: Some(0.2), ..SOUND };
    let open_ms = drive_until_open(&mut joint, wet).expect("it stops");
    assert!((199..=203).contains(&open_ms), "{open_ms} ms");
    assert!(joint.has_fault(Code::Leak));
}

#[test]
fn leak_that_is_only_reported_lets_the_joint_come_home() {
    let mut joint = driving(SensorParameters { leak_stops: 0.0, ..SensorParameters::default() });
    let wet = Readings { leak_share: Some(0.2), ..SOUND };
    assert_eq!(drive_until_open(&mut joint, wet), None);
    assert!(has_limit(&joint, Code::LeakReported));
    // A broken wire of the probe is not a leak.
    let open = Readings { leak_share: Some(1.0), ..SOUND };
    assert_eq!(drive_until_open(&mut joint, open), None);
    assert!(has_limit(&joint, Code::EnclosureUnknown) && !has_limit(&joint, Code::LeakReported));
}

#[test]
fn either_channel_of_safe_torque_off_opens_the_bridge_and_refuses_arming() {
    for torque_allowed in [[false, true], [true, false], [false; 2]] {
        let mut joint = driving(SensorParameters::default());
        let off = Readings { torque_allowed: Some(torque_allowed), ..SOUND };
        let open_ms = drive_until_open(&mut joint, off).expect("it stops");
        assert!(open_ms <= 3, "{open_ms} ms");
        assert!(joint.has_fault(Code::TorqueOff));
        joint.run_ms(300);
        assert_eq!(
            has_limit(&joint, Code::TorqueOffChannels),
            torque_allowed[0] != torque_allowed[1]
        );
        joint.request_state(2);
        joint.run_ms(5);
        joint.request_state(1);
        joint.drive_ms(CURRENT_A, 5);
        assert!(!joint.background.node().joint.is_armed(), "{torque_allowed:?}");
        joint.board.enclosure = SOUND;
        joint.run_ms(150);
        joint.request_state(2);
        joint.drive_ms(0.0, 5);
        joint.request_state(1);
        joint.drive_ms(CURRENT_A, 5);
        assert!(joint.background.node().joint.is_armed());
    }
}

#[test]
fn humidity_and_pressure_of_the_housing_are_reported_and_do_not_stop() {
    let mut joint = driving(SensorParameters::default());
    let air = Air { pressure_pa: 1.5e5, temperature_c: 15.0, humidity_percent: 70.0 };
    joint.board.enclosure = Readings { air: Some(air), ..SOUND };
    joint.drive_ms(CURRENT_A, 3100);
    assert!(has_limit(&joint, Code::HousingHumid) && has_limit(&joint, Code::HousingPressure));
    assert!(joint.background.node().joint.is_armed());
}
