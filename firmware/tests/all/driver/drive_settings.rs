//! Tests of the settings of the drive: their ranges, their storage, and which of them an enabled drive accepts.

use super::bench::Bench;
use super::drive::{control, enabled, in_cst, pass};
use firmware::control::MotorParameters;
use firmware::driver::Boot;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;

#[test]
fn drive_settings_are_checked_stored_and_restored() {
    let mut bench = in_cst();
    assert!(bench.write(index::QUICK_STOP_OPTION, 0, &3i16.to_le_bytes()).is_err());
    bench.check_refusal("quick stop option", &["quick_stop_option", "-1, 0, 1, 2, 5", "6"]);
    bench.write(index::QUICK_STOP_OPTION, 0, &(-1i16).to_le_bytes()).unwrap();
    assert_eq!(bench.number(index::QUICK_STOP_OPTION, 0) as i16, -1);
    bench.write(index::POSITION_LIMITS, 1, &(-500_000i32).to_le_bytes()).unwrap();
    bench.write(index::HOLDING_BRAKE, 2, &60u16.to_le_bytes()).unwrap();
    assert!(bench.write(index::HOLDING_BRAKE, 6, &[1]).is_err(), "only the driver releases");
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    assert_eq!(bench.number(index::QUICK_STOP_OPTION, 0) as i16, -1);
    assert_eq!(bench.number(index::POSITION_LIMITS, 1) as i32, -500_000);
    assert_eq!(bench.number(index::HOLDING_BRAKE, 2), 60);
}

/// A motor whose short circuit exceeds the overcurrent level can be neither given the reaction nor combined with it.
#[test]
fn shorted_low_sides_are_refused_for_a_motor_with_a_large_short_circuit_current() {
    let place = MotorParameters::NAMES.iter().position(|name| *name == "overcurrent_a").unwrap();
    let limit = MotorParameters::NAMES.iter().position(|name| *name == "current_limit_a").unwrap();
    let low = |bench: &mut Bench| {
        bench.write(index::MOTOR, limit as u8 + 1, &5f32.to_le_bytes()).unwrap();
        bench.write(index::MOTOR, place as u8 + 1, &6f32.to_le_bytes()).unwrap();
        let crc = bench.number(index::COMMIT, 2);
        bench.write(index::COMMIT, 3, &crc.to_le_bytes())
    };
    let mut bench = in_cst();
    low(&mut bench).unwrap();
    assert!(bench.write(index::FAULT_OPTION, 0, &(-1i16).to_le_bytes()).is_err());
    bench.check_refusal("fault option", &["overcurrent_a"]);
    let mut bench = in_cst();
    bench.write(index::FAULT_OPTION, 0, &(-1i16).to_le_bytes()).unwrap();
    assert!(low(&mut bench).is_err());
    assert!(bench.text(index::REFUSAL).starts_with("overcurrent_a"));
}

#[test]
fn armed_drive_accepts_ramps_of_its_moves_and_no_other_setting() {
    let mut bench = enabled();
    for at_index in [index::PROFILE_VELOCITY, index::ACCELERATION, index::DECELERATION] {
        bench.write(at_index, 0, &500_000u32.to_le_bytes()).unwrap();
    }
    for (at_index, sub_index) in
        [(index::QUICK_DECELERATION, 0), (index::POSITION_LIMITS, 1), (index::POSITION_LOOP, 1)]
    {
        let refused = bench.write(at_index, sub_index, &500_000u32.to_le_bytes());
        assert_eq!(refused, Err(0x0800_0022), "{at_index:04X}");
    }
}

#[test]
fn limits_and_heartbeat_change_while_enabled_and_deadlines_do_not() {
    let mut bench = enabled();
    control(&mut bench, 0x0F, 500);
    assert!(
        (bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a - 13.0).abs() < 1e-4
    );
    bench.write(index::MAX_TORQUE, 0, &300u16.to_le_bytes()).unwrap();
    control(&mut bench, 0x0F, 500);
    assert!((bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a - 7.8).abs() < 1e-4);
    bench.write(index::MAX_MOTOR_SPEED, 0, &487u32.to_le_bytes()).unwrap();
    bench.write(index::HOME_OFFSET, 0, &1000i32.to_le_bytes()).unwrap();
    bench.write(0x1800, 3, &10u16.to_le_bytes()).unwrap();
    bench.write(0x1800, 5, &20u16.to_le_bytes()).unwrap();
    bench.sent();
    bench.write(index::HEARTBEAT, 0, &10u16.to_le_bytes()).unwrap();
    for _ in 0..10 {
        control(&mut bench, 0x0F, 500);
        pass(&mut bench, 5);
    }
    let heartbeats = bench.sent().iter().filter(|frame| frame.identifier() == 0x701).count();
    assert_eq!(heartbeats, 5);
    for (at_index, sub_index, value) in [
        (0x1016, 1, &[0u8; 4][..]),
        (0x1400, 5, &[50, 0]),
        (0x1800, 1, &[0x81, 1, 0, 0x80]),
        (index::MODE, 0, &[0]),
        (index::COMPENSATOR, 1, &[0; 4]),
    ] {
        let refused = bench.write(at_index, sub_index, value);
        assert_eq!(refused, Err(0x0800_0022), "{at_index:04X}h");
    }
    assert!(bench.driver.joint.is_armed());
}
