//! Scenario 29: the compact node on the B-G431B-ESC1, with an encoder or Hall sensors at the motor and a supply of 24 V.

use super::driver::compact_power_up;
use super::rig::{Joint, Master, constants, set};
use super::table::{ScenarioRow, check, row};
use compensator_core::can::NodeId;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::parameter_set::ParameterSet;
use joint_bus::canopen::Client;
use joint_bus::parameters::{read_set, write_set};
use joint_rig::{ESC1_SCALES, HallFault, JointRig, PowerUp, RigBus};
use simulated_machines::joint_plant::Parameters;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Values of `encoder_kind`.
pub const ABZ: f32 = 2.0;
pub const HALL: f32 = 4.0;

/// Speed of the joint with the faults, rad/s: 24 turns of the motor in a second.
const SPEED_RAD_S: f64 = 3.0;

/// Half of the friction: a compensation of 0.9 whose model is within 20 % leaves less of the error.
const COMPENSATED_SHARE: f64 = 0.5;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = motion();
        rows.extend(friction());
        rows.extend(stops());
        rows.extend(stored_set());
        rows
    });
    &ROWS
}

/// Returns the set of a joint on this board, with this compensated share of its friction.
fn board_set(kind: f32, share: f32) -> ParameterSet {
    let mut set = set(share);
    set.sensors.encoder_kind = kind;
    set.sensors.strain_connected = 0.0;
    set.sensors.bridge_ratio_at_25 = 2.13;
    (set.motor.current_limit_a, set.motor.overcurrent_a) = (20.0, 30.0);
    (set.motor.bus_voltage_min_v, set.motor.bus_voltage_max_v) = (12.0, 28.0);
    let levels = &mut set.thresholds;
    (levels.bus_undervoltage_v, levels.bus_undervoltage_clear_v) = (13.0, 14.0);
    (levels.bus_overvoltage_v, levels.bus_overvoltage_clear_v) = (29.0, 28.0);
    levels.overcurrent_a = 30.0;
    set
}

/// A joint on this board.
pub fn joint(kind: f32, share: f32) -> Joint {
    // The comparators are exact to 6 A.
    let constants = Parameters { bus_voltage_v: 24.0, break_error_a: 6.0, ..constants() };
    Joint { constants, ..Joint::with(board_set(kind, share)) }
}

/// Returns the state of the driver of a joint on this board at power-up.
pub fn power_up(joint: &Joint) -> PowerUp<'_> {
    PowerUp { scales: ESC1_SCALES, ..joint.start() }
}

/// Powers a joint on this board up.
fn run<R>(joint: &Joint, work: impl FnOnce(&mut Master) -> R) -> R {
    let plant = joint.plant();
    let inertia = plant.inertia_kg_m2();
    let work = |rig: &mut JointRig| work(&mut Master::new(rig, inertia));
    compact_power_up(&power_up(joint), plant, joint.faults, work).expect("a set that builds")
}

fn flag(is_set: bool) -> f64 {
    f64::from(u8::from(is_set))
}

/// Turns the motor by hand, past the index of its encoder.
pub fn turn_by_hand(rig: &mut JointRig) {
    let from = rig.plant().position_rad();
    let turn = TAU / f64::from(set(0.0).motor.gear_ratio);
    for k in 1..=100 {
        rig.plant_mut().place(from + 1.2 * turn * f64::from(k) / 100.0);
        rig.step_idle();
    }
    (0..150).for_each(|_| rig.step_idle());
}

/// Accelerates to the speed in 100 ms and holds it for 60 ms.
fn reach_speed(master: &mut Master) {
    master.arm().expect("it arms");
    for k in 1..=100 {
        master.follow(SPEED_RAD_S * f64::from(k) / 100.0, SPEED_RAD_S / 0.1);
    }
    (0..60).for_each(|_| master.follow(SPEED_RAD_S, 0.0));
}

fn motion() -> Vec<ScenarioRow> {
    let name = "Hall sensors: to 3 rad/s in 0.1 s";
    let (error, armed) = run(&joint(HALL, 0.9), |master| {
        reach_speed(master);
        let mut squares = 0.0;
        for _ in 0..100 {
            master.follow(SPEED_RAD_S, 0.0);
            squares += (master.rig.plant().velocity_rad_s() - SPEED_RAD_S).powi(2);
        }
        ((squares / 100.0f64).sqrt(), master.rig.is_armed())
    });
    vec![
        row(29, name, "stays armed", flag(armed), 1.0..=1.0),
        // The loop of the master (2 Hz) leaves 0.2 rad/s of its ramp, as with the driver's board.
        row(29, name, "RMS velocity error, rad/s", error, 0.0..=0.3),
    ]
}

