//! Tests of the encoder at the joint's side of the gear: its position, the difference of both sides, and its faults.

use super::bench::Bench;
use super::drive::{control, in_cst};
use firmware::background::BoardState;
use firmware::driver::LoopReport;
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::OperationObject;
use firmware::sensors::biss::WORDS;
use firmware::supervisor::Code;

/// Counts of a turn of the joint's encoder, and of the rotor per turn of the joint: a gear of 51.
const COUNTS: f64 = 262_144.0;
const GEAR: f64 = 51.0;
/// An open line.
const OPEN: [u16; WORDS] = [0x3FFF; WORDS];

/// Words of a frame with this position: two clocks idle, two busy, start and CDS.
fn words(joint_rad: f64) -> [u16; WORDS] {
    let position = (joint_rad / std::f64::consts::TAU * COUNTS).rem_euclid(COUNTS) as u64;
    let covered = position << 2 | 3;
    let mut remainder = covered << 6;
    for bit in (6..26).rev() {
        if remainder >> bit & 1 == 1 {
            remainder ^= 0b100_0011 << (bit - 6);
        }
    }
    let frame = (0b11_00_10 << 26 | covered << 6 | !remainder & 0x3F) << 24;
    std::array::from_fn(|word| (frame >> (42 - 14 * word) & 0x3FFF) as u16)
}

/// Passes a report with the motor at this position, rad at the joint, and a frame.
fn report(bench: &mut Bench, motor_rad: f64, words: [u16; WORDS]) {
    let turns = (motor_rad * GEAR / std::f64::consts::TAU).rem_euclid(1.0);
    bench
        .driver
        .joint
        .take_board_state(&BoardState { joint_words: Some(words), ..BoardState::default() });
    bench.driver.joint.report(&LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        sample_age_us: Some(0),
        rotor_angle: (turns * 4_294_967_296.0) as u32,
        ..LoopReport::default()
    });
    bench.pass_ms(1);
}

fn position_rad(bench: &mut Bench) -> f64 {
    1e-6 * f64::from(bench.number(index::ADDITIONAL_POSITION, 1) as i32)
}

fn difference_rad(bench: &mut Bench) -> f32 {
    f32::from_bits(bench.number(index::JOINT_ENCODER, 1))
}

fn state(bench: &mut Bench) -> u32 {
    bench.number(index::JOINT_ENCODER, 2)
}

fn is_warned(bench: &Bench) -> bool {
    bench.driver.joint.supervisor().limits().contains(Code::EncoderMagnet)
}

#[test]
fn position_of_the_joint_counts_turns_and_is_missing_without_a_frame() {
    let mut bench = in_cst();
    assert_eq!(bench.number(index::ADDITIONAL_POSITION, 1), 0x8000_0000, "no frame yet");
    // Slower than half a turn of the rotor in a report.
    for k in 0..=300 {
        let at_rad = 0.05 * f64::from(k);
        report(&mut bench, at_rad, words(at_rad));
    }
    assert!((position_rad(&mut bench) - 15.0).abs() < 3e-5, "{}", position_rad(&mut bench));
    assert!(difference_rad(&mut bench).abs() < 5e-5 && !is_warned(&bench));
    report(&mut bench, 15.02, OPEN);
    assert_eq!(bench.number(index::ADDITIONAL_POSITION, 1), 0x8000_0000);
    assert_eq!((state(&mut bench), is_warned(&bench)), (1, true));
    report(&mut bench, 15.04, words(15.04));
    assert!((position_rad(&mut bench) - 15.04).abs() < 3e-5);
    assert!(state(&mut bench) == 0 && is_warned(&bench), "until 0.5 s later");
    (0..700).for_each(|_| report(&mut bench, 15.04, words(15.04)));
    assert!(!is_warned(&bench));
}

#[test]
fn frames_that_jump_are_left_out_until_the_fourth_in_a_row() {
    let mut bench = in_cst();
    (0..3).for_each(|_| report(&mut bench, 0.1, words(0.2)));
    for k in 1..=3 {
        report(&mut bench, 0.1, words(0.25));
        assert_eq!((state(&mut bench), is_warned(&bench)), (2, true), "{k}");
        assert_eq!(bench.number(index::ADDITIONAL_POSITION, 1), 0x8000_0000);
    }
    report(&mut bench, 0.1, words(0.25));
    assert_eq!(state(&mut bench), 0);
    assert!((position_rad(&mut bench) - 0.25).abs() < 3e-5);
    assert!((difference_rad(&mut bench) - 0.05).abs() < 5e-5);
    // Motion of both sides is no jump.
    report(&mut bench, 0.14, words(0.29));
    assert_eq!(state(&mut bench), 0);
}

#[test]
fn sides_that_differ_by_more_than_the_window_stop_an_armed_joint_only() {
    let mut bench = in_cst();
    let drift = |bench: &mut Bench, from: i32, to: i32| {
        for k in from..=to {
            report(bench, 0.0, words(0.3 + 1e-3 * f64::from(k)));
        }
    };
    drift(&mut bench, 0, 100);
    assert!(bench.driver.joint.supervisor().faults().is_empty(), "not armed");
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 0);
        drift(&mut bench, 100, 101);
    }
    assert!(bench.driver.joint.is_armed());
    for k in 100..=150 {
        control(&mut bench, 0x0F, 0);
        drift(&mut bench, k, k);
    }
    assert!(bench.driver.joint.is_armed(), "{}", difference_rad(&mut bench));
    bench.sent();
    control(&mut bench, 0x0F, 0);
    drift(&mut bench, 153, 153);
    assert!(bench.driver.joint.supervisor().faults().contains(Code::FollowingError));
    let sent = bench.sent();
    let emergency = sent.iter().find(|frame| frame.identifier() == 0x081).expect("an emergency");
    assert_eq!(emergency.data()[3..5], [30, 3], "code and state");
    assert!((difference_rad(&mut bench) - 0.053).abs() < 1.2e-3);
    // The difference of the next arming counts from there.
    drift(&mut bench, 153, 154);
    bench.write(index::STATE, 1, &[2]).unwrap();
    assert!(bench.driver.joint.supervisor().faults().is_empty());
}

#[test]
fn joint_encoder_of_a_joint_in_hil_has_no_position() {
    let mut bench = Bench::on_sensors();
    (0..3).for_each(|_| report(&mut bench, 0.1, words(0.2)));
    report(&mut bench, 0.1, words(0.203));
    assert!((position_rad(&mut bench) - 0.203).abs() < 3e-5);
    assert!((difference_rad(&mut bench) - 0.003).abs() < 5e-5);
    bench.write(index::OPERATION, OperationObject::SOURCE, &[1]).expect("HIL");
    report(&mut bench, 0.1, words(0.25));
    assert_eq!(bench.number(index::ADDITIONAL_POSITION, 1), 0x8000_0000);
    assert_eq!((state(&mut bench), difference_rad(&mut bench)), (0, 0.0));
    // On its sensors again, it begins anew.
    bench.write(index::OPERATION, OperationObject::SOURCE, &[0]).expect("its sensors");
    report(&mut bench, 0.1, words(0.25));
    assert!((position_rad(&mut bench) - 0.25).abs() < 3e-5);
    assert_eq!((state(&mut bench), difference_rad(&mut bench)), (0, 0.0));
}
