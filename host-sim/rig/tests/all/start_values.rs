//! Encoder kind and sign of the shunts are read at the start: another one needs a restart before the joint moves.

use crate::closed_loop::commissioning::commission;
use crate::closed_loop::rig::{Joint, Master, set};
use firmware::node::dictionary::records::{CommissioningObject, CommitObject};
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::sensors::SensorParameters;
use joint_rig::run_compact_from_power_up;

/// Values of the wiring that another reader and another sign need.
const OTHER: [(&str, f32); 2] = [("encoder_kind", 4.0), ("shunt_sign", 1.0)];

fn read(master: &mut Master, at_index: u16, sub_index: u8) -> u32 {
    master.rig.read_object(at_index, sub_index).expect("a number")
}

fn write(master: &mut Master, at_index: u16, sub_index: u8, word: u32) {
    master.rig.write_object(at_index, sub_index, word.to_le_bytes());
    (0..3).for_each(|_| master.rig.step_idle());
}

fn stage(master: &mut Master, (name, value): (&str, f32)) {
    let place = SensorParameters::NAMES.iter().position(|known| *known == name).expect(name);
    write(master, index::SENSORS, place as u8 + 1, value.to_bits());
}

/// Commits what is staged, and confirms its wiring.
fn commit(master: &mut Master) {
    let crc = read(master, index::COMMIT, 2);
    write(master, index::COMMIT, CommitObject::COMMIT, crc);
    assert_eq!(read(master, index::COMMIT, 1), crc);
    let wiring = read(master, index::COMMISSIONING, CommissioningObject::WIRING_CRC);
    write(master, index::COMMISSIONING, CommissioningObject::CONFIRM, wiring);
}

fn is_proven(master: &mut Master) -> bool {
    read(master, index::COMMISSIONING, CommissioningObject::PROVEN) != 0
}

/// Commits another reader, and requires that the joint neither arms nor moves with the old one.
fn assert_not_armed(master: &mut Master) {
    OTHER.into_iter().for_each(|value| stage(master, value));
    commit(master);
    let refused = master.arm().expect_err("the old reader is in use");
    assert!(refused.to_string().contains("encoder_kind: needs a restart"), "{refused}");
    let at = master.rig.plant().position_rad();
    master.current(300, 6.0);
    assert!(!master.rig.is_armed() && master.rig.stage_mut().applied_duty().is_none());
    assert!((master.rig.plant().position_rad() - at).abs() < 0.01);
    assert!(!is_proven(master));
}

#[test]
fn joint_with_another_encoder_kind_and_shunt_sign_moves_after_a_restart_only() {
    Joint::with(set(0.9)).run(|master| {
        assert_not_armed(master);
        write(master, index::STORE, 1, SAVE_SIGNATURE);
        (0..400).for_each(|_| master.rig.step_idle());
        master.rig.reset();
        master.rig.restart().expect("it starts");
        (0..200).for_each(|_| master.rig.step_idle());
        assert!(!is_proven(master), "no motion has shown the new wiring");
        master.arm().expect("the new reader is in use");
    });
}

#[test]
fn compact_node_with_another_encoder_kind_and_shunt_sign_is_not_armed() {
    let joint = Joint::with(set(0.9));
    let plant = joint.plant();
    let inertia = plant.inertia_kg_m2();
    run_compact_from_power_up(&joint.start(), plant, joint.faults, |rig| {
        assert_not_armed(&mut Master::new(rig, inertia));
    })
    .expect("a set that builds");
}

/// A measurement proves the wiring that turned the motor, not what was staged before it.
#[test]
fn measurement_with_another_sign_staged_proves_no_wiring() {
    let proven = [false, true].map(|is_staged| {
        Joint { commissioned: false, ..Joint::with(set(0.9)) }.run(|master| {
            if is_staged {
                master.rig.unlock().expect("the default key");
                stage(master, OTHER[1]);
            }
            let outcome = commission(master);
            (is_proven(master), outcome.torque_share.is_some())
        })
    });
    assert_eq!(proven, [(true, true), (false, false)]);
}
