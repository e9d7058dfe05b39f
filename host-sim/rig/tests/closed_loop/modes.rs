//! Scenario 25: profile velocity (3), profile torque (4), and changes of the mode of an enabled drive.

use super::holding_brake::with_brake;
use super::position::micro;
use super::rig::{Joint, Master, set};
use super::stops::{flag, write_short};
use super::table::{ScenarioRow, check, row};
use super::velocity::drive;
use firmware::node::dictionary::index;
use simulated_machines::joint_plant::HoldingBrake;
use std::sync::LazyLock;

const PV: u8 = 3;
const TQ: u8 = 4;
const CSV: u8 = 9;
const ENABLED: u16 = 0x0F;
const HALT: u16 = 0x010F;
/// Accelerations of 6083h and 6084h, rad/s^2.
const FASTER: f64 = 4.0;
const SLOWER: f64 = 8.0;
/// Slope of 6087h, thousandths of the rated torque per second.
const SLOPE: u32 = 2000;
/// Bits of the statusword.
const REACHED: u32 = 1 << 10;
const LIMITED: u32 = 1 << 11;
const STANDS: u32 = 1 << 12;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = velocity_ramps();
        rows.extend(velocity_limit_and_halt());
        rows.extend(torque_ramp());
        rows.extend(torque_speed_limit());
        rows.extend(held_changes());
        rows.extend(moving_changes());
        rows.extend(offset_after_halt());
        rows
    });
    &ROWS
}

fn status(master: &mut Master) -> u32 {
    master.rig.read_object(index::STATUSWORD, 0).unwrap_or_default()
}

fn enable(master: &mut Master, mode: u8) {
    master.rig.send_immediately(0, &[1, 1]);
    master.rig.write_object_byte(index::MODE, 0, mode);
    for word in [0x06, 0x07, ENABLED] {
        (0..20).for_each(|_| drive(master, word, 0.0));
    }
    assert!(master.rig.is_armed(), "{:?}", master.faults());
}

/// Sends a controlword and a torque (thousandths) in each of these milliseconds.
fn torque(master: &mut Master, milliseconds: u32, word: u16, permille: i16) {
    for _ in 0..milliseconds {
        let [a, b] = word.to_le_bytes();
        let [c, d] = permille.to_le_bytes();
        master.rig.send_immediately(0x201, &[a, b, c, d]);
        master.rig.step_idle();
    }
}

/// Runs until the joint passes two speeds, rad/s. Returns the mean acceleration between them, rad/s^2; 0 without them.
fn slope(master: &mut Master, target_rad_s: f64, [first, second]: [f64; 2]) -> f64 {
    let mut passed = [None; 2];
    for ms in 0..900 {
        drive(master, ENABLED, target_rad_s);
        let speed = master.rig.plant().velocity_rad_s();
        for (at, level) in passed.iter_mut().zip([first, second]) {
            let is_past = if first < second { speed >= level } else { speed <= level };
            *at = at.or(is_past.then_some(ms));
        }
        if let [Some(from), Some(to)] = passed {
            return (second - first) / (1e-3 * f64::from(to - from).max(1.0));
        }
    }
    0.0
}

