//! Scenario 4: the driver identifies its own motor and then drives it.
//!
//! Twenty random motors, three for the image, differ in magnet, winding, cogging, friction, encoder and rotor position. The driver knows only the
//! gear ratio. Its results are compared with the constants of the plant. All commands are object writes, as from a tool.

use super::driver::MOTORS;
use super::rig::{Joint, Master, constants, set};
use super::table::{ScenarioRow, check, row};
use firmware::driver::commissioning::CommissioningStep;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{
    CommissioningObject, CommissioningRunObject, CommitObject,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::Parameters;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Maximum duration of a run, ms.
const MAX_RUN_MS: usize = 40_000;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = random_motors();
        rows.extend(miswired());
        rows.extend(ended());
        rows
    });
    &ROWS
}

/// Result of a run.
pub(crate) struct RunOutcome {
    step: u32,
    seconds: f64,
    resistance: f64,
    inductance: [f64; 2],
    constant: f64,
    pole_pairs: f64,
    pub direction: f64,
    zero_rad: f64,
    dead_time_s: f64,
    bandwidth_hz: f64,
    current_a: f64,
    travel_rad: f64,
    /// Torque-producing current over commanded current afterwards, at +8 A and -8 A; `None` if the driver does not arm, does not
    /// stay armed, or moves in the wrong direction.
    pub torque_share: Option<[f64; 2]>,
}

pub(crate) fn commission(master: &mut Master) -> RunOutcome {
    let run = index::COMMISSIONING_RUN;
    master.rig.unlock().expect("the default key");
    let from = master.rig.plant().position_rad();
    master.rig.stage_mut().take_extremes();
    let (mut step, mut travel_rad, mut at) = (0, 0.0f64, 0);
    while at < MAX_RUN_MS {
        if at % 20 == 0 {
            master.rig.write_object_byte(
                run,
                CommissioningRunObject::ORDER,
                if at == 0 { 1 } else { 2 },
            );
        }
        master.rig.step_idle();
        at += 1;
        travel_rad = travel_rad.max((master.rig.plant().position_rad() - from).abs());
        if at % 100 == 0 {
            step = master.rig.read_object(run, CommissioningRunObject::STEP).expect("a step");
            if step >= CommissioningStep::Done as u32 {
                break;
            }
        }
    }
    let mut float = |sub_index| {
        f64::from(f32::from_bits(master.rig.read_object(run, sub_index).expect("a number")))
    };
    let [resistance, d, q] = [
        CommissioningRunObject::RESISTANCE,
        CommissioningRunObject::INDUCTANCE_D,
        CommissioningRunObject::INDUCTANCE_Q,
    ]
    .map(&mut float);
    let constant = float(CommissioningRunObject::TORQUE_CONSTANT);
    let zero_rad = float(CommissioningRunObject::ENCODER_OFFSET);
    let dead_time_s = float(CommissioningRunObject::DEAD_TIME);
    let bandwidth_hz = float(CommissioningRunObject::BANDWIDTH);
    let mut byte = |sub_index| master.rig.read_object(run, sub_index).expect("a byte") as u8;
    let (pole_pairs, direction) = (
        f64::from(byte(CommissioningRunObject::POLE_PAIRS)),
        f64::from(byte(CommissioningRunObject::ENCODER_DIRECTION) as i8),
    );
    let most = master.rig.stage_mut().take_extremes();
    let torque_share = if step == CommissioningStep::Done as u32 { drive(master) } else { None };
    RunOutcome {
        step,
        seconds: at as f64 * 1e-3,
        resistance,
        inductance: [d, q],
        constant,
        pole_pairs,
        direction,
        zero_rad,
        dead_time_s,
        bandwidth_hz,
        current_a: most.current_a,
        travel_rad,
        torque_share,
    }
}

