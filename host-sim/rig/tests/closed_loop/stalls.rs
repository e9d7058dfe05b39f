//! Scenarios 10 to 12: a stalled background loop, late or missing interrupts, and a dead processor.

use super::rig::{Joint, Master, constants, set};
use super::table::{ScenarioRow, check, row};
use firmware::driver::Boot;
use firmware::supervisor::ResetCause;
use joint_rig::{InterruptTiming, StageExtremes, WATCHDOG_TIMEOUT_MS};
use simulated_machines::joint_plant::JointPlant;
use std::f64::consts::TAU;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for milliseconds in [1, 2, 5, 10, 20, 40] {
            rows.extend(background(milliseconds));
        }
        rows.extend(watchdog());
        rows.extend(restart());
        rows.extend(late_interrupts());
        rows.extend(dead_processor());
        rows.extend(comparators());
        rows
    });
    &ROWS
}

fn flag(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

/// Runs at 3 rad/s with compensation.
fn running<R>(work: impl FnOnce(&mut Master) -> R) -> R {
    Joint::with(set(0.9)).run(|master| {
        master.arm().expect("it arms");
        master.spin(3.0, 500);
        master.rig.stage_mut().take_extremes();
        work(master)
    })
}

/// Joint velocities in a sine of ±2 rad/s, with the background stalled from just before a reversal.
fn reversing(milliseconds: u32) -> (Vec<f64>, StageExtremes, bool) {
    Joint::with(set(0.9)).run(|master| {
        master.arm().expect("it arms");
        master.rig.stage_mut().take_extremes();
        let mut velocities = Vec::new();
        for k in 0..1500 {
            let (sine, cosine) = (TAU * f64::from(k) * 1e-3).sin_cos();
            if k == 990 {
                master.rig.stall_background(milliseconds);
            }
            master.follow(2.0 * sine, 2.0 * TAU * cosine);
            velocities.push(master.rig.plant().velocity_rad_s());
        }
        (velocities, master.rig.stage_mut().take_extremes(), master.rig.is_armed())
    })
}

fn background(milliseconds: u32) -> Vec<ScenarioRow> {
    static PRESENT: LazyLock<Vec<f64>> = LazyLock::new(|| reversing(0).0);
    let name =
        format!("background stalled for {milliseconds} ms at a reversal of ±2 rad/s at 1 Hz");
    let (velocities, most, armed) = reversing(milliseconds);
    let both = velocities.iter().zip(PRESENT.iter());
    let apart = both.fold(0.0, |most: f64, (with, without)| most.max((with - without).abs()));
    vec![
        row(10, &name, "stays armed", flag(armed), 1.0..=1.0),
        // The reference changes by 12 rad/s^2 at the reversal; the limit is twice what a constant set-point misses.
        row(
            10,
            &name,
            "largest deviation from the course without a stall, rad/s",
            apart,
            0.0..=0.025 * f64::from(milliseconds),
        ),
        row(10, &name, "largest phase current, A", most.current_a, 0.5..=26.5),
    ]
}

fn watchdog() -> Vec<ScenarioRow> {
    let name = "background stalled for 60 ms at 3 rad/s";
    let (after, most, reset) = running(|master| {
        master.rig.stall_background(60);
        let mut after = f64::INFINITY;
        for k in 0..200 {
            master.follow(3.0, 0.0);
            if after.is_infinite() && master.rig.stage_mut().applied_duty().is_none() {
                after = f64::from(k + 1);
            }
        }
        (after, master.rig.stage_mut().take_extremes(), master.rig.is_reset())
    });
    let bite = f64::from(WATCHDOG_TIMEOUT_MS);
    vec![
        row(10, name, "the watchdog resets it", flag(reset), 1.0..=1.0),
        row(10, name, "to open bridge, ms", after, bite - 2.0..=bite + 2.0),
        row(10, name, "largest phase current, A", most.current_a, 0.5..=26.5),
    ]
}

fn restart() -> Vec<ScenarioRow> {
    let name = "restart after a watchdog reset";
    let boot = Boot { cause: ResetCause::Watchdog, ..Boot::default() };
    let joint = Joint { boot, ..Joint::with(set(0.9)) };
    let (is_reported, first, second) = joint.run(|master| {
        let is_reported = master.has("watchdog-reset");
        let first = master.arm().is_ok();
        master.rig.request_state(2);
        (is_reported, first, master.arm().is_ok())
    });
    vec![
        row(10, name, "reports watchdog-reset", is_reported, 1.0..=1.0),
        row(10, name, "arms before the fault is cleared", flag(first), 0.0..=0.0),
        row(10, name, "arms after", flag(second), 1.0..=1.0),
    ]
}

fn late_interrupts() -> Vec<ScenarioRow> {
    let late = |cycles: u32| InterruptTiming::Late(cycles);
    let cases: [(&str, &[InterruptTiming], bool, bool); 6] = [
        ("one interrupt 12 us late", &[late(2000)], true, false),
        ("one interrupt 25 us late", &[late(4200)], true, true),
        ("one interrupt 41 us late, its duties a period late", &[late(7000)], true, true),
        ("one interrupt missed", &[InterruptTiming::Missed], true, true),
        ("two interrupts missed in a row", &[InterruptTiming::Missed; 2], true, true),
        ("five interrupts missed in a row", &[InterruptTiming::Missed; 5], false, true),
    ];
    let mut rows = Vec::new();
    for (what, interrupts, stays, drops) in cases {
        let name = format!("{what}, at 3 rad/s");
        let (armed, late, most) = running(|master| {
            master.rig.stage_mut().interrupts.extend(interrupts.iter().copied());
            let mut late = false;
            for _ in 0..60 {
                master.follow(3.0, 0.0);
                let flags = master.rig.active_limits();
                late |= flags.iter().any(|code| code.info().name == "loop-late");
            }
            (master.rig.is_armed(), late, master.rig.stage_mut().take_extremes())
        });
        // An interrupt that starts late but ends in time is not a late period, but it skips the compensation.
        let expected = if drops && !what.contains("25 us") { 1.0..=1.0 } else { 0.0..=0.0 };
        let wanted = flag(stays);
        rows.push(row(11, &name, "stays armed", flag(armed), wanted..=wanted));
        rows.push(row(11, &name, "loop-late is reported", flag(late), expected));
        rows.push(row(11, &name, "largest phase current, A", most.current_a, 0.5..=26.5));
    }
    rows
}

/// Currents of a joint whose processor failed.
struct FailedRun {
    /// Torque-producing current at the failure, A.
    before_a: f64,
    /// Largest phase current 10 ms after the bridge is open, A.
    left_a: f64,
    most: StageExtremes,
}

/// Lets the processor fail at 8 rad/s and 10 A, with the joint at this position at the start.
fn dies_at(turned_rad: f64, how: &dyn Fn(&mut Master)) -> FailedRun {
    let place = |plant: &mut JointPlant| plant.place(turned_rad);
    Joint::with(set(0.0)).run_plant(place, |master| {
        master.arm().expect("it arms");
        master.spin(8.0, 300);
        // Another 5 ms with 10 A of torque-producing current.
        master.current(5, 10.0);
        let before_a = master.rig.plant().torque_current_a();
        master.rig.stage_mut().take_extremes();
        how(master);
        let after = master.rig.stage_mut();
        (0..200).for_each(|_| after.run_without_processor(50e-6, None));
        let left_a =
            after.plant.phase_currents_a().into_iter().fold(0.0, |m: f64, a| m.max(a.abs()));
        FailedRun { before_a, left_a, most: after.take_extremes() }
    })
}

/// The processor or its clock fails at 8 rad/s and 10 A: currents until the bridge is open.
fn dead_processor() -> Vec<ScenarioRow> {
    let dies = |how: &dyn Fn(&mut Master)| dies_at(0.0, how);
    // The handler opens the bridge first: an interrupt entry and a store, here rounded up to a microsecond.
    let handler = dies(&|master| {
        let duty = master.rig.stage_mut().applied_duty();
        master.rig.stage_mut().run_without_processor(1e-6, duty);
    });
    // The timer keeps its last duty cycles until the comparators or the watchdog stop it. Worst of twelve angles in an
    // electrical turn.
    let worst = |all: &mut dyn Iterator<Item = FailedRun>| {
        all.max_by(|one, other| one.most.current_a.total_cmp(&other.most.current_a)).expect("some")
    };
    let p = constants();
    let electrical_rad = TAU / (p.gear_ratio * p.pole_pairs);
    let mut angles = (0..12).map(|k| {
        dies_at(f64::from(k) / 12.0 * electrical_rad, &|master| {
            let duty = master.rig.stage_mut().applied_duty();
            (0..1000).for_each(|_| master.rig.stage_mut().run_without_processor(50e-6, duty));
        })
    });
    let hangs = worst(&mut angles);
    // The timer stops with the clock and keeps its outputs until the clock security system breaks them, after at most 10 us. Worst
    // of the six states that drive current.
    let states = (1..7).map(|state: u8| [0, 1, 2].map(|phase| f64::from(state >> phase & 1)));
    let clock = worst(&mut states.map(|duty| {
        dies(&|master| {
            (0..10).for_each(|_| master.rig.stage_mut().run_without_processor(1e-6, Some(duty)))
        })
    }));
    let mut rows = Vec::new();
    for (what, FailedRun { before_a, left_a, most }, bears_a) in [
        (
            "HardFault or panic at 8 rad/s, 10 A: the handler opens the bridge in 1 us",
            handler,
            40.0,
        ),
        (
            "clock stops at 8 rad/s, 10 A, outputs as they are (worst): broken by CSS after 10 us",
            clock,
            40.0,
        ),
        // Level of the comparators with its tolerance, 46 A, and the current rise in the period until they act: 11 V on 88 uH give
        // 6.2 A, more with filter and delay.
        (
            "processor hangs at 8 rad/s, 10 A: last duties until comparators open the bridge (worst of 12 angles)",
            hangs,
            53.0,
        ),
    ] {
        rows.push(row(12, what, "current at the failure, A", before_a, 8.0..=12.0));
        rows.push(row(12, what, "largest phase current, A", most.current_a, 5.0..=bears_a));
        rows.push(row(12, what, "current 10 ms after the bridge is open, A", left_a, 0.0..=1e-6));
        rows.push(row(12, what, "highest bus, V", most.bus_v, 47.0..=60.0));
    }
    rows
}

/// Comparator level below the commanded current: the processor runs on and reports it.
fn comparators() -> Vec<ScenarioRow> {
    let name = "comparators at 15 A: 24 A commanded at rest, then 8 A";
    let mut joint = Joint::with(set(0.0));
    // An error of the comparators, because the driver sets their level above its own.
    joint.constants.break_error_a = 15.0 - joint.constants.break_level_a;
    let (before, is_reported, armed, most, again, calm) = joint.run(|master| {
        master.arm().expect("it arms");
        master.current(40, 8.0);
        let before = flag(master.rig.is_armed());
        master.rig.stage_mut().take_extremes();
        master.current(20, 24.0);
        let is_reported = master.has("overcurrent");
        let (armed, most) = (flag(master.rig.is_armed()), master.rig.stage_mut().take_extremes());
        master.rig.request_state(2);
        master.current(20, 0.0);
        let again = flag(master.arm().is_ok());
        master.current(40, 8.0);
        (before, is_reported, armed, most, again, flag(master.rig.is_armed()))
    });
    vec![
        row(12, name, "armed at 8 A", before, 1.0..=1.0),
        row(12, name, "stays armed at 24 A", armed, 0.0..=0.0),
        row(12, name, "reports overcurrent", is_reported, 1.0..=1.0),
        row(12, name, "largest phase current, A", most.current_a, 15.0..=20.0),
        row(12, name, "arms again after clearing", again, 1.0..=1.0),
        row(12, name, "stays armed at 8 A", calm, 1.0..=1.0),
    ]
}

#[test]
fn bridge_opens_when_background_interrupt_or_processor_fails() {
    check(rows());
}
