//! Motions that a master performs: positions over time, relative to where the joint stands.
//!
//! A [`Motion`] starts and ends at rest. It is a list of positions at equal times, as a drive in cyclic synchronous position
//! mode takes them. [`MotionBuilder`] joins strokes, sines and rests. [`standard`] is the motion of a trial: reversals at
//! three speeds, rests, both directions. The motions of [`crate::experiment`] show what friction depends on.
//!
//! A motion is checked against [`MotionLimits`] before it is performed, because the drive's own limits would distort it.

use std::f64::consts::{PI, TAU};

/// Time between two positions, s: a drive interpolates between them, and a PC without real-time kernel can keep it.
pub const TARGET_PERIOD_S: f64 = 5e-3;

/// Speed below which a demand counts as rest, rad/s.
pub const REST_RAD_S: f64 = 1e-4;

/// Error of a motion; its message is one line.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("{motion}: {defect}")]
pub struct MotionError {
    /// Name of the motion, or its file.
    pub motion: String,
    /// What is wrong with it.
    pub defect: MotionDefect,
}

/// What is wrong with a motion.
#[derive(Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages describe the variants")]
pub enum MotionDefect {
    #[error("expected a motion that starts and ends at 0 rad")]
    Ends,
    #[error("expected finite positions")]
    NotFinite,
    #[error("found {found:.3} rad from the start, expected at most {most} rad (--range)")]
    Range { found: f64, most: f64 },
    #[error("found {found:.3} rad/s, expected at most {most} rad/s (--speed)")]
    Speed { found: f64, most: f64 },
    #[error("the file is empty")]
    Empty,
    #[error("row 1: found {header:?}, expected a column {column}")]
    Column { header: String, column: &'static str },
    #[error("row {row}, column {column}: found {found:?}, expected a finite number")]
    Cell { row: usize, column: &'static str, found: String },
    #[error("row {row}, column time_s: found {found} after {last}, expected a later time")]
    Order { row: usize, found: f64, last: f64 },
    #[error("found {0} rows, expected at least 2")]
    Rows(usize),
    #[error("found {0} s, expected at most {MAX_MOTION_S} s")]
    Duration(f64),
}

/// Bounds of every motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Largest distance from the start, rad.
    pub range_rad: f64,
    /// Largest speed, rad/s.
    pub speed_rad_s: f64,
    /// Largest acceleration of strokes, rad/s^2.
    pub acceleration_rad_s2: f64,
}

impl MotionLimits {
    /// Returns limits with an acceleration of strokes that reaches the speed within a quarter of the range.
    pub fn new(range_rad: f64, speed_rad_s: f64) -> Self {
        let acceleration = 2.0 * speed_rad_s * speed_rad_s / range_rad;
        Self { range_rad, speed_rad_s, acceleration_rad_s2: acceleration.clamp(1.0, 30.0) }
    }
}

/// Positions at equal times.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Name, as reports print it.
    pub name: String,
    /// Positions relative to the start, rad, one every [`TARGET_PERIOD_S`]. The first and the last are 0.
    pub positions_rad: Vec<f64>,
}

impl Motion {
    /// Returns the duration, s.
    pub fn seconds(&self) -> f64 {
        self.positions_rad.len() as f64 * TARGET_PERIOD_S
    }

