//! Scenario 4: the driver finds out by itself what motor it drives, and drives it afterwards.
//!
//! Twenty motors are drawn, each with its magnet, winding, cogging, friction, encoder and place of the rotor; the driver knows
//! none of it but the gear. What it finds is held against what the plant was made of, and the plant knows nothing of how it
//! was found. All orders are objects, as a tool writes them.

use super::rig::{Joint, Master, constants, set};
use super::table::{Row, hold, row};
use firmware::driver::commissioning::Step;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{Commissioning, CommissioningRun, Commit};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::Parameters;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

const MOTORS: usize = 20;

/// The longest a run may take, ms.
const LONGEST_MS: usize = 40_000;

pub fn rows() -> &'static [Row] {
    static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| {
        let mut rows = drawn();
        rows.extend(miswired());
        rows.extend(ended());
        rows
    });
    &ROWS
}

/// What came of a run.
struct Outcome {
    step: u32,
    seconds: f64,
    resistance: f64,
    inductance: [f64; 2],
    constant: f64,
    pole_pairs: f64,
    direction: f64,
    zero_rad: f64,
    current_a: f64,
    travel_rad: f64,
    /// Afterwards, at 8 A to either side: the current that makes torque over that asked for; none where it does not arm, stay
    /// armed, and move the way that was asked.
    made: Option<[f64; 2]>,
}

fn commission(master: &mut Master) -> Outcome {
    let run = index::COMMISSIONING_RUN;
    let from = master.rig.plant().position_rad();
    master.rig.stage_mut().take_extremes();
    let (mut step, mut travel_rad, mut at) = (0, 0.0f64, 0);
    while at < LONGEST_MS {
        if at % 20 == 0 {
            master.rig.write_byte(run, CommissioningRun::ORDER, if at == 0 { 1 } else { 2 });
        }
        master.rig.pass();
        at += 1;
        travel_rad = travel_rad.max((master.rig.plant().position_rad() - from).abs());
        if at % 100 == 0 {
            step = master.rig.read(run, CommissioningRun::STEP).expect("a step");
            if step >= Step::Done as u32 {
                break;
            }
        }
    }
    let mut float =
        |sub_index| f64::from(f32::from_bits(master.rig.read(run, sub_index).expect("a number")));
    let [resistance, d, q] = [
        CommissioningRun::RESISTANCE,
        CommissioningRun::INDUCTANCE_D,
        CommissioningRun::INDUCTANCE_Q,
    ]
    .map(&mut float);
    let constant = float(CommissioningRun::TORQUE_CONSTANT);
    let zero_rad = float(CommissioningRun::ENCODER_OFFSET);
    let mut byte = |sub_index| master.rig.read(run, sub_index).expect("a byte") as u8;
    let (pole_pairs, direction) = (
        f64::from(byte(CommissioningRun::POLE_PAIRS)),
        f64::from(byte(CommissioningRun::ENCODER_DIRECTION) as i8),
    );
    let most = master.rig.stage_mut().take_extremes();
    let made = if step == Step::Done as u32 { drive(master) } else { None };
    Outcome {
        step,
        seconds: at as f64 * 1e-3,
        resistance,
        inductance: [d, q],
        constant,
        pole_pairs,
        direction,
        zero_rad,
        current_a: most.current_a,
        travel_rad,
        made,
    }
}

/// Commits what was staged, confirms it, arms, and asks for 8 A to either side.
fn drive(master: &mut Master) -> Option<[f64; 2]> {
    let number = |master: &mut Master, index, sub_index| {
        master.rig.read(index, sub_index).expect("a number").to_le_bytes()
    };
    let staged = number(master, index::COMMIT, 2);
    master.rig.write(index::COMMIT, Commit::COMMIT, staged);
    master.rig.pass();
    let wiring = number(master, index::COMMISSIONING, Commissioning::WIRING_CRC);
    master.rig.write(index::COMMISSIONING, Commissioning::CONFIRM, wiring);
    (0..200).for_each(|_| master.rig.pass());
    master.arm().ok()?;
    let mut made = [0.0; 2];
    for (made, asked_a) in made.iter_mut().zip([8.0, -8.0]) {
        master.current(60, asked_a);
        for _ in 0..40 {
            master.current(1, asked_a);
            // Positive is where the encoder has it, which need not be the plant's.
            *made += master.rig.plant().torque_current_a().abs() / asked_a.abs() / 40.0;
        }
        let way = f64::from(master.rig.heard().velocity_rad_s) * asked_a;
        if way <= 0.0 || !master.rig.is_armed() {
            return None;
        }
        // To rest again.
        master.current(300, 0.0);
    }
    Some(made)
}

struct Motor {
    constants: Parameters,
    seed: u64,
    /// Where the rotor is put before, s of 5 A.
    pushed_s: f64,
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
        ..constants()
    };
    Motor { constants, seed, pushed_s: between(0.02, 0.08) }
}

