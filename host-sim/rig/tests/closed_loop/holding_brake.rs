//! Scenario 18: a leg of 2 kg held horizontally, with a holding brake. The load must not fall.

use super::rig::{Joint, Master, set};
use super::stops::{flag, write_short};
use super::table::{ScenarioRow, check, row};
use super::velocity::{drive, enable};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use simulated_machines::joint_plant::{HoldingBrake, Load};
use std::sync::LazyLock;

/// Times of the brake, s, and its torque, Nm: three times the load.
const CLOSING_S: f64 = 0.03;
const OPENING_S: f64 = 0.04;
const TORQUE_NM: f64 = 18.0;
/// Delays in the driver, ms: the times of the brake and a margin.
const RELEASE_MS: i16 = 60;
const ENGAGE_MS: i16 = 50;
/// Largest acceleration of the falling leg, rad/s^2: 5.9 Nm on 0.4 kg m^2.
const FALL_RAD_S2: f64 = 15.0;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = cycle();
        rows.extend(fault(true));
        rows.extend(fault(false));
        rows.extend(fall_in_motion("gate driver fault", |master| {
            master.rig.stage_mut().gate_fault = true;
            0x0F
        }));
        rows.extend(fall_in_motion("disable voltage", |_| 0x00));
        rows.extend(silence());
        rows
    });
    &ROWS
}

/// The set of the loaded joint: its inertia, and a gain for 4 Hz.
fn loaded_set() -> ParameterSet {
    let mut set = set(0.9);
    set.motor.inertia_kg_m2 = 0.4;
    set.motor.velocity_gain_a_s_per_rad = 10.0;
    set
}

/// Powers the leg up at rest, with its brake closed, and enables it if it is to be held.
pub fn with_brake<R>(has_brake: bool, work: impl FnOnce(&mut Master) -> R) -> R {
    let joint = Joint { load: Load::Leg, ..Joint::with(loaded_set()) };
    joint.run_plant(
        |plant| {
            plant.place(0.0);
            plant.brake = Some(HoldingBrake::new(TORQUE_NM, CLOSING_S, OPENING_S));
        },
        |master| {
            write_short(master, index::DISABLE_OPTION, 0, 1);
            write_short(master, index::FAULT_OPTION, 0, 2);
            write_short(master, index::HOLDING_BRAKE, 2, RELEASE_MS);
            write_short(master, index::HOLDING_BRAKE, 3, ENGAGE_MS);
            if has_brake {
                master.rig.write_object_byte(index::HOLDING_BRAKE, 1, 1);
            }
            master.rig.step_idle();
            work(master)
        },
    )
}

fn run(master: &mut Master, milliseconds: u32, controlword: u16, velocity_rad_s: f64) {
    (0..milliseconds).for_each(|_| drive(master, controlword, velocity_rad_s));
}

/// Largest way downwards in this time, rad.
fn fall(master: &mut Master, milliseconds: u32, mut step: impl FnMut(&mut Master)) -> f64 {
    let from = master.rig.plant().position_rad();
    (0..milliseconds).fold(0.0, |most, _| {
        step(master);
        f64::max(most, from - master.rig.plant().position_rad())
    })
}

