//! Scenarios 1 and 2: a joint from power-up to disarming, and one with a blank flash.

use super::rig::{Joint, set};
use super::table::{ScenarioRow, check, row};
use std::f64::consts::TAU;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> =
        LazyLock::new(|| [power_cycle(0.0), power_cycle(0.9), blank()].concat());
    &ROWS
}

/// Power-up, start, homing, arming, a sine of velocity, and disarming, by CAN frames alone.
fn power_cycle(share: f32) -> Vec<ScenarioRow> {
    let what = if share > 0.0 { "with compensation (0.9)" } else { "without compensation" };
    let name = format!("power-up, arm, 2 s of ±2 rad/s at 1 Hz, disarm, {what}");
    let joint = Joint::with(set(share));
    let (error, arming, driven_before, opened, current) = joint.run(|master| {
        master.rig.stage_mut().take_extremes();
        (0..50).for_each(|_| master.rig.step_idle());
        let before = master.rig.stage_mut().take_extremes().driven_periods;
        master.arm().expect("it arms");
        // The rig waits 60 ms for arming; the bridge is closed for the rest of that time.
        let arming = 60.0 - f64::from(master.rig.stage_mut().take_extremes().driven_periods) / 20.0;
        let (mut sum, mut most) = (0.0, 0.0f64);
        for k in 0..3000 {
            let t = f64::from(k) * 1e-3;
            let (sine, cosine) = (TAU * t).sin_cos();
            master.follow(2.0 * sine, 2.0 * TAU * cosine);
            if k >= 1000 {
                sum +=
                    (master.rig.plant().velocity_rad_s() - 2.0 * ((t + 1e-3) * TAU).sin()).powi(2);
            }
            most = most.max(f64::from(master.rig.master_view().current_a).abs());
        }
        assert!(master.rig.is_armed(), "{:?}", master.faults());
        master.rig.request_state(0);
        master.rig.stage_mut().take_extremes();
        master.current(20, 5.0);
        let opened = f64::from(master.rig.stage_mut().take_extremes().driven_periods) / 20.0;
        ((sum / 2000.0).sqrt(), arming, before, opened, most)
    });
    let bound = if share > 0.0 { 0.0..=0.3 } else { 0.3..=1.42 };
    vec![
        row(1, &name, "periods driven before arming", f64::from(driven_before), 0.0..=0.0),
        row(1, &name, "arm request to closed bridge, ms", arming, 12.8..=16.0),
        row(1, &name, "RMS velocity error, rad/s", error, bound),
        row(1, &name, "largest current, A", current, 1.0..=26.5),
        row(1, &name, "disarm request to open bridge, ms", opened, 0.0..=2.0),
    ]
}

/// A blank flash, with every way to request driving.
fn blank() -> Vec<ScenarioRow> {
    let name =
        "blank flash: arm by object and by controlword, commit a friction parameter, arm again";
    let joint = Joint { set: None, commissioned: false, ..Joint::with(set(0.0)) };
    let (driven, moved, refused, armed) = joint.run(|master| {
        let from = master.rig.plant().position_rad();
        let mut refused = 0;
        master.rig.stage_mut().take_extremes();
        for round in 0..3 {
            refused += u8::from(master.arm().is_err());
            // CiA 402: mode 10, then 6, 7, 15.
            master.rig.send_immediately(0x601, &[0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]);
            for word in [6u8, 7, 15] {
                master.rig.send_immediately(0x601, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]);
                master.rig.send_immediately(0x601, &[0x2B, 0x71, 0x60, 0, 0xE8, 3, 0, 0]);
                master.current(20, 10.0);
            }
            master.rig.send_immediately(0x601, &[0x2F, 0x60, 0x60, 0, 0, 0, 0, 0]);
            if round == 0 {
                let mut changed = firmware::parameter_set::ParameterSet::default();
                changed.friction.compensator.scale = 0.5;
                master.rig.write_object(0x2022, 1, 0.5f32.to_le_bytes());
                master.rig.write_object(0x2027, 3, changed.crc().to_le_bytes());
            }
            master.rig.request_state(2);
        }
        assert_eq!(master.rig.read_object(0x2022, 1), Some(0.5f32.to_bits()));
        let driven = master.rig.stage_mut().take_extremes().driven_periods;
        let moved = (master.rig.plant().position_rad() - from).abs();
        // Confirming the wiring must allow arming; otherwise the test above would show nothing.
        master.rig.unlock().expect("the default key");
        let wiring = master.rig.read_object(0x200A, 2).expect("a CRC");
        master.rig.write_object(0x200A, 3, wiring.to_le_bytes());
        master.rig.request_state(2);
        (driven, moved, refused, master.arm().is_ok())
    });
    vec![
        row(2, name, "times refused, of 3", f64::from(refused), 3.0..=3.0),
        row(2, name, "periods driven", f64::from(driven), 0.0..=0.0),
        row(2, name, "moved, rad", moved, 0.0..=1e-6),
        row(2, "then the wiring is confirmed", "arms", f64::from(u8::from(armed)), 1.0..=1.0),
    ]
}

#[test]
fn driver_from_power_up_follows_and_blank_driver_never_drives() {
    check(rows());
}
