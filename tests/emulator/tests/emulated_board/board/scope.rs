//! The image's scope: its whole memory at 20 kHz, read over the bus.

use super::board_bus::{new_board, started};
use super::course::{rig, set};
use compensator_core::can::NodeId;
use firmware::node::dictionary::index;
use firmware::scope::Signal;
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;
use joint_bus::scope::{Capture, ScopeRequest, ScopeTrigger, capture};
use joint_rig::{JointRig, RigBus};
use std::time::Duration;

/// Values of the scope of the STM32G474.
const VALUES: usize = 6144;

#[test]
fn capture_of_the_image_fills_its_memory_without_a_gap() {
    let mut client = started(new_board());
    let all: Vec<Signal> =
        Signal::ALL.iter().map(|(_, name)| Signal::from_name(name).expect("known")).collect();
    for (signals, limit_s) in [(&all[..8], 1.0), (&all[..1], 1.2)] {
        let begin_ns = client.bus().now_ns();
        let request = ScopeRequest {
            signals: signals.to_vec(),
            every: 1,
            trigger: ScopeTrigger::Now,
            before: 0.0,
            timeout: Duration::from_secs(1),
        };
        let found = capture(&mut client, &request, || false).expect("a capture");
        let elapsed_s = (client.bus().now_ns() - begin_ns) as f64 * 1e-9;
        println!(
            "measured: {} signals, {} rows, after {elapsed_s:.2} s",
            signals.len(),
            found.columns[0].len()
        );
        assert_eq!(found.columns.len(), signals.len());
        for (signal, column) in signals.iter().zip(&found.columns) {
            assert_eq!(column.len(), VALUES / signals.len(), "{}", signal.name());
            assert!(column.iter().all(|value| value.is_finite()), "{}", signal.name());
        }
        assert!(elapsed_s < limit_s, "{elapsed_s} s");
    }
}

/// Signals of a driven joint.
const DRIVEN: [&str; 6] =
    ["velocity_rad_s", "position_rad", "current_a", "phase_a_a", "phase_b_a", "phase_c_a"];
const SPEED_RAD_S: f64 = 2.0;
const PERIOD_S: f64 = 5e-5;

fn signal(name: &str) -> Signal {
    Signal::from_name(name).expect("known")
}

/// Spins the joint up, and captures what follows when its commands stop.
fn capture_of_stop(joint: &mut JointRig, trigger: ScopeTrigger) -> Capture {
    for _ in 0..600 {
        let error = SPEED_RAD_S - f64::from(joint.master_view().velocity_rad_s);
        joint.step_with_command((0.5 + 2.0 * error) as f32, SPEED_RAD_S as f32);
    }
    let request = ScopeRequest {
        signals: DRIVEN.map(signal).to_vec(),
        every: 1,
        trigger,
        before: 0.5,
        timeout: Duration::from_secs(1),
    };
    let mut client = Client::new(RigBus::new(joint), NodeId::FIRST);
    capture(&mut client, &request, || false).expect("a capture")
}

/// Checks that the rows follow each other at 20 kHz, with the currents of a motor.
fn check_rows(found: &Capture) {
    let [velocity, position, _, a, b, c] = &found.columns[..] else { panic!("{found:?}") };
    assert_eq!(velocity.len(), VALUES / DRIVEN.len());
    for (at, pair) in position.windows(2).enumerate() {
        let expected = velocity[at] * PERIOD_S;
        // A row that is missing would be a second step of 1e-4 rad at full speed.
        assert!((pair[1] - pair[0] - expected).abs() < 5e-5, "row {at}: {pair:?}");
    }
    for ((a, b), c) in a.iter().zip(b).zip(c) {
        assert!((a + b + c).abs() < 0.5, "{a} {b} {c}");
    }
}

#[test]
fn capture_of_driven_joint_has_its_trigger_in_place() {
    let mut joint = rig(&set()).expect("the image starts");
    let at = joint.plant().position_rad();
    joint.arm(at).expect("it arms");
    let of_fault = capture_of_stop(&mut joint, ScopeTrigger::Fault);
    check_rows(&of_fault);
    let [velocity, _, current, ..] = &of_fault.columns[..] else { panic!("{of_fault:?}") };
    let (before, after) = velocity.split_at(of_fault.trigger_row);
    let mean = before.iter().sum::<f64>() / before.len() as f64;
    println!(
        "measured: {mean:.2} rad/s before the fault, {:.2} at the end",
        after[after.len() - 1]
    );
    assert_eq!(before.len(), VALUES / DRIVEN.len() / 2);
    assert!((1.0..2.2).contains(&mean), "{mean} rad/s");
    assert!(current.iter().any(|current| current.abs() > 0.2));

    // The fault is cleared only once commands come again.
    (0..500).for_each(|_| joint.step_with_command(0.0, 0.0));
    joint.write_object_byte(index::STATE, 1, 2);
    (0..5).for_each(|_| joint.step_with_command(0.0, 0.0));
    joint.write_object_byte(index::STATE, 1, 1);
    (0..60).for_each(|_| joint.step_with_command(0.0, 0.0));
    assert!(joint.is_armed(), "{:?}", joint.latched_faults());
    let level =
        ScopeTrigger::Level { signal: signal("velocity_rad_s"), level: 1.0, is_falling: true };
    let of_level = capture_of_stop(&mut joint, level);
    check_rows(&of_level);
    let velocity = &of_level.columns[0];
    let row = of_level.trigger_row;
    assert!(velocity[row - 1] >= 1.0 && velocity[row] < 1.0, "{:?}", &velocity[row - 1..=row]);
}
