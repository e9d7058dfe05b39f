//! Angles that wrap: a position that jumps back by a turn each time the joint has made one.
//!
//! Across a wrap the position changes by the travel of the row minus the period. So the jumps have one size, oppose the
//! travel beside them, and all values lie within one period. A real step has no travel beside it, and a lost row jumps
//! along the travel. The position is unwrapped, and a velocity that was derived from it is derived again.

use super::finding::{LogFinding, LogFindingKind};
use super::typed;
use crate::number::figure;
use crate::statistics::{median, quantile_range};
use crate::unit::conversion;
use crate::{Dataset, Run, segments};
use compensator_core::quantity::{JointKind, Quantity};
use std::f64::consts::{PI, TAU};

/// Minimum size of a jump, as a share of the position's range. A wrap is at least two thirds of it.
const MIN_JUMP_SHARE: f64 = 0.5;

/// Maximum share of the rows with a jump. With more, a turn has fewer than four rows, and its direction is unknown.
const MAX_JUMP_ROWS: f64 = 0.25;

/// Maximum difference between two sizes of jumps, and between a size and a known period, as a share of the period.
const MAX_SIZE_DIFFERENCE: f64 = 0.01;

/// Maximum error of the travel of a jump's row, as a share of the travel. It is estimated from the rows beside it.
const MAX_TRAVEL_ERROR: f64 = 0.5;

/// Minimum share of the jumps that oppose the travel, and that have the size of the others.
const MIN_SHARE: f64 = 0.8;

/// Minimum number of jumps by a period that is not in [`PERIODS`].
const MIN_JUMPS: usize = 3;

/// Rows on either side of a jump from which its travel is estimated.
const NEIGHBOURS: usize = 8;

/// Periods of angles in their usual units: rad, half turns, degrees, turns.
const PERIODS: [f64; 4] = [TAU, PI, 360.0, 1.0];

/// Bits of an encoder's counter whose counts are not converted.
const ENCODER_BITS: [i32; 10] = [8, 10, 12, 13, 14, 16, 17, 18, 20, 24];

/// Bits of the counters in which drives keep counts, whatever the unit of a count.
const COUNTER_BITS: [i32; 3] = [16, 31, 32];

/// The period at which a position wraps.
#[derive(Clone, Copy, Debug)]
pub struct Wrap {
    /// The period, rad by the column's unit.
    pub period: f64,
    /// Number of wraps.
    pub count: usize,
}

impl Wrap {
    /// Returns the number of periods that a step between two rows contains: -1, 0 or 1.
    pub fn turns(self, step: f64) -> f64 {
        let turns = (step / self.period).round();
        // A step of several periods is not a wrap.
        if turns.abs() == 1.0 { turns } else { 0.0 }
    }
}

/// A row across which the position may wrap.
struct Jump {
    /// Its step, and the part of it that is travel.
    step: f64,
    travel: f64,
    /// Displacement of the rows beside it. Its sign is the direction of the travel.
    beside: f64,
}

impl Jump {
    fn size(&self) -> f64 {
        (self.step - self.travel).abs()
    }
}

/// Unwraps the position if it wraps and `correct` is true.
pub fn unwrapped(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let Some(wrap) = find(&data) else { return (data, Vec::new()) };
    let (position, unit) = (Quantity::Position.name(data.joint), data.joint.position_unit());
    let derived = is_velocity_derived(&data);
    let done = match (correct, derived) {
        (false, _) => "left in, as asked",
        (true, false) => "it is unwrapped",
        (true, true) => "it is unwrapped, and the velocity is derived from the result",
    };
    let hint = if (wrap.period / 360.0 - 1.0).abs() < MAX_SIZE_DIFFERENCE {
        format!(
            " By this period it may be in degrees (--columns {}).",
            typed(&data, position, "deg")
        )
    } else if wrap.period == 1.0 {
        format!(" By this period it may be in turns (--columns {}).", typed(&data, position, "rev"))
    } else {
        String::new()
    };
    let times = if wrap.count == 1 { "once".into() } else { format!("{} times", wrap.count) };
    let words =
        format!("The position wraps {times} at {} {unit}: {done}.{hint}", figure(wrap.period));
    let finding = LogFindingKind::WrappedAngle
        .finding(&[position], wrap.period, unit, words)
        .corrected(correct);
    if correct {
        data.runs.iter_mut().for_each(|run| unwrap_run(run, wrap, derived));
    }
    (data, vec![finding])
}

