//! Tests of stops with a ramp: what a fault permits, and what ends a ramp.

use super::driver::Joint;
use super::plant::Machine;
use firmware::background::RoundOutcome;
use firmware::control::{BridgeFault, MotorParameters, ValidChannels};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::InputsObject;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::{Code, JointState};

const CST: u8 = 10;
const CSV: u8 = 9;
const QUICK_STOP: u16 = 0x0B;
const DISABLE: u16 = 0x07;

fn set_option(joint: &mut Joint, at_index: u16, value: i16) {
    let [a, b] = value.to_le_bytes();
    joint.write_object(at_index, 0, [a, b, 0, 0], 2);
    joint.run_ms(1);
}

/// Returns a joint with a known inertia that turns with 3 rad/s in CSV, and these reactions.
fn spinning(options: &[(u16, i16)]) -> Joint {
    let mut joint = started(options);
    joint.enable_mode(CSV);
    (0..600).for_each(|_| joint.drive_velocity(0x0F, 3.0));
    let found = joint.stage.plant.velocity();
    assert!((found - 3.0).abs() < 0.3, "{found} rad/s");
    joint
}

fn started(options: &[(u16, i16)]) -> Joint {
    let machine = Machine::default();
    let motor =
        MotorParameters { inertia_kg_m2: machine.inertia as f32, ..MotorParameters::default() };
    let mut joint = Joint::with(machine, &ParameterSet { motor, ..ParameterSet::default() });
    for (at_index, value) in options {
        set_option(&mut joint, *at_index, *value);
    }
    joint
}

/// Runs until the bridge opens; returns the time, ms.
fn open_ms(joint: &mut Joint, mut step: impl FnMut(&mut Joint)) -> usize {
    (1..3000)
        .find(|_| {
            step(joint);
            !joint.stage.is_on()
        })
        .expect("the bridge opens")
}

#[test]
fn ramp_after_a_lost_master_ends_in_fault_and_can_only_be_cleared_afterwards() {
    let mut joint = spinning(&[(index::FAULT_OPTION, 1)]);
    joint.run_ms(110);
    let driver = joint.background.node();
    assert_eq!(driver.joint.supervisor().state(), JointState::Fault);
    assert!(joint.has_fault(Code::CommandTimeout) && joint.stage.is_on());
    // "Fault reaction active"; clearing and new parameters are refused.
    joint.request_state(2);
    joint.write_object(index::MOTOR, 1, 8f32.to_le_bytes(), 4);
    joint.run_ms(1);
    assert!(joint.has_fault(Code::CommandTimeout) && joint.stage.is_on());
    let ms = 111 + open_ms(&mut joint, |joint| joint.run_ms(1));
    // 100 ms of the last target, and 300 ms from 3 rad/s with 10 rad/s^2.
    assert!((400..=470).contains(&ms), "{ms} ms");
    assert!(joint.stage.plant.velocity().abs() < 0.15, "{}", joint.stage.plant.velocity());
    joint.drive_velocity(0x00, 0.0);
    joint.drive_velocity(0x80, 0.0);
    assert!(!joint.has_fault(Code::CommandTimeout));
}

#[test]
fn command_frames_that_stop_end_in_the_configured_ramp() {
    let mut joint = started(&[(index::FAULT_OPTION, 1)]);
    joint.drive_ms(0.0, 5);
    joint.request_state(1);
    joint.drive_ms(0.0, 40);
    joint.drive_ms(6.0, 100);
    joint.drive_ms(3.0, 20);
    let speed = joint.stage.plant.velocity();
    assert!(speed > 1.0, "{speed} rad/s");
    let ms = open_ms(&mut joint, |joint| joint.run_ms(1));
    assert!(joint.has_fault(Code::CommandTimeout));
    assert!(ms > 140 && joint.stage.plant.velocity().abs() < 0.15, "{ms} ms");
}

