//! The underwater joint: its short form says what it is to say, and the loop behind it is the same bits each time.

use super::quick;
use compensator_core::can::Node;
use compensator_core::{LawKind, ParameterId, Parameters};
use firmware::parameter_set::ParameterSet;
use host_sim::joint_rig::{Faults, JointRig, RigBus, SETTLE_MS, SealSensor, with_joint};
use joint_bus::canopen::Client;
use joint_bus::parameters::{read_set, write_set};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters as Plant};

fn set() -> ParameterSet {
    let mut set = ParameterSet::default();
    set.friction.model = Parameters::<f32>::new(LawKind::Lugre)
        .with(ParameterId::CoulombTorque, 1.6)
        .with(ParameterId::StaticTorque, 2.1)
        .with(ParameterId::StribeckVelocity, 0.2)
        .with(ParameterId::BristleStiffness, 3e3)
        .with(ParameterId::ViscousFriction, 0.1);
    set
}

/// Position after a second under a steady current, and whether the driver is still armed.
fn pushed(set: &ParameterSet, seed: u64, faults: Faults) -> (f64, bool) {
    let plant = JointPlant::with_phase(&Plant::default(), Load::Free, [0.1, 0.2], seed);
    let work = |rig: &mut host_sim::joint_rig::JointRig| {
        (0..1000).for_each(|_| rig.millisecond(1.2, 1.0));
        assert!((rig.heard().position_rad as f64 - rig.plant().position_rad()).abs() < 0.05);
        (rig.plant().position_rad(), rig.is_armed())
    };
    with_joint(set, plant, faults, work).expect("a driver that arms")
}

#[test]
fn the_shipped_driver_moves_the_plant_and_is_the_same_bits_each_time() {
    let sound = Faults::default();
    let (compensated, armed) = pushed(&set(), 1, sound);
    assert!(armed && compensated > 0.5, "{compensated}");
    let mut off = set();
    off.friction.compensator.scale = 0.0;
    let (stuck, _) = pushed(&off, 1, sound);
    assert!(stuck < 0.02, "1.2 A is below the breakaway: {stuck}");
    assert_eq!(pushed(&set(), 1, sound).0.to_bits(), compensated.to_bits());
    assert_ne!(pushed(&set(), 2, sound).0.to_bits(), compensated.to_bits());
    for seal in [SealSensor::Stale, SealSensor::Stuck, SealSensor::Dropped, SealSensor::Absent] {
        assert!(pushed(&set(), 1, Faults::seal_sensor(seal)).1, "{seal:?}");
    }
    let late = Faults { delay_ms: 3, encoder_lost: 0.05, ..Faults::default() };
    assert!(pushed(&set(), 1, late).1);
}

#[test]
fn a_set_goes_into_a_running_joint_over_its_bus() {
    let mut slack = set();
    slack.friction.compensator.scale = 0.0;
    let moved = |rig: &mut JointRig| {
        let from = rig.plant().position_rad();
        (0..1000).for_each(|_| rig.millisecond(1.2, 1.0));
        rig.plant().position_rad() - from
    };
    let work = |rig: &mut JointRig| {
        let before = moved(rig);
        let mut client = Client::new(RigBus::new(rig), Node::FIRST);
        let refused = write_set(&mut client, &set()).expect_err("it is armed");
        assert!(refused.to_string().contains("not in this state"), "{refused}");
        rig.request(0);
        (0..SETTLE_MS).for_each(|_| rig.pass());
        let mut client = Client::new(RigBus::new(rig), Node::FIRST);
        assert_eq!(write_set(&mut client, &set()).expect("a set"), set().crc());
        assert_eq!(read_set(&mut client).expect("a set").emit(), set().emit());
        rig.arm(rig.plant().position_rad()).expect("it arms again");
        (before, moved(rig))
    };
    let plant = JointPlant::with_phase(&Plant::default(), Load::Free, [0.1, 0.2], 1);
    let (before, after) = with_joint(&slack, plant, Faults::default(), work).expect("a joint");
    // 1.2 A is below the breakaway: it moves only where its friction is given back.
    assert!(before < 0.02 && after > 0.3, "{before} {after}");
}

