//! Scenario 21: a parameter set on trial (2042h) while the joint moves in CSP, and the undo of a tuning (2043h).

use super::position::{CSP, enable, micro};
use super::rig::{Joint, Master, set};
use super::stops::{REST_RAD_S, SLOW, flag, write_short};
use super::table::{ScenarioRow, check, row};
use firmware::node::dictionary::records::{TrialObject, TuningObject};
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use std::sync::LazyLock;

/// Time from a renewal to the deadline, ms.
const DEADLINE_MS: i16 = 400;
/// Speed of the targets, rad/s.
const SPEED_RAD_S: f64 = 1.5;
/// Time to that speed, ms.
const RISE_MS: i32 = 200;
/// Stored position gain, and that of the trial, 1e-3 1/s.
const GAIN: u32 = 10_000;
const TRIAL_GAIN: u32 = 6_000;
/// Time within which the image saves and answers again, ms.
const SAVE_MS: usize = 400;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = end_in_motion("the master renews nothing", true, 4);
        rows.extend(end_in_motion("the master is killed", false, 6));
        rows.extend(kept_and_undone());
        rows
    });
    &ROWS
}

fn idle(master: &mut Master, milliseconds: usize) {
    (0..milliseconds).for_each(|_| master.rig.step_idle());
}

fn read(master: &mut Master, at_index: u16, sub_index: u8) -> u32 {
    master.rig.read_object(at_index, sub_index).unwrap_or_default()
}

fn write(master: &mut Master, at_index: u16, sub_index: u8, word: u32) {
    master.rig.write_object(at_index, sub_index, word.to_le_bytes());
    idle(master, 3);
}

fn write_byte(master: &mut Master, at_index: u16, sub_index: u8, byte: u8) {
    master.rig.write_object_byte(at_index, sub_index, byte);
    idle(master, 3);
}

fn save(master: &mut Master) {
    write(master, index::STORE, 1, SAVE_SIGNATURE);
    idle(master, SAVE_MS);
}

/// CRC of the set in use, and the position gain.
fn in_use(master: &mut Master) -> (u32, u32) {
    (read(master, index::COMMIT, 1), read(master, index::POSITION_LOOP, 1))
}

/// Stores a ramp as the reaction, and tries half the compensation with another gain. Returns what was in use before, and
/// is on trial.
fn begin(master: &mut Master) -> [(u32, u32); 2] {
    write_short(master, index::FAULT_OPTION, 0, 1);
    save(master);
    let before = in_use(master);
    write_short(master, index::TRIAL, TrialObject::DEADLINE, DEADLINE_MS);
    write(master, index::COMPENSATOR, 1, 0.45f32.to_bits());
    let crc = read(master, index::COMMIT, 2);
    write(master, index::COMMIT, 3, crc);
    write(master, index::POSITION_LOOP, 1, TRIAL_GAIN);
    [before, in_use(master)]
}

/// Sends a target and a controlword, and runs 1 ms.
fn drive(master: &mut Master, position_rad: f64) {
    master.rig.write_object(index::TARGET_POSITION, 0, micro(position_rad));
    master.rig.send_immediately(0x201, &[0x0F, 0, 0, 0, 0, 0, 0, 0]);
    master.rig.step_idle();
}