#[test]
fn fault_that_permits_no_ramp_opens_the_bridge_also_during_a_ramp() {
    type Fault = (&'static str, fn(&mut Joint));
    let faults: [Fault; 4] = [
        ("gate driver", |joint| {
            (joint.stage.fault, joint.stage.has_latched_fault) =
                (Some(BridgeFault::GateDriver), true);
        }),
        ("comparators", |joint| joint.stage.fault = Some(BridgeFault::Overcurrent)),
        ("shunt", |joint| joint.stage.valid -= ValidChannels::CURRENT_A),
        ("encoder", |joint| joint.stage.valid -= ValidChannels::ENCODER),
    ];
    let options = [(index::FAULT_OPTION, 1), (index::QUICK_STOP_OPTION, 1)];
    for (name, fault) in faults {
        // While it drives, during the ramp of a command, and during the ramp of a fault.
        for before_ms in [0, 50, 150] {
            let mut joint = spinning(&options);
            match before_ms {
                0 => {}
                50 => (0..50).for_each(|_| joint.drive_velocity(QUICK_STOP, 3.0)),
                silent_ms => joint.run_ms(silent_ms),
            }
            assert!(joint.stage.is_on() && joint.stage.plant.velocity() > 1.5, "{name}");
            fault(&mut joint);
            let ms = open_ms(&mut joint, |joint| joint.drive_velocity(0x0F, 3.0));
            assert!(ms <= 5, "{name} after {before_ms} ms: open after {ms} ms");
            joint.run_ms(20);
            assert!(!joint.stage.is_on(), "{name}");
        }
    }
}

#[test]
fn quick_stop_in_torque_mode_holds_the_load_during_its_ramp() {
    for (load, is_measured) in [(0.0, false), (8.0, false), (8.0, true)] {
        let mut joint = started(&[(index::QUICK_STOP_OPTION, 6)]);
        joint.enable_mode(CST);
        // The torque that holds the load, and then lifts it.
        let drive = |joint: &mut Joint, word: u16, permille: i16| {
            let ([a, b], [c, d]) = (word.to_le_bytes(), permille.to_le_bytes());
            joint.queue_frame(0x201, &[a, b, c, d]);
            if is_measured {
                let load_nm = (joint.stage.plant.load as f32).to_le_bytes();
                joint.write_object(index::INPUTS, InputsObject::LOAD_TORQUE, load_nm, 4);
            }
            joint.run_ms(1);
        };
        let torque_nm = joint.background.node().joint.set().motor.current_limit_a;
        for step in 0..200 {
            let share = f64::from(step) / 200.0;
            joint.stage.plant.load = load * share;
            drive(&mut joint, 0x0F, (1e3 * (load * share) as f32 / torque_nm) as i16);
        }
        for _ in 0..200 {
            drive(&mut joint, 0x0F, (1e3 * (load + 4.0) as f32 / torque_nm) as i16);
        }
        let from = joint.stage.plant.position();
        let speed = joint.stage.plant.velocity();
        let (mut least, mut most) = (0.0f64, 0.0f64);
        for _ in 0..1500 {
            drive(&mut joint, QUICK_STOP, 0);
            let way = joint.stage.plant.position() - from;
            (least, most) = (least.min(way), most.max(way));
        }
        let (end, v) = (joint.stage.plant.position() - from, joint.stage.plant.velocity());
        println!(
            "{load} Nm, measured {is_measured}: {speed:.2} rad/s, {least:.3} to {most:.3} rad, ends at {end:.3}"
        );
        assert!(joint.background.node().joint.is_armed() && speed > 0.5);
        assert!(v.abs() < 0.02, "{v} rad/s");
        let ramp = 0.5 * speed * speed / 50.0;
        assert!(most < 2.0 * ramp + 0.12 && least > -0.05, "{least} to {most} rad, {ramp}");
    }
}

#[test]
fn disabling_ramp_needs_no_master_and_is_resumed_by_a_new_enable() {
    let mut joint = spinning(&[(index::DISABLE_OPTION, 1)]);
    joint.drive_velocity(DISABLE, 3.0);
    let ms = open_ms(&mut joint, |joint| joint.run_ms(1));
    assert!((300..=380).contains(&ms), "{ms} ms");
    let faults = joint.background.node().joint.supervisor().faults();
    assert!(faults.is_empty(), "{faults:?}");
    let mut joint = spinning(&[(index::DISABLE_OPTION, 1)]);
    (0..150).for_each(|_| joint.drive_velocity(DISABLE, 3.0));
    assert!(joint.stage.plant.velocity() < 2.0);
    (0..500).for_each(|_| joint.drive_velocity(0x0F, 3.0));
    assert!(joint.stage.is_on() && (joint.stage.plant.velocity() - 3.0).abs() < 0.2);
}

#[test]
fn network_that_stops_ends_the_driving_with_the_reaction_of_6007h() {
    for (options, expected_ms) in [
        (vec![], 0..=2),
        (vec![(index::FAULT_OPTION, 1), (index::ABORT_CONNECTION, 2)], 0..=2),
        (vec![(index::FAULT_OPTION, 1)], 300..=380),
        (vec![(index::ABORT_CONNECTION, 3), (index::QUICK_STOP_OPTION, 2)], 60..=130),
    ] {
        let mut joint = spinning(&options);
        joint.queue_frame(0, &[2, 1]);
        let ms = open_ms(&mut joint, |joint| joint.run_ms(1));
        assert!(expected_ms.contains(&ms), "{options:?}: {ms} ms");
        assert!(joint.background.node().joint.supervisor().faults().is_empty());
    }
}

/// Runs until the restart, with these frames each millisecond; returns the time, ms. The bridge is open then.
fn restart_ms(joint: &mut Joint, frames: &[(u16, &[u8])]) -> usize {
    let ms = (1..12_000)
        .find(|_| {
            frames.iter().for_each(|(identifier, data)| joint.queue_frame(*identifier, data));
            joint.run_interrupts();
            joint.run_round() == RoundOutcome::Restart
        })
        .expect("a restart");
    assert!(ms >= 10_000 || !joint.stage.is_on(), "after {ms} ms");
    ms
}

/// Attack: reset the joint. Bound: it stops as 6007h says before the restart, for at most 10 s.
#[test]
fn network_reset_restarts_after_the_reaction_of_6007h_whatever_the_master_sends() {
    for (options, expected_ms) in [
        (vec![], 1..=5),
        (vec![(index::FAULT_OPTION, 1)], 300..=385),
        // A shorted motor needs 0.1 s at rest.
        (vec![(index::FAULT_OPTION, -1)], 120..=300),
        (vec![(index::ABORT_CONNECTION, 3), (index::QUICK_STOP_OPTION, 2)], 60..=135),
    ] {
        let mut joint = spinning(&options);
        joint.queue_frame(0, &[0x81, 1]);
        let ms = restart_ms(&mut joint, &[(0, &[1, 1]), (0x201, &[0x0F, 0, 0, 0])]);
        assert!(expected_ms.contains(&ms), "{options:?}: {ms} ms");
    }
}

#[test]
fn network_reset_during_a_ramp_waits_for_its_end() {
    // By a fault, with 605Eh, and by a command, whose ramp becomes that of 6007h.
    for (silent_ms, expected_ms) in [(150, 230..=330), (0, 60..=135)] {
        let reaction = if silent_ms > 0 { 1 } else { 2 };
        let options = [(index::FAULT_OPTION, reaction), (index::QUICK_STOP_OPTION, 1)];
        let mut joint = spinning(&options);
        joint.run_ms(silent_ms);
        if silent_ms == 0 {
            joint.drive_velocity(QUICK_STOP, 3.0);
        }
        joint.queue_frame(0, &[0x81, 1]);
        let ms = restart_ms(&mut joint, &[]);
        assert!(expected_ms.contains(&ms), "silent for {silent_ms} ms: {ms} ms");
        assert!(joint.stage.plant.velocity().abs() < 0.15, "{}", joint.stage.plant.velocity());
    }
}

#[test]
fn network_reset_of_a_joint_that_does_not_stop_has_a_limit() {
    // The ramp ends a second late, or would last for 300 s.
    for (deceleration, expected_ms) in [(50_000_000u32, 1_060..=1_070), (10_000, 10_000..=10_001)] {
        // A machine turns the joint against its motor.
        let machine = Machine { driven: Some(3.0), ..Machine::default() };
        let mut joint = Joint::with(machine, &ParameterSet::default());
        set_option(&mut joint, index::FAULT_OPTION, 2);
        joint.write_object(index::QUICK_DECELERATION, 0, deceleration.to_le_bytes(), 4);
        joint.drive_ms(0.0, 5);
        joint.request_state(1);
        joint.drive_ms(0.0, 60);
        assert!(joint.stage.is_on());
        joint.queue_frame(0, &[0x81, 1]);
        let ms = restart_ms(&mut joint, &[]);
        assert!(expected_ms.contains(&ms), "{deceleration}: {ms} ms");
    }
}

#[test]
fn master_that_returns_does_not_end_the_stop_by_its_lost_connection() {
    for command in [0x82, 0x80] {
        let mut joint = spinning(&[(index::FAULT_OPTION, 1)]);
        joint.queue_frame(0, &[command, 1]);
        joint.run_ms(50);
        joint.queue_frame(0, &[1, 1]);
        let ms = 50 + open_ms(&mut joint, |joint| joint.drive_velocity(0x0F, 3.0));
        assert!((300..=380).contains(&ms), "{command:x}: {ms} ms");
        // The same controlword does not enable the drive again.
        (0..50).for_each(|_| joint.drive_velocity(0x0F, 3.0));
        assert!(!joint.stage.is_on(), "{command:x}");
    }
}

#[test]
fn ramp_of_a_joint_that_does_not_stop_ends_a_second_late() {
    let mut joint = spinning(&[(index::QUICK_STOP_OPTION, 2)]);
    // A machine that turns the joint against its motor.
    joint.stage.plant.load = -40.0;
    let ms = open_ms(&mut joint, |joint| joint.drive_velocity(QUICK_STOP, 3.0));
    assert!(ms <= 1100, "{ms} ms");
}
