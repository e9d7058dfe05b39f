//! Scenario 16: the drive's own velocity loop, CiA 402's CSV. Also the friction run of scenario 4, which uses it.

use super::rig::{Joint, Master, set};
use super::table::{ScenarioRow, check, row};
use firmware::driver::commissioning::{AbortReason, CommissioningStep};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRunObject;
use firmware::parameter_set::ParameterSet;
use std::f64::consts::TAU;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        rows.extend(follows());
        rows.extend(gains());
        rows.extend(late_targets());
        rows.extend(stops());
        rows.extend(friction_run());
        rows
    });
    &ROWS
}

fn flag(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

/// Sends one velocity command with a SYNC, and runs 1 ms.
pub fn drive(master: &mut Master, controlword: u16, velocity_rad_s: f64) {
    send(master, controlword, velocity_rad_s);
    master.rig.step_idle();
}

fn send(master: &mut Master, controlword: u16, velocity_rad_s: f64) {
    let mut data = [0; 8];
    data[..2].copy_from_slice(&controlword.to_le_bytes());
    data[4..].copy_from_slice(&((1e6 * velocity_rad_s).round() as i32).to_le_bytes());
    master.rig.send_immediately(0x201, &data);
}

/// Selects mode 9 and enables the drive, by frames alone.
pub fn enable(master: &mut Master) {
    master.rig.send_immediately(0, &[1, 1]);
    master.rig.write_object_byte(index::MODE, 0, 9);
    for word in [0x06, 0x07, 0x0F] {
        (0..20).for_each(|_| drive(master, word, 0.0));
    }
    assert!(master.rig.is_armed(), "{:?}", master.faults());
}

/// Results of a velocity course: RMS error after its first second, rad/s, and largest current, A.
struct CourseResult {
    error_rad_s: f64,
    current_a: f64,
    armed: bool,
}

fn course(set: ParameterSet, seconds: u32, wanted: impl Fn(f64) -> f64) -> CourseResult {
    Joint::with(set).run(|master| {
        enable(master);
        let (mut sum, mut count) = (0.0, 0.0);
        master.rig.stage_mut().take_extremes();
        for k in 0..1000 * seconds {
            let t = f64::from(k) * 1e-3;
            drive(master, 0x0F, wanted(t));
            if k >= 1000 {
                sum += (master.rig.plant().velocity_rad_s() - wanted(t)).powi(2);
                count += 1.0;
            }
        }
        let current_a = master.rig.stage_mut().take_extremes().current_a;
        CourseResult { error_rad_s: (sum / count).sqrt(), current_a, armed: master.rig.is_armed() }
    })
}

fn sine(peak: f64, hz: f64) -> impl Fn(f64) -> f64 {
    move |t| peak * (TAU * hz * t).sin()
}

fn follows() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (what, peak, hz, without, with) in [
        ("±2 rad/s at 1 Hz", 2.0, 1.0, 0.1..=0.45, 0.0..=0.1),
        // A joint at rest has the RMS of the course itself: 0.141 rad/s.
        ("±0.2 rad/s at 0.5 Hz", 0.2, 0.5, 0.0707..=0.1415, 0.0..=0.0707),
    ] {
        for (share, limits) in [(0.0, without), (0.9, with)] {
            let result = course(set(share), 3, sine(peak, hz));
            let with = if share > 0.0 { "with compensation (0.9)" } else { "without compensation" };
            let name = format!("CSV, {what}, {with}");
            rows.push(row(16, &name, "RMS velocity error, rad/s", result.error_rad_s, limits));
            rows.push(row(16, &name, "largest phase current, A", result.current_a, 1.0..=26.5));
            rows.push(row(16, &name, "stays armed", flag(result.armed), 1.0..=1.0));
        }
    }
    rows
}

/// Results with half and twice each parameter of the loop.
fn gains() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (what, gain, integral) in [
        ("gain halved", 0.5, 1.0),
        ("gain doubled", 2.0, 1.0),
        ("integral time halved", 1.0, 0.5),
        ("integral time doubled", 1.0, 2.0),
    ] {
        let mut set = set(0.9);
        set.motor.velocity_gain_a_s_per_rad *= gain;
        set.motor.velocity_integral_s *= integral;
        let result = course(set, 3, sine(2.0, 1.0));
        let name = format!("CSV, ±2 rad/s at 1 Hz, with compensation (0.9), {what}");
        rows.push(row(16, &name, "RMS velocity error, rad/s", result.error_rad_s, 0.0..=0.2));
        rows.push(row(16, &name, "largest phase current, A", result.current_a, 1.0..=26.5));
    }
    rows
}

