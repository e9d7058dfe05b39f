//! Measures of a course, as the paper's text defines them.

use super::tasks::{Course, LOW_SPEED_RAD_S, RPM, TARGET_RAD};
use simulated_machines::joint_plant::load;

/// Maximum distance from the target, rad: one degree.
const TARGET_TOLERANCE_RAD: f64 = 0.0175;
/// Relative speed error above which a leg oscillates at its start.
const OSCILLATION_SHARE: f64 = 0.2;
/// End of the start, s; later oscillation is stick-slip.
const START_END_S: f64 = 2.0;
/// Share of the commanded speed below which a leg sticks.
const STICK_SHARE: f64 = 0.5;
/// Start of the paper's evaluation of velocity, s.
const EVALUATION_START_S: f64 = 0.15;

/// Mean and standard deviation over repeats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation; 0 for one value.
    pub deviation: f64,
}

impl Spread {
    /// Computes mean and standard deviation; NaN without values.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let deviation = if count > 1.0 { (squares / (count - 1.0)).sqrt() } else { 0.0 };
        Self { mean, deviation }
    }
}

/// Mean absolute velocity error from 0.15 s on, rpm.
pub fn velocity_error_rpm(course: &Course) -> f64 {
    let rows = rows(course).filter(|row| row.time_s >= EVALUATION_START_S);
    mean(rows.map(|row| row.error_rad_s().abs())) / RPM
}

/// Mean absolute error of the lifting speed, % of it.
pub fn error_rate_percent(course: &Course) -> f64 {
    100.0 * mean(rows(course).map(|row| row.error_rad_s().abs())) / LOW_SPEED_RAD_S
}

/// Duration of the starting oscillation, s: time until the speed stays within a fifth of the reference, up to 2 s.
pub fn starting_oscillation_s(course: &Course) -> f64 {
    let off = |row: &Row| {
        row.time_s < START_END_S && row.error_rad_s().abs() > OSCILLATION_SHARE * LOW_SPEED_RAD_S
    };
    rows(course).filter(off).map(|row| row.time_s).fold(0.0, f64::max)
}

/// Number of times the leg sticks after its start.
pub fn stick_count(course: &Course) -> f64 {
    let slow: Vec<bool> = rows(course)
        .filter(|row| row.time_s >= START_END_S)
        .map(|row| row.velocity_rad_s < STICK_SHARE * LOW_SPEED_RAD_S)
        .collect();
    slow.windows(2).filter(|pair| !pair[0] && pair[1]).count() as f64
}

/// Time until the joint is first within a degree of the target, s; the task's length if it never is.
pub fn time_to_target_s(course: &Course) -> f64 {
    let reached =
        course.position_rad.iter().position(|q| (q - TARGET_RAD).abs() < TARGET_TOLERANCE_RAD);
    let end = course.time_s.last().copied().unwrap_or(f64::NAN);
    reached.map_or(end, |row| course.time_s[row])
}

/// Overshoot over the target, % of the travel.
pub fn overshoot_percent(course: &Course) -> f64 {
    let top = course.position_rad.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    100.0 * (top - TARGET_RAD).max(0.0) / (TARGET_RAD - load::JUMP_FROM_RAD)
}

/// Root mean square error of velocity, rad/s.
pub fn velocity_rmse_rad_s(course: &Course) -> f64 {
    mean(rows(course).map(|row| row.error_rad_s().powi(2))).sqrt()
}

/// Root mean square error of position, rad.
pub fn position_rmse_rad(course: &Course) -> f64 {
    let pairs = course.position_rad.iter().zip(&course.reference_rad);
    mean(pairs.map(|(is, reference)| (is - reference).powi(2))).sqrt()
}

/// Swing of the position in the last second, rad from end to end.
pub fn hold_swing_rad(course: &Course) -> f64 {
    let end = course.time_s.last().copied().unwrap_or(f64::NAN);
    let late = course.time_s.iter().zip(&course.position_rad).filter(|(t, _)| **t > end - 1.0);
    let (least, most) =
        late.fold((f64::MAX, f64::MIN), |(least, most), (_, q)| (least.min(*q), most.max(*q)));
    most - least
}

/// A row of a course.
struct Row {
    time_s: f64,
    velocity_rad_s: f64,
    reference_rad_s: f64,
}

impl Row {
    fn error_rad_s(&self) -> f64 {
        self.velocity_rad_s - self.reference_rad_s
    }
}

fn rows(course: &Course) -> impl Iterator<Item = Row> + '_ {
    let velocities = course.velocity_rad_s.iter().zip(&course.reference_rad_s);
    let times = course.time_s.iter();
    times.zip(velocities).map(|(time_s, (velocity_rad_s, reference_rad_s))| Row {
        time_s: *time_s,
        velocity_rad_s: *velocity_rad_s,
        reference_rad_s: *reference_rad_s,
    })
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(velocity: impl Fn(f64) -> f64, reference: f64) -> Course {
        let time_s: Vec<f64> = (0..3600).map(|row| f64::from(row) * 1e-3).collect();
        Course {
            reference_rad_s: vec![reference; time_s.len()],
            velocity_rad_s: time_s.iter().map(|t| velocity(*t)).collect(),
            position_rad: time_s.iter().map(|t| 1.1 * (1.0 - (-10.0 * t).exp())).collect(),
            reference_rad: vec![1.1; time_s.len()],
            time_s,
            ..Course::default()
        }
    }

    #[test]
    fn measures_of_known_courses_have_expected_values() {
        let v = LOW_SPEED_RAD_S;
        let steady = course(|t| if t < 0.7 { 0.5 * v } else { 0.9 * v }, v);
        assert!((starting_oscillation_s(&steady) - 0.699).abs() < 1e-9);
        let expected = 100.0 * (0.5 * 700.0 + 0.1 * 2900.0) / 3600.0;
        assert!((error_rate_percent(&steady) - expected).abs() < 1e-9);
        assert_eq!(stick_count(&steady), 0.0);
        let sticking = course(|t| if ((t * 4.0) as usize).is_multiple_of(2) { v } else { 0.0 }, v);
        assert_eq!(stick_count(&sticking), 3.0);
        assert!((velocity_error_rpm(&course(|_| 2.0 * RPM, 5.0 * RPM)) - 3.0).abs() < 1e-9);
        // 1.1 (1 - exp(-10 t)) = 1 - 0.0175.
        assert!((time_to_target_s(&steady) - 0.224).abs() < 2e-3);
        assert!((overshoot_percent(&steady) - 100.0 * 0.1 / 1.2).abs() < 1e-2);
        // 1.1 exp(-10 t) over 3.6 s: 1.1^2 / 20 / 3.6, and half a row of 1 ms.
        assert!((position_rmse_rad(&steady).powi(2) - 1.21 / 72.0).abs() < 2e-4);
        assert_eq!(Spread::of(&[1.0, 3.0]), Spread { mean: 2.0, deviation: 2f64.sqrt() });
    }
}
