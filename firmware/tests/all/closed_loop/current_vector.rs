//! Tests of the length of the current vector: at the voltage circle, in reversals, and with wrong parameters.
//!
//! The limit is 26 A. Sensor resolution, dead time and the PWM's delay add a ripple.

use super::plant::Machine;
use super::rig::{Rig, cycles, no_compensation, parameters};
use firmware::control::{LoopFlags, MotorParameters};

const LIMIT_A: f64 = 26.0;
/// Ripple and overshoot of a current within the circle, A.
const RIPPLE_A: f64 = 1.0;

/// Results of a reversal from one limit to the other and back at an imposed speed.
#[derive(Clone, Copy, Debug, Default)]
struct Reversal {
    /// Largest length of the plant's current vector, A.
    peak_a: f64,
    /// q currents at the end of both halves, A: with the larger one first.
    ends_a: [f64; 2],
    flags: LoopFlags,
}

fn reverse(bus: f64, joint_rad_s: f64, motor: MotorParameters) -> Reversal {
    let machine = Machine { bus, driven: Some(joint_rad_s), ..Machine::default() };
    let mut rig = Rig::settled(machine, motor, no_compensation());
    let mut found = Reversal::default();
    for current_a in [26.0, -26.0, 26.0] {
        rig.setpoint.current_a = current_a;
        for _ in 0..cycles(0.05) {
            found.flags |= rig.cycle().flags;
            let [d, q] = rig.stage.plant.current();
            found.peak_a = found.peak_a.max(d.hypot(q));
        }
        found.ends_a[usize::from(current_a < 0.0)] = rig.stage.plant.current()[1];
    }
    found
}

/// Parameters of a joint that may be driven faster than it runs by itself.
fn fast() -> MotorParameters {
    MotorParameters { velocity_max_rad_s: 31.0, ..parameters() }
}

#[test]
fn current_vector_in_reversals_at_the_voltage_circle_stays_within_its_limit() {
    let mut worst = 0.0f64;
    for bus in [18.5, 24.0, 36.0, 48.0] {
        for speed in [-20.0, -11.9, -4.0, 8.0, 11.9, 16.0, 30.0] {
            let found = reverse(bus, speed, fast());
            assert!(found.peak_a < LIMIT_A + RIPPLE_A, "{bus} V, {speed} rad/s: {found:?}");
            worst = worst.max(found.peak_a);
        }
    }
    println!("largest current vector {worst:.2} A at a limit of {LIMIT_A} A");
}

/// At 18.5 V and 11.9 rad/s the limit of 26 A would need 11 V of 10 V.
#[test]
fn current_at_the_voltage_circle_is_derated_and_stays_controlled() {
    let found = reverse(18.5, 11.9, fast());
    println!("{:.1} A driving, {:.1} A braking", found.ends_a[0], found.ends_a[1]);
    assert!(found.flags.contains(LoopFlags::VOLTAGE_LIMITED | LoopFlags::CURRENT_LIMITED));
    let [driving_a, braking_a] = found.ends_a;
    assert!((6.0..12.0).contains(&driving_a), "{driving_a} A");
    assert!((-26.0..-19.0).contains(&braking_a), "{braking_a} A");
    let free = reverse(48.0, 11.9, fast());
    assert!(!free.flags.contains(LoopFlags::CURRENT_LIMITED), "{free:?}");
    assert!((free.ends_a[0] - 26.0).abs() < 0.5 && (free.ends_a[1] + 26.0).abs() < 0.5);
}

#[test]
fn current_vector_with_wrong_parameters_stays_below_the_overcurrent_level() {
    let mut worst = 0.0f64;
    for [ohm, henry, flux] in [
        [0.7, 1.0, 1.0],
        [1.4, 1.0, 1.0],
        [1.0, 0.8, 1.0],
        [1.0, 1.25, 1.0],
        [1.0, 1.0, 0.93],
        [1.0, 1.0, 1.07],
    ] {
        let right = fast();
        let motor = MotorParameters {
            resistance_ohm: right.resistance_ohm * ohm,
            inductance_d_h: right.inductance_d_h * henry,
            inductance_q_h: right.inductance_q_h * henry,
            torque_constant_nm_per_a: right.torque_constant_nm_per_a * flux,
            ..right
        };
        for (bus, speed) in [(18.5, 11.9), (18.5, 16.0), (24.0, 16.0), (36.0, 20.0), (48.0, 30.0)] {
            let found = reverse(bus, speed, motor);
            worst = worst.max(found.peak_a);
        }
    }
    println!("largest current vector {worst:.2} A with wrong parameters");
    assert!(worst < LIMIT_A + 5.0, "{worst} A");
}
