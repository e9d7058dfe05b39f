//! Tests of a trial of a parameter set whose master fails while the joint moves: the ramp, and what the loop then uses.

use super::driver::Joint;
use super::plant::Machine;
use firmware::control::MotorParameters;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::parameter_set::ParameterSet;

const CSV: u8 = 9;
const DEADLINE_MS: u16 = 700;
const HOME_RAD: f64 = 0.25;

/// Reads a number of up to four bytes.
fn read(joint: &mut Joint, at_index: u16, sub_index: u8) -> u32 {
    let [low, high] = at_index.to_le_bytes();
    joint.board.sent.clear();
    joint.queue_frame(0x601, &[0x40, low, high, sub_index, 0, 0, 0, 0]);
    joint.run_ms(1);
    let answer = joint.board.sent.iter().find(|frame| frame.identifier() == 0x581);
    let data = answer.expect("an answer").data();
    assert_eq!(data[0] & 0xE2, 0x42, "{data:?}");
    u32::from_le_bytes(data[4..8].try_into().expect("four bytes"))
}

fn trial_state(joint: &mut Joint) -> u32 {
    read(joint, index::TRIAL, 3)
}

/// Difference of the reported position from the plant's, rad. Before homing it is NaN.
fn position_error(joint: &mut Joint) -> f64 {
    let reported_rad = f32::from_bits(read(joint, index::MEASURED, 2));
    f64::from(reported_rad) - HOME_RAD - joint.stage.plant.position()
}

/// Returns a joint with a stored ramp as its reaction, that turns with 3 rad/s on a trial of other current controllers
/// and of another position gain.
fn moving_on_trial() -> Joint {
    let machine = Machine::default();
    let motor =
        MotorParameters { inertia_kg_m2: machine.inertia as f32, ..MotorParameters::default() };
    let mut joint = Joint::with(machine, &ParameterSet { motor, ..ParameterSet::default() });
    joint.write_object(index::FAULT_OPTION, 0, [1, 0, 0, 0], 2);
    joint.write_object(index::STORE, 1, SAVE_SIGNATURE.to_le_bytes(), 4);
    joint.write_object(index::STATE, 6, (HOME_RAD as f32).to_le_bytes(), 4);
    joint.run_ms(2);
    renew(&mut joint);
    let place = MotorParameters::NAMES.iter().position(|name| *name == "current_bandwidth_hz");
    let sub_index = place.expect("a parameter") as u8 + 1;
    joint.write_object(index::MOTOR, sub_index, 300f32.to_le_bytes(), 4);
    joint.write_object(index::POSITION_LOOP, 1, 3_000u32.to_le_bytes(), 4);
    joint.commit_staged();
    joint.enable_mode(CSV);
    for _ in 0..600 {
        joint.drive_velocity(0x0F, 3.0);
    }
    joint.write_object(index::TRIAL, 1, renewal(), 2);
    joint.drive_velocity(0x0F, 3.0);
    assert_eq!(trial_state(&mut joint), 1);
    joint
}

fn renewal() -> [u8; 4] {
    let [low, high] = DEADLINE_MS.to_le_bytes();
    [low, high, 0, 0]
}

fn renew(joint: &mut Joint) {
    joint.write_object(index::TRIAL, 1, renewal(), 2);
    joint.run_ms(1);
}

#[test]
fn deadline_in_motion_stops_with_the_ramp_and_returns_the_stored_values() {
    let mut joint = moving_on_trial();
    let trial_crc = read(&mut joint, index::COMMIT, 1);
    let error = position_error(&mut joint);
    assert!(error.abs() < 0.01, "{error} rad");
    let velocity = joint.stage.plant.velocity();
    assert!((velocity - 3.0).abs() < 0.3, "{velocity} rad/s");
    let mut ended_ms = None;
    // The master repeats its target and renews nothing.
    for ms in 4..2000 {
        joint.drive_velocity(0x0F, 3.0);
        if !joint.background.node().joint.is_armed() {
            ended_ms = Some(ms);
            break;
        }
        let is_late = ms > usize::from(DEADLINE_MS) + 20;
        assert!(!is_late || joint.stage.plant.velocity() < 3.0, "{ms} ms");
        if ms == usize::from(DEADLINE_MS) + 100 {
            assert_eq!(trial_state(&mut joint), 7);
            assert_eq!(read(&mut joint, index::COMMIT, 1), trial_crc, "still on trial");
        }
    }
    // The ramp of 10 rad/s^2 takes 300 ms, and the joint must stand for 20 ms.
    let ended_ms = ended_ms.expect("the joint stops") - usize::from(DEADLINE_MS);
    println!("disarmed {ended_ms} ms after the deadline");
    assert!((300..=400).contains(&ended_ms), "{ended_ms} ms");
    assert!(joint.stage.plant.velocity().abs() < 0.15, "{}", joint.stage.plant.velocity());
    assert!(joint.background.node().joint.supervisor().faults().is_empty());
    assert_eq!(trial_state(&mut joint), 4);
    let stored_crc = read(&mut joint, index::TRIAL, 4);
    assert_eq!(read(&mut joint, index::COMMIT, 1), stored_crc);
    assert_eq!(joint.background.node().joint.set().crc(), stored_crc);
    assert_ne!(stored_crc, trial_crc);
    assert_eq!(read(&mut joint, index::POSITION_LOOP, 1), 10_000);
    let error = position_error(&mut joint);
    assert!(error.abs() < 0.01, "the position is lost: {error} rad");
    // The joint drives with the returned set.
    joint.enable_mode(CSV);
    (0..500).for_each(|_| joint.drive_velocity(0x0F, -2.0));
    let velocity = joint.stage.plant.velocity();
    assert!((velocity + 2.0).abs() < 0.2, "{velocity} rad/s");
}

#[test]
fn master_that_is_silent_in_a_trial_stops_with_the_ramp_and_returns_the_stored_values() {
    let mut joint = moving_on_trial();
    joint.run_ms(150);
    assert!(joint.stage.is_on() && joint.stage.plant.velocity() > 0.5, "the ramp");
    assert_eq!(trial_state(&mut joint), 7);
    joint.run_ms(600);
    assert!(!joint.stage.is_on() && joint.stage.plant.velocity().abs() < 0.1);
    assert_eq!(trial_state(&mut joint), 6);
    assert_eq!(read(&mut joint, index::POSITION_LOOP, 1), 10_000);
    assert!(position_error(&mut joint).abs() < 0.01);
}