/// Returns the RMS of the velocity error on a sine of 1 rad/s, rad/s, and whether the joint armed before and after its motor was
/// turned by hand.
fn sine(share: f32) -> (f64, [bool; 2]) {
    run(&joint(ABZ, share), |master| {
        let is_early = master.arm().is_ok();
        turn_by_hand(master.rig);
        let is_armed = master.arm().is_ok();
        let mut sum = 0.0;
        for k in 0..2000 {
            let (sine, cosine) = (TAU * f64::from(k) * 1e-3).sin_cos();
            master.follow(sine, TAU * cosine);
            if k >= 1000 {
                sum += (master.rig.plant().velocity_rad_s() - sine).powi(2);
            }
        }
        let is_armed = is_armed && master.rig.is_armed();
        ((sum / 1000.0f64).sqrt(), [is_early, is_armed])
    })
}

fn friction() -> Vec<ScenarioRow> {
    let ((with, [is_early, is_armed]), (without, _)) = (sine(0.9), sine(0.0));
    let (before, name) = ("ABZ, before its index", "ABZ, turned by hand: sine of 1 rad/s, 1 Hz");
    vec![
        row(29, before, "arms", flag(is_early), 0.0..=0.0),
        row(29, name, "stays armed", flag(is_armed), 1.0..=1.0),
        // Friction of up to 2 Nm over the master's gain of 1.5 Nm s/rad.
        row(29, name, "RMS velocity error without compensation, rad/s", without, 0.1..=1.3),
        row(29, name, "share of this error with it", with / without, 0.0..=COMPENSATED_SHARE),
    ]
}

/// Milliseconds from a fault to the open bridge, and the largest phase current.
fn stopped(fault: impl Fn(&mut Master), has_commands: bool) -> (f64, f64) {
    run(&joint(HALL, 0.9), |master| {
        reach_speed(master);
        fault(master);
        master.rig.stage_mut().take_extremes();
        let mut after = f64::INFINITY;
        for k in 0..150 {
            if has_commands {
                master.follow(SPEED_RAD_S, 0.0);
            } else {
                master.rig.step_idle();
            }
            if master.rig.stage_mut().applied_duty().is_none() {
                after = f64::from(k + 1);
                break;
            }
        }
        (after, master.rig.stage_mut().take_extremes().current_a)
    })
}

fn stops() -> Vec<ScenarioRow> {
    let (plug, timeout) = ("Hall sensors, plug off, at 3 rad/s", "no more commands, at 3 rad/s");
    let unplug = |master: &mut Master| {
        master.rig.stage_mut().board.as_mut().expect("a board").set_hall(HallFault::Missing);
    };
    let (off_ms, off_a) = stopped(unplug, true);
    let (late_ms, late_a) = stopped(|_| {}, false);
    vec![
        // 2 ms until the rotor is lost.
        row(29, plug, "to open bridge, ms", off_ms, 0.0..=4.0),
        row(29, plug, "largest phase current, A", off_a, 0.5..=30.0),
        // `command_timeout_us` is 100 ms.
        row(29, timeout, "to open bridge, ms", late_ms, 99.0..=103.0),
        row(29, timeout, "largest phase current, A", late_a, 0.5..=20.0),
    ]
}

/// A set of a host on a blank board, saved in the only bank of its flash.
fn stored_set() -> Vec<ScenarioRow> {
    let name = "blank flash: a set of the host, saved, and a reset";
    let written = board_set(HALL, 0.9);
    let blank = Joint { set: None, commissioned: false, ..joint(HALL, 0.0) };
    let (is_kept, arms) = run(&blank, |master| {
        let client = &mut Client::new(RigBus::new(master.rig), NodeId::FIRST);
        write_set(client, &written).expect("the set is accepted");
        let at = |index, sub_index| canopen_rs::Address::new(index, sub_index);
        let wiring = client.read_number(at(index::COMMISSIONING, 2)).expect("the wiring");
        client.write(at(index::COMMISSIONING, 3), &wiring.to_le_bytes()).expect("confirmed");
        client.write(at(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes()).expect("saved");
        master.rig.reset();
        master.rig.restart().expect("a restart");
        master.current(200, 0.0);
        let client = &mut Client::new(RigBus::new(master.rig), NodeId::FIRST);
        let is_kept = read_set(client).is_ok_and(|set| set.crc() == written.crc());
        (is_kept, master.arm().is_ok())
    });
    vec![
        row(29, name, "the set is kept", flag(is_kept), 1.0..=1.0),
        row(29, name, "arms", flag(arms), 1.0..=1.0),
    ]
}

#[test]
fn compact_node_on_its_board_drives_stops_and_keeps_its_set() {
    check(rows());
}
