//! Scenarios 1 and 2: a joint from power-up to disarming, and one with a blank flash.

use super::rig::{Joint, Master, set};
use super::table::{ScenarioRow, check, row};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{CommissioningObject, CommitObject};
use firmware::parameter_set::ParameterSet;
use joint_rig::{ARMING_TIMEOUT_MS, PERIODS_PER_MS};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Sub-index of the compensated share, and of the CRC of the active set.
const SCALE: u8 = 1;
const ACTIVE_CRC: u8 = 1;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> =
        LazyLock::new(|| [power_cycle(0.0), power_cycle(0.9), blank()].concat());
    &ROWS
}

/// What a joint did from power-up to disarming.
struct PowerCycle {
    periods_before_arming: u32,
    arming_ms: f64,
    rms_error_rad_s: f64,
    current_max_a: f64,
    disarming_ms: f64,
}

/// What a joint with a blank flash did.
struct BlankCycle {
    arming_refusals: u8,
    driven_periods: u32,
    moved_rad: f64,
    is_armed_with_wiring: bool,
}

/// Returns the time that the bridge was driven since the last call, ms.
fn take_driven_ms(master: &mut Master) -> f64 {
    f64::from(master.rig.stage_mut().take_extremes().driven_periods) / PERIODS_PER_MS as f64
}

/// Power-up, start, homing, arming, a sine of velocity, and disarming, by CAN frames alone.
fn power_cycle(share: f32) -> Vec<ScenarioRow> {
    let what = if share > 0.0 { "with compensation (0.9)" } else { "without compensation" };
    let name = format!("power-up, arm, 2 s of ±2 rad/s at 1 Hz, disarm, {what}");
    let joint = Joint::with(set(share));
    let cycle = joint.run(|master| {
        master.rig.stage_mut().take_extremes();
        (0..50).for_each(|_| master.rig.step_idle());
        let periods_before_arming = master.rig.stage_mut().take_extremes().driven_periods;
        master.arm().expect("it arms");
        // The rig waits for the whole timeout; the bridge is closed for the rest of that time.
        let arming_ms = ARMING_TIMEOUT_MS as f64 - take_driven_ms(master);
        let (mut sum, mut current_max_a) = (0.0, 0.0f64);
        for k in 0..3000 {
            let t = f64::from(k) * 1e-3;
            let (sine, cosine) = (TAU * t).sin_cos();
            master.follow(2.0 * sine, 2.0 * TAU * cosine);
            if k >= 1000 {
                sum +=
                    (master.rig.plant().velocity_rad_s() - 2.0 * ((t + 1e-3) * TAU).sin()).powi(2);
            }
            current_max_a = current_max_a.max(f64::from(master.rig.master_view().current_a).abs());
        }
        assert!(master.rig.is_armed(), "{:?}", master.faults());
        master.rig.request_state(0);
        master.rig.stage_mut().take_extremes();
        master.current(20, 5.0);
        PowerCycle {
            periods_before_arming,
            arming_ms,
            rms_error_rad_s: (sum / 2000.0).sqrt(),
            current_max_a,
            disarming_ms: take_driven_ms(master),
        }
    });
    let bound = if share > 0.0 { 0.0..=0.3 } else { 0.3..=1.42 };
    vec![
        row(
            1,
            &name,
            "periods driven before arming",
            cycle.periods_before_arming.into(),
            0.0..=0.0,
        ),
        row(1, &name, "arm request to closed bridge, ms", cycle.arming_ms, 12.8..=16.0),
        row(1, &name, "RMS velocity error, rad/s", cycle.rms_error_rad_s, bound),
        row(1, &name, "largest current, A", cycle.current_max_a, 1.0..=26.5),
        row(1, &name, "disarm request to open bridge, ms", cycle.disarming_ms, 0.0..=2.0),
    ]
}

/// A blank flash, with every way to request driving.
fn blank() -> Vec<ScenarioRow> {
    let name =
        "blank flash: arm by object and by controlword, commit a friction parameter, arm again";
    let joint = Joint { set: None, commissioned: false, ..Joint::with(set(0.0)) };
    let mut changed = ParameterSet::default();
    changed.friction.compensator.scale = 0.5;
    let cycle = joint.run(|master| {
        let from = master.rig.plant().position_rad();
        let mut arming_refusals = 0;
        master.rig.stage_mut().take_extremes();
        for round in 0..3 {
            arming_refusals += u8::from(master.arm().is_err());
            // CiA 402: mode 10, then 6, 7, 15.
            master.rig.send_immediately(0x601, &[0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]);
            for word in [6u8, 7, 15] {
                master.rig.send_immediately(0x601, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]);
                master.rig.send_immediately(0x601, &[0x2B, 0x71, 0x60, 0, 0xE8, 3, 0, 0]);
                master.current(20, 10.0);
            }
            master.rig.send_immediately(0x601, &[0x2F, 0x60, 0x60, 0, 0, 0, 0, 0]);
            if round == 0 {
                master.rig.write_object(index::COMPENSATOR, SCALE, 0.5f32.to_le_bytes());
                let crc = changed.crc().to_le_bytes();
                master.rig.write_object(index::COMMIT, CommitObject::COMMIT, crc);
            }
            master.rig.request_state(2);
        }
        assert_eq!(master.rig.read_object(index::COMMIT, ACTIVE_CRC), Some(changed.crc()));
        let driven_periods = master.rig.stage_mut().take_extremes().driven_periods;
        let moved_rad = (master.rig.plant().position_rad() - from).abs();
        // Confirming the wiring must allow arming; otherwise the test above would show nothing.
        master.rig.unlock().expect("the default key");
        let (object, crc) = (index::COMMISSIONING, CommissioningObject::WIRING_CRC);
        let wiring = master.rig.read_object(object, crc).expect("a CRC");
        master.rig.write_object(object, CommissioningObject::CONFIRM, wiring.to_le_bytes());
        master.rig.request_state(2);
        let is_armed_with_wiring = master.arm().is_ok();
        BlankCycle { arming_refusals, driven_periods, moved_rad, is_armed_with_wiring }
    });
    vec![
        row(2, name, "times refused, of 3", cycle.arming_refusals.into(), 3.0..=3.0),
        row(2, name, "periods driven", cycle.driven_periods.into(), 0.0..=0.0),
        row(2, name, "moved, rad", cycle.moved_rad, 0.0..=1e-6),
        row(
            2,
            "then the wiring is confirmed",
            "arms",
            u8::from(cycle.is_armed_with_wiring).into(),
            1.0..=1.0,
        ),
    ]
}

#[test]
fn driver_from_power_up_follows_and_blank_driver_never_drives() {
    check(rows());
}