/// Electrical angle between two zeros of the encoder, rad.
fn apart(found: f64, truth: f64, pole_pairs: f64) -> f64 {
    let turn = TAU / pole_pairs;
    let off = (found - truth).rem_euclid(turn);
    pole_pairs * if off > 0.5 * turn { off - turn } else { off }
}

fn run(of: &Motor, swapped: bool) -> Outcome {
    let mut joint = Joint::with(set(0.0));
    joint.constants = of.constants;
    joint.commissioned = false;
    joint.faults.seed = of.seed;
    joint.run_plant(
        |plant| {
            let steps = |seconds: f64| (seconds / 50e-6) as usize;
            (0..steps(of.pushed_s)).for_each(|_| plant.period_at_current(50e-6, 6.0));
            (0..steps(0.5)).for_each(|_| plant.period_at_current(50e-6, 0.0));
        },
        |master| {
            master.rig.stage_mut().swapped = swapped;
            commission(master)
        },
    )
}

fn drawn() -> Vec<Row> {
    let name = "20 motors drawn, each commissioned by the driver itself at 7.8 A, committed, armed";
    let motors: Vec<Motor> = (0..MOTORS).map(motor).collect();
    let outcomes: Vec<(Outcome, &Motor)> = motors.iter().map(|of| (run(of, false), of)).collect();
    let count = |of: &dyn Fn(&Outcome, &Parameters) -> bool| {
        outcomes.iter().filter(|(out, motor)| of(out, &motor.constants)).count() as f64
    };
    let least = |of: &dyn Fn(&Outcome, &Parameters) -> f64| {
        outcomes.iter().map(|(out, motor)| of(out, &motor.constants)).fold(f64::INFINITY, f64::min)
    };
    let most = |of: &dyn Fn(&Outcome, &Parameters) -> f64| {
        outcomes.iter().map(|(out, motor)| of(out, &motor.constants)).fold(-f64::INFINITY, f64::max)
    };
    let all = MOTORS as f64;
    let resistance = |out: &Outcome, p: &Parameters| out.resistance / p.phase_resistance_ohm;
    let inductance = |axis: usize| {
        move |out: &Outcome, p: &Parameters| out.inductance[axis] / p.phase_inductance_h
    };
    let constant = |out: &Outcome, p: &Parameters| out.constant / p.motor_torque_constant_nm_per_a;
    let zero = |out: &Outcome, p: &Parameters| {
        apart(out.zero_rad, p.encoder_zero_rad, p.pole_pairs).to_degrees()
    };
    let figures: Vec<(&'static str, f64, std::ops::RangeInclusive<f64>)> = vec![
        ("found everything", count(&|out, _| out.step == Step::Done as u32), all..=all),
        ("pole pairs right", count(&|out, p| out.pole_pairs == p.pole_pairs), all..=all),
        ("direction right", count(&|out, p| out.direction == p.encoder_direction), all..=all),
        ("resistance found over true, least", least(&resistance), 0.97..=1.03),
        ("resistance found over true, most", most(&resistance), 0.97..=1.03),
        ("inductance along, found over true, least", least(&inductance(0)), 0.95..=1.05),
        ("inductance along, found over true, most", most(&inductance(0)), 0.95..=1.05),
        ("inductance across, found over true, least", least(&inductance(1)), 0.95..=1.05),
        ("inductance across, found over true, most", most(&inductance(1)), 0.95..=1.05),
        ("torque constant found over true, least", least(&constant), 0.95..=1.05),
        ("torque constant found over true, most", most(&constant), 0.95..=1.05),
        ("electrical zero less true, degrees, least", least(&zero), -3.0..=3.0),
        ("electrical zero less true, degrees, most", most(&zero), -3.0..=3.0),
        ("largest phase current, A", most(&|out, _| out.current_a), 7.0..=12.2),
        ("farthest the joint went, rad", most(&|out, _| out.travel_rad), 0.05..=0.5),
        ("longest run, s", most(&|out, _| out.seconds), 2.0..=40.0),
        (
            "afterwards, moves the way asked, 8 A to either side",
            count(&|out, _| out.made.is_some()),
            all..=all,
        ),
        (
            "current that makes torque over that asked for, least",
            least(&|out, _| made(out)[0]),
            0.97..=1.03,
        ),
        (
            "current that makes torque over that asked for, most",
            most(&|out, _| made(out)[1]),
            0.97..=1.03,
        ),
    ];
    figures.into_iter().map(|(figure, value, limits)| row(4, name, figure, value, limits)).collect()
}

