//! Scenario 26: encoders of other kinds, in a small motion. [`super::encoder_faults`] has their faults.

use super::driver::ALL_ENCODER_FAULTS;
use super::rig::{Joint, Master, set};
use super::table::{ScenarioRow, check, row};
use super::velocity::{drive, enable};
use firmware::node::dictionary::index;
use std::sync::LazyLock;

/// Values of `encoder_kind`.
pub(super) const ABZ: f32 = 2.0;
pub(super) const ABZ_HALL: f32 = 3.0;
pub(super) const HALL: f32 = 4.0;
pub(super) const BISS: f32 = 5.0;

/// Bit 8 of the statusword.
const POSITION_KNOWN: u32 = 1 << 8;

/// Speed of the joint with the faults, rad/s: 24 turns of the motor in a second.
pub(super) const SPEED_RAD_S: f64 = 3.0;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        // The loop of the master (2 Hz) leaves 0.2 rad/s of its ramp. Hall sensors show a speed by 1000 edges in a second, whose
        // places are off by a twentieth of their distance; at the joint a sector is 3 mrad.
        rows.extend(motion("ABZ and Hall sensors", ABZ_HALL, 0.3));
        rows.extend(motion("Hall sensors alone", HALL, 0.3));
        rows.extend(motion("BiSS C", BISS, 0.3));
        if ALL_ENCODER_FAULTS {
            rows.extend(slow_targets());
        }
        rows.extend(homes_after_reset());
        rows.extend(homes_after_power_cut());
        rows.extend(without_index());
        rows
    });
    &ROWS
}

pub(super) fn board<'a>(master: &'a mut Master) -> &'a mut joint_rig::BoardSensors {
    master.rig.stage_mut().board.as_mut().expect("a board")
}

pub(super) fn joint(kind: f32) -> Joint {
    let mut set = set(0.9);
    set.sensors.encoder_kind = kind;
    set.sensors.biss_turn_bits = 12.0;
    Joint::with(set)
}

/// Returns true if the driver knows the position of the joint.
pub(super) fn is_position_known(master: &mut Master) -> bool {
    let status = master.rig.read_object(0x6041, 0).expect("the statusword");
    status & POSITION_KNOWN != 0
}

/// Turns the motor by more than a turn and back by hand, so that an ABZ encoder finds its index.
pub(super) fn turn_by_hand(master: &mut Master) {
    let from_rad = master.rig.plant().position_rad();
    let turn_rad = std::f64::consts::TAU / f64::from(set(0.0).motor.gear_ratio);
    for k in (0..30).chain((0..30).rev()) {
        let at_rad = from_rad + 1.2 * turn_rad * f64::from(k) / 29.0;
        master.rig.plant_mut().place(at_rad);
        master.rig.step_idle();
    }
    // `encoder-lost` is over 0.1 s after its cause.
    (0..120).for_each(|_| master.rig.step_idle());
}

/// Accelerates to the speed in 100 ms and holds it for 60 ms.
pub(super) fn reach_speed(master: &mut Master) {
    reach(master, SPEED_RAD_S);
}

/// Accelerates to this speed in 100 ms and holds it for 60 ms.
pub(super) fn reach(master: &mut Master, speed_rad_s: f64) {
    master.arm().expect("it arms");
    for k in 1..=100 {
        master.follow(speed_rad_s * f64::from(k) / 100.0, speed_rad_s / 0.1);
    }
    (0..60).for_each(|_| master.follow(speed_rad_s, 0.0));
}

pub(super) fn flag(is_set: bool) -> f64 {
    f64::from(u8::from(is_set))
}

