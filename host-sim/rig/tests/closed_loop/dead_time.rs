//! Scenario 24: the voltage that the dead time takes, measured by commissioning and compensated.
//!
//! The bridge has a drawn dead time, charged switches, diodes, and phases that differ. A stand turns the joint at 0.1 rad/s
//! under a constant current. The ripple is that of the true torque, at six times the electrical frequency. The library
//! measures the motor for both drivers; scenario 4 measures motors with the image.

use super::rig::{Joint, Master, constants, set};
use super::table::{ScenarioRow, check, row};
use firmware::control::MotorParameters;
use firmware::driver::commissioning::CommissioningStep;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRunObject as Run;
use joint_rig::{JointRig, PowerUp, RigFaults, run_from_power_up};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::sync::LazyLock;

const SCENARIO: u8 = 24;

/// Speed of the joint, rad/s, its current, A, and the electrical turns of a measurement: 0.35 s.
const SPEED_RAD_S: f64 = 0.1;
const CURRENT_A: f64 = 3.0;
const TURNS: f64 = 2.0;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = turned();
        rows.extend(at_rest());
        rows.push(refused());
        rows
    });
    &ROWS
}

/// Draws a bridge that is not as its data sheet says.
fn bridge(seed: u64) -> Parameters {
    let random = &mut Pcg64::seed_from_u64(seed);
    let mut between = |least: f64, most: f64| random.random_range(least..most);
    Parameters {
        dead_time_s: between(0.4e-6, 0.6e-6),
        switch_capacitance_f: between(0.8e-9, 2.4e-9),
        switch_resistance_ohm: between(2e-3, 6e-3),
        diode_drop_v: between(0.7, 1.0),
        phase_spread: between(-0.06, 0.06),
        ..constants()
    }
}

/// Measurement of a bridge by the driver's own commissioning.
struct Commissioned {
    dead_time_s: f32,
    dead_time_current_a: f32,
    resistance_ohm: f64,
    step: u32,
}

/// Reads a number of the commissioning run.
fn float(rig: &mut JointRig, place: u8) -> f32 {
    f32::from_bits(rig.read_object(index::COMMISSIONING_RUN, place).expect("a number"))
}

/// Runs the commissioning until it ends, or until a step in which it is stopped.
fn commission(constants: &Parameters, stop_in: Option<CommissioningStep>) -> (Commissioned, u32) {
    let set = set(0.0);
    let start = PowerUp { set: Some(&set), ..PowerUp::default() };
    let plant = JointPlant::new(constants, Load::Free, 5);
    run_from_power_up(&start, plant, RigFaults::default(), |rig| {
        rig.unlock().expect("the default key");
        let before = rig.read_object(index::COMMIT, 2).expect("the staged set");
        let (mut step, mut at) = (0, 0);
        while step < CommissioningStep::Done as u32 && at < 40_000 {
            if at % 20 == 0 {
                let is_stopped = stop_in.is_some_and(|stop| step == stop as u32);
                let order = if at == 0 {
                    1
                } else if is_stopped {
                    0
                } else {
                    2
                };
                rig.write_object_byte(index::COMMISSIONING_RUN, Run::ORDER, order);
            }
            rig.step_idle();
            at += 1;
            if at % 100 == 0 {
                step = rig.read_object(index::COMMISSIONING_RUN, Run::STEP).expect("a step");
            }
        }
        let found = Commissioned {
            dead_time_s: float(rig, Run::DEAD_TIME),
            dead_time_current_a: float(rig, Run::DEAD_TIME_CURRENT),
            resistance_ohm: f64::from(float(rig, Run::RESISTANCE)),
            step,
        };
        let after = rig.read_object(index::COMMIT, 2).expect("the staged set");
        (found, u32::from(after != before))
    })
    .expect("a set that builds")
}

/// A joint with this bridge whose driver compensates a multiple of what was measured.
fn joint(constants: &Parameters, found: &Commissioned, factor: f32) -> Joint {
    let mut set = set(0.0);
    set.motor = MotorParameters {
        dead_time_s: factor * found.dead_time_s,
        dead_time_current_a: found.dead_time_current_a.max(0.05),
        ..set.motor
    };
    Joint { constants: *constants, ..Joint::with(set) }
}

/// Torque ripple at six times the electrical frequency, Nm, while a stand turns the joint.
fn ripple_nm(constants: &Parameters, found: &Commissioned, factor: f32) -> f64 {
    joint(constants, found, factor).run(|master| {
        master.arm().expect("it arms");
        master.rig.plant_mut().turn(Some(SPEED_RAD_S));
        master.current(60, CURRENT_A);
        master.rig.plant_mut().analyse_order(6.0);
        while master.rig.plant().orders.is_some_and(|orders| orders.turns() < TURNS) {
            master.current(1, CURRENT_A);
        }
        assert!(master.rig.is_armed(), "{:?}", master.faults());
        master.rig.plant().orders.expect("an analysis").amplitude_nm()
    })
}