fn miswired() -> Vec<Row> {
    let mut rows = Vec::new();
    for (name, swapped, reversed) in [
        ("phases b and c swapped", true, false),
        ("encoder counts the other way", false, true),
        ("phases b and c swapped and the encoder counts the other way", true, true),
    ] {
        let constants = Parameters {
            encoder_direction: if reversed { -1.0 } else { 1.0 },
            encoder_zero_rad: 0.4 * PI,
            cogging_nm: 0.005,
            ..constants()
        };
        let out = run(&Motor { constants, seed: 77, pushed_s: 0.05 }, swapped);
        let name = format!("{name}: commissioned by the driver itself, committed, armed");
        let direction = if swapped == reversed { 1.0 } else { -1.0 };
        let done = f64::from(u8::from(out.step == Step::Done as u32));
        rows.push(row(4, &name, "found everything", done, 1.0..=1.0));
        rows.push(row(4, &name, "encoder direction found", out.direction, direction..=direction));
        let moves = f64::from(u8::from(out.made.is_some()));
        rows.push(row(
            4,
            &name,
            "afterwards, moves the way asked, 8 A to either side",
            moves,
            1.0..=1.0,
        ));
        let [least, most] = made(&out);
        let figure = "current that makes torque over that asked for";
        rows.push(row(4, &name, figure, 0.5 * (least + most), 0.97..=1.03));
    }
    rows
}

/// What may end a run, and that it leaves nothing behind.
fn ended() -> Vec<Row> {
    #[derive(Clone, Copy)]
    enum End {
        Held,
        Travel,
        Silent,
        Heavy,
        Stop,
    }
    let mut rows = Vec::new();
    for (what, end, reason) in [
        ("the joint is held", End::Held, 7),
        ("the range is 0.05 rad", End::Travel, 10),
        ("the master falls silent after 3 s", End::Silent, 2),
        ("friction holds the rotor at 1.5 A", End::Heavy, 0),
        ("it is disarmed after 3 s", End::Stop, 1),
    ] {
        let mut joint = Joint::with(set(0.0));
        joint.commissioned = false;
        joint.run(|master| {
            let run = index::COMMISSIONING_RUN;
            match end {
                End::Held => master.rig.plant_mut().hold(true),
                End::Travel => {
                    master.rig.write(run, CommissioningRun::TRAVEL, 0.05f32.to_le_bytes());
                }
                End::Heavy => {
                    master.rig.write(run, CommissioningRun::CURRENT, 1.5f32.to_le_bytes());
                }
                End::Silent | End::Stop => {}
            }
            master.rig.pass();
            master.rig.stage_mut().take_extremes();
            let from = master.rig.plant().position_rad();
            let mut open_ms = 0;
            for at in 0..20_000 {
                let over = at >= 3000;
                match end {
                    End::Stop if at == 3000 => master.rig.request(0),
                    End::Silent if over => {}
                    _ if at % 20 == 0 => {
                        let order = if at == 0 { 1 } else { 2 };
                        master.rig.write_byte(run, CommissioningRun::ORDER, order);
                    }
                    _ => {}
                }
                master.rig.pass();
                if !master.rig.is_armed() && at > 100 {
                    open_ms = at;
                    break;
                }
            }
            let most = master.rig.stage_mut().take_extremes();
            let travel = (master.rig.plant().position_rad() - from).abs();
            let said = master.rig.read(run, CommissioningRun::REASON).expect("a reason") as u8;
            let named = match end {
                // One of the two: it does not follow at all, or slips.
                End::Heavy => matches!(said, 5..=9),
                _ => said == reason,
            };
            let name = format!("commissioning by the driver itself; {what}");
            rows.push(row(4, &name, "ends for that reason", f64::from(u8::from(named)), 1.0..=1.0));
            if matches!(end, End::Silent) {
                let after = f64::from(open_ms - 3000);
                rows.push(row(4, &name, "to open bridge, ms", after, 60.0..=102.0));
            }
            if matches!(end, End::Travel) {
                rows.push(row(4, &name, "moved, rad", travel, 0.03..=0.06));
            }
            rows.push(row(4, &name, "largest phase current, A", most.current_a, 1.0..=12.2));
            master.rig.request(2);
            master.rig.pass();
            master.rig.stage_mut().take_extremes();
            let refused = f64::from(u8::from(master.arm().is_err()));
            rows.push(row(4, &name, "arms afterwards, unconfirmed", 1.0 - refused, 0.0..=0.0));
            let driven = f64::from(master.rig.stage_mut().take_extremes().driven);
            rows.push(row(4, &name, "periods driven afterwards", driven, 0.0..=0.0));
        });
    }
    rows
}

/// The least and the most of the two ways.
fn made(out: &Outcome) -> [f64; 2] {
    let [there, back] = out.made.unwrap_or([0.0; 2]);
    [there.min(back), there.max(back)]
}

#[test]
fn the_driver_finds_out_what_motor_it_drives() {
    hold(rows());
}
