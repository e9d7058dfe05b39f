//! Scenario 19: position limits (607Dh) and following error. Scenario 20: position modes of CiA 402: CSP (8), PP (1) and
//! homing at a stop (6).

use super::rig::{Joint, Master, set};
use super::stops::{flag, write_short};
use super::table::{ScenarioRow, check, row};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use std::f64::consts::TAU;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = limits();
        rows.extend(following_error());
        rows.extend(tracking());
        rows.extend(late_tracking());
        rows.extend(stiff_tracking());
        rows.extend(moves());
        rows.extend(halted_move());
        rows.extend(homing_at_stop());
        rows.extend(homing_without_stop());
        rows
    });
    &ROWS
}

pub const CSP: u8 = 8;
const PP: u8 = 1;
const HOMING: u8 = 6;

pub fn micro(number: f64) -> [u8; 4] {
    ((1e6 * number).round() as i32).to_le_bytes()
}

/// Sends a controlword with a target torque (thousandths) and a target velocity (rad/s), and runs 1 ms.
fn command(master: &mut Master, controlword: u16, permille: i16, velocity_rad_s: f64) {
    let mut data = [0; 8];
    data[..2].copy_from_slice(&controlword.to_le_bytes());
    data[2..4].copy_from_slice(&permille.to_le_bytes());
    data[4..].copy_from_slice(&micro(velocity_rad_s));
    master.rig.send_immediately(0x201, &data);
    master.rig.step_idle();
}

/// Sends a target position.
fn target(master: &mut Master, position_rad: f64) {
    master.rig.write_object(index::TARGET_POSITION, 0, micro(position_rad));
}

fn run(master: &mut Master, milliseconds: u32, controlword: u16) {
    (0..milliseconds).for_each(|_| command(master, controlword, 0, 0.0));
}

/// Makes the position known, selects a mode and enables the drive.
pub fn enable(master: &mut Master, mode: u8) {
    let at = master.rig.plant().position_rad();
    master.rig.write_object(index::STATE, 6, (at as f32).to_le_bytes());
    // Targets are written as objects, whose answers need room on a bus of 1 Mbit/s.
    for (index, base) in [(index::TRANSMIT_STATUS, 0x280), (index::TRANSMIT_TORQUE, 0x680)] {
        let unused = 1u32 << 31 | (base + 1);
        master.rig.write_object(index, 1, unused.to_le_bytes());
        master.rig.step_idle();
    }
    master.rig.send_immediately(0, &[1, 1]);
    master.rig.write_object_byte(index::MODE, 0, mode);
    for word in [0x06, 0x07, 0x0F] {
        run(master, 20, word);
    }
    assert!(master.rig.is_armed(), "{:?}", master.faults());
}

fn status(master: &mut Master) -> u32 {
    master.rig.read_object(index::STATUSWORD, 0).unwrap_or_default()
}

