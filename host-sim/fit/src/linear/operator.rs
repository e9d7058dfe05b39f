//! Operators with memory, of which columns are made: stop, play, time at rest, low-pass, shift.
//!
//! A stop operator is the elastic part of friction: it follows the displacement up to a travel and then slides, so its value
//! lies in -1..1. It is the Dahl law of exponent zero, and a sum of stops of several travels is the Maxwell-slip law. A play
//! operator is a gap: its output moves only where the input pushes it. Both depend on the path alone, not on the time, so
//! that one pass over the positions serves every amplitude. No operator crosses the border of a run.

use std::ops::Range;

/// Shortest rest that counts as dwell, s.
const MIN_DWELL_S: f64 = 0.02;

/// Returns the stop operator of a travel over the positions of each run. The first row of a run is 0.
pub fn stop(position: &[f64], runs: &[Range<usize>], travel: f64) -> Vec<f64> {
    let mut out = vec![0.0; position.len()];
    let scale = 1.0 / travel.max(f64::MIN_POSITIVE);
    for run in runs {
        let mut state = 0.0f64;
        for row in run.start + 1..run.end {
            state = (state + (position[row] - position[row - 1]) * scale).clamp(-1.0, 1.0);
            out[row] = state;
        }
    }
    out
}

/// Returns the play operator of a half width over the positions of each run.
pub fn play(position: &[f64], runs: &[Range<usize>], half_width: f64) -> Vec<f64> {
    let mut out = position.to_vec();
    for run in runs {
        for row in run.start + 1..run.end {
            let (q, before) = (position[row], out[row - 1]);
            out[row] = before.clamp(q - half_width, q + half_width);
        }
    }
    out
}

/// The last rest before each row.
#[derive(Clone, Debug, Default)]
pub struct Rests {
    /// Duration of the last rest, s; 0 before the first one.
    pub dwell_s: Vec<f64>,
    /// Path travelled since that rest, rad or m.
    pub path: Vec<f64>,
}

/// Finds the last rest before each row: a stretch of time in which the position stays within `step` of one value.
pub fn rests(position: &[f64], time_s: &[f64], runs: &[Range<usize>], step: f64) -> Rests {
    let rows = position.len();
    let mut found = Rests { dwell_s: vec![0.0; rows], path: vec![0.0; rows] };
    for run in runs {
        let (mut anchor, mut since) = (position[run.start], time_s[run.start]);
        let (mut dwell, mut path) = (0.0f64, f64::INFINITY);
        for row in run.clone() {
            let moved = (position[row] - anchor).abs();
            if moved > step {
                let rested = time_s[row] - since;
                // A short stop soon after a long one belongs to the long one.
                if rested > MIN_DWELL_S && (rested > dwell || path > 4.0 * step) {
                    (dwell, path) = (rested, 0.0);
                }
                path += moved;
                (anchor, since) = (position[row], time_s[row]);
            }
            (found.dwell_s[row], found.path[row]) = (dwell, path.min(1e12));
        }
    }
    found
}

/// Returns values moved later by a number of rows within each run, by linear interpolation; the ends repeat.
pub fn later(values: &[f64], runs: &[Range<usize>], rows: f64) -> Vec<f64> {
    let whole = rows.floor();
    let share = rows - whole;
    let mut out = shift(values, runs, whole as i32);
    if share > 0.0 {
        let next = shift(values, runs, whole as i32 + 1);
        out.iter_mut().zip(next).for_each(|(now, next)| *now += share * (next - *now));
    }
    out
}

/// Returns the mean of the last `window` rows within each run; before the first row the value is held.
pub fn running_mean(values: &[f64], runs: &[Range<usize>], window: f64) -> Vec<f64> {
    let window = window.max(1.0);
    let (whole, share) = (window.floor() as usize, window.fract());
    let mut out = vec![0.0; values.len()];
    for run in runs {
        let at = |row: usize, before: usize| values[row.saturating_sub(before).max(run.start)];
        let mut sum: f64 = (0..whole).map(|before| at(run.start, before)).sum();
        for row in run.clone() {
            if row > run.start {
                sum += values[row] - at(row - 1, whole - 1);
            }
            out[row] = (sum + share * at(row, whole)) / window;
        }
    }
    out
}

/// Returns the values of a first-order low-pass with a time constant in rows, started at each run's first value.
pub fn low_pass(values: &[f64], runs: &[Range<usize>], rows: f64) -> Vec<f64> {
    let mut out = values.to_vec();
    let share = 1.0 - (-1.0 / rows.max(1e-9)).exp();
    for run in runs {
        for row in run.start + 1..run.end {
            out[row] = out[row - 1] + share * (values[row] - out[row - 1]);
        }
    }
    out
}