    /// Returns the velocities from each position to the next, rad/s.
    pub fn velocities_rad_s(&self) -> impl Iterator<Item = f64> + '_ {
        self.positions_rad.windows(2).map(|pair| (pair[1] - pair[0]) / TARGET_PERIOD_S)
    }

    /// Checks the motion against limits.
    ///
    /// # Errors
    /// Returns one line with the value that exceeds its limit.
    pub fn validate(&self, limits: &MotionLimits) -> Result<(), MotionError> {
        let failed = |defect| MotionError { motion: self.name.clone(), defect };
        self.check(limits).map_err(failed)
    }

    fn check(&self, limits: &MotionLimits) -> Result<(), MotionDefect> {
        let ends = [self.positions_rad.first(), self.positions_rad.last()];
        if ends.iter().any(|end| end.is_none_or(|at| at.abs() > 1e-9)) {
            return Err(MotionDefect::Ends);
        }
        if self.positions_rad.iter().any(|at| !at.is_finite()) {
            return Err(MotionDefect::NotFinite);
        }
        // A tolerance for the rounding of sampled positions.
        const TOLERANCE: f64 = 1.02;
        let largest = |values: &mut dyn Iterator<Item = f64>| {
            values.fold(0.0f64, |most, value| most.max(value.abs()))
        };
        let range = largest(&mut self.positions_rad.iter().copied());
        let speed = largest(&mut self.velocities_rad_s());
        if range > TOLERANCE * limits.range_rad {
            return Err(MotionDefect::Range { found: range, most: limits.range_rad });
        }
        if speed > TOLERANCE * limits.speed_rad_s {
            return Err(MotionDefect::Speed { found: speed, most: limits.speed_rad_s });
        }
        Ok(())
    }
}

/// Joins parts to a motion.
#[derive(Clone, Debug)]
pub struct MotionBuilder {
    limits: MotionLimits,
    positions_rad: Vec<f64>,
}

impl MotionBuilder {
    /// Starts a motion at rest.
    pub fn new(limits: MotionLimits) -> Self {
        Self { limits, positions_rad: vec![0.0] }
    }

    fn at(&self) -> f64 {
        self.positions_rad.last().copied().unwrap_or_default()
    }

    /// Rests for a time, s.
    #[must_use]
    pub fn rest(mut self, seconds: f64) -> Self {
        let at = self.at();
        let count = (seconds / TARGET_PERIOD_S).round() as usize;
        self.positions_rad.extend(std::iter::repeat_n(at, count));
        self
    }

    /// Moves to a position, rad, at a speed, rad/s. The velocity rises and falls along a raised cosine, so that the
    /// acceleration has no steps.
    #[must_use]
    pub fn stroke(mut self, to_rad: f64, speed_rad_s: f64) -> Self {
        let from = self.at();
        let way = (to_rad - from).abs();
        let acceleration = self.limits.acceleration_rad_s2;
        // The mean acceleration of the ramp is 2/pi of its largest one. A short way does not reach the speed.
        let speed = speed_rad_s
            .abs()
            .min(self.limits.speed_rad_s)
            .min((way * acceleration * 2.0 / PI).sqrt());
        if speed <= REST_RAD_S {
            return self;
        }
        let ramp_s = speed / acceleration * PI / 2.0;
        let total_s = way / speed + ramp_s;
        let travelled = |time: f64| {
            let rise = |time: f64| 0.5 * speed * (time - ramp_s / PI * (PI * time / ramp_s).sin());
            if time < ramp_s {
                rise(time)
            } else if time < total_s - ramp_s {
                speed * (time - 0.5 * ramp_s)
            } else {
                way - rise((total_s - time).max(0.0))
            }
        };
        let count = (total_s / TARGET_PERIOD_S).ceil() as usize;
        let direction = (to_rad - from).signum();
        for step in 1..=count {
            let time = step as f64 * TARGET_PERIOD_S;
            self.positions_rad.push(from + direction * travelled(time.min(total_s)));
        }
        self
    }

    /// Performs whole periods of a sine from one end of its range to the same end. `amplitude_rad` is signed: the sine starts
    /// at the present position and goes to it plus twice the amplitude.
    #[must_use]
    pub fn sine(mut self, amplitude_rad: f64, peak_rad_s: f64, periods: usize) -> Self {
        let from = self.at();
        let rate = peak_rad_s.min(self.limits.speed_rad_s) / amplitude_rad.abs();
        let count = (periods as f64 * TAU / rate / TARGET_PERIOD_S).round() as usize;
        for step in 1..=count {
            let angle = periods as f64 * TAU * step as f64 / count as f64;
            self.positions_rad.push(from + amplitude_rad * (1.0 - angle.cos()));
        }
        self
    }

