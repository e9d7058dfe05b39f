use super::*;
use std::f64::consts::TAU;

const POLE_PAIRS: f64 = 7.0;

/// Levels at this angle of the motor, turns. Each sensor is off by its own placement error.
fn levels(turns: f64, placement: [f64; 3]) -> u8 {
    let mut word = 0;
    for (sensor, off) in placement.into_iter().enumerate() {
        // Sensor k is high for half a turn, a third of a turn apart: 1 from -60 to 120 degrees, 2 from 60, 3 from 180.
        let begin = [-1.0 / 6.0, 1.0 / 6.0, 0.5][sensor] + off;
        let share = (turns * POLE_PAIRS - begin).rem_euclid(1.0);
        word |= u8::from(share < 0.5) << sensor;
    }
    word
}

fn encoder() -> HallEncoder {
    HallEncoder::new(POLE_PAIRS as f32)
}

/// Electrical error, rad.
fn error(evaluation: Evaluation, turns: f64) -> f64 {
    let Evaluation::Angle(angle) = evaluation else { panic!("{evaluation:?}") };
    let off = (f64::from(angle) / 4_294_967_296.0 - turns) * POLE_PAIRS;
    ((off + 0.5).rem_euclid(1.0) - 0.5) * TAU
}

#[test]
fn sectors_of_a_rising_angle_rise() {
    for (k, expected) in [0, 1, 2, 3, 4, 5].into_iter().enumerate() {
        let turns = (k as f64 + 0.5) / 6.0 / POLE_PAIRS;
        assert_eq!(sector(levels(turns, [0.0; 3])), Some(expected));
    }
    assert_eq!((sector(0), sector(7)), (None, None));
    assert_eq!((direction(5, 0), direction(0, 5), direction(2, 4)), (1, -1, 0));
}

#[test]
fn angle_at_rest_is_within_half_a_sector() {
    for k in 0..100 {
        let turns = f64::from(k) / 100.0;
        let mut encoder = encoder();
        let evaluation = encoder.evaluate(sector(levels(turns, [0.0; 3])));
        assert!(error(evaluation, turns).abs() <= TAU / 12.0 + 1e-3);
    }
}

#[test]
fn angle_at_speed_is_within_placement_errors() {
    // Sensors 3 degrees (electrical) off, 24 turns/s: 3 rad/s of the joint.
    let placement = [3.0 / 360.0, -3.0 / 360.0, 2.0 / 360.0];
    for direction in [1.0, -1.0] {
        let mut encoder = encoder();
        let mut most = 0.0f64;
        for k in 0..20_000 {
            let turns = direction * 24.0 * f64::from(k) * 50e-6;
            let evaluation = encoder.evaluate(sector(levels(turns, placement)));
            // The angle is a period old.
            let turns = turns - direction * 24.0 * 50e-6;
            if k > 1000 {
                most = most.max(error(evaluation, turns).abs());
            }
        }
        // Two placement errors change the speed that a sector shows, by a tenth; and a period is 3 degrees.
        assert!(most < 0.27, "{most}");
    }
}

#[test]
fn angle_in_any_motion_is_within_a_sector() {
    let mut encoder = encoder();
    for k in 0..200_000 {
        let t = f64::from(k) * 50e-6;
        let turns = 2.0 * (3.0 * t).sin() + 0.05 * (40.0 * t).sin();
        let evaluation = encoder.evaluate(sector(levels(turns, [0.0; 3])));
        let off = error(evaluation, turns).abs();
        // A sector, and what the motor turns while the angle returns to it.
        assert!(off < TAU / 6.0 + 0.2, "{off} at {t}");
    }
}

#[test]
fn illegal_levels_are_a_contradiction_after_three_periods() {
    let mut encoder = encoder();
    encoder.evaluate(Some(1));
    assert_eq!(encoder.evaluate(None), Evaluation::Missing);
    assert!(matches!(encoder.evaluate(Some(1)), Evaluation::Angle(_)));
    let three: Vec<_> = (0..3).map(|_| encoder.evaluate(None)).collect();
    assert_eq!(three, [Evaluation::Missing, Evaluation::Missing, Evaluation::Contradiction]);
}

#[test]
fn skipped_sector_is_a_contradiction() {
    let mut encoder = encoder();
    encoder.evaluate(Some(1));
    assert!(matches!(encoder.evaluate(Some(3)), Evaluation::Angle(_)), "a disturbance");
    assert_eq!(encoder.evaluate(Some(3)), Evaluation::Contradiction);
}

#[test]
fn level_of_one_period_does_not_move_the_angle() {
    let mut encoder = encoder();
    let before = encoder.evaluate(Some(1));
    for _ in 0..10 {
        encoder.evaluate(Some(2));
        let (Evaluation::Angle(one), Evaluation::Angle(other)) =
            (before, encoder.evaluate(Some(1)))
        else {
            panic!("no angle")
        };
        assert!(one.abs_diff(other) < 100, "{one} {other}");
    }
}

#[test]
fn stuck_sensor_is_found_within_an_electrical_turn() {
    for sensor in 0..3 {
        for level in [0u8, 1] {
            let mut encoder = encoder();
            let mut found = None;
            for k in 0..2000 {
                let turns = 3.0 / POLE_PAIRS * f64::from(k) / 2000.0;
                let mut word = levels(turns, [0.0; 3]);
                if turns * POLE_PAIRS > 1.0 {
                    word = word & !(1 << sensor) | level << sensor;
                }
                if encoder.evaluate(super::sector(word)) == Evaluation::Contradiction {
                    found.get_or_insert(turns * POLE_PAIRS);
                }
            }
            assert!(found.is_some_and(|at| at < 2.0), "{sensor} {level}: {found:?}");
        }
    }
}