/// Targets of a bus and a background that are late: target `k`, sent every `period_ms`, arrives up to 3 ms later.
fn late_targets() -> Vec<ScenarioRow> {
    let late_ms = |k: u32| k * 7 % 13 % 4;
    let wanted = sine(2.0, 1.0);
    let mut rows = Vec::new();
    for period_ms in [1u32, 10] {
        let name = format!(
            "CSV, ±2 rad/s at 1 Hz, targets every {period_ms} ms, up to 3 ms late, with compensation (0.9)"
        );
        rows.extend(Joint::with(set(0.9)).run(|master| {
            master.rig.write_object_byte(index::INTERPOLATION_TIME, 1, period_ms as u8);
            enable(master);
            let (mut next, mut squares, mut count) = (0, 0.0, 0.0);
            master.rig.stage_mut().take_extremes();
            for ms in 0..3000 {
                // A late target delays those after it.
                while next * period_ms + late_ms(next) <= ms {
                    send(master, 0x0F, wanted(1e-3 * f64::from(next * period_ms)));
                    next += 1;
                }
                master.rig.step_idle();
                if ms >= 1000 {
                    let course = wanted(1e-3 * f64::from(ms + 1 - period_ms));
                    squares += (master.rig.plant().velocity_rad_s() - course).powi(2);
                    count += 1.0;
                }
            }
            let error = f64::sqrt(squares / count);
            let current_a = master.rig.stage_mut().take_extremes().current_a;
            vec![
                // Targets of 3 ms ago are behind by 0.04 rad/s.
                row(
                    16,
                    &name,
                    "RMS error from the course a period before, rad/s",
                    error,
                    0.0..=0.1,
                ),
                // Friction and inertia need 4 A.
                row(16, &name, "largest phase current, A", current_a, 1.0..=6.0),
                row(16, &name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
            ]
        }));
    }
    rows
}

/// Ways to stop the drive.
fn stops() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    let spinning = |how: &dyn Fn(&mut Master), ends_sync: bool| {
        Joint::with(set(0.9)).run(|master| {
            enable(master);
            (0..1000).for_each(|_| drive(master, 0x0F, 3.0));
            let speed = master.rig.plant().velocity_rad_s();
            how(master);
            // Time until the bridge is open, ms.
            let mut open_ms = 200.0;
            for ms in 0..200 {
                master.rig.stage_mut().take_extremes();
                if ends_sync {
                    master.rig.stop_sync();
                }
                master.rig.step_idle();
                if master.rig.stage_mut().take_extremes().driven_periods == 0 {
                    open_ms = f64::from(ms);
                    break;
                }
            }
            (speed, open_ms, master.rig.is_armed())
        })
    };
    let quick: &dyn Fn(&mut Master) =
        &|master| master.rig.send_immediately(0x201, &[0x0B, 0, 0, 0, 0, 0, 0, 0]);
    let silent: &dyn Fn(&mut Master) = &|_| {};
    for (what, how, ends_sync, limits) in [
        ("quick stop", quick, true, 0.0..=2.0),
        ("the master stops sending, SYNC too", silent, true, 97.0..=102.0),
        ("the master stops sending, SYNC goes on", silent, false, 97.0..=102.0),
    ] {
        let (speed, open_ms, armed) = spinning(how, ends_sync);
        let name = format!("CSV at 3 rad/s: {what}");
        rows.push(row(16, &name, "speed before, rad/s", speed, 2.9..=3.1));
        rows.push(row(16, &name, "to open bridge, ms", open_ms, limits));
        rows.push(row(16, &name, "stays armed", flag(armed), 0.0..=0.0));
    }
    rows
}

/// What ends a friction run.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Free,
    Held,
    Silent,
}

/// Course of a friction run: time of its end, ms, and the farthest place from its start, rad.
struct FrictionCourse {
    end_ms: f64,
    farthest_rad: f64,
}

/// Runs a friction run to its end, which comes from 3 s on.
fn run_friction(master: &mut Master, end: End) -> FrictionCourse {
    let run = index::COMMISSIONING_RUN;
    let from = master.rig.plant().position_rad();
    let (mut farthest_rad, mut end_ms) = (0.0f64, 0);
    for ms in 0..80_000 {
        let over = ms >= 3000;
        if over && end == End::Held {
            master.rig.plant_mut().hold(true);
        }
        if ms % 20 == 0 && !(over && end == End::Silent) {
            let order = if ms == 0 { 3 } else { 2 };
            master.rig.write_object_byte(run, CommissioningRunObject::ORDER, order);
        }
        master.rig.step_idle();
        farthest_rad = farthest_rad.max((master.rig.plant().position_rad() - from).abs());
        end_ms = ms;
        if ms > 100 && !master.rig.is_armed() {
            break;
        }
    }
    FrictionCourse { end_ms: f64::from(end_ms), farthest_rad }
}

/// The friction run of a free joint, of a held joint, and with a master that stops sending.
fn friction_run() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (what, end, reason) in [
        ("free, 0.4 rad, 2 rad/s", End::Free, AbortReason::None),
        ("the joint is held after 3 s", End::Held, AbortReason::JointHeld),
        ("the master stops sending after 3 s", End::Silent, AbortReason::Fault),
    ] {
        let name = format!("friction run; {what}");
        let run = index::COMMISSIONING_RUN;
        Joint::with(set(0.0)).run(|master| {
            master.rig.write_object(run, CommissioningRunObject::TRAVEL, 0.4f32.to_le_bytes());
            master.rig.stage_mut().take_extremes();
            let course = run_friction(master, end);
            let most = master.rig.stage_mut().take_extremes();
            let step = master.rig.read_object(run, CommissioningRunObject::STEP).expect("a step");
            let reported =
                master.rig.read_object(run, CommissioningRunObject::REASON).expect("a reason");
            let as_meant = reported == reason as u32
                && step
                    == if end == End::Free {
                        CommissioningStep::Done
                    } else {
                        CommissioningStep::Aborted
                    } as u32;
            rows.push(row(4, &name, "ends as it should", flag(as_meant), 1.0..=1.0));
            let after_ms = course.end_ms - if end == End::Free { 0.0 } else { 3000.0 };
            let limits = match end {
                End::Free => 20e3..=71e3,
                End::Held => 300.0..=2000.0,
                End::Silent => 60.0..=102.0,
            };
            rows.push(row(4, &name, "to open bridge, ms", after_ms, limits));
            rows.push(row(4, &name, "largest travel, rad", course.farthest_rad, 0.2..=0.4));
            rows.push(row(4, &name, "largest speed, rad/s", most.speed_rad_s, 1.8..=2.6));
            rows.push(row(4, &name, "largest phase current, A", most.current_a, 1.0..=12.2));
        });
    }
    rows
}

#[test]
fn velocity_loop_follows_and_friction_run_stays_in_bounds() {
    check(rows());
}
