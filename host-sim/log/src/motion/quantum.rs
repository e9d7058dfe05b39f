//! Quantisation step of a column.
//!
//! An encoder counts: neighbouring values differ by a whole number of steps, often by none or one. The smallest frequent
//! difference is tried as the step. It is accepted if nearly all small differences are its multiples. The digits of a
//! file are detected in the same way; their step is small.
//!
//! An encoder is most accurate when it counts: between the last row of one count and the first row of the next, the
//! joint passed the line between them. So a row beside a change is known to the travel of one row, which is a step over
//! the rows of the shorter plateau. The many rows of a plateau together are as accurate as one of them. If all rows had
//! independent errors of step^2/12, the result would follow the staircase where the joint is slow, which is where it
//! reverses.

/// Maximum difference that is evaluated, steps. Digits and rounding hide multiples of larger ones.
const MAX_STEPS: f64 = 40.0;

/// Minimum share of the differences that must be multiples.
const MIN_MULTIPLE_SHARE: f64 = 0.95;

/// Maximum deviation from a multiple, steps.
const MAX_MULTIPLE_ERROR: f64 = 0.1;

/// Minimum number of differences for a decision.
const MIN_DIFFERENCES: usize = 20;

/// Returns the step of a column over all segments; 0 if it has none.
pub fn quantum<'a>(columns: impl Iterator<Item = &'a [f64]>) -> f64 {
    let mut steps: Vec<f64> = columns
        .flat_map(|column| column.windows(2).map(|w| (w[1] - w[0]).abs()))
        .filter(|step| *step > 0.0)
        .collect();
    if steps.len() < MIN_DIFFERENCES {
        return 0.0;
    }
    let at = steps.len() / 200;
    let least = *steps.select_nth_unstable_by(at, f64::total_cmp).1;
    // Rounding in a file spreads one step over a few values, so the middle of the smallest cluster is used.
    let below = |limit: f64| steps.iter().filter(|step| **step < limit).count();
    let (near, from) = (below(1.5 * least), below(0.67 * least));
    if near - from < MIN_DIFFERENCES / 2 {
        return 0.0;
    }
    let step = *steps.select_nth_unstable_by((from + near) / 2, f64::total_cmp).1;
    let is_multiple = |other: &f64| {
        let times = *other / step;
        (times - times.round()).abs() < MAX_MULTIPLE_ERROR && times.round() >= 1.0
    };
    let (mut small, mut multiples) = (0usize, 0usize);
    for other in steps.iter().filter(|other| **other < MAX_STEPS * step) {
        small += 1;
        multiples += usize::from(is_multiple(other));
    }
    let share = multiples as f64 / small as f64;
    if share >= MIN_MULTIPLE_SHARE { step } else { 0.0 }
}

/// Estimates the values before quantisation, with the variance of each.
pub fn unstepped(values: &[f64], step: f64) -> (Vec<f64>, Vec<f64>) {
    let rows = values.len();
    let (mut found, mut variances) = (values.to_vec(), vec![step * step / 12.0; rows]);
    let mut starts = vec![0];
    starts.extend((1..rows).filter(|row| (values[*row] - values[row - 1]).abs() > 0.5 * step));
    let end = |plateau: usize| starts.get(plateau + 1).copied().unwrap_or(rows);
    for (plateau, start) in starts.iter().enumerate() {
        let length = end(plateau) - start;
        if length > 1 {
            let share = length as f64 * step * step / 12.0;
            variances[*start..end(plateau)].fill(share);
        }
    }
    for (plateau, here) in starts.iter().enumerate().skip(1) {
        let lengths = [here - starts[plateau - 1], end(plateau) - here];
        let shorter = lengths[0].min(lengths[1]);
        let jump = values[*here] - values[here - 1];
        if shorter < 2 || jump.abs() > 1.5 * step {
            continue;
        }
        // Travel of one row, in which the crossing lies.
        let travel = jump / shorter as f64;
        let line = 0.5 * (values[*here] + values[here - 1]);
        for (row, side) in [(here - 1, -0.5), (*here, 0.5)] {
            found[row] = line + side * travel;
            variances[row] = travel * travel / 12.0;
        }
    }
    (found, variances)
}