/// The joint moves with a constant speed. Then the master fails: it sends targets without renewing the trial, or nothing.
fn end_in_motion(what: &str, sends_targets: bool, state: u32) -> Vec<ScenarioRow> {
    let name = format!("CSP at 1.5 rad/s on trial: {what}");
    Joint::with(set(0.9)).run(|master| {
        let [before, on_trial] = begin(master);
        enable(master, CSP);
        let mut target_rad = master.rig.plant().position_rad();
        for ms in 0..3 * RISE_MS {
            target_rad += 1e-3 * SPEED_RAD_S * f64::from(ms.min(RISE_MS)) / f64::from(RISE_MS);
            if ms % 100 == 0 {
                let [a, b] = DEADLINE_MS.to_le_bytes();
                master.rig.send_immediately(0x601, &[0x2B, 0x42, 0x20, 1, a, b, 0, 0]);
            }
            drive(master, target_rad);
        }
        // The last renewal is 99 ms old, the last target 1 ms.
        let delay_ms = f64::from(if sends_targets { i32::from(DEADLINE_MS) - 99 } else { 99 });
        let speed = master.rig.plant().velocity_rad_s();
        let (mut rest_ms, mut open_ms) = (f64::INFINITY, f64::INFINITY);
        for ms in 0..1000 {
            if sends_targets {
                target_rad += 1e-3 * SPEED_RAD_S;
                drive(master, target_rad);
            } else {
                master.rig.step_idle();
            }
            let stands = master.rig.plant().velocity_rad_s().abs() < REST_RAD_S;
            rest_ms = if stands { f64::min(rest_ms, f64::from(ms + 1)) } else { f64::INFINITY };
            if master.rig.stage_mut().applied_duty().is_none() {
                open_ms = f64::min(open_ms, f64::from(ms + 1));
            }
        }
        let armed = flag(master.rig.is_armed());
        let is_back = in_use(master) == before && before.1 == GAIN;
        let found = read(master, index::TRIAL, TrialObject::STATE);
        let reported_rad = 1e-6 * f64::from(read(master, index::ACTUAL_POSITION, 0) as i32);
        let lost_rad = (reported_rad - master.rig.plant().position_rad()).abs();
        let ramp_ms = 1e3 * SPEED_RAD_S / SLOW;
        // Without targets the position loop holds the last one, so that the joint may stand before its ramp.
        let (least_rest_ms, least_ramp_ms) =
            if sends_targets { (delay_ms + 0.8 * ramp_ms, 0.9 * ramp_ms) } else { (10.0, 0.0) };
        // The velocity loop lags by up to 30 ms, and the drive waits 20 ms at rest.
        let rest = least_rest_ms..=delay_ms + ramp_ms + 80.0;
        let open = delay_ms + least_ramp_ms + 15.0..=delay_ms + ramp_ms + 120.0;
        vec![
            row(21, &name, "another set is on trial", flag(on_trial.0 != before.0), 1.0..=1.0),
            row(21, &name, "speed before, rad/s", speed, 1.3..=1.7),
            row(21, &name, "to rest, ms", rest_ms, rest),
            row(21, &name, "to open bridge, ms", open_ms, open),
            row(21, &name, "stays armed", armed, 0.0..=0.0),
            row(21, &name, "stored set and gain are back", flag(is_back), 1.0..=1.0),
            row(21, &name, "its cause is reported (2042h:3)", flag(found == state), 1.0..=1.0),
            row(21, &name, "error of the reported position, rad", lost_rad, 0.0..=0.01),
        ]
    })
}

/// A set that is kept stays after the deadline and is saved; the undo brings the former one back.
fn kept_and_undone() -> Vec<ScenarioRow> {
    let name = "a set on trial is kept, saved, and undone";
    Joint::with(set(0.9)).run(|master| {
        let [before, on_trial] = begin(master);
        write_byte(master, index::TRIAL, TrialObject::ORDER, 1);
        write(master, index::TUNING, 1, 1_800_000_000);
        write(master, index::TUNING, 3, before.0);
        write(master, index::TUNING, 4, on_trial.0);
        idle(master, 2 * DEADLINE_MS as usize);
        save(master);
        let is_kept = in_use(master) == on_trial && on_trial.1 == TRIAL_GAIN;
        let is_recorded = read(master, index::TUNING, 1) == 1_800_000_000;
        write_byte(master, index::TUNING, TuningObject::UNDO, 1);
        let is_undone = in_use(master) == before && read(master, index::TUNING, 1) == 0;
        save(master);
        // The record is empty: a second undo is refused.
        write_byte(master, index::TUNING, TuningObject::UNDO, 1);
        let is_former = in_use(master) == before;
        vec![
            row(21, name, "set and gain after the deadline", flag(is_kept), 1.0..=1.0),
            row(21, name, "the record is stored", flag(is_recorded), 1.0..=1.0),
            row(21, name, "former set and gain after the undo", flag(is_undone), 1.0..=1.0),
            row(21, name, "the same after its save", flag(is_former), 1.0..=1.0),
        ]
    })
}

#[test]
fn trials_end_with_the_stored_set_unless_they_are_kept() {
    check(rows());
}
