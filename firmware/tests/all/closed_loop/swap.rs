//! Tests of parameter and compensator swaps while the joint moves.

use super::plant::Machine;
use super::rig::{PERIOD_S, Rig, cycles, lugre, parameters};
use firmware::control::{JointCompensator, LoopFlags, MotorParameters, Setpoint};

/// Returns a compensated rig at 1 rad/s and 4 A.
fn moving_rig() -> Rig<JointCompensator<f32>> {
    let mut rig =
        Rig::settled(Machine { driven: Some(1.0), ..Machine::default() }, parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 4.0, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.1));
    rig
}

/// Runs for a time and returns the maximum deviation of the plant's current from the reference, A.
fn max_deviation(rig: &mut Rig<JointCompensator<f32>>, seconds: f64, reference_a: f64) -> f64 {
    (0..cycles(seconds)).fold(0.0f64, |largest, _| {
        rig.cycle();
        largest.max((rig.stage.plant.current()[1] - reference_a).abs())
    })
}

#[test]
fn swap_of_motor_parameters_disturbs_current_by_less_than_its_limit() {
    let mut rig = moving_rig();
    let reference_a = f64::from(rig.cycle().current_reference_a);
    let ripple = max_deviation(&mut rig, 0.02, reference_a);
    // These parameters change every gain of both current controllers and of the observer.
    let changed = MotorParameters {
        current_bandwidth_hz: 300.0,
        observer_bandwidth_hz: 60.0,
        resistance_ohm: 0.14,
        inductance_q_h: 110e-6,
        ..parameters()
    };
    rig.control.swap(&changed.build(PERIOD_S).expect("valid parameters"));
    let disturbance = max_deviation(&mut rig, 0.02, reference_a);
    println!("deviation {ripple:.3} A before the swap, {disturbance:.3} A after it");
    assert!((0.01..0.2).contains(&ripple), "{ripple}");
    assert!(disturbance < 0.3, "{disturbance}");
    assert_eq!(rig.cycle().flags & LoopFlags::FAULTS, LoopFlags::empty());
}

#[test]
fn swap_of_compensator_keeps_current_change_within_slew_limit() {
    let mut rig = moving_rig();
    let old = rig.cycle().feed_forward_current_a;
    let mut before = old;
    rig.control.swap_compensator(&lugre(0.3));
    let mut largest = 0.0f32;
    let first = rig.cycle();
    assert_eq!(first.feed_forward_current_a, old, "the current changes in the cycle of the swap");
    assert!(first.flags.contains(LoopFlags::CROSS_FADING));
    let mut fade_cycles = 1;
    let end = loop {
        let cycle = rig.cycle();
        largest = largest.max((cycle.feed_forward_current_a - before).abs());
        before = cycle.feed_forward_current_a;
        // The current stays between zero and its value before the swap.
        assert!(before <= old + 1e-4 && before > 0.0, "{before}");
        if !cycle.flags.contains(LoopFlags::CROSS_FADING) {
            break cycle;
        }
        fade_cycles += 1;
    };
    assert!((90..=110).contains(&fade_cycles), "{fade_cycles}");
    // The slew limit: 2000 Nm/s in 50 us at 0.98 Nm/A.
    assert!((1e-4..0.102).contains(&largest), "{largest}");
    let ratio = end.feed_forward_current_a / old;
    assert!((ratio - 0.3 / 0.9).abs() < 0.03, "{ratio}");
}

#[test]
fn swap_with_compensation_off_adds_no_current() {
    let mut rig = moving_rig();
    rig.control.set_compensating(false);
    rig.run(2);
    rig.control.swap_compensator(&lugre(0.9));
    let cycle = rig.cycle();
    assert!(!cycle.flags.contains(LoopFlags::CROSS_FADING));
    assert_eq!((cycle.feed_forward_current_a, cycle.current_reference_a), (0.0, 4.0));
    // Switching compensation off also ends a cross-fade.
    rig.control.set_compensating(true);
    rig.run(cycles(0.05));
    rig.control.swap_compensator(&lugre(0.3));
    rig.control.set_compensating(false);
    let cycle = rig.cycle();
    assert_eq!((cycle.feed_forward_current_a, cycle.current_reference_a), (0.0, 4.0));
}

#[test]
fn swap_of_encoder_offset_loses_rotor_until_observer_settles() {
    let mut rig = moving_rig();
    let changed = MotorParameters { encoder_offset_rad: 0.01, ..parameters() };
    rig.control.swap(&changed.build(PERIOD_S).expect("valid parameters"));
    assert!(rig.cycle().flags.contains(LoopFlags::ENCODER_LOST));
    let cycle = rig.run(cycles(0.05));
    assert!(!cycle.flags.contains(LoopFlags::ENCODER_LOST));
}
