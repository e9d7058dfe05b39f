//! Tests of the touch probe: which edge is stored, where, and what the status shows.

use super::bench::Bench;
use super::drive::in_cst;
use firmware::driver::{LoopReport, TouchEdges};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;

/// A hundredth of a turn of the rotor, 2^-32 turns, and its way at the joint, 1e-6 rad: a gear of 51.
const ANGLE: u32 = 42_949_673;
const WAY: i32 = 1232;
/// Half a period at 2 rad/s, 1e-6 rad.
const HALF_PERIOD: i32 = 50;

fn report(bench: &mut Bench, turned_rad: f32, (rotor_angle, touch): (u32, TouchEdges)) {
    bench.driver.joint.report(&LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        velocity_rad_s: 2.0,
        turned_rad,
        rotor_angle,
        touch,
        ..LoopReport::default()
    });
    bench.pass_ms(1);
}

fn function(bench: &mut Bench, word: u16) {
    bench.write(index::TOUCH_FUNCTION, 0, &word.to_le_bytes()).unwrap();
    assert_eq!(bench.number(index::TOUCH_FUNCTION, 0), word.into());
    // Edges of the first two reports may be older.
    for _ in 0..2 {
        let old = (ANGLE, TouchEdges { rise: Some(0), fall: Some(0) });
        report(bench, 0.0, old);
    }
}

fn position(bench: &mut Bench, at_index: u16) -> i32 {
    bench.number(at_index, 0) as i32
}

#[test]
fn touch_probe_stores_the_first_edge_or_each_edge_of_its_input() {
    let mut bench = in_cst();
    function(&mut bench, 0x0031);
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0x01);
    let rise = (ANGLE, TouchEdges { rise: Some(0), fall: None });
    report(&mut bench, 0.25, rise);
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0x43);
    let expected = 250_000 - WAY + HALF_PERIOD;
    let first = position(&mut bench, index::TOUCH_1_POSITIVE);
    assert!((first - expected).abs() <= 1, "{first}");
    let fall = (0, TouchEdges { rise: Some(0), fall: Some(ANGLE) });
    report(&mut bench, 0.5, fall);
    assert_eq!(position(&mut bench, index::TOUCH_1_POSITIVE), first, "the first one");
    let negative = position(&mut bench, index::TOUCH_1_NEGATIVE);
    assert!((negative - (500_000 + WAY + HALF_PERIOD)).abs() <= 1, "{negative}");
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0xC7);
    function(&mut bench, 0);
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0);
    function(&mut bench, 0x0013);
    for turned_rad in [0.25, 0.5] {
        report(&mut bench, turned_rad, rise);
    }
    // Twice: the bit is as it was.
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0x03);
    assert!((position(&mut bench, index::TOUCH_1_POSITIVE) - expected - 250_000).abs() <= 1);
}

#[test]
fn touch_probe_at_the_zero_stores_its_position_as_both_edges() {
    let mut bench = in_cst();
    function(&mut bench, 0x3500);
    let at = |angle: u32| (angle, TouchEdges { rise: Some(5), fall: None });
    report(&mut bench, 0.1 + 2e-6 * WAY as f32, at(ANGLE));
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0x0100);
    report(&mut bench, 0.1, at(ANGLE.wrapping_neg()));
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0xC700);
    for at_index in [index::TOUCH_2_POSITIVE, index::TOUCH_2_NEGATIVE] {
        let found = position(&mut bench, at_index);
        assert!((found - (100_000 + WAY)).abs() <= 1, "{found}");
    }
    // Half a turn away is no zero.
    function(&mut bench, 0);
    function(&mut bench, 0x3500);
    report(&mut bench, 0.2, at(0x7FFF_0000));
    report(&mut bench, 0.2, at(0x8001_0000));
    assert_eq!(bench.number(index::TOUCH_STATUS, 0), 0x0100);
}

#[test]
fn touch_probe_with_another_source_is_refused_with_the_reason() {
    let mut bench = in_cst();
    for word in [0x0019u16, 0x1900] {
        let written = bench.write(index::TOUCH_FUNCTION, 0, &word.to_le_bytes());
        assert_eq!(written, Err(0x0609_0030));
        bench.check_refusal("source of the touch probe", &["touch_probe_function", " 0 (", " 1 ("]);
    }
    assert_eq!(bench.number(index::TOUCH_FUNCTION, 0), 0);
}
