//! The underwater joint: its short form says what it is to say, and the loop behind it is the same bits each time.

use super::quick;
use compensator_core::{LawKind, ParameterId, Parameters};
use firmware::parameter_set::ParameterSet;
use host_sim::joint_rig::{Faults, SealSensor, with_joint};
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
    let harm = outcome.rows.iter().filter(|row| row.column == "tracking error over that without");
    assert!(harm.clone().count() >= 20 && harm.clone().all(|row| row.ours <= 1.05));
    let summary = outcome.summary.join("\n");
    for word in
        ["Simulated", "missed", "reached", "refitting alone", "perfect model", "pressure-coulomb"]
    {
        assert!(summary.contains(word), "{word}: {summary}");
    }
}