/// Returns true if the velocity was not logged but derived from the position.
pub fn is_velocity_derived(data: &Dataset) -> bool {
    let velocity = Quantity::Velocity.name(data.joint);
    !data.sources.is_empty() && data.source(velocity).is_none()
}

fn unwrap_run(run: &mut Run, wrap: Wrap, derives_velocity: bool) {
    let Some(mut position) = run.get(Quantity::Position).map(<[f64]>::to_vec) else { return };
    let mut turns = 0.0;
    let mut before = position[0];
    for value in &mut position {
        turns -= wrap.turns(*value - before);
        before = *value;
        *value += turns * wrap.period;
    }
    run.set(Quantity::Position, position);
    if derives_velocity {
        run.derive_velocity();
    }
}

/// Returns the periods at which a position may wrap: turns of a rotary joint, and the ranges of counters.
fn known_periods(data: &Dataset) -> Vec<f64> {
    let name = Quantity::Position.name(data.joint);
    let count = data.given_unit(name).and_then(|unit| conversion(name, unit).ok());
    let count =
        count.map_or(1.0, |conversion| (conversion.apply(1.0) - conversion.apply(0.0)).abs());
    let ranges = |bits: i32| 2f64.powi(bits) * count;
    let mut periods = Vec::new();
    if data.joint == JointKind::Revolute {
        periods.extend(PERIODS.into_iter().chain(ENCODER_BITS.map(|bits| 2f64.powi(bits))));
    }
    periods.extend(COUNTER_BITS.map(ranges));
    periods
}

/// Returns the period of a position that wraps. A slide does not turn, but its counter may wrap.
pub fn find(data: &Dataset) -> Option<Wrap> {
    let positions = data.columns_of(Quantity::Position)?;
    let mut all: Vec<f64> = positions.iter().flat_map(|q| q.iter().copied()).collect();
    let range = quantile_range(&mut all, 0.001);
    if range <= 0.0 {
        return None;
    }
    let is_logged = !is_velocity_derived(data);
    let mut jumps = Vec::new();
    for (run, position) in data.runs.iter().zip(positions) {
        for rows in segments(run) {
            let velocity = is_logged.then(|| &run.velocity[rows.clone()]);
            let (time, position) = (&run.time_s[rows.clone()], &position[rows]);
            jumps.extend(jumps_of(time, position, velocity, MIN_JUMP_SHARE * range));
        }
    }
    if jumps.is_empty() || jumps.len() as f64 > MAX_JUMP_ROWS * data.rows as f64 {
        return None;
    }
    let wrap = period(&jumps, &known_periods(data), data.joint == JointKind::Revolute)?;
    (range < (1.0 + MAX_SIZE_DIFFERENCE) * wrap.period).then_some(wrap)
}