fn velocity_ramps() -> Vec<ScenarioRow> {
    let name = "bare shaft, PV: 60FFh = 2, -2 and 0 rad/s, 6083h = 4 and 6084h = 8 rad/s^2";
    Joint::with(set(0.9)).run(|master| {
        master.rig.write_object(index::ACCELERATION, 0, micro(FASTER));
        master.rig.step_idle();
        master.rig.write_object(index::DECELERATION, 0, micro(SLOWER));
        master.rig.step_idle();
        enable(master, PV);
        let rest = status(master);
        let up = slope(master, 2.0, [0.5, 1.5]);
        let on_ramp = status(master);
        (0..250).for_each(|_| drive(master, ENABLED, 2.0));
        let (end_rad_s, end) = (master.rig.plant().velocity_rad_s(), status(master));
        let down = slope(master, -2.0, [1.6, 0.4]);
        let back = slope(master, -2.0, [-0.8, -1.8]);
        (0..350).for_each(|_| drive(master, ENABLED, 0.0));
        let stopped = status(master);
        let has = |word: u32, bits: u32| flag(word & (REACHED | STANDS) == bits);
        vec![
            row(25, name, "acceleration from 0.5 to 1.5 rad/s, rad/s^2", up, 3.6..=4.4),
            row(25, name, "acceleration from 1.6 to 0.4 rad/s, rad/s^2", down, -8.8..=-7.2),
            // The loop still makes up for the friction that turned.
            row(25, name, "acceleration from -0.8 to -1.8 rad/s, rad/s^2", back, -4.6..=-3.4),
            row(25, name, "speed at the end of the ramp, rad/s", end_rad_s, 1.95..=2.05),
            row(25, name, "at rest: reached, stands", has(rest, REACHED | STANDS), 1.0..=1.0),
            row(25, name, "on the ramp: neither", has(on_ramp, 0), 1.0..=1.0),
            row(25, name, "at 2 rad/s: reached", has(end, REACHED), 1.0..=1.0),
            row(25, name, "stopped: reached, stands", has(stopped, REACHED | STANDS), 1.0..=1.0),
        ]
    })
}

fn velocity_limit_and_halt() -> Vec<ScenarioRow> {
    let name = "bare shaft, PV: 60FFh = 2 rad/s, 607Fh = 1 rad/s, then halt";
    Joint::with(set(0.9)).run(|master| {
        master.rig.write_object(index::MAX_PROFILE_VELOCITY, 0, micro(1.0));
        master.rig.step_idle();
        enable(master, PV);
        (0..400).for_each(|_| drive(master, ENABLED, 2.0));
        let (fast_rad_s, limited) = (master.rig.plant().velocity_rad_s(), status(master));
        (0..300).for_each(|_| drive(master, HALT, 2.0));
        let (halted_rad_s, halted) = (master.rig.plant().velocity_rad_s(), status(master));
        vec![
            row(25, name, "speed, rad/s", fast_rad_s, 0.95..=1.05),
            row(
                25,
                name,
                "limit is reported, target is not reached",
                flag(limited & (LIMITED | REACHED) == LIMITED),
                1.0..=1.0,
            ),
            row(25, name, "speed in the halt, rad/s", halted_rad_s, -0.02..=0.02),
            row(25, name, "halt is reported", flag(halted & REACHED != 0), 1.0..=1.0),
        ]
    })
}

/// Torque (6077h), thousandths of the rated torque.
fn actual_permille(master: &mut Master) -> f64 {
    f64::from(master.rig.read_object(index::ACTUAL_TORQUE, 0).unwrap_or_default() as u16 as i16)
}

fn torque_ramp() -> Vec<ScenarioRow> {
    let name = "joint with its brake closed by another device, TQ: 6071h = 300, 6087h = 2000 per s, 6072h = 250";
    Joint::with(set(0.0)).run_plant(
        |plant| plant.brake = Some(HoldingBrake::new(60.0, 0.03, 0.04)),
        |master| {
            write_short(master, index::MAX_TORQUE, 0, 250);
            master.rig.write_object(index::TORQUE_SLOPE, 0, SLOPE.to_le_bytes());
            master.rig.step_idle();
            enable(master, TQ);
            // Two readings take equal times, so that their difference has that of the commands between them.
            torque(master, 25, ENABLED, 300);
            let first = actual_permille(master);
            torque(master, 49, ENABLED, 300);
            let second = actual_permille(master);
            let on_ramp = status(master);
            torque(master, 100, ENABLED, 300);
            let (end, reached) = (actual_permille(master), status(master));
            torque(master, 50, HALT, 300);
            let halting = actual_permille(master);
            torque(master, 150, HALT, 300);
            let (halted, at_rest) = (actual_permille(master), status(master));
            torque(master, 50, ENABLED, -100);
            let negative = actual_permille(master);
            vec![
                row(25, name, "torque after 27 ms, thousandths", first, 35.0..=70.0),
                row(25, name, "rise in 50 ms, thousandths", second - first, 85.0..=118.0),
                row(25, name, "torque at the end of the ramp, thousandths", end, 240.0..=260.0),
                row(
                    25,
                    name,
                    "reached on the ramp, and at its end",
                    flag(on_ramp & REACHED != 0) + 2.0 * flag(reached & REACHED != 0),
                    2.0..=2.0,
                ),
                row(25, name, "torque 50 ms after a halt, thousandths", halting, 125.0..=165.0),
                row(25, name, "torque at the end of the halt, thousandths", halted, -10.0..=10.0),
                row(25, name, "halt is reported", flag(at_rest & REACHED != 0), 1.0..=1.0),
                row(
                    25,
                    name,
                    "torque 50 ms after 6071h = -100, thousandths",
                    negative,
                    -110.0..=-85.0,
                ),
            ]
        },
    )
}