#[test]
fn a_set_the_driver_refuses_is_said() {
    let mut refused = set();
    refused.friction.model.set(ParameterId::StaticTorque, 0.5);
    let plant = JointPlant::new(&Plant::default(), Load::Free, 1);
    let why = with_joint(&refused, plant, Faults::default(), |_| ()).unwrap_err();
    assert!(why.contains("static_torque"), "{why}");
}

#[test]
fn the_short_form_repeats_the_papers_numbers() {
    let outcome = quick("underwater-joint");
    let number = |table: &str, row: &str, column: &str| {
        let found = outcome
            .rows
            .iter()
            .find(|own| own.table == table && own.row == row && own.column == column);
        found.unwrap_or_else(|| panic!("{table}: {row}, {column}"))
    };
    assert!(outcome.rows.iter().all(|row| row.simulated && row.ours.is_finite()));
    let published = number("Fig. 6", "LuGre, as published", "estimation error at 100 rpm");
    assert_eq!(published.printed, Some(9.95));
    // What is identified on all runs estimates better than what never saw a load, and the diagnosis better than a refit.
    for rpm in [35, 70, 100] {
        let of = |arm| number("Fig. 6", arm, &format!("estimation error at {rpm} rpm")).ours;
        assert!(of("diagnosed") < of("LuGre, refitted"), "{rpm} rpm");
        assert!(of("diagnosed") < 0.5 * of("LuGre, as published"), "{rpm} rpm");
    }
    // Any compensation follows better than none, and none better than the perfect model by much.
    for (figure, column) in [("Fig. 9", "mean velocity error"), ("Fig. 10", "mean error")] {
        let of = |arm| number(figure, arm, column).ours;
        assert!(of("diagnosed") < 0.7 * of("no compensation"), "{column}");
        assert!(of("perfect model") < 0.7 * of("no compensation"), "{column}");
    }
    // Everyone gets to the jump's target: 0.6 to 0.73 s; 1.5 s is the end of the task.
    for arm in ["no compensation", "LuGre, as published", "diagnosed", "perfect model"] {
        let seconds = number("Fig. 11", arm, "time to target").ours;
        assert!((0.4..0.9).contains(&seconds), "{arm}: {seconds} s");
    }
    let harm = || outcome.rows.iter().filter(|row| row.column.ends_with("error over that without"));
    assert!(harm().count() >= 3 * 20);
    assert!(harm().filter(|row| row.column.contains("6.6 rpm")).all(|row| row.ours <= 1.05));
    // The running joint lifts better on what was diagnosed, and nothing else was changed. On the sine it is 1.076 of before: from the
    // short form's 24 runs of the factorial the diagnosis takes the water's effect for the film's; from the long form's 48 it is 0.98.
    let closed = "the loop closed once more";
    for (task, most) in [
        ("Velocity tracking, 65 to 95 rpm, mean velocity error", 1.1),
        ("Lifting 2 kg at 6.6 rpm, mean error", 0.7),
    ] {
        let of = |column| number(closed, task, column).ours;
        assert!(of("after params set") < most * of("before"), "{task}");
    }
    // Far too much friction is found by the driver itself; what was identified is not complained of.
    let told = |name: &str| {
        let table = "harm, diagnosed model";
        outcome
            .rows
            .iter()
            .any(|row| row.table == table && row.row == name && row.column.starts_with("said"))
    };
    assert!(told("both levels +30 %") && !told("as identified"));
    // The paper's own form of Table III and its sums.
    let printed = outcome.rows.iter().filter(|row| row.table.contains("variance over mean"));
    assert_eq!(printed.filter(|row| row.printed.is_some()).count(), 6 * 3 + 2 * 3);
    let summary = outcome.summary.join("\n");
    for word in
        ["Simulated", "missed", "reached", "refitting alone", "perfect model", "pressure-coulomb"]
    {
        assert!(summary.contains(word), "{word}: {summary}");
    }
}
