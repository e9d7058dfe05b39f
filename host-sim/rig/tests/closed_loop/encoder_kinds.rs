//! Scenario 26: encoders of other kinds, in a small motion and with their faults.

use super::rig::{Joint, Master, set};
use super::table::{ScenarioRow, check, row};
use joint_rig::{HallFault, LineFault, SerialFault};
use std::sync::LazyLock;

/// Values of `encoder_kind`.
const ABZ: f32 = 2.0;
const ABZ_HALL: f32 = 3.0;
const HALL: f32 = 4.0;
const BISS: f32 = 5.0;

/// Bit 8 of the statusword.
const POSITION_KNOWN: u32 = 1 << 8;

/// Speed of the joint with the faults, rad/s: 24 turns of the motor in a second.
const SPEED_RAD_S: f64 = 3.0;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        // The loop of the master (2 Hz) leaves 0.2 rad/s of its ramp. Hall sensors show a speed by 1000 edges in a second, whose
        // places are off by a twentieth of their distance; at the joint a sector is 3 mrad.
        rows.extend(motion("ABZ and Hall sensors", ABZ_HALL, 0.3));
        rows.extend(motion("Hall sensors alone", HALL, 0.3));
        for (what, fault, within_ms) in [
            // 16 samples, 0.8 ms.
            ("lines missing", LineFault::Missing, 3.0),
            // The Hall sensors contradict the count after 85 degrees (electrical), 1.4 ms, and the start of a sector; then 2 ms
            // until the rotor is lost.
            ("line A stuck", LineFault::StuckLine, 6.0),
            ("count jumps by a quarter of a turn", LineFault::Jump(1024), 4.0),
        ] {
            let set_fault = |master: &mut Master| board(master).set_lines(fault);
            rows.extend(stopped(
                &format!("ABZ and Hall sensors, {what}"),
                ABZ_HALL,
                within_ms,
                set_fault,
            ));
        }
        for (what, fault, within_ms) in [
            // The next index, after 41 ms at most, and 10 ms between two looks.
            ("30 counts lost", LineFault::Lost(30), 60.0),
            ("index missing", LineFault::NoIndex, 110.0),
            ("every 50th edge lost or counted twice", LineFault::Noisy(0.02), 130.0),
        ] {
            let set_fault = |master: &mut Master| board(master).set_lines(fault);
            let what = format!("ABZ and Hall sensors, {what}");
            rows.extend(reported(&what, ABZ_HALL, within_ms, set_fault));
        }
        for (what, fault, within_ms) in [
            ("plug off", HallFault::Missing, 4.0),
            // An illegal level within an electrical turn, 6 ms, and 2 ms until the rotor is lost.
            ("a sensor stuck", HallFault::StuckSensor, 10.0),
            ("levels jump by half an electrical turn", HallFault::Jump, 4.0),
        ] {
            let set_fault = |master: &mut Master| board(master).set_hall(fault);
            rows.extend(stopped(
                &format!("Hall sensors alone, {what}"),
                HALL,
                within_ms,
                set_fault,
            ));
        }
        rows.extend(motion("BiSS C", BISS, 0.3));
        for (what, fault, within_ms) in [
            // 2 ms until the rotor is lost.
            ("line open", SerialFault::Open, 4.0),
            ("line low", SerialFault::Low, 4.0),
            // 16 samples, 0.8 ms.
            ("position frozen", SerialFault::Frozen, 3.0),
            ("every frame disturbed", SerialFault::Disturbed(1.0), 4.0),
            ("position jumps by a quarter of a turn", SerialFault::Jump(0.25), 4.0),
            ("error bit", SerialFault::Error, 4.0),
        ] {
            let set_fault = |master: &mut Master| board(master).set_serial(fault);
            rows.extend(stopped(&format!("BiSS C, {what}"), BISS, within_ms, set_fault));
        }
        // A report comes every millisecond, and 10 ms are between two looks.
        for (what, fault) in [
            ("5 % of the frames disturbed", SerialFault::Disturbed(0.05)),
            ("warning bit", SerialFault::Warning),
        ] {
            let set_fault = |master: &mut Master| board(master).set_serial(fault);
            rows.extend(reported(&format!("BiSS C, {what}"), BISS, 40.0, set_fault));
        }
        rows.extend(homes_after_reset());
        rows.extend(homes_after_power_cut());
        rows.extend(frozen_levels());
        rows.extend(reversed());
        rows.extend(without_index());
        rows
    });
    &ROWS
}

fn board<'a>(master: &'a mut Master) -> &'a mut joint_rig::BoardSensors {
    master.rig.stage_mut().board.as_mut().expect("a board")
}

fn joint(kind: f32) -> Joint {
    let mut set = set(0.9);
    set.sensors.encoder_kind = kind;
    set.sensors.biss_turn_bits = 12.0;
    Joint::with(set)
}

/// Accelerates to the speed in 100 ms and holds it for 60 ms.
fn reach_speed(master: &mut Master) {
    master.arm().expect("it arms");
    for k in 1..=100 {
        master.follow(SPEED_RAD_S * f64::from(k) / 100.0, SPEED_RAD_S / 0.1);
    }
    (0..60).for_each(|_| master.follow(SPEED_RAD_S, 0.0));
}

