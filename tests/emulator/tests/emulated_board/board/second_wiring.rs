//! The image of the second wiring (firmware/tests/wiring/second.rs), on a board that is wired so, and on the standard one.
//!
//! `FIRMWARE_SECOND` names the image. [`emulated_board::chip::wiring`] states the connections of both boards by themselves.

use super::course::{follow_sine, set};
use crate::common::second_image;
use emulated_board::chip::wiring::{SECOND, STANDARD, Wiring};
use emulated_board::{BoardDriver, store_content};
use firmware::supervisor::Code;
use joint_rig::{JointRig, PowerUp, RigDriver, RigFaults, stage_at_power_up};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};

fn driver(wiring: &'static Wiring) -> BoardDriver {
    let set = set();
    let start = PowerUp { set: Some(&set), commissioned: true, board: true, ..PowerUp::default() };
    let mut plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
    plant.watch_overcurrent();
    let stage = stage_at_power_up(&start, plant, &RigFaults::default());
    let store = store_content(&start).expect("a legal set");
    BoardDriver::start_wired(second_image(), &start, &store, stage, wiring).expect("it starts")
}

#[test]
fn joint_with_image_of_second_wiring_follows_sine_of_velocity() {
    let rig = JointRig::new(Box::new(driver(&SECOND)), RigFaults::default());
    let (rms_rad_s, most_a) = follow_sine(rig);
    println!("measured: second wiring: RMS velocity error {rms_rad_s:.3} rad/s, {most_a:.2} A");
    assert!(rms_rad_s < 0.5, "{rms_rad_s}");
    assert!((1.0..8.0).contains(&most_a), "{most_a}");
}

#[test]
fn image_of_second_wiring_on_standard_board_fails_its_self_test() {
    let mut driver = driver(&STANDARD);
    let faults = driver.faults();
    assert!(faults.contains(Code::SelfTestFailed), "{faults:?}");
    assert!(!driver.is_armed());
}