/// Every mode drives the joint towards a limit of 0.5 rad.
fn limits() -> Vec<ScenarioRow> {
    type Drive = fn(&mut Master);
    let modes: [(&str, u8, Drive); 3] = [
        ("CST, 5 A", 10, |master| command(master, 0x0F, 192, 0.0)),
        ("CSV, 3 rad/s", 9, |master| command(master, 0x0F, 0, 3.0)),
        ("CSP, target 2 rad", CSP, |master| {
            target(master, 2.0);
            command(master, 0x0F, 0, 0.0);
        }),
    ];
    let mut rows = Vec::new();
    for (what, mode, step) in modes {
        let name = format!("{what} towards a limit of 0.5 rad (607Dh)");
        rows.extend(Joint::with(set(0.9)).run(|master| {
            master.rig.write_object(index::POSITION_LIMITS, 1, micro(-0.5));
            master.rig.write_object(index::POSITION_LIMITS, 2, micro(0.5));
            enable(master, mode);
            let (mut farthest, mut fastest) = (0.0, 0.0);
            for _ in 0..2000 {
                step(master);
                farthest = f64::max(farthest, master.rig.plant().position_rad());
                fastest = f64::max(fastest, master.rig.plant().velocity_rad_s());
            }
            let end = master.rig.plant().position_rad();
            let status = status(master);
            vec![
                // From 0.5 rad away, 10 rad/s^2 permit 3.2 rad/s. The lag of the velocity loop, 30 ms, is a tenth of it.
                row(19, &name, "highest speed, rad/s", fastest, 0.5..=3.5),
                row(19, &name, "farthest position, rad", farthest, 0.45..=0.53),
                row(19, &name, "position at the end, rad", end, 0.4..=0.53),
                row(
                    19,
                    &name,
                    "internal limit is reported",
                    flag(status & 1 << 11 != 0),
                    1.0..=1.0,
                ),
                row(19, &name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
            ]
        }));
    }
    rows
}

/// Identifier of the joint's emergencies, and their code of a following error.
const EMERGENCY: u16 = 0x81;
const FOLLOWING_ERROR_CODE: u16 = 0x8611;

/// A joint whose torque is limited below its friction cannot follow.
fn following_error() -> Vec<ScenarioRow> {
    let name = "CSP with 1 rad/s, torque limited below the friction, window 0.1 rad for 50 ms";
    Joint::with(set(0.0)).run(|master| {
        write_short(master, index::MAX_TORQUE, 0, 10);
        master.rig.write_object(index::FOLLOWING_WINDOW, 0, micro(0.1));
        write_short(master, index::FOLLOWING_TIME, 0, 50);
        enable(master, CSP);
        let from = master.rig.plant().position_rad();
        let mut stopped_ms = f64::INFINITY;
        for ms in 0..500 {
            target(master, from + 1e-3 * f64::from(ms));
            command(master, 0x0F, 0, 0.0);
            // With another request in every millisecond, the bus has no room left.
            let emergency = master.rig.take_answers().iter().any(|frame| {
                let code = frame.data().first_chunk::<2>();
                frame.identifier() == EMERGENCY && code == Some(&FOLLOWING_ERROR_CODE.to_le_bytes())
            });
            if emergency && stopped_ms.is_infinite() {
                stopped_ms = f64::from(ms + 1);
            }
        }
        let reported = master.has("following-error");
        vec![
            row(19, name, "to the fault, ms", stopped_ms, 150.0..=160.0),
            row(19, name, "following-error is reported", reported, 1.0..=1.0),
        ]
    })
}

/// Returns the delay of target k, ms.
type Lateness = fn(u32) -> u32;

const ON_TIME: Lateness = |_| 0;

/// RMS and largest deviation from the course one period before, in CSP; largest current; stays armed. If targets are late,
/// the background is late by 3 ms too, every 200 ms.
fn track(
    set: ParameterSet,
    period_ms: u32,
    [radius, hz]: [f64; 2],
    gain: u32,
    late_ms: Lateness,
) -> [f64; 4] {
    Joint::with(set).run(|master| {
        master.rig.write_object_byte(index::INTERPOLATION_TIME, 1, period_ms as u8);
        master.rig.write_object(index::POSITION_LOOP, 1, gain.to_le_bytes());
        master.rig.step_idle();
        enable(master, CSP);
        let from = master.rig.plant().position_rad();
        let course = |t: f64| from + radius * (1.0 - (TAU * hz * t).cos());
        let (mut sum, mut most, mut count) = (0.0, 0.0, 0.0);
        master.rig.stage_mut().take_extremes();
        let end_ms = 1000 + (2000.0 / hz) as u32;
        let (is_late, mut next) = (late_ms(LATE) > 0, 0);
        for ms in 0..end_ms {
            // A late target delays those after it.
            while next * period_ms + late_ms(next) <= ms {
                target(master, course(1e-3 * f64::from(next * period_ms)));
                next += 1;
            }
            if is_late && ms % 200 == 150 {
                master.rig.stall_background(3);
            }
            command(master, 0x0F, 0, 0.0);
            if ms >= 1000 {
                let at = course(1e-3 * f64::from(ms + 1 - period_ms));
                let error = master.rig.plant().position_rad() - at;
                sum += error * error;
                most = f64::max(most, error.abs());
                count += 1.0;
            }
        }
        let current_a = master.rig.stage_mut().take_extremes().current_a;
        [f64::sqrt(sum / count), most, current_a, flag(master.rig.is_armed())]
    })
}

fn tracking() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    // Without a model, the velocity loop finds the friction, at most 2 Nm, anew at each reversal: a step of twice that on a
    // stiffness of 3 A s/rad (10 /s + 1 / 0.1 s) is 0.07 rad.
    for (what, radius, hz) in [("±0.5 rad at 0.5 Hz", 0.5, 0.5), ("±0.05 rad at 0.2 Hz", 0.05, 0.2)]
    {
        for period_ms in [1, 10] {
            let mut without = 0.0;
            for share in [0.0, 0.9] {
                let with =
                    if share > 0.0 { "with compensation (0.9)" } else { "without compensation" };
                let name = format!("CSP, {what}, targets every {period_ms} ms, {with}");
                let [rms, most, current_a, armed] =
                    track(set(share), period_ms, [radius, hz], 10_000, ON_TIME);
                let limit = if share > 0.0 { without } else { 0.03 };
                rows.push(row(20, &name, "RMS position error, rad", rms, 1e-5..=limit));
                rows.push(row(20, &name, "largest position error, rad", most, 1e-5..=0.07));
                rows.push(row(20, &name, "largest phase current, A", current_a, 0.5..=26.5));
                rows.push(row(20, &name, "stays armed", armed, 1.0..=1.0));
                without = rms;
            }
        }
    }
    rows
}