    /// Strokes between two positions around the present one, and returns to it.
    #[must_use]
    pub fn triangle(mut self, amplitude_rad: f64, speed_rad_s: f64, periods: usize) -> Self {
        let centre = self.at();
        for _ in 0..periods {
            self = self
                .stroke(centre + amplitude_rad, speed_rad_s)
                .stroke(centre - amplitude_rad, speed_rad_s);
        }
        self.stroke(centre, speed_rad_s)
    }

    /// Adds a small motion to the positions from `from_index` on, which must start and end with 0.
    #[must_use]
    pub fn superpose(mut self, from_index: usize, added_rad: &[f64]) -> Self {
        for (place, added) in self.positions_rad.iter_mut().skip(from_index).zip(added_rad) {
            *place += added;
        }
        self
    }

    /// Returns the positions so far, rad.
    pub fn positions(&self) -> &[f64] {
        &self.positions_rad
    }

    /// Returns to the start, and ends the motion after a rest.
    pub fn finish(self, name: &str) -> Motion {
        let speed = 0.5 * self.limits.speed_rad_s;
        let mut done = self.stroke(0.0, speed).rest(0.2);
        if let Some(last) = done.positions_rad.last_mut() {
            *last = 0.0;
        }
        Motion { name: name.to_owned(), positions_rad: done.positions_rad }
    }
}

/// Returns the standard motion of a trial: sines and a slow triangle through reversals at three speeds, rests, and strokes in
/// both directions. It takes 9 to 12 s with the default limits.
pub fn standard(limits: &MotionLimits) -> Motion {
    let MotionLimits { range_rad: range, speed_rad_s: speed, .. } = *limits;
    MotionBuilder::new(*limits)
        .rest(0.2)
        .stroke(-0.95 * range, 0.6 * speed)
        .sine(0.95 * range, 0.95 * speed, 1)
        .rest(0.3)
        .stroke(-0.4 * range, 0.3 * speed)
        .rest(0.3)
        .sine(0.3 * range, 0.25 * speed, 1)
        .stroke(0.5 * range, 0.6 * speed)
        .rest(0.4)
        .triangle(0.05 * range, 0.04 * speed, 1)
        .rest(0.3)
        .finish("standard")
}

/// Reads the motion of a file: columns `time_s` and `position_rad`, strictly rising times. It is moved so that it starts at 0,
/// and a return to the start is added if it ends elsewhere.
///
/// # Errors
/// Returns one line: the file, the row, what was found and what was expected.
pub fn parse(name: &str, text: &str, limits: &MotionLimits) -> Result<Motion, MotionError> {
    let failed = |defect| MotionError { motion: name.to_owned(), defect };
    let points = parse_points(text).map_err(failed)?;
    let motion = through(&points, limits).finish(name);
    motion.validate(limits).map(|()| motion)
}

/// A row of a motion's file.
#[derive(Clone, Copy)]
struct Point {
    time_s: f64,
    position_rad: f64,
}

fn parse_points(text: &str) -> Result<Vec<Point>, MotionDefect> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let (_, header) = lines.next().ok_or(MotionDefect::Empty)?;
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let place = |column| {
        let at = names.iter().position(|known| *known == column);
        at.ok_or_else(|| MotionDefect::Column { header: header.to_owned(), column })
    };
    let (time_at, position_at) = (place("time_s")?, place("position_rad")?);
    let mut points: Vec<Point> = Vec::new();
    for (row, line) in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let row = row + 1;
        let number = |at: usize, column| {
            let cell = cells.get(at).copied().unwrap_or_default();
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| MotionDefect::Cell { row, column, found: cell.to_owned() })
        };
        let time_s = number(time_at, "time_s")?;
        if let Some(last) = points.last()
            && time_s <= last.time_s
        {
            return Err(MotionDefect::Order { row, found: time_s, last: last.time_s });
        }
        points.push(Point { time_s, position_rad: number(position_at, "position_rad")? });
    }
    let [first, .., last] = points[..] else { return Err(MotionDefect::Rows(points.len())) };
    let seconds = last.time_s - first.time_s;
    if seconds > MAX_MOTION_S { Err(MotionDefect::Duration(seconds)) } else { Ok(points) }
}