/// Returns the values moved `rows` rows later within each run (earlier if negative). The value at the border repeats.
pub fn shift(values: &[f64], runs: &[Range<usize>], rows: i32) -> Vec<f64> {
    let mut out = values.to_vec();
    for run in runs.iter().filter(|run| rows != 0 && !run.is_empty()) {
        let (first, last) = (run.start as i64, run.end as i64 - 1);
        for row in run.clone() {
            out[row] = values[(row as i64 - i64::from(rows)).clamp(first, last) as usize];
        }
    }
    out
}

/// Returns the mean over a centred window of an odd number of rows, shorter at the ends of a run.
pub fn smooth(values: &[f64], runs: &[Range<usize>], window: usize) -> Vec<f64> {
    let half = window / 2;
    let mut out = values.to_vec();
    for run in runs {
        for (at, out) in out[run.clone()].iter_mut().enumerate() {
            let row = run.start + at;
            let range = row.saturating_sub(half).max(run.start)..(row + half + 1).min(run.end);
            let count = range.len() as f64;
            *out = values[range].iter().sum::<f64>() / count;
        }
    }
    out
}

/// Returns the difference quotient of values over time within each run, by central differences.
pub fn slope(values: &[f64], time_s: &[f64], runs: &[Range<usize>]) -> Vec<f64> {
    let mut out = vec![0.0; values.len()];
    for run in runs {
        for row in run.clone() {
            let (a, b) = (row.saturating_sub(1).max(run.start), (row + 1).min(run.end - 1));
            let seconds = time_s[b] - time_s[a];
            out[row] = if seconds > 0.0 { (values[b] - values[a]) / seconds } else { 0.0 };
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns one run of some rows.
    fn run(rows: usize) -> Vec<Range<usize>> {
        std::iter::once(0..rows).collect()
    }

    #[test]
    fn stop_over_reversal_slides_then_turns_with_the_travel() {
        let position = [0.0, 0.5, 1.0, 2.0, 1.5, 0.0, -4.0];
        let found = stop(&position, &run(7), 1.0);
        assert_eq!(found, [0.0, 0.5, 1.0, 1.0, 0.5, -1.0, -1.0]);
    }

    #[test]
    fn stop_at_run_border_starts_at_zero() {
        assert_eq!(stop(&[0.0, 5.0, 5.0, 5.5], &[0..2, 2..4], 1.0), [0.0, 1.0, 0.0, 0.5]);
    }

    #[test]
    fn play_inside_gap_does_not_move() {
        assert_eq!(play(&[0.0, 0.4, 2.0, 1.5, 0.0], &run(5), 0.5), [0.0, 0.0, 1.5, 1.5, 0.5]);
    }

    #[test]
    fn shift_then_shift_back_returns_inner_rows() {
        let values: Vec<f64> = (0..10).map(f64::from).collect();
        let later = shift(&values, &run(10), 3);
        assert_eq!(later[3..], values[..7]);
        assert_eq!(shift(&later, &run(10), -3)[..7], values[..7]);
        assert_eq!(shift(&values, &[0..5, 5..10], 1), [0., 0., 1., 2., 3., 5., 5., 6., 7., 8.]);
    }

    #[test]
    fn later_by_part_of_a_row_interpolates() {
        let values: Vec<f64> = (0..6).map(f64::from).collect();
        assert_eq!(later(&values, &run(6), 1.5)[2..], [0.5, 1.5, 2.5, 3.5]);
        assert_eq!(later(&values, &run(6), -0.5)[..5], [0.5, 1.5, 2.5, 3.5, 4.5]);
    }

    #[test]
    fn running_mean_of_ramp_is_late_by_half_its_window() {
        let values: Vec<f64> = (0..12).map(f64::from).collect();
        assert_eq!(running_mean(&values, &run(12), 5.0)[6..8], [4.0, 5.0]);
        assert!((running_mean(&values, &run(12), 2.5)[6] - 5.2).abs() < 1e-12);
        assert_eq!(running_mean(&values, &run(12), 1.0), values);
    }

    #[test]
    fn low_pass_of_step_reaches_63_percent_after_its_time_constant() {
        let mut step = vec![1.0; 50];
        step[0] = 0.0;
        let found = low_pass(&step, &run(50), 10.0);
        assert!((found[10] - (1.0 - (-1.0f64).exp())).abs() < 1e-12);
    }

    #[test]
    fn rests_after_pause_reports_its_duration_and_the_path_since() {
        let time: Vec<f64> = (0..20).map(|row| 0.01 * f64::from(row)).collect();
        let position: Vec<f64> = (0..20)
            .map(|row| 0.1 * f64::from(if row < 5 { row } else { (row - 8).max(4) }))
            .collect();
        let found = rests(&position, &time, &run(20), 0.05);
        assert!((found.dwell_s[15] - 0.09).abs() < 1e-9, "{:?}", found.dwell_s);
        assert!((found.path[15] - 0.3).abs() < 1e-9, "{:?}", found.path);
    }
}
