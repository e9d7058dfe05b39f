//! Parameters and compensators that change while the joint moves.

use crate::plant::Machine;
use crate::rig::{PERIOD_S, Rig, cycles, lugre, parameters};
use firmware::control::{JointCompensator, LoopFlags, MotorParameters, Setpoint};

fn moving() -> Rig<JointCompensator<f32>> {
    let mut rig =
        Rig::settled(Machine { driven: Some(1.0), ..Machine::default() }, parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 4.0, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.1));
    rig
}

/// Farthest the true current is from `wanted`, A, in a time.
fn farthest(rig: &mut Rig<JointCompensator<f32>>, seconds: f64, wanted: f64) -> f64 {
    (0..cycles(seconds)).fold(0.0f64, |far, _| {
        rig.cycle();
        far.max((rig.stage.plant.current()[1] - wanted).abs())
    })
}

#[test]
fn a_swap_of_the_motors_parameters_bumps_the_current_by_less_than_a_step_of_its_ripple() {
    let mut rig = moving();
    let wanted = f64::from(rig.cycle().current_reference_a);
    let ripple = farthest(&mut rig, 0.02, wanted);
    // Every gain of both controllers and of the observer becomes another.
    let other = MotorParameters {
        current_bandwidth_hz: 300.0,
        observer_bandwidth_hz: 60.0,
        resistance_ohm: 0.14,
        inductance_q_h: 110e-6,
        ..parameters()
    };
    rig.control.swap(&other.build(PERIOD_S).expect("legal"));
    let bump = farthest(&mut rig, 0.02, wanted);
    println!("ripple {ripple:.3} A, after the swap {bump:.3} A");
    assert!((0.01..0.2).contains(&ripple), "{ripple}");
    assert!(bump < 0.3, "{bump}");
    assert_eq!(rig.cycle().flags & LoopFlags::FAULTS, LoopFlags::empty());
}

#[test]
fn a_swap_of_the_compensator_changes_the_current_by_less_than_its_slew_limit_a_cycle() {
    let mut rig = moving();
    let old = rig.cycle().feed_forward_current_a;
    let mut before = old;
    rig.control.swap_compensator(&lugre(0.3));
    let mut largest = 0.0f32;
    let first = rig.cycle();
    assert_eq!(first.feed_forward_current_a, old, "nothing moves in the cycle of the swap");
    assert!(first.flags.contains(LoopFlags::CROSS_FADING));
    let mut faded = 1;
    let end = loop {
        let cycle = rig.cycle();
        largest = largest.max((cycle.feed_forward_current_a - before).abs());
        before = cycle.feed_forward_current_a;
        // Never more than the larger, nor less than the smaller of the two.
        assert!(before <= old + 1e-4 && before > 0.0, "{before}");
        if !cycle.flags.contains(LoopFlags::CROSS_FADING) {
            break cycle;
        }
        faded += 1;
    };
    assert!((90..=110).contains(&faded), "{faded}");
    // 2000 Nm/s in 50 us at 0.98 Nm/A.
    assert!((1e-4..0.102).contains(&largest), "{largest}");
    let share = end.feed_forward_current_a / old;
    assert!((share - 0.3 / 0.9).abs() < 0.03, "{share}");
}

#[test]
fn a_swap_with_compensation_off_adds_nothing() {
    let mut rig = moving();
    rig.control.set_compensating(false);
    rig.run(2);
    rig.control.swap_compensator(&lugre(0.9));
    let cycle = rig.cycle();
    assert!(!cycle.flags.contains(LoopFlags::CROSS_FADING));
    assert_eq!((cycle.feed_forward_current_a, cycle.current_reference_a), (0.0, 4.0));
    // Nor does a fade outlive an order to stop.
    rig.control.set_compensating(true);
    rig.run(cycles(0.05));
    rig.control.swap_compensator(&lugre(0.3));
    rig.control.set_compensating(false);
    let cycle = rig.cycle();
    assert_eq!((cycle.feed_forward_current_a, cycle.current_reference_a), (0.0, 4.0));
}

#[test]
fn another_encoder_zero_loses_the_rotor_until_it_is_found_again() {
    let mut rig = moving();
    let turned = MotorParameters { encoder_offset_rad: 0.01, ..parameters() };
    rig.control.swap(&turned.build(PERIOD_S).expect("legal"));
    assert!(rig.cycle().flags.contains(LoopFlags::ENCODER_LOST));
    let cycle = rig.run(cycles(0.05));
    assert!(!cycle.flags.contains(LoopFlags::ENCODER_LOST));
}