/// Commits the staged parameters, confirms the wiring, arms, and commands 8 A in both directions.
fn drive(master: &mut Master) -> Option<[f64; 2]> {
    let number = |master: &mut Master, index, sub_index| {
        master.rig.read_object(index, sub_index).expect("a number").to_le_bytes()
    };
    let staged = number(master, index::COMMIT, 2);
    master.rig.write_object(index::COMMIT, CommitObject::COMMIT, staged);
    master.rig.step_idle();
    let wiring = number(master, index::COMMISSIONING, CommissioningObject::WIRING_CRC);
    master.rig.write_object(index::COMMISSIONING, CommissioningObject::CONFIRM, wiring);
    (0..200).for_each(|_| master.rig.step_idle());
    master.arm().ok()?;
    let mut torque_share = [0.0; 2];
    for (torque_share, commanded_a) in torque_share.iter_mut().zip([8.0, -8.0]) {
        master.current(60, commanded_a);
        for _ in 0..40 {
            master.current(1, commanded_a);
            // The encoder defines the positive direction, which can differ from the plant's.
            *torque_share += master.rig.plant().torque_current_a().abs() / commanded_a.abs() / 40.0;
        }
        let way = f64::from(master.rig.master_view().velocity_rad_s) * commanded_a;
        if way <= 0.0 || !master.rig.is_armed() {
            return None;
        }
        // Lets the joint come to rest.
        master.current(300, 0.0);
    }
    Some(torque_share)
}

struct Motor {
    constants: Parameters,
    seed: u64,
    /// Time for which 5 A move the rotor to its initial position, s.
    move_s: f64,
}

fn motor(number: usize) -> Motor {
    let seed = 0xc0de + number as u64;
    let random = &mut Pcg64::seed_from_u64(seed);
    let mut between = |least: f64, most: f64| random.random_range(least..most);
    let scale = between(0.5, 2.0);
    let constants = Parameters {
        pole_pairs: [4.0, 5.0, 7.0, 10.0, 14.0][between(0.0, 5.0) as usize],
        phase_resistance_ohm: 0.13 * scale * between(0.7, 1.4),
        phase_inductance_h: 88e-6 * scale * between(0.7, 1.4),
        motor_torque_constant_nm_per_a: 0.0196 * between(0.8, 1.6),
        torque_constant_error: 0.0,
        cogging_nm: between(0.0, 0.008),
        cogging_periods: [36.0, 42.0, 84.0][between(0.0, 3.0) as usize],
        friction_static: between(0.13, 0.25),
        magnet_eccentricity_rad: between(0.0, 0.01),
        encoder_zero_rad: between(0.0, TAU),
        encoder_direction: if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 },
        dead_time_s: between(0.2e-6, 0.6e-6),
        switch_capacitance_f: between(0.5e-9, 2e-9),
        switch_resistance_ohm: between(1e-3, 5e-3),
        diode_drop_v: between(0.6, 1.0),
        phase_spread: between(-0.05, 0.05),
        ..constants()
    };
    Motor { constants, seed, move_s: between(0.02, 0.08) }
}

/// Electrical angle between two encoder zeros, rad.
fn electrical_difference(found: f64, truth: f64, pole_pairs: f64) -> f64 {
    let turn = TAU / pole_pairs;
    let off = (found - truth).rem_euclid(turn);
    pole_pairs * if off > 0.5 * turn { off - turn } else { off }
}

fn run(of: &Motor, swapped: bool) -> RunOutcome {
    let mut joint = Joint::with(set(0.0));
    joint.constants = of.constants;
    joint.commissioned = false;
    joint.faults.seed = of.seed;
    joint.run_plant(
        |plant| {
            let steps = |seconds: f64| (seconds / 50e-6) as usize;
            (0..steps(of.move_s)).for_each(|_| plant.period_at_current(50e-6, 6.0));
            (0..steps(0.5)).for_each(|_| plant.period_at_current(50e-6, 0.0));
        },
        |master| {
            master.rig.stage_mut().phases_swapped = swapped;
            commission(master)
        },
    )
}

