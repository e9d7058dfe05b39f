use super::*;
use crate::sensors::hall::sector;
use std::f64::consts::PI;

const LINES: f32 = 1000.0;
const COUNTS: i64 = 4000;
const POLE_PAIRS: f64 = 7.0;

/// A shaft with the lines of an encoder and Hall sensors, counted exactly.
struct Shaft {
    encoder: QuadratureEncoder,
    count: i64,
    /// Counts that the counter did not see.
    lost: i64,
    has_index: bool,
    hall_shift: f64,
}

impl Shaft {
    /// A shaft at this position, counts after the index.
    fn at(count: i64, has_hall: bool) -> Self {
        let pole_pairs = POLE_PAIRS as f32;
        let start = StartValues { abz_lines: LINES, pole_pairs, ..StartValues::default() };
        Self {
            encoder: QuadratureEncoder::new(&start, has_hall),
            count,
            lost: count,
            has_index: true,
            hall_shift: 0.0,
        }
    }

    fn levels(&self) -> u8 {
        let turns = (self.count as f64 / COUNTS as f64 + self.hall_shift) * POLE_PAIRS;
        let sector = (turns.rem_euclid(1.0) * 6.0) as usize;
        [0b001, 0b011, 0b010, 0b110, 0b100, 0b101][sector]
    }

    /// Turns by these counts in a period.
    fn turn(&mut self, counts: i64) -> Evaluation {
        let before = self.count;
        self.count += counts;
        let passed = self.count.max(before).div_euclid(COUNTS) * COUNTS;
        let has_passed = self.has_index && passed > before.min(self.count);
        let index = has_passed.then_some((passed - self.lost) as u16);
        let read =
            Quadrature { count: (self.count - self.lost) as u16, index, has_double_edge: false };
        let levels = self.levels();
        self.encoder.evaluate(read, || sector(levels))
    }

    /// Error of an angle in turns, at most half an electrical turn.
    fn electrical_error(&self, evaluation: Evaluation) -> f64 {
        let (Evaluation::Angle(angle) | Evaluation::Doubtful(angle)) = evaluation else {
            panic!("{evaluation:?}")
        };
        let off = f64::from(angle) / 4_294_967_296.0 - self.count as f64 / COUNTS as f64;
        let electrical = (off * POLE_PAIRS + 0.5).rem_euclid(1.0) - 0.5;
        electrical * 2.0 * PI
    }
}

#[test]
fn encoder_without_hall_has_no_angle_until_the_index_and_then_an_exact_one() {
    let mut shaft = Shaft::at(1500, false);
    for _ in 0..240 {
        assert_eq!(shaft.turn(10), Evaluation::Missing);
    }
    for step in [200, 10, -10, -250, -10, 10] {
        let evaluation = shaft.turn(step);
        assert!(matches!(evaluation, Evaluation::Angle(_)), "{evaluation:?}");
        assert!(shaft.electrical_error(evaluation).abs() < 1e-5);
    }
}

#[test]
fn start_by_hall_sensors_is_within_half_a_sector_and_exact_after_index() {
    for start in [0, 40, 95, 300, 570, 3000] {
        for direction in [1, -1] {
            let mut shaft = Shaft::at(start, true);
            // Levels count from their second period on.
            shaft.turn(0);
            let error = shaft.electrical_error_of_turn(0);
            assert!(error.abs() <= PI / 6.0 + 0.02, "{start}: {error}");
            let mut last = shaft.turn(0);
            // 20 counts in a period are 100 rad/s. An electrical turn has 571 counts.
            for _ in 0..20 * COUNTS / 20 {
                let before = shaft.count;
                let now = shaft.turn(20 * direction);
                let moved = (shaft.count - before) as f64 / COUNTS as f64;
                let (Evaluation::Angle(one), Evaluation::Angle(other)) = (last, now) else {
                    panic!("{last:?} {now:?}")
                };
                let step = f64::from(other.wrapping_sub(one) as i32) / 4_294_967_296.0;
                assert!((step - moved).abs() < 1.0 / 60_000.0, "{step}");
                last = now;
            }
            assert!(shaft.electrical_error(last).abs() < 1e-4);
        }
    }
}

impl Shaft {
    fn electrical_error_of_turn(&mut self, counts: i64) -> f64 {
        let evaluation = self.turn(counts);
        self.electrical_error(evaluation)
    }
}

#[test]
fn lost_counts_are_reported_at_the_index_and_corrected() {
    let mut shaft = Shaft::at(3990, false);
    shaft.turn(20);
    shaft.lost += 30;
    let (mut reported, mut periods) = (0, 0);
    for _ in 0..1000 {
        if let Evaluation::Doubtful(_) = shaft.turn(10) {
            reported += 1;
        }
        periods += 1;
        if reported == 1 && periods < 402 {
            // 30 of 4000 counts of seven pole pairs.
            let error = shaft.electrical_error_of_turn(0);
            assert!((error.abs() - 0.33).abs() < 0.01, "{error}");
        }
    }
    assert_eq!(reported, 1);
    assert!(shaft.electrical_error_of_turn(0).abs() < 1e-4);
}