/// A target that comes late in [`late_tracking`].
const LATE: u32 = 7;

/// Targets and background are late by up to 3 ms, as by a busy bus.
fn late_tracking() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    // 3 A are needed on time. With 1 ms, the velocity that 5 rad/s^2 change in 3 ms takes another 2 A for a millisecond. With
    // 10 ms, a target that is 3 ms late leaves 7 ms for its way, which needs twice the acceleration.
    let cases: [(u32, Lateness, f64); 2] = [
        (1, |k| if k % 50 == LATE { 3 } else { u32::from(k % 20 == 11) }, 6.0),
        (10, |k| if k % 5 == LATE % 5 { 3 } else { u32::from(k % 2 == 1) }, 8.0),
    ];
    for (period_ms, late_ms, limit_a) in cases {
        let name = format!(
            "CSP, ±0.5 rad at 0.5 Hz, targets every {period_ms} ms, up to 3 ms late, with compensation (0.9)"
        );
        let [rms, most, current_a, armed] = track(set(0.9), period_ms, [0.5, 0.5], 10_000, late_ms);
        // A delay of 3 ms at the highest speed, 1.6 rad/s, is 5 mrad.
        rows.push(row(20, &name, "RMS position error, rad", rms, 1e-5..=0.01));
        rows.push(row(20, &name, "largest position error, rad", most, 1e-5..=0.07));
        rows.push(row(20, &name, "largest phase current, A", current_a, 0.5..=limit_a));
        rows.push(row(20, &name, "stays armed", armed, 1.0..=1.0));
    }
    rows
}

/// Results with both gains doubled.
fn stiff_tracking() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (share, with) in [(0.0, "without compensation"), (0.9, "with compensation (0.9)")] {
        let mut set = set(share);
        set.motor.velocity_gain_a_s_per_rad *= 2.0;
        let name =
            format!("CSP, ±0.5 rad at 0.5 Hz, targets every 1 ms, both gains doubled, {with}");
        let [rms, most, current_a, armed] = track(set, 1, [0.5, 0.5], 20_000, ON_TIME);
        // Four times the stiffness.
        rows.push(row(20, &name, "RMS position error, rad", rms, 1e-5..=0.03 / 3.0));
        rows.push(row(20, &name, "largest position error, rad", most, 1e-5..=0.07 / 2.0));
        rows.push(row(20, &name, "largest phase current, A", current_a, 0.5..=26.5));
        rows.push(row(20, &name, "stays armed", armed, 1.0..=1.0));
    }
    rows
}

/// Offers a set-point of mode 1 and returns whether it was acknowledged.
fn set_point(master: &mut Master, position_rad: f64, controlword: u16) -> bool {
    target(master, position_rad);
    run(master, 2, controlword | 0x10);
    let taken = status(master) & 1 << 12 != 0;
    run(master, 2, controlword);
    taken
}

/// Runs until "target reached" is reported, and returns the time, ms, and the farthest position on the way.
fn reach(master: &mut Master, controlword: u16) -> (f64, f64) {
    let (mut farthest, from_ms) = (f64::NEG_INFINITY, 20);
    for ms in 0..4000 {
        command(master, controlword, 0, 0.0);
        farthest = farthest.max(master.rig.plant().position_rad());
        if ms >= from_ms && ms % 5 == 0 && status(master) & 1 << 10 != 0 {
            return (f64::from(ms), farthest);
        }
    }
    (f64::INFINITY, farthest)
}

/// Moves of mode 1 with 1 rad/s and 10 rad/s^2, with and without compensation.
fn moves() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (share, with) in [(0.0, "without compensation"), (0.9, "with compensation (0.9)")] {
        let name = format!("PP, 1 rad with 1 rad/s, then back by two relative moves, {with}");
        rows.extend(Joint::with(set(share)).run(|master| {
            enable(master, PP);
            let from = master.rig.plant().position_rad();
            let taken = set_point(master, from + 1.0, 0x0F);
            let (ms, farthest) = reach(master, 0x0F);
            let error = (master.rig.plant().position_rad() - from - 1.0).abs();
            // The second one waits for the first.
            let both = set_point(master, -0.4, 0x4F) && set_point(master, -0.6, 0x4F);
            let _ = reach(master, 0x4F);
            let back = (master.rig.plant().position_rad() - from).abs();
            vec![
                row(20, &name, "set-points are acknowledged", flag(taken && both), 1.0..=1.0),
                // 1.1 s of the trapezoid; every fifth millisecond reads the statusword, which takes some more.
                row(20, &name, "to target reached, ms", ms, 600.0..=1500.0),
                row(20, &name, "overshoot, rad", (farthest - from - 1.0).max(0.0), 0.0..=0.03),
                row(20, &name, "error when reached, rad", error, 0.0..=0.002),
                row(20, &name, "error of the way back, rad", back, 0.0..=0.004),
                row(20, &name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
            ]
        }));
    }
    rows
}