fn random_motors() -> Vec<ScenarioRow> {
    let name = "random motors (20 for the library, 3 for the image), each commissioned by the driver itself at 7.8 A, committed, armed";
    let motors: Vec<Motor> = (0..MOTORS).map(motor).collect();
    let outcomes: Vec<(RunOutcome, &Motor)> =
        motors.iter().map(|of| (run(of, false), of)).collect();
    let share = |of: &dyn Fn(&RunOutcome, &Parameters) -> bool| {
        let count = outcomes.iter().filter(|(out, motor)| of(out, &motor.constants)).count();
        count as f64 / MOTORS as f64
    };
    let least = |of: &dyn Fn(&RunOutcome, &Parameters) -> f64| {
        outcomes.iter().map(|(out, motor)| of(out, &motor.constants)).fold(f64::INFINITY, f64::min)
    };
    let most = |of: &dyn Fn(&RunOutcome, &Parameters) -> f64| {
        outcomes.iter().map(|(out, motor)| of(out, &motor.constants)).fold(-f64::INFINITY, f64::max)
    };
    let resistance = |out: &RunOutcome, p: &Parameters| {
        out.resistance / (p.phase_resistance_ohm + p.switch_resistance_ohm)
    };
    let dead_time = |out: &RunOutcome, p: &Parameters| out.dead_time_s / p.dead_time_s;
    let inductance = |axis: usize| {
        move |out: &RunOutcome, p: &Parameters| out.inductance[axis] / p.phase_inductance_h
    };
    let constant =
        |out: &RunOutcome, p: &Parameters| out.constant / p.motor_torque_constant_nm_per_a;
    let zero = |out: &RunOutcome, p: &Parameters| {
        electrical_difference(out.zero_rad, p.encoder_zero_rad, p.pole_pairs).to_degrees()
    };
    let figures: Vec<(&'static str, f64, std::ops::RangeInclusive<f64>)> = vec![
        (
            "share that found everything",
            share(&|out, _| out.step == CommissioningStep::Done as u32),
            1.0..=1.0,
        ),
        ("pole pairs right, share", share(&|out, p| out.pole_pairs == p.pole_pairs), 1.0..=1.0),
        (
            "direction right, share",
            share(&|out, p| out.direction == p.encoder_direction),
            1.0..=1.0,
        ),
        ("resistance found over true, least", least(&resistance), 0.97..=1.03),
        ("resistance found over true, most", most(&resistance), 0.97..=1.03),
        ("dead time found over true, least", least(&dead_time), 0.9..=1.15),
        ("dead time found over true, most", most(&dead_time), 0.9..=1.15),
        ("bandwidth chosen, Hz, least", least(&|out, _| out.bandwidth_hz), 1000.0..=2000.1),
        ("inductance along, found over true, least", least(&inductance(0)), 0.95..=1.05),
        ("inductance along, found over true, most", most(&inductance(0)), 0.95..=1.05),
        ("inductance across, found over true, least", least(&inductance(1)), 0.95..=1.05),
        ("inductance across, found over true, most", most(&inductance(1)), 0.95..=1.05),
        ("torque constant found over true, least", least(&constant), 0.95..=1.05),
        ("torque constant found over true, most", most(&constant), 0.95..=1.05),
        ("electrical zero less true, degrees, least", least(&zero), -3.0..=3.0),
        ("electrical zero less true, degrees, most", most(&zero), -3.0..=3.0),
        ("largest phase current, A", most(&|out, _| out.current_a), 7.0..=12.2),
        ("largest travel, rad", most(&|out, _| out.travel_rad), 0.05..=0.5),
        ("longest run, s", most(&|out, _| out.seconds), 2.0..=40.0),
        (
            "afterwards, moves in the commanded direction at ±8 A, share",
            share(&|out, _| out.torque_share.is_some()),
            1.0..=1.0,
        ),
        (
            "torque-producing current over commanded, least",
            least(&|out, _| torque_share(out)[0]),
            0.97..=1.03,
        ),
        (
            "torque-producing current over commanded, most",
            most(&|out, _| torque_share(out)[1]),
            0.97..=1.03,
        ),
    ];
    figures.into_iter().map(|(figure, value, limits)| row(4, name, figure, value, limits)).collect()
}

fn miswired() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (name, swapped, reversed) in [
        ("phases b and c swapped", true, false),
        ("encoder reversed", false, true),
        ("phases b and c swapped and the encoder reversed", true, true),
    ] {
        let constants = Parameters {
            encoder_direction: if reversed { -1.0 } else { 1.0 },
            encoder_zero_rad: 0.4 * PI,
            cogging_nm: 0.005,
            ..constants()
        };
        let out = run(&Motor { constants, seed: 77, move_s: 0.05 }, swapped);
        let name = format!("{name}: commissioned by the driver itself, committed, armed");
        let direction = if swapped == reversed { 1.0 } else { -1.0 };
        let done = f64::from(u8::from(out.step == CommissioningStep::Done as u32));
        rows.push(row(4, &name, "found everything", done, 1.0..=1.0));
        rows.push(row(4, &name, "encoder direction found", out.direction, direction..=direction));
        let moves = f64::from(u8::from(out.torque_share.is_some()));
        rows.push(row(
            4,
            &name,
            "afterwards, moves in the commanded direction at ±8 A",
            moves,
            1.0..=1.0,
        ));
        let [least, most] = torque_share(&out);
        let figure = "torque-producing current over commanded";
        rows.push(row(4, &name, figure, 0.5 * (least + most), 0.97..=1.03));
    }
    rows
}