/// Returns the jumps of a segment which its velocity does not explain.
fn jumps_of(time: &[f64], position: &[f64], velocity: Option<&[f64]>, least: f64) -> Vec<Jump> {
    let step = |row: usize| position[row] - position[row - 1];
    let is_jump = |row: usize| step(row).abs() > least;
    let jump = |row: usize| {
        let near = row.saturating_sub(NEIGHBOURS).max(1)..(row + NEIGHBOURS + 1).min(time.len());
        let beside: Vec<usize> = near.filter(|at| !is_jump(*at)).collect();
        let rate = |at: &usize| {
            let length = time[*at] - time[at - 1];
            (length > 0.0).then(|| step(*at) / length)
        };
        let closest = |at: &&usize| at.abs_diff(row) <= 2;
        let mut rates: Vec<f64> = beside.iter().filter(closest).filter_map(rate).collect();
        let length = time[row] - time[row - 1];
        let travel = length * median(&mut rates).unwrap_or_default();
        Jump { step: step(row), travel, beside: beside.into_iter().map(step).sum() }
    };
    let explained = |row: &usize| {
        let travel = |velocity: &[f64]| velocity[*row] * (time[*row] - time[row - 1]);
        velocity.is_some_and(|v| travel(v).abs() > MAX_TRAVEL_ERROR * step(*row).abs())
    };
    let rows = (1..time.len()).filter(|row| is_jump(*row) && !explained(row));
    rows.map(jump).collect()
}