/// A joint that reaches a speed and holds it.
fn motion(what: &str, kind: f32, error_rad_s: f64) -> Vec<ScenarioRow> {
    let name = format!("{what}: to 3 rad/s in 0.1 s");
    let (velocity, position, armed) = joint(kind).run(|master| {
        reach_speed(master);
        let (mut squares, mut off) = (0.0, 0.0f64);
        let from = master.rig.plant().position_rad();
        let shown = f64::from(master.rig.master_view().position_rad);
        for _ in 0..100 {
            master.follow(SPEED_RAD_S, 0.0);
            let plant = master.rig.plant();
            squares += (plant.velocity_rad_s() - SPEED_RAD_S).powi(2);
            let turned = f64::from(master.rig.master_view().position_rad) - shown;
            off = off.max((turned - (plant.position_rad() - from)).abs());
        }
        ((squares / 100.0f64).sqrt(), off, master.rig.is_armed())
    });
    vec![
        row(26, &name, "stays armed", flag(armed), 1.0..=1.0),
        row(26, &name, "RMS velocity error, rad/s", velocity, 0.0..=error_rad_s),
        // A report is a millisecond old.
        row(26, &name, "largest error of the reported travel, rad", position, 0.0..=0.006),
    ]
}

/// Slow targets in CSV with Hall sensors alone: an edge comes every 3 mrad, off by a twentieth of this distance. At less than
/// 0.06 rad/s the joint counts as resting between two edges.
fn slow_targets() -> Vec<ScenarioRow> {
    let at = |target_rad_s: f64| {
        let error = joint(HALL).run(|master| {
            enable(master);
            (0..1000).for_each(|_| drive(master, 0x0F, target_rad_s));
            let mut squares = 0.0;
            for _ in 0..1000 {
                drive(master, 0x0F, target_rad_s);
                squares += (master.rig.plant().velocity_rad_s() - target_rad_s).powi(2);
            }
            (squares / 1000.0f64).sqrt()
        });
        let name =
            format!("Hall sensors alone: CSV, {target_rad_s} rad/s, with compensation (0.9)");
        let share = if target_rad_s < 0.2 { 1.0 } else { 0.1 };
        row(26, &name, "RMS velocity error, rad/s", error, 0.0..=share * target_rad_s)
    };
    [0.05, 0.1, 0.2, 0.5].map(at).to_vec()
}

/// Resets of a homed joint at 0.3 rad. Meanwhile the motor turns by this share of a turn, the joint is armed, or neither.
fn homes_after_reset() -> Vec<ScenarioRow> {
    let cases = [
        ("disarmed", 0.0, false, true),
        ("disarmed, motor turned by 0.35 turns meanwhile", 0.35, false, true),
        ("disarmed, motor turned by 0.45 turns meanwhile", 0.45, false, false),
        ("armed", 0.0, true, false),
    ];
    let mut rows = Vec::new();
    for (what, turns, is_armed, is_kept) in cases {
        let name = format!("reset of a homed joint at rest, {what}");
        let mut joint = joint(0.0);
        joint.constants.encoder_zero_rad = 2.0;
        let (known, off_rad) = joint.run_plant(
            |plant| plant.place(0.3),
            |master| {
                master.arm().expect("it arms");
                if !is_armed {
                    master.rig.request_state(0);
                }
                (0..30).for_each(|_| master.rig.step_idle());
                master.rig.reset();
                restart_turned(master, turns)
            },
        );
        rows.push(row(26, &name, "position known", flag(known), flag(is_kept)..=flag(is_kept)));
        if is_kept {
            // Noise of one sample of the encoder, three counts of the motor.
            rows.push(row(26, &name, "error of the position, rad", off_rad.abs(), 0.0..=1e-4));
        }
    }
    rows
}

/// Turns the motor of a joint that does not run by this share of a turn, and starts the driver again. Returns whether the
/// position is known, and its error, rad.
fn restart_turned(master: &mut Master, turns: f64) -> (bool, f64) {
    (0..5).for_each(|_| master.rig.step_idle());
    let at_rad = master.rig.plant().position_rad();
    let gear = f64::from(set(0.0).motor.gear_ratio);
    master.rig.plant_mut().place(at_rad + turns * std::f64::consts::TAU / gear);
    master.rig.restart().expect("it starts");
    (0..250).for_each(|_| master.rig.step_idle());
    let shown = master.rig.read_object(0x6064, 0).expect("the position") as i32;
    let off_rad = f64::from(shown) * 1e-6 - master.rig.plant().position_rad();
    (is_position_known(master), off_rad)
}

