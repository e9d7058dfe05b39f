//! Feed-forward of a master, 60B1h and 60B2h: limits, decay, and the change of the mode.

use super::bench::Bench;
use firmware::driver::LoopReport;
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;

const CSV: u8 = 9;
const CST: u8 = 10;
const ENABLED: u8 = 0x0F;

/// Passes milliseconds of an enabled joint, with a target torque of 0 in each.
fn pass(bench: &mut Bench, milliseconds: usize, offset_permille: Option<i16>) {
    for _ in 0..milliseconds {
        if let Some(permille) = offset_permille {
            bench.write(index::TORQUE_OFFSET, 0, &permille.to_le_bytes()).unwrap();
        }
        bench.write(index::TARGET_TORQUE, 0, &[0, 0]).unwrap();
        bench.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            ..LoopReport::default()
        });
        bench.pass_ms(1);
        bench.sent();
    }
}

fn commanded_a(bench: &Bench) -> f32 {
    bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a
}

fn enabled() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.commission();
    bench.start();
    bench.write(index::MODE, 0, &[CST]).unwrap();
    for controlword in [6, 7, ENABLED] {
        bench.write(index::CONTROLWORD, 0, &[controlword, 0]).unwrap();
        pass(&mut bench, 5, None);
    }
    assert!(bench.driver.joint.is_armed());
    bench
}

#[test]
fn torque_offset_acts_within_the_largest_torque_and_decays_without_its_master() {
    let mut bench = enabled();
    let rated_a = bench.driver.joint.set().motor.current_limit_a;
    pass(&mut bench, 20, Some(200));
    assert!((commanded_a(&bench) - 0.2 * rated_a).abs() < 1e-3, "{}", commanded_a(&bench));
    bench.write(index::MAX_TORQUE, 0, &100i16.to_le_bytes()).unwrap();
    pass(&mut bench, 5, Some(200));
    assert!((commanded_a(&bench) - 0.1 * rated_a).abs() < 1e-3, "{}", commanded_a(&bench));
    bench.write(index::MAX_TORQUE, 0, &1000i16.to_le_bytes()).unwrap();
    pass(&mut bench, 600, None);
    assert_eq!(commanded_a(&bench), 0.0, "it is stale");
}

#[test]
fn change_of_the_mode_ends_both_offsets() {
    let mut bench = enabled();
    pass(&mut bench, 20, Some(200));
    bench.write(index::VELOCITY_OFFSET, 0, &500_000i32.to_le_bytes()).unwrap();
    for mode in [CSV, CST] {
        bench.write(index::MODE, 0, &[mode]).unwrap();
        assert_eq!(bench.number(index::TORQUE_OFFSET, 0), 0, "mode {mode}");
        assert_eq!(bench.number(index::VELOCITY_OFFSET, 0), 0, "mode {mode}");
        bench.write(index::TARGET_TORQUE, 0, &[0, 0]).unwrap();
        bench.write(index::TORQUE_OFFSET, 0, &100i16.to_le_bytes()).unwrap();
        bench.write(index::VELOCITY_OFFSET, 0, &500_000i32.to_le_bytes()).unwrap();
        pass(&mut bench, 3, None);
    }
}
