//! Scenarios 13 and 14: compensation with changing or failing inputs, and on joints it was not designed for.

use super::driver::STUCK_SENSORS;
use super::rig::{Joint, compute_in_parallel, set};
use super::table::{ScenarioRow, check, outside_row, row};
use compensator_core::ParameterId as Id;
use firmware::supervisor::Code;
use joint_rig::{RigFaults, SealSensorFault};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Maximum swing of a held joint, rad from end to end: half a degree. A larger swing is a limit cycle.
const MAX_SWING_RAD: f64 = 0.0087;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for (what, seal) in [
            ("sensors healthy", SealSensorFault::None),
            ("half of their frames lost", SealSensorFault::Dropped),
            ("no frames from 1.5 s on", SealSensorFault::Stale),
            ("constant values from 1.5 s on", SealSensorFault::Stuck),
            ("no such sensors", SealSensorFault::Absent),
        ] {
            rows.extend(steps(what, seal));
        }
        rows.push(one_frame());
        rows.extend(map(&[0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0]));
        rows
    });
    &ROWS
}

/// Side load and pressure change within `rise_ms` at every reversal of a velocity sine; then the joint is held.
fn course(share: f32, seal: SealSensorFault, rise_ms: f64) -> (f64, f64, f64, bool, usize) {
    let faults = RigFaults::seal_sensor(seal);
    let joint = Joint { faults, ..Joint::with(set(share)) };
    joint.run(|master| {
        master.arm().expect("it arms");
        let (mut sum, mut most) = (0.0, 0.0f64);
        for k in 0..4000 {
            let t = f64::from(k) * 1e-3;
            // Velocity is a cosine of 0.5 Hz, with reversals half-way between the seconds.
            let since_ms = f64::from((k + 500) % 1000);
            let risen = (since_ms / rise_ms).min(1.0);
            let high = if (k + 500) / 1000 % 2 == 1 { risen } else { 1.0 - risen };
            let high = if k < 500 { 0.0 } else { high };
            let stage = master.rig.stage_mut();
            stage.plant.side_load_n = 120.0 * high;
            stage.plant.around.pressure_diff_pa = 34.3e3 + 2.66e5 * high;
            let (sine, cosine) = (TAU * 0.5 * t).sin_cos();
            master.follow(cosine, -TAU * 0.5 * sine);
            if k >= 1000 {
                sum += (master.rig.plant().velocity_rad_s() - cosine).powi(2);
            }
            most = most.max(f64::from(master.rig.master_view().current_a).abs());
        }
        let at = master.rig.plant().position_rad();
        let swing = master.swing_rad(at);
        let limits = master.rig.active_limits();
        let stuck = [Code::RadialForceStuck, Code::PressureStuck];
        let reported = stuck.into_iter().filter(|code| limits.contains(*code)).count();
        ((sum / 3000.0).sqrt(), swing, most, master.rig.is_armed(), reported)
    })
}

fn steps(what: &str, seal: SealSensorFault) -> Vec<ScenarioRow> {
    let name = format!(
        "±1 rad/s at 0.5 Hz, side load 0/120 N and pressure 0.03/0.3 MPa in 50 ms at each reversal, then held; {what}"
    );
    let (error, swing, most, armed, reported) = course(0.9, seal, 50.0);
    let sticks =
        if seal == SealSensorFault::Stuck { STUCK_SENSORS..=STUCK_SENSORS } else { 0.0..=0.0 };
    let (without, ..) = course(0.0, seal, 50.0);
    vec![
        row(13, &name, "error over that without compensation", error / without, 0.0..=1.05),
        row(13, &name, "swing while held, rad", swing, 0.0..=MAX_SWING_RAD),
        row(13, &name, "largest current, A", most, 1.0..=26.5),
        row(13, &name, "stays armed", f64::from(u8::from(armed)), 1.0..=1.0),
        row(13, &name, "sensors of two reported as stuck", reported as f64, sticks),
    ]
}

/// The same steps between two frames of the sensor.
fn one_frame() -> ScenarioRow {
    let name = "the same with side load and pressure that step from one frame to the next";
    let (.., armed, _) = course(0.9, SealSensorFault::None, 1.0);
    row(13, name, "stays armed", f64::from(u8::from(armed)), 1.0..=1.0)
}

