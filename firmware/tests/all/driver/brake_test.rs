//! Tests of the brake test: when it is due, what ends it, and what it reports.

use super::bench::Bench;
use super::drive::{control, in_cst};
use firmware::driver::LoopReport;
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;

const HOUR_US: u64 = 3_600_000_000;
const ORDER: u8 = 11;
const RESULT: u8 = 12;

/// Creates a commissioned joint whose brake is tested with 0.4 of 26 A.
fn with_test() -> Bench {
    let mut bench = in_cst();
    for (place, value) in [(1, &[1][..]), (7, &[0x90, 1]), (8, &[50, 0])] {
        bench.write(index::HOLDING_BRAKE, place, value).unwrap();
    }
    bench
}

/// Runs this time on a joint whose current follows, and which turns by this share of its torque, rad/A. Returns the largest
/// current.
fn run(bench: &mut Bench, milliseconds: u32, word: Option<u16>, rad_per_a: f32) -> f32 {
    let mut most_a = 0.0f32;
    for _ in 0..milliseconds {
        if let Some(word) = word {
            control(bench, word, 0);
        }
        let current_a = bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a;
        most_a = most_a.max(current_a.abs());
        bench.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            current_a,
            turned_rad: rad_per_a * current_a,
            ..LoopReport::default()
        });
        bench.pass_ms(1);
    }
    most_a
}

/// Enables the drive and returns the largest current.
fn enable(bench: &mut Bench, rad_per_a: f32) -> f32 {
    for word in [0x06, 0x07] {
        run(bench, 2, Some(word), rad_per_a);
    }
    run(bench, 800, Some(0x0F), rad_per_a)
}

fn presses(current_a: f32) -> bool {
    (current_a - 10.4).abs() < 0.1
}

#[test]
fn brake_is_tested_at_the_first_arming_and_a_day_of_operation_later() {
    let mut bench = with_test();
    assert!(presses(enable(&mut bench, 0.0)) && bench.driver.joint.is_armed());
    assert_eq!(bench.number(index::HOLDING_BRAKE, RESULT), 2);
    for (hours, is_due) in [(0, false), (23, false), (2, true), (23, false)] {
        run(&mut bench, 2, Some(0), 0.0);
        bench.now_us += hours * HOUR_US;
        run(&mut bench, 200, Some(0), 0.0);
        assert_eq!(presses(enable(&mut bench, 0.0)), is_due, "{hours} h later");
        assert!(bench.driver.joint.is_armed());
    }
}

#[test]
fn brake_that_slipped_is_tested_at_every_arming_and_named() {
    let mut bench = with_test();
    bench.write(index::HOLDING_BRAKE, 10, &[0, 0]).unwrap();
    assert!(!presses(enable(&mut bench, 0.0)), "on request only");
    run(&mut bench, 2, Some(0), 0.0);
    bench.write(index::HOLDING_BRAKE, ORDER, &[1]).unwrap();
    // Slips beyond 20 mrad at 8 A.
    let slipping = 2.5e-3;
    assert!(run(&mut bench, 400, None, slipping) < 8.5);
    assert!(!bench.driver.joint.is_armed());
    assert_eq!(bench.number(index::HOLDING_BRAKE, RESULT), 3);
    let forwards = bench.number(index::HOLDING_BRAKE, 13);
    assert!((20_000..22_000).contains(&forwards), "{forwards}");
    bench.check_refusal("holding brake slipped", &[]);
    assert!(enable(&mut bench, slipping) > 7.0 && !bench.driver.joint.is_armed());
    assert!(presses(enable(&mut bench, 0.0)) && bench.driver.joint.is_armed(), "it holds again");
    run(&mut bench, 2, Some(0), 0.0);
    assert!(!presses(enable(&mut bench, 0.0)));
}

#[test]
fn brake_test_without_brake_or_torque_is_refused_with_the_reason() {
    let mut bench = in_cst();
    assert_eq!(bench.write(index::HOLDING_BRAKE, ORDER, &[1]), Err(0x0800_0022));
    bench.check_refusal("no holding brake", &[]);
    bench.write(index::HOLDING_BRAKE, 1, &[1]).unwrap();
    assert_eq!(bench.write(index::HOLDING_BRAKE, ORDER, &[1]), Err(0x0800_0022));
    bench.check_refusal("holding brake without torque", &["2030h:7 = 0"]);
    assert!(!presses(enable(&mut bench, 0.0)), "off by default");
    assert_eq!(bench.number(index::HOLDING_BRAKE, RESULT), 0);
}
