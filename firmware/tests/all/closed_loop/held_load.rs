//! Tests of arming with a load that the motor must hold: the joint does not move.

use super::driver::Joint;
use super::plant::Machine;
use firmware::control::MotorParameters;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::supervisor::Code;

/// Current that holds the load, A. It exceeds the stall current of 5 A.
const HOLDING_A: f32 = 8.0;

/// Arms the joint against a brake and commands the holding current for a second. Returns true if it stays armed.
fn holds(joint: &mut Joint) -> bool {
    joint.stage.plant.machine.clamped = true;
    joint.request_state(2);
    joint.drive_ms(0.0, 5);
    joint.request_state(1);
    joint.drive_ms(HOLDING_A, 1000);
    let is_armed = joint.background.node().joint.is_armed();
    assert_eq!(!is_armed, joint.has_fault(Code::MotorStands));
    joint.request_state(0);
    joint.drive_ms(0.0, 5);
    is_armed
}

/// Turns the released joint by about a rad, and stops it.
fn turn(joint: &mut Joint) {
    joint.stage.plant.machine.clamped = false;
    joint.request_state(2);
    joint.drive_ms(0.0, 5);
    joint.request_state(1);
    joint.drive_ms(5.0, 150);
    joint.drive_ms(0.0, 600);
    let [position, velocity] = [joint.stage.plant.position(), joint.stage.plant.velocity()];
    assert!(position > 0.1 && velocity.abs() < 0.01, "{position} rad, {velocity} rad/s");
    joint.request_state(0);
    joint.drive_ms(0.0, 5);
}

#[test]
fn arming_with_held_load_stops_until_the_motor_has_turned_once() {
    let mut joint = Joint::started();
    assert!(!holds(&mut joint), "never proven");
    turn(&mut joint);
    for arming in 0..3 {
        assert!(holds(&mut joint), "arming {arming} after the motor has turned");
    }
}

#[test]
fn proof_of_turning_survives_a_restart_and_ends_with_other_wiring_parameters() {
    let mut joint = Joint::started();
    turn(&mut joint);
    joint.write_object(index::STORE, 1, SAVE_SIGNATURE.to_le_bytes(), 4);
    joint.run_ms(2);
    let mut joint = Joint::restarted(Machine::default(), joint.into_flash());
    assert!(holds(&mut joint), "after a restart");
    // Another value of a wiring parameter, committed and confirmed without a measurement.
    let names = MotorParameters::NAMES.iter();
    let sub_index = names.take_while(|name| **name != "resistance_ohm").count() as u8 + 1;
    joint.write_object(index::MOTOR, sub_index, 0.125f32.to_le_bytes(), 4);
    joint.commit_staged();
    joint.confirm_wiring();
    assert!(!holds(&mut joint), "with other parameters");
}