/// Coupling compliance and backlash, friction levels 20 % off, and these multiples of the inertia that the master assumes.
fn map(inertias: &[f64]) -> Vec<ScenarioRow> {
    let couplings: &[(f64, f64, &str)] = &[
        (0.0, 0.0, "rigid"),
        (2000.0, 0.0, "2000 Nm/rad"),
        (2000.0, 0.003, "2000 Nm/rad and 3 mrad of play"),
    ];
    let levels = [0.8f32, 1.0, 1.2];
    let joints: Vec<_> = couplings
        .iter()
        .flat_map(|(stiffness, play, _)| levels.map(|level| (*stiffness, *play, level)))
        .flat_map(|(stiffness, play, level)| {
            inertias.iter().map(move |inertia| (*inertia, stiffness, play, level))
        })
        .collect();
    let corners = compute_in_parallel(&joints, |at| (corner(*at, 0.9), corner(*at, 0.0)));
    let mut of_rows = corners.chunks(inertias.len());
    let mut rows = Vec::new();
    for (stiffness, play, what) in couplings {
        for level in levels {
            let (mut swings, mut cycles, mut most, mut armed) = (0.0f64, 0, 0.0f64, true);
            let mut reported = 0.0;
            for &((swing, current, stays, is_reported), (without, ..)) in
                of_rows.next().expect("a row")
            {
                reported += is_reported;
                // A joint that also hunts without compensation is not counted.
                swings = swings.max(swing - without);
                cycles += u8::from(swing - without > MAX_SWING_RAD);
                most = most.max(current);
                armed &= stays;
            }
            let name = format!(
                "coupling {what}, friction levels x{level}, inertia x0.3 to x3: 0.3 rad move, then held (worst)"
            );
            let figure = "swing while held minus that without compensation, rad";
            // 0.9 of a level 20 % too high is 1.08 of the friction, an over-compensation until the driver detects it.
            let known = level == 0.8 || level == 1.2 && *stiffness == 0.0;
            let judged = if known { outside_row } else { row };
            let count = f64::from(cycles);
            rows.push(judged(14, &name, "inertias of 7 that swing more", count, 0.0..=0.0));
            rows.push(judged(14, &name, figure, swings, -0.2..=MAX_SWING_RAD));
            rows.push(row(14, &name, "largest current, A", most, 0.5..=26.5));
            let figure = "inertias of 7 reported as over-compensated";
            let limits = if level == 1.2 { 6.0..=7.0 } else { 0.0..=1.0 };
            // A compliant coupling lets the motor move while the seal sticks.
            let judged =
                if level == 0.8 && *stiffness > 0.0 && *play == 0.0 { outside_row } else { row };
            rows.push(judged(14, &name, figure, reported, limits));
            rows.push(row(14, &name, "stays armed", f64::from(u8::from(armed)), 1.0..=1.0));
        }
    }
    rows
}

fn corner(
    (inertia, stiffness, play, level): (f64, f64, f64, f32),
    share: f32,
) -> (f64, f64, bool, f64) {
    let mut joint = Joint::with(set(share));
    joint.constants.rotor_inertia_kg_m2 *= inertia;
    joint.constants.output_inertia_kg_m2 *= inertia;
    joint.constants.output_stiffness_nm_per_rad = stiffness;
    joint.constants.backlash_rad = play;
    let model = &mut joint.set.as_mut().expect("a set").friction.model;
    for id in [Id::CoulombTorque, Id::StaticTorque] {
        model.set(id, model.get(id) * level);
    }
    joint.run(|master| {
        master.scale_inertia(1.0 / inertia);
        master.arm().expect("it arms");
        let from = master.rig.plant().position_rad();
        let mut most = 0.0f64;
        for k in 0..600 {
            master.hold(from + 0.3 * (f64::from(k) / 300.0).min(1.0));
            most = most.max(f64::from(master.rig.master_view().current_a).abs());
        }
        let swing = master.swing_rad(from + 0.3);
        let limits = master.rig.active_limits();
        let is_reported = limits.iter().any(|code| code.info().name == "over-compensated");
        (swing, most, master.rig.is_armed(), f64::from(u8::from(is_reported)))
    })
}

#[test]
fn input_steps_dropouts_and_other_joints_make_no_limit_cycle() {
    check(rows());
}