/// A power cut of a homed joint at 0.3 rad that has rested for a second.
#[derive(Clone, Copy)]
struct PowerCut {
    what: &'static str,
    /// Kind of the encoder.
    kind: f32,
    /// Turns of the motor without power.
    turns: f64,
    is_armed: bool,
    /// The bus falls to 25 V before.
    is_failing: bool,
    has_brake: bool,
    /// The home is expected to be known afterwards.
    is_kept: bool,
}

const POWER_CUTS: [PowerCut; 6] = {
    let at_rest = PowerCut {
        what: "at rest, motor turned by 0.3 turns meanwhile",
        kind: 0.0,
        turns: 0.3,
        is_armed: false,
        is_failing: false,
        has_brake: false,
        is_kept: true,
    };
    let failed = PowerCut {
        what: "armed after a rest, 40 ms after its bus has fallen to 25 V",
        is_armed: true,
        is_failing: true,
        is_kept: false,
        ..at_rest
    };
    [
        at_rest,
        PowerCut {
            what: "at rest, motor turned by 0.45 turns meanwhile",
            turns: 0.45,
            is_kept: false,
            ..at_rest
        },
        PowerCut {
            what: "armed after a rest, without a warning",
            turns: 0.0,
            is_failing: false,
            ..failed
        },
        PowerCut {
            what: "armed after a rest, 40 ms after its bus has fallen to 25 V, with a holding brake",
            has_brake: true,
            is_kept: true,
            ..failed
        },
        failed,
        PowerCut {
            what: "at rest, BiSS C, motor turned by 3.45 turns meanwhile",
            kind: BISS,
            turns: 3.45,
            ..at_rest
        },
    ]
};

fn homes_after_power_cut() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for cut in POWER_CUTS {
        let PowerCut { what, kind, turns, is_armed, is_failing, has_brake, is_kept } = cut;
        let name = format!("power cut of a homed joint, {what}");
        let mut joint = joint(kind);
        joint.constants.encoder_zero_rad = 2.0;
        let (known, off_rad) = joint.run_plant(
            |plant| plant.place(0.3),
            |master| {
                master.arm().expect("it arms");
                master.rig.request_state(0);
                (0..1200).for_each(|_| master.rig.step_idle());
                if has_brake {
                    master.rig.write_object_byte(index::HOLDING_BRAKE, 1, 1);
                }
                if is_armed {
                    // Without homing it again.
                    (0..5).for_each(|_| master.rig.step_with_command(0.0, 0.0));
                    master.rig.request_state(1);
                    (0..20).for_each(|_| master.rig.step_with_command(0.0, 0.0));
                    assert!(master.rig.is_armed());
                }
                if is_failing {
                    master.rig.plant_mut().set_supply(25.0);
                    (0..40).for_each(|_| master.rig.step_with_command(0.0, 0.0));
                }
                master.rig.cut_power();
                master.rig.plant_mut().set_supply(48.0);
                restart_turned(master, turns)
            },
        );
        rows.push(row(26, &name, "position known", flag(known), flag(is_kept)..=flag(is_kept)));
        if is_kept {
            rows.push(row(26, &name, "error of the position, rad", off_rad.abs(), 0.0..=1e-4));
        }
    }
    rows
}

/// Without Hall sensors there is no angle before the index.
fn without_index() -> Vec<ScenarioRow> {
    let name = "ABZ alone, before its index";
    let mut joint = joint(ABZ);
    joint.constants.encoder_zero_rad = 1.0;
    let armed = joint.run(|master| master.arm().is_ok());
    vec![row(26, name, "arms", flag(armed), 0.0..=0.0)]
}

#[test]
fn encoders_of_all_kinds_drive_and_keep_the_home() {
    check(rows());
}