/// Returns the common size of the jumps, if they are wraps: of a known period, or of any other if `takes_any` is true.
fn period(jumps: &[Jump], known: &[f64], takes_any: bool) -> Option<Wrap> {
    let mut sizes: Vec<f64> = jumps.iter().map(Jump::size).collect();
    let usual = median(&mut sizes).unwrap_or_default();
    let is_usual = |jump: &&Jump| {
        let tolerance = MAX_TRAVEL_ERROR * jump.travel.abs() + MAX_SIZE_DIFFERENCE * usual;
        (jump.size() - usual).abs() < tolerance
    };
    let same: Vec<&Jump> = jumps.iter().filter(is_usual).collect();
    let directed = same.iter().filter(|jump| jump.beside != 0.0);
    let (mut opposing, mut directions) = (0, 0);
    for jump in directed {
        directions += 1;
        opposing += usize::from(jump.beside * jump.step < 0.0);
    }
    let is_share = |part: usize, of: usize| part as f64 >= MIN_SHARE * of as f64;
    if !is_share(same.len(), jumps.len()) || directions == 0 || !is_share(opposing, directions) {
        return None;
    }
    let mean = same.iter().map(|jump| jump.size()).sum::<f64>() / same.len() as f64;
    let is_near = |known: &f64| (mean / known - 1.0).abs() < MAX_SIZE_DIFFERENCE;
    let known = known.iter().copied().find(is_near);
    let period = known.or_else(|| (takes_any && same.len() >= MIN_JUMPS).then_some(mean))?;
    Some(Wrap { period, count: same.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.01;

    fn log(position: impl Fn(f64) -> f64, velocity: impl Fn(f64) -> f64) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"].map(str::to_owned);
        let time: Vec<f64> = (0..1000).map(|row| STEP_S * f64::from(row)).collect();
        let of = |f: &dyn Fn(f64) -> f64| time.iter().map(|t| f(*t)).collect::<Vec<f64>>();
        let columns = vec![time.clone(), of(&velocity), vec![1.0; 1000], of(&position)];
        Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("columns")
    }

    /// Ten rad to and fro in 6.3 s.
    fn true_position(time: f64) -> f64 {
        10.0 * time.sin()
    }

    fn true_velocity(time: f64) -> f64 {
        10.0 * time.cos()
    }

    #[test]
    fn unwrapped_with_any_period_and_origin_returns_true_travel() {
        for (scale, period, origin) in [
            (1.0, TAU, 0.0),
            (1.0, TAU, -PI),
            (1.0, TAU, 0.7),
            (180.0 / PI, 360.0, -180.0),
            (1.0 / TAU, 1.0, 0.0),
            (4096.0 / TAU, 4096.0, 0.0),
            (1.0, 5.0, 0.0),
        ] {
            let wrapped = |t: f64| (scale * true_position(t) - origin).rem_euclid(period) + origin;
            let (data, findings) = unwrapped(log(wrapped, true_velocity), true);
            assert_eq!(findings.len(), 1, "period {period}");
            assert!((findings[0].value / period - 1.0).abs() < 1e-3, "{findings:?}");
            let q = data.runs[0].get(Quantity::Position).expect("a position");
            let travel = |row: usize| q[row] - q[0];
            for row in 0..1000 {
                let expected = scale * true_position(STEP_S * row as f64);
                assert!((travel(row) - expected).abs() < 5e-3 * period, "{period}: row {row}");
            }
        }
    }

    #[test]
    fn unwrapped_with_one_wrap_of_a_counter_finds_it() {
        // A count is a 4096th of a turn, or a micrometre.
        for (joint, unit, count) in
            [(JointKind::Revolute, "4096counts", TAU / 4096.0), (JointKind::Prismatic, "um", 1e-6)]
        {
            for bits in COUNTER_BITS {
                let range = 2f64.powi(bits) * count;
                let start = range - 15.0 * count;
                let exact = |t: f64| start + 40.0 * count * t;
                let mut data = log(|t| exact(t).rem_euclid(range), |_| 0.0);
                let name = Quantity::Position.name(joint).to_owned();
                let unit = Some(unit.to_owned());
                data.sources = vec![crate::SourceColumn { name, unit, ..Default::default() }];
                data.joint = joint;
                let (data, findings) = unwrapped(data, true);
                assert_eq!(findings.len(), 1, "{bits} bits");
                let q = data.runs[0].get(Quantity::Position).expect("a position");
                let travel = exact(STEP_S * 999.0) - exact(0.0);
                assert!((q[999] - q[0] - travel).abs() < 1e-6 * range, "{bits} bits");
            }
        }
    }

    #[test]
    fn unwrapped_with_one_wrap_of_a_turn_finds_it() {
        let wrapped = |t: f64| (0.5 * t).rem_euclid(TAU);
        let (_, findings) = unwrapped(log(|t| wrapped(t + 7.0), |_| 0.5), true);
        assert_eq!(findings.len(), 1);
        assert!((findings[0].value - TAU).abs() < 1e-3, "{findings:?}");
        crate::message::check(
            "checks",
            "position wraps once",
            &findings[0].in_words,
            &["6.283 rad"],
        );
    }

    #[test]
    fn unwrapped_with_derived_velocity_derives_it_again() {
        let mut data = log(|t| true_position(t).rem_euclid(TAU), |_| 0.0);
        let position = data.runs[0].get(Quantity::Position).expect("a position").to_vec();
        data.runs[0].velocity = crate::differences(&data.runs[0].time_s, &position);
        data.sources = vec![crate::SourceColumn { name: "time_s".into(), ..Default::default() }];
        assert!(data.runs[0].velocity.iter().any(|v| v.abs() > 500.0));
        let (data, _) = unwrapped(data, true);
        assert!(data.runs[0].velocity.iter().all(|v| v.abs() < 10.01));
    }

    #[test]
    fn find_with_real_steps_returns_none() {
        // To and fro between two angles within a row, at rest or moving slowly along the step.
        let square = |t: f64| TAU * f64::from(u8::from(t.sin() > 0.0));
        assert!(find(&log(square, |_| 0.0)).is_none());
        let along = |t: f64| square(t) + 0.1 * if t.sin() > 0.0 { t } else { -t };
        assert!(find(&log(along, |_| 0.1)).is_none());
        // One step, rows that were lost, and a fast motion that the velocity shows.
        assert!(find(&log(|t| f64::from(u8::from(t > 5.0)), |_| 0.0)).is_none());
        assert!(find(&log(|t| t + 3.0 * f64::from(u8::from(t > 5.0)), |_| 1.0)).is_none());
        assert!(
            find(&log(
                |t| t.rem_euclid(3.0),
                |t| if t.rem_euclid(3.0) < STEP_S { -300.0 } else { 1.0 }
            ))
            .is_none()
        );
        assert!(find(&log(true_position, true_velocity)).is_none());
    }
}