#[test]
fn loss_of_a_twelfth_of_an_electrical_turn_is_a_contradiction() {
    let mut shaft = Shaft::at(3990, false);
    shaft.turn(20);
    shaft.lost += 50;
    let at = (0..500).position(|_| shaft.turn(10) == Evaluation::Contradiction);
    assert!(at.is_some_and(|at| at < 400), "{at:?}");
    assert_eq!(shaft.turn(10), Evaluation::Missing);
}

#[test]
fn width_of_the_index_is_no_loss() {
    let mut shaft = Shaft::at(3990, false);
    shaft.turn(20);
    for lost in [-4, 4, 0] {
        shaft.lost = 3990 + lost;
        for _ in 0..500 {
            assert!(matches!(shaft.turn(10), Evaluation::Angle(_)));
        }
    }
}

#[test]
fn index_that_stays_away_is_reported_after_1_25_turns() {
    let mut shaft = Shaft::at(3990, false);
    shaft.turn(20);
    shaft.has_index = false;
    let at = (0..1000).position(|_| matches!(shaft.turn(10), Evaluation::Doubtful(_)));
    assert!((495..505).contains(&at.expect("it is reported")), "{at:?}");
}

#[test]
fn hall_sensors_that_contradict_the_counts_are_found_within_a_sector() {
    // A counter that stands: the sensors go on.
    let mut shaft = Shaft::at(0, true);
    (0..500).for_each(|_| assert!(matches!(shaft.turn(10), Evaluation::Angle(_))));
    let mut periods = 0;
    loop {
        shaft.lost += 10;
        periods += 1;
        if shaft.turn(10) == Evaluation::Contradiction {
            break;
        }
        assert!(periods < 14, "a sector has 95 counts, and its margin 40");
    }
    // Illegal levels are no angle in that period.
    let mut shaft = Shaft::at(0, true);
    shaft.turn(10);
    assert_eq!(shaft.encoder.evaluate(Quadrature::default(), || None), Evaluation::Missing);
}

#[test]
fn counter_that_stands_before_its_index_contradicts_the_second_edge_of_hall_sensors() {
    for direction in [1, -1] {
        let mut shaft = Shaft::at(1000, true);
        (0..2).for_each(|_| _ = shaft.turn(0));
        let from = shaft.count;
        let found = (0..40).find(|_| {
            shaft.lost += 5 * direction;
            shaft.turn(5 * direction) == Evaluation::Contradiction
        });
        assert!(found.is_some() && (shaft.count - from).abs() < 2 * 95 + 10, "{found:?}");
    }
}

#[test]
fn wrong_level_of_a_period_is_ignored() {
    for turned in [0, 6000] {
        let mut shaft = Shaft::at(1000, true);
        (0..turned / 10 + 2).for_each(|_| _ = shaft.turn(10));
        for wrong in [0b001, 0b010, 0b100] {
            let shown = sector(shaft.levels() ^ wrong);
            let count = (shaft.count - shaft.lost) as u16;
            let read = Quadrature { count, ..Quadrature::default() };
            let evaluation = shaft.encoder.evaluate(read, || shown);
            assert_eq!(evaluation == Evaluation::Missing, shown.is_none(), "{evaluation:?}");
            let error =
                (0..20).map(|_| shaft.electrical_error_of_turn(1).abs()).fold(0.0, f64::max);
            assert!(error <= PI / 6.0 + 0.02, "{error}");
        }
    }
}

#[test]
fn hall_sensors_of_reverse_order_contradict_the_counts_within_two_sectors() {
    let mut shaft = Shaft::at(0, true);
    shaft.encoder.is_hall_reversed = true;
    shaft.turn(0);
    let found = (0..25).find(|_| shaft.turn(10) == Evaluation::Contradiction);
    assert!(found.is_some());
}

#[test]
fn counter_that_jumps_by_more_than_a_turn_is_a_contradiction() {
    let mut shaft = Shaft::at(3990, false);
    shaft.turn(20);
    shaft.lost -= 5000;
    assert_eq!(shaft.turn(10), Evaluation::Contradiction);
}

#[test]
fn double_edge_is_reported_with_the_angle() {
    let mut shaft = Shaft::at(3990, false);
    shaft.turn(20);
    let count = (shaft.count - shaft.lost) as u16;
    let read = Quadrature { count, index: None, has_double_edge: true };
    assert!(matches!(shaft.encoder.evaluate(read, || None), Evaluation::Doubtful(_)));
}