/// Enabling, a lift, disabling, and enabling again.
fn cycle() -> Vec<ScenarioRow> {
    let name = "leg held horizontally: enable, lift, disable with 605Ch = 1, enable again";
    with_brake(true, |master| {
        enable(master);
        let first = fall(master, 500, |master| drive(master, 0x0F, 0.0));
        run(master, 600, 0x0F, 0.5);
        run(master, 500, 0x0F, 0.0);
        let disabled = fall(master, 2000, |master| drive(master, 0x07, 0.0));
        let open = master.rig.stage_mut().applied_duty().is_none();
        let again = fall(master, 600, |master| drive(master, 0x0F, 0.0));
        vec![
            // The first release finds an unknown load of 5.9 Nm, and the loop has a stiffness of
            // gain (position gain + 1 / integral time), 200 Nm/rad. A load that comes at once falls up to three times as far.
            row(18, name, "fall at the first release, rad", first, 0.0..=0.09),
            row(18, name, "fall while disabled, rad", disabled, 0.0..=0.005),
            row(18, name, "bridge open while disabled", flag(open), 1.0..=1.0),
            row(18, name, "fall at the next release, rad", again, 0.0..=0.01),
            row(18, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// A fault of the gate driver opens the bridge while the leg is held.
fn fault(has_brake: bool) -> Vec<ScenarioRow> {
    let brake = if has_brake { "with its brake" } else { "brake released by another device" };
    let name = format!("leg held horizontally, {brake}: gate driver fault");
    with_brake(has_brake, |master| {
        if !has_brake {
            master.rig.plant_mut().brake = Some(HoldingBrake::new(0.0, CLOSING_S, OPENING_S));
        }
        enable(master);
        run(master, 500, 0x0F, 0.0);
        master.rig.stage_mut().gate_fault = true;
        let fallen = fall(master, 1000, |master| drive(master, 0x0F, 0.0));
        // The brake closes in 30 ms, and the driver reports the fault within 3 ms.
        let most = 0.5 * FALL_RAD_S2 * (CLOSING_S + 0.003) * (CLOSING_S + 0.003);
        let limits = if has_brake { 0.0..=2.0 * most } else { 0.3..=3.0 };
        vec![
            row(18, &name, "fall, rad", fallen, limits),
            row(18, &name, "stays armed", flag(master.rig.is_armed()), 0.0..=0.0),
        ]
    })
}

/// The bridge opens while the leg moves down; `open` returns the controlword that the master sends then.
fn fall_in_motion(what: &str, open: fn(&mut Master) -> u16) -> Vec<ScenarioRow> {
    let name = format!("leg lowered with 0.5 rad/s, with its brake: {what}");
    with_brake(true, |master| {
        enable(master);
        run(master, 500, 0x0F, 0.0);
        run(master, 500, 0x0F, -0.5);
        let controlword = open(master);
        let fallen = fall(master, 1000, |master| drive(master, controlword, -0.5));
        // The brake closes in 30 ms, 3 ms after the fault, or 7 ms after the leg is faster by 0.1 rad/s. Then it stops the
        // leg with three times the load.
        let until_s = CLOSING_S + 0.01;
        let speed = 0.5 + FALL_RAD_S2 * until_s;
        let most = 0.5 * (0.5 + speed) * until_s + 0.5 * speed * speed / (2.0 * FALL_RAD_S2);
        vec![
            row(18, &name, "fall, rad", fallen, 0.01..=1.5 * most),
            row(18, &name, "stays armed", flag(master.rig.is_armed()), 0.0..=0.0),
        ]
    })
}

/// The master stops sending while the leg moves down.
fn silence() -> Vec<ScenarioRow> {
    let name = "leg lowered with 0.5 rad/s, 605Eh = 2: the master stops sending";
    with_brake(true, |master| {
        enable(master);
        run(master, 500, 0x0F, 0.0);
        run(master, 500, 0x0F, -0.5);
        // 99 ms of the last target, the ramp, and the lag of the loop.
        let fallen = fall(master, 1500, |master| master.rig.step_idle());
        let way = 0.5 * 0.099 + 0.5 * 0.5 * 0.5 / 50.0;
        vec![
            row(18, name, "way down, rad", fallen, 0.9 * way..=way + 0.05),
            row(
                18,
                name,
                "speed at the end, rad/s",
                master.rig.plant().velocity_rad_s().abs(),
                0.0..=0.001,
            ),
            row(18, name, "stays armed", flag(master.rig.is_armed()), 0.0..=0.0),
        ]
    })
}

#[test]
fn load_with_a_holding_brake_does_not_fall() {
    check(rows());
}