/// Returns a motion through at least two points, with a rest at both ends.
fn through(points: &[Point], limits: &MotionLimits) -> MotionBuilder {
    let mut builder = MotionBuilder::new(*limits).rest(0.2);
    let (first, last) = (points[0], points[points.len() - 1]);
    let count = ((last.time_s - first.time_s) / TARGET_PERIOD_S).floor() as usize;
    let mut at = 0;
    for step in 1..=count {
        let time_s = first.time_s + step as f64 * TARGET_PERIOD_S;
        while at + 2 < points.len() && points[at + 1].time_s < time_s {
            at += 1;
        }
        let (before, after) = (points[at], points[at + 1]);
        let share = ((time_s - before.time_s) / (after.time_s - before.time_s)).clamp(0.0, 1.0);
        let way_rad = share * (after.position_rad - before.position_rad);
        builder.positions_rad.push(before.position_rad + way_rad - first.position_rad);
    }
    builder.rest(0.2)
}

/// Longest motion of a file, s.
const MAX_MOTION_S: f64 = 120.0;

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotionLimits =
        MotionLimits { range_rad: 0.4, speed_rad_s: 1.5, acceleration_rad_s2: 20.0 };

    #[test]
    fn standard_motion_keeps_its_limits_at_any_range_and_speed() {
        for (range_rad, speed_rad_s) in [(0.4, 1.5), (0.05, 0.2), (2.0, 6.0), (0.4, 0.1)] {
            let limits = MotionLimits { range_rad, speed_rad_s, acceleration_rad_s2: 15.0 };
            let motion = standard(&limits);
            motion.validate(&limits).unwrap();
            let speeds: Vec<f64> = motion.velocities_rad_s().collect();
            let steps = speeds.windows(2).map(|pair| (pair[1] - pair[0]).abs() / TARGET_PERIOD_S);
            let sine = (0.95 * speed_rad_s).powi(2) / (0.95 * range_rad);
            let most = steps.fold(0.0f64, f64::max);
            assert!(most < 1.1 * (15.0f64).max(sine), "{range_rad} {speed_rad_s}: {most} rad/s^2");
        }
        assert!(
            (8.0..13.0).contains(&standard(&LIMITS).seconds()),
            "{}",
            standard(&LIMITS).seconds()
        );
    }

    #[test]
    fn stroke_ends_at_its_position_with_its_speed() {
        let builder = MotionBuilder::new(LIMITS).stroke(0.3, 0.5);
        assert!((builder.at() - 0.3).abs() < 1e-9);
        let motion = builder.finish("there and back");
        let fastest = motion.velocities_rad_s().take(200).fold(0.0f64, f64::max);
        assert!((fastest - 0.5).abs() < 1e-6, "{fastest}");
    }

    #[test]
    fn parse_moves_the_motion_to_its_start_and_returns() {
        let text = "time_s,position_rad\n1.0,2.0\n1.5,2.1\n2.0,2.05\n";
        let motion = parse("file", text, &LIMITS).unwrap();
        let most = motion.positions_rad.iter().fold(0.0f64, |most, at| most.max(at.abs()));
        assert!((most - 0.1).abs() < 1e-6, "{most}");
        assert_eq!(motion.positions_rad.last(), Some(&0.0));
    }

    #[test]
    fn parse_of_bad_file_names_row_and_column() {
        let mut messages = String::new();
        for (text, place, found) in [
            ("", "file: ", ""),
            ("t,position_rad\n0,0\n", "file: row 1: ", "\"t,position_rad\""),
            ("time_s,position_rad\n0,x\n", "file: row 2, column position_rad: ", "\"x\""),
            ("time_s,position_rad\n0,0\n0,1\n", "file: row 3, column time_s: ", " 0 "),
            ("time_s,position_rad\n0,0\n", "file: ", " 1 "),
            ("time_s,position_rad\n0,0\n1,9\n", "file: ", " 9.000 rad "),
            ("time_s,position_rad\n0,0\n0.1,0.3\n", "file: ", " 3.000 rad/s"),
        ] {
            let error = parse("file", text, &LIMITS).unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(found), "{error}");
            messages += &format!("{error}\n");
        }
        crate::snapshot::check("session", "bad files of a motion", &messages);
    }
}