fn torque_speed_limit() -> Vec<ScenarioRow> {
    let name = "bare shaft, TQ: 6071h = 100, 6080h = 1 rad/s at the joint";
    Joint::with(set(0.9)).run(|master| {
        master.rig.write_object(index::MAX_MOTOR_SPEED, 0, 487u32.to_le_bytes());
        master.rig.step_idle();
        enable(master, TQ);
        torque(master, 600, ENABLED, 100);
        // The gain of the velocity loop limits the torque: that of 2.6 A is left 0.9 rad/s below 6080h at the latest.
        let speed = master.rig.plant().velocity_rad_s();
        vec![row(25, name, "speed, rad/s", speed, 0.13..=1.05)]
    })
}

/// Changes the mode of an enabled drive and waits without a target; returns the largest step of the current in a
/// millisecond, A.
fn change(master: &mut Master, mode: u8, milliseconds: u32) -> f64 {
    let mut before_a = f64::from(master.rig.master_view().current_a);
    master.rig.write_object_byte(index::MODE, 0, mode);
    (0..milliseconds).fold(0.0, |most, ms| {
        if ms % 20 == 10 {
            // Confirms the last target.
            write_controlword(master);
        }
        master.rig.step_idle();
        let now_a = f64::from(master.rig.master_view().current_a);
        let step_a = (now_a - before_a).abs();
        before_a = now_a;
        f64::max(most, step_a)
    })
}

fn write_controlword(master: &mut Master) {
    let [low, high] = index::CONTROLWORD.to_le_bytes();
    master.rig.send_immediately(0x601, &[0x2B, low, high, 0, ENABLED as u8, 0, 0, 0]);
}

/// A walk through all ordered pairs of these modes, from the first one.
fn all_pairs<const N: usize>(modes: [u8; N]) -> Vec<u8> {
    let mut walk = Vec::new();
    for first in 0..N {
        for second in first + 1..N {
            walk.extend([modes[first], modes[second]]);
        }
    }
    // Each pair was walked forwards; between them lie others, and the way back has the rest.
    let back: Vec<u8> = walk.iter().rev().copied().collect();
    walk.extend(back);
    walk
}