fn turned() -> Vec<ScenarioRow> {
    let name = "drawn bridge, commissioned by the driver itself; a stand turns the joint at 0.1 rad/s, 3 A";
    let mut rows = Vec::new();
    let p = bridge(0xdead);
    let (found, _) = commission(&p, None);
    let done = f64::from(u8::from(found.step == CommissioningStep::Done as u32));
    rows.push(row(SCENARIO, name, "found everything", done, 1.0..=1.0));
    // The diodes add a tenth of a volt in the dead time: some per cent of its 48 V.
    let share = f64::from(found.dead_time_s) / p.dead_time_s;
    rows.push(row(SCENARIO, name, "dead time found over true", share, 0.9..=1.15));
    let half_a = p.switch_capacitance_f * p.bus_voltage_v / p.dead_time_s;
    let share = f64::from(found.dead_time_current_a) / half_a;
    rows.push(row(SCENARIO, name, "current of half the loss, found over true", share, 0.5..=1.5));
    let resistance_ohm = p.phase_resistance_ohm + p.switch_resistance_ohm;
    let share = found.resistance_ohm / resistance_ohm;
    rows.push(row(SCENARIO, name, "resistance found over true", share, 0.97..=1.03));
    let [without, with, half, double] =
        [0.0, 1.0, 0.5, 2.0].map(|factor| ripple_nm(&p, &found, factor));
    let figure = "torque ripple at six times the electrical frequency without compensation, Nm";
    rows.push(row(SCENARIO, name, figure, without, 0.004..=0.05));
    rows.push(row(SCENARIO, name, "with, over that without", with / without, 0.0..=0.4));
    let figure = "with half of the dead time, over that without";
    rows.push(row(SCENARIO, name, figure, half / without, 0.1..=0.75));
    let figure = "with twice the dead time, over that without";
    rows.push(row(SCENARIO, name, figure, double / without, 0.1..=1.15));
    rows
}

/// RMS torque noise of an armed joint at 0 A, Nm.
fn noise_nm(master: &mut Master) -> f64 {
    master.arm().expect("it arms");
    master.current(20, 0.0);
    master.rig.plant_mut().analyse_order(6.0);
    master.current(150, 0.0);
    master.rig.plant().orders.expect("an analysis").deviation_nm()
}

fn at_rest() -> Vec<ScenarioRow> {
    let name = "the same bridge, armed at rest with a set-point of 0 A for 0.15 s";
    let p = bridge(0xdead);
    let found = Commissioned {
        dead_time_s: p.dead_time_s as f32,
        dead_time_current_a: 0.1,
        resistance_ohm: 0.0,
        step: 0,
    };
    let [without, with, double] =
        [0.0, 1.0, 2.0].map(|factor| joint(&p, &found, factor).run(noise_nm));
    let held = "the same, 0.3 s after the master's position loop has moved the joint by 10 mrad";
    let [free, loose] = [0.0, 2.0].map(|factor| joint(&p, &found, factor).run(held_nm));
    vec![
        row(SCENARIO, name, "RMS of the torque without compensation, Nm", without, 1e-3..=0.05),
        row(SCENARIO, name, "with, over that without", with / without, 0.9..=1.1),
        row(
            SCENARIO,
            name,
            "with twice the dead time, over that without",
            double / without,
            0.9..=1.1,
        ),
        row(SCENARIO, held, "RMS of the torque without compensation, Nm", free, 1e-3..=0.3),
        row(
            SCENARIO,
            held,
            "with twice the dead time, over that without",
            loose / free,
            0.5..=1.25,
        ),
    ]
}

/// RMS torque of a free joint that the master's loops hold at its position, Nm.
fn held_nm(master: &mut Master) -> f64 {
    master.arm().expect("it arms");
    let position = master.rig.plant().position_rad() + 0.01;
    (0..300).for_each(|_| master.hold(position));
    master.rig.plant_mut().analyse_order(6.0);
    (0..300).for_each(|_| master.hold(position));
    master.rig.plant().orders.expect("an analysis").deviation_nm()
}

/// A run that ends before its results stages nothing.
fn refused() -> ScenarioRow {
    let name = "commissioning stopped while the resistance is measured";
    let (found, changed) = commission(&bridge(0xdead), Some(CommissioningStep::FullCurrent));
    let nothing = changed == 0 && found.dead_time_s == 0.0;
    row(SCENARIO, name, "stages no dead time", f64::from(u8::from(nothing)), 1.0..=1.0)
}

#[test]
fn dead_time_is_measured_and_compensated() {
    check(rows());
}