fn flag(is_set: bool) -> f64 {
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

/// A fault with which the joint cannot be driven.
fn stopped(
    what: &str,
    kind: f32,
    within_ms: f64,
    set_fault: impl Fn(&mut Master),
) -> Vec<ScenarioRow> {
    let name = format!("{what}, at 3 rad/s");
    let (after, most) = joint(kind).run(|master| {
        reach_speed(master);
        set_fault(master);
        master.rig.stage_mut().take_extremes();
        let mut after = f64::INFINITY;
        for k in 0..30 {
            master.follow(SPEED_RAD_S, 0.0);
            if after.is_infinite() && master.rig.stage_mut().applied_duty().is_none() {
                after = f64::from(k + 1);
            }
        }
        (after, master.rig.stage_mut().take_extremes())
    });
    vec![
        row(26, &name, "to open bridge, ms", after, 0.0..=within_ms),
        row(26, &name, "largest phase current, A", most.current_a, 0.5..=40.0),
        row(26, &name, "largest speed, rad/s", most.speed_rad_s, 2.0..=4.5),
    ]
}

/// Returns true if the driver reports a warning of the encoder.
fn is_warned(master: &mut Master) -> bool {
    master.rig.active_limits().iter().any(|code| code.info().name == "encoder-magnet")
}

/// A fault with which the joint is driven on, and that is reported.
fn reported(
    what: &str,
    kind: f32,
    within_ms: f64,
    set_fault: impl Fn(&mut Master),
) -> Vec<ScenarioRow> {
    let name = format!("{what}, at 3 rad/s");
    let (after, most, armed) = joint(kind).run(|master| {
        reach_speed(master);
        let is_early = is_warned(master);
        set_fault(master);
        master.rig.stage_mut().take_extremes();
        let mut after = f64::INFINITY;
        for k in 0..150 {
            master.follow(SPEED_RAD_S, 0.0);
            // Every request of the state runs the board for some time.
            if !is_early && after.is_infinite() && k % 10 == 9 && is_warned(master) {
                after = f64::from(k + 1);
            }
        }
        (after, master.rig.stage_mut().take_extremes(), master.rig.is_armed())
    });
    vec![
        row(26, &name, "to its report, ms", after, 0.0..=within_ms),
        row(26, &name, "stays armed", flag(armed), 1.0..=1.0),
        row(26, &name, "largest phase current, A", most.current_a, 0.5..=26.5),
    ]
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
    let status = master.rig.read_object(0x6041, 0).expect("the statusword");
    let shown = master.rig.read_object(0x6064, 0).expect("the position") as i32;
    let off_rad = f64::from(shown) * 1e-6 - master.rig.plant().position_rad();
    (status & POSITION_KNOWN != 0, off_rad)
}

/// Power cuts of a homed joint at 0.3 rad that has rested for a second. It is armed then or not, and its bus falls to 25 V before
/// or not. Its motor turns by this share of a turn without power.
fn homes_after_power_cut() -> Vec<ScenarioRow> {
    let cases = [
        ("at rest, motor turned by 0.3 turns meanwhile", 0.0, 0.3, [false, false], true),
        ("at rest, motor turned by 0.45 turns meanwhile", 0.0, 0.45, [false, false], false),
        ("armed after a rest, without a warning", 0.0, 0.0, [true, false], false),
        (
            "armed after a rest, 40 ms after its bus has fallen to 25 V",
            0.0,
            0.3,
            [true, true],
            true,
        ),
        ("at rest, BiSS C, motor turned by 3.45 turns meanwhile", BISS, 3.45, [false, false], true),
    ];
    let mut rows = Vec::new();
    for (what, kind, turns, [is_armed, is_failing], is_kept) in cases {
        let name = format!("power cut of a homed joint, {what}");
        let mut joint = joint(kind);
        joint.constants.encoder_zero_rad = 2.0;
        let (known, off_rad) = joint.run_plant(
            |plant| plant.place(0.3),
            |master| {
                master.arm().expect("it arms");
                master.rig.request_state(0);
                (0..1200).for_each(|_| master.rig.step_idle());
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

/// Levels that are stuck hold the field still, and with it the rotor.
fn frozen_levels() -> Vec<ScenarioRow> {
    let name = "Hall sensors alone, all levels stuck, at 3 rad/s";
    let (turned, most) = joint(HALL).run(|master| {
        reach_speed(master);
        board(master).set_hall(HallFault::Frozen);
        master.rig.stage_mut().take_extremes();
        let from = master.rig.plant().position_rad();
        (0..150).for_each(|_| master.follow(SPEED_RAD_S, 0.0));
        let turned = (master.rig.plant().position_rad() - from).abs();
        (turned, master.rig.stage_mut().take_extremes())
    });
    vec![
        row(26, name, "turned in 0.15 s, rad", turned, 0.0..=0.3),
        row(26, name, "largest phase current, A", most.current_a, 0.5..=40.0),
        row(26, name, "largest speed, rad/s", most.speed_rad_s, 2.0..=4.5),
    ]
}

/// Lines A and B swapped since the start: the Hall sensors contradict the count.
fn reversed() -> Vec<ScenarioRow> {
    let name = "ABZ and Hall sensors, lines A and B swapped, 2 rad/s commanded";
    let (armed, travel) = joint(ABZ_HALL).run(|master| {
        board(master).set_lines(LineFault::Reversed);
        let from = master.rig.plant().position_rad();
        master.arm().expect("nothing is seen at rest");
        (0..100).for_each(|_| master.follow(2.0, 0.0));
        let travel = (master.rig.plant().position_rad() - from).abs();
        (master.rig.is_armed(), travel)
    });
    vec![
        row(26, name, "stays armed", flag(armed), 0.0..=0.0),
        // Two sectors are 6 mrad.
        row(26, name, "total travel, rad", travel, 0.0..=0.02),
    ]
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
fn encoders_of_all_kinds_drive_and_their_faults_are_found() {
    check(rows());
}