/// A leg is held while the modes change: the torque of its load must remain.
fn held_changes() -> Vec<ScenarioRow> {
    let name = "leg held horizontally: all changes between the modes 1, 3, 4, 8, 9 and 10";
    with_brake(true, |master| {
        enable(master, CSV);
        (0..600).for_each(|_| drive(master, ENABLED, 0.0));
        (0..400).for_each(|_| drive(master, ENABLED, 0.3));
        (0..400).for_each(|_| drive(master, ENABLED, 0.0));
        let from = master.rig.plant().position_rad();
        let (mut step_a, mut most_rad, mut changes) = (0.0, 0.0, 0);
        for mode in all_pairs([1, PV, TQ, 8, CSV, 10]) {
            step_a = f64::max(step_a, change(master, mode, 12));
            most_rad = f64::max(most_rad, (master.rig.plant().position_rad() - from).abs());
            changes +=
                u32::from(master.rig.read_object(index::MODE_DISPLAY, 0) == Some(mode.into()));
        }
        vec![
            row(25, name, "changes that were accepted", f64::from(changes), 60.0..=60.0),
            // The noise of a current sensor is 0.1 A; the load needs 5.7 A.
            row(25, name, "largest step of the current in a millisecond, A", step_a, 0.0..=1.5),
            row(25, name, "largest way, rad", most_rad, 0.0..=0.03),
            row(25, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// A joint turns while the modes change between velocity and torque.
fn moving_changes() -> Vec<ScenarioRow> {
    let name = "bare shaft at 1 rad/s: all changes between the modes 3, 4, 9 and 10, then 8 and 1";
    Joint::with(set(0.9)).run(|master| {
        enable(master, CSV);
        (0..500).for_each(|_| drive(master, ENABLED, 1.0));
        let (mut step_a, mut slowest, mut fastest) = (0.0, f64::INFINITY, 0.0);
        for mode in all_pairs([PV, TQ, CSV, 10]) {
            step_a = f64::max(step_a, change(master, mode, 15));
            let speed = master.rig.plant().velocity_rad_s();
            (slowest, fastest) = (f64::min(slowest, speed), f64::max(fastest, speed));
        }
        let mut ramp_a = change(master, 8, 60);
        master.rig.write_object_byte(index::MODE, 0, PV);
        master.rig.step_idle();
        (0..400).for_each(|_| drive(master, ENABLED, 1.0));
        ramp_a = f64::max(ramp_a, change(master, 1, 200));
        let end_rad_s = master.rig.plant().velocity_rad_s();
        vec![
            row(25, name, "largest step of the current in a millisecond, A", step_a, 0.0..=1.5),
            row(25, name, "slowest, rad/s", slowest, 0.8..=1.0),
            row(25, name, "fastest, rad/s", fastest, 0.95..=1.2),
            // 6085h is 50 rad/s^2: 6 A begin at once on an inertia of 0.12 kg m^2, and overshoot in the current loop.
            row(25, name, "largest step of the current at a ramp, A", ramp_a, 0.0..=12.0),
            row(25, name, "speed at the end, rad/s", end_rad_s, -0.05..=0.05),
        ]
    })
}

/// A master stops sending its torque offset during a halt.
fn offset_after_halt() -> Vec<ScenarioRow> {
    let name = "leg held horizontally in CSV, 60B2h = its gravity: halt, in which 60B2h ends, then 6040h without halt";
    with_brake(true, |master| {
        let rated_nm =
            1e-3 * f64::from(master.rig.read_object(index::RATED_TORQUE, 0).unwrap_or(1));
        let permille = (5.9e3 / rated_nm) as i16;
        let offset = |master: &mut Master| {
            let [low, high] = index::TORQUE_OFFSET.to_le_bytes();
            let [a, b] = permille.to_le_bytes();
            master.rig.send_immediately(0x601, &[0x2B, low, high, 0, a, b, 0, 0]);
        };
        enable(master, CSV);
        let run = |master: &mut Master, milliseconds: u32, word: u16, has_offset: bool| {
            let from = master.rig.plant().position_rad();
            (0..milliseconds).fold(0.0, |most, ms| {
                if has_offset && ms % 5 == 0 {
                    offset(master);
                }
                drive(master, word, 0.0);
                f64::max(most, (master.rig.plant().position_rad() - from).abs())
            })
        };
        run(master, 500, ENABLED, true);
        // The motor has then turned, so that a load without motion is no fault.
        for ms in 0..600 {
            if ms % 5 == 0 {
                offset(master);
            }
            drive(master, ENABLED, if ms < 300 { 0.5 } else { 0.0 });
        }
        run(master, 100, HALT, true);
        let halted = run(master, 500, HALT, false);
        let released = run(master, 500, ENABLED, false);
        vec![
            row(25, name, "largest way in the halt, rad", halted, 0.0..=0.004),
            row(25, name, "largest way after it, rad", released, 0.0..=0.004),
            row(25, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

#[test]
fn profile_modes_ramp_and_change_without_a_jump() {
    check(rows());
}
