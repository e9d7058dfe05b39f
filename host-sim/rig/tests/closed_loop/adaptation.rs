//! Scenario 22: the driver learns the levels of a joint whose seal has changed since its set was identified (2044h).

use super::rig::{Joint, Master, compute_in_parallel, set};
use super::stops::flag;
use super::table::{ScenarioRow, check, row};
use super::velocity::{drive, enable};
use compensator_core::adaptation::Frozen;
use compensator_core::can::{Message, NodeId, SealFrame};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AdaptationObject;
use simulated_machines::joint_plant::FrictionFamily;
use simulated_machines::joint_plant::seal::Seal;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Time of learning, and of each measurement at its begin and its end, ms.
const LEARNING_MS: usize = 60_000;
const MEASURED_MS: usize = 8_000;
const HELD_MS: usize = 2_000;
/// Modes of 2044h:1.
const OFF: u8 = 0;
const ON: u8 = 1;
const HOLD: u8 = 2;
/// Controlword of an enabled drive.
const ENABLED: u16 = 0x0F;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let cases = [
            ("maxwell-slip", FrictionFamily::MaxwellSlip, 1.6),
            ("rate-and-state", FrictionFamily::RateAndState, 1.6),
            ("iwan", FrictionFamily::Iwan, 1.6),
            ("maxwell-slip", FrictionFamily::MaxwellSlip, 0.65),
            ("maxwell-slip", FrictionFamily::MaxwellSlip, 1.0),
        ];
        compute_in_parallel(&cases, |(name, family, wear)| learn(name, *family, *wear)).concat()
    });
    &ROWS
}

fn write_mode(master: &mut Master, mode: u8) {
    master.rig.write_object_byte(index::ADAPTATION, AdaptationObject::MODE, mode);
    (0..5).for_each(|_| drive(master, ENABLED, 0.0));
}

fn level_gain(master: &mut Master) -> f64 {
    f64::from(f32::from_bits(master.rig.read_object(index::LEARNT_GAINS, 1).unwrap_or_default()))
}

/// Sends side load and pressure, which the law of the set reads.
fn send_seal(master: &mut Master) {
    let shown = master.rig.plant_mut().show();
    let frame = SealFrame {
        radial_force_n: shown.radial_force_n as f32,
        pressure_diff_pa: shown.pressure_diff_pa as f32,
    };
    let frame = Message::Seal(NodeId::FIRST, frame).emit();
    master.rig.send_immediately(frame.identifier(), frame.data());
}

/// Follows a velocity of changing size for this time. Returns the RMS error of the true velocity, rad/s.
fn strokes(master: &mut Master, milliseconds: usize) -> f64 {
    let mut sum = 0.0;
    for ms in 0..milliseconds {
        let time_s = 1e-3 * ms as f64;
        let size_rad_s = 0.7 + 0.5 * (TAU * 0.11 * time_s).sin();
        let wanted_rad_s = size_rad_s * (TAU * 0.5 * time_s).sin();
        send_seal(master);
        drive(master, ENABLED, wanted_rad_s);
        sum += (master.rig.plant().velocity_rad_s() - wanted_rad_s).powi(2);
    }
    (sum / milliseconds as f64).sqrt()
}

/// The friction of the seal is `wear` times that of its identification.
fn learn(family_name: &str, family: FrictionFamily, wear: f64) -> Vec<ScenarioRow> {
    let name = format!(
        "CSV, sines of changing size for 60 s, seal of the family {family_name} with x{wear} the friction of the set"
    );
    let joint = Joint::with(set(0.9));
    let phase_rad = [0.7, 2.1];
    joint.run_plant(
        |plant| {
            plant.seal = Seal::of_family(family, &joint.constants, phase_rad);
            plant.seal.set_wear(wear);
        },
        |master| {
            enable(master);
            let before = strokes(master, MEASURED_MS);
            write_mode(master, ON);
            strokes(master, LEARNING_MS);
            let frozen = master.rig.read_object(index::ADAPTATION, AdaptationObject::FROZEN);
            let learnt = level_gain(master);
            let after = strokes(master, MEASURED_MS);
            write_mode(master, HOLD);
            let held = level_gain(master);
            strokes(master, HELD_MS);
            let later = level_gain(master);
            write_mode(master, OFF);
            let off = level_gain(master);
            let again = strokes(master, MEASURED_MS);
            let armed = master.rig.is_armed();
            let is_reported =
                frozen.is_some_and(|code| Frozen::ALL.iter().any(|reason| *reason as u32 == code));
            let ratio = if wear > 1.0 { 0.1..=0.8 } else { 0.5..=1.05 };
            // Part of the friction does not wear: the set's viscous friction has a gain of its own.
            let level = if wear == 1.0 { 0.93..=1.07 } else { 0.85 * wear..=1.15 * wear };
            vec![
                row(22, &name, "learnt gain of the level", learnt, level),
                row(22, &name, "error after over error before", after / before, ratio),
                row(22, &name, "change of the gain on hold", later - held, 0.0..=0.0),
                row(22, &name, "gain when off", off, 1.0..=1.0),
                row(22, &name, "error when off over error before", again / before, 0.5..=1.5),
                row(22, &name, "reports why it learns or not", flag(is_reported), 1.0..=1.0),
                row(22, &name, "stays armed", flag(armed), 1.0..=1.0),
            ]
        },
    )
}

#[test]
fn levels_follow_a_changed_seal() {
    check(rows());
}