/// A halt interrupts a move, which then goes on to its target.
fn halted_move() -> Vec<ScenarioRow> {
    let name = "PP, 1 rad with 1 rad/s, halted after 0.5 s, then released";
    Joint::with(set(0.9)).run(|master| {
        enable(master, PP);
        let from = master.rig.plant().position_rad();
        set_point(master, from + 1.0, 0x0F);
        run(master, 500, 0x0F);
        run(master, 400, 0x10F);
        let halted = master.rig.plant().position_rad() - from;
        let speed = master.rig.plant().velocity_rad_s().abs();
        run(master, 1500, 0x0F);
        let error = (master.rig.plant().position_rad() - from - 1.0).abs();
        vec![
            // 0.45 rad at 0.5 s, some milliseconds of the handshake, and 0.05 rad of the ramp.
            row(20, name, "position of the halt, rad", halted, 0.45..=0.6),
            row(20, name, "speed while halted, rad/s", speed, 0.0..=0.02),
            row(20, name, "error at the end, rad", error, 0.0..=0.002),
            row(20, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// Runs a millisecond of a joint with a stop at this position, which yields to no torque.
fn step_with_stop(master: &mut Master, stop_rad: f64, controlword: u16) {
    let plant = master.rig.plant_mut();
    let pushes = plant.torque_current_a() < 0.0;
    if plant.position_rad() <= stop_rad && pushes {
        plant.place(stop_rad);
        plant.hold(true);
    } else {
        plant.hold(false);
    }
    command(master, controlword, 0, 0.0);
}

/// Homing by torque at a stop 0.3 rad away, and the way from it to position 0.
fn homing_at_stop() -> Vec<ScenarioRow> {
    const STOP_RAD: f64 = -0.3;
    const OFFSET_RAD: f64 = 0.25;
    let mut rows = Vec::new();
    for (share, with) in [(0.0, "without compensation"), (0.9, "with compensation (0.9)")] {
        let name = format!("homing at a stop (method -1), 607Ch = 0.25 rad, {with}");
        rows.extend(Joint::with(set(share)).run(|master| {
            master.rig.write_object_byte(index::HOMING_METHOD, 0, -1i8 as u8);
            master.rig.write_object(index::HOME_OFFSET, 0, micro(OFFSET_RAD));
            enable(master, HOMING);
            master.rig.stage_mut().take_extremes();
            let mut ended_ms = f64::INFINITY;
            for ms in 0..6000 {
                step_with_stop(master, STOP_RAD, 0x1F);
                if ms % 50 == 49 && status(master) & 1 << 12 != 0 {
                    ended_ms = f64::from(ms);
                    break;
                }
            }
            let most_a = master.rig.stage_mut().take_extremes().current_a;
            (0..200).for_each(|_| step_with_stop(master, STOP_RAD, 0x1F));
            let end = master.rig.plant().position_rad();
            let shown = master.rig.read_object(index::ACTUAL_POSITION, 0).unwrap_or_default();
            let shown = f64::from(shown as i32) * 1e-6;
            vec![
                // 0.3 rad and 0.25 rad with 0.2 rad/s, and 0.1 s at the stop.
                row(20, &name, "to home attained, ms", ended_ms, 2500.0..=4000.0),
                row(20, &name, "way from the stop, rad", end - STOP_RAD, 0.24..=0.26),
                row(20, &name, "position at the end, rad", shown, -0.005..=0.005),
                // 0.15 of 26 A, the compensation, and an overshoot.
                row(20, &name, "largest phase current, A", most_a, 3.5..=7.0),
                row(20, &name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
            ]
        }));
    }
    rows
}

/// Homing that meets no stop within its longest way.
fn homing_without_stop() -> Vec<ScenarioRow> {
    let name = "homing at a stop (method -2), no stop within 0.5 rad";
    Joint::with(set(0.9)).run(|master| {
        master.rig.write_object_byte(index::HOMING_METHOD, 0, -2i8 as u8);
        master.rig.write_object(index::HOMING_STOP, 3, micro(0.5));
        enable(master, HOMING);
        let from = master.rig.plant().position_rad();
        run(master, 4000, 0x1F);
        let way = master.rig.plant().position_rad() - from;
        let status = status(master);
        vec![
            row(20, name, "way, rad", way, 0.49..=0.53),
            row(20, name, "homing error is reported", flag(status & 1 << 13 != 0), 1.0..=1.0),
            row(
                20,
                name,
                "speed at the end, rad/s",
                master.rig.plant().velocity_rad_s().abs(),
                0.0..=0.02,
            ),
            row(20, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

#[test]
fn position_modes_track_stop_and_find_home() {
    check(rows());
}