/// A cause for the end of a commissioning run.
#[derive(Clone, Copy)]
enum RunEnd {
    Held,
    Travel,
    Silent,
    Heavy,
    Stop,
}

/// Ways to end a run, each of which must leave the driver safe.
fn ended() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (what, end, reason) in [
        ("the joint is held", RunEnd::Held, 7),
        ("the range is 0.05 rad", RunEnd::Travel, 10),
        ("the master stops sending after 3 s", RunEnd::Silent, 2),
        ("friction holds the rotor at 1.5 A", RunEnd::Heavy, 0),
        ("it is disarmed after 3 s", RunEnd::Stop, 1),
    ] {
        let mut joint = Joint::with(set(0.0));
        joint.commissioned = false;
        let name = format!("commissioning by the driver itself; {what}");
        joint.run(|master| rows.extend(ended_run(master, &name, end, reason)));
    }
    rows
}

/// Runs the commissioning until it ends and checks reason, currents, and the driver afterwards.
fn ended_run(master: &mut Master, name: &str, end: RunEnd, reason: u8) -> Vec<ScenarioRow> {
    let run = index::COMMISSIONING_RUN;
    match end {
        RunEnd::Held => master.rig.plant_mut().hold(true),
        RunEnd::Travel => {
            master.rig.write_object(run, CommissioningRunObject::TRAVEL, 0.05f32.to_le_bytes());
        }
        RunEnd::Heavy => {
            master.rig.write_object(run, CommissioningRunObject::CURRENT, 1.5f32.to_le_bytes());
        }
        RunEnd::Silent | RunEnd::Stop => {}
    }
    master.rig.step_idle();
    master.rig.stage_mut().take_extremes();
    let from = master.rig.plant().position_rad();
    let open_ms = run_until_open(master, end);
    let most = master.rig.stage_mut().take_extremes();
    let travel = (master.rig.plant().position_rad() - from).abs();
    let reported =
        master.rig.read_object(run, CommissioningRunObject::REASON).expect("a reason") as u8;
    let is_expected = match end {
        // The rotor does not follow at all, or slips.
        RunEnd::Heavy => matches!(reported, 5..=9),
        _ => reported == reason,
    };
    let mut rows =
        vec![row(4, name, "ends for that reason", f64::from(u8::from(is_expected)), 1.0..=1.0)];
    if matches!(end, RunEnd::Silent) {
        let after = f64::from(open_ms - 3000);
        rows.push(row(4, name, "to open bridge, ms", after, 60.0..=102.0));
    }
    if matches!(end, RunEnd::Travel) {
        rows.push(row(4, name, "moved, rad", travel, 0.03..=0.06));
    }
    rows.push(row(4, name, "largest phase current, A", most.current_a, 1.0..=12.2));
    master.rig.request_state(2);
    master.rig.step_idle();
    master.rig.stage_mut().take_extremes();
    let refused = f64::from(u8::from(master.arm().is_err()));
    rows.push(row(4, name, "arms afterwards, unconfirmed", 1.0 - refused, 0.0..=0.0));
    let driven = f64::from(master.rig.stage_mut().take_extremes().driven_periods);
    rows.push(row(4, name, "periods driven afterwards", driven, 0.0..=0.0));
    rows
}

/// Commands the run until the bridge is open, and returns the time, ms; 0 if it stays closed for 20 s.
fn run_until_open(master: &mut Master, end: RunEnd) -> i32 {
    let run = index::COMMISSIONING_RUN;
    for at in 0..20_000 {
        match end {
            RunEnd::Stop if at == 3000 => master.rig.request_state(0),
            RunEnd::Silent if at >= 3000 => {}
            _ if at % 20 == 0 => {
                let order = if at == 0 { 1 } else { 2 };
                master.rig.write_object_byte(run, CommissioningRunObject::ORDER, order);
            }
            _ => {}
        }
        master.rig.step_idle();
        if !master.rig.is_armed() && at > 100 {
            return at;
        }
    }
    0
}

/// Returns the smaller and the larger of both directions.
fn torque_share(out: &RunOutcome) -> [f64; 2] {
    let [there, back] = out.torque_share.unwrap_or([0.0; 2]);
    [there.min(back), there.max(back)]
}

#[test]
fn driver_commissions_random_motors_and_drives_them() {
    check(rows());
}
