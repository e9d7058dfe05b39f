//! The step of a quantised column.
//!
//! An encoder counts: neighbouring values differ by a whole number of steps, often by none or one. The
//! smallest difference that comes often is tried as the step; it is one if nearly all small differences are
//! multiples of it. Digits of a file quantise too, and are found likewise; they are small, and say so.
//!
//! An encoder tells most when it counts: between the last row of one count and the first row of the next the
//! joint passed the line between them. So a row beside a change is measured to a part of a step (the travel
//! of one row, which is a step over the rows of the shorter plateau), while the many rows of a plateau
//! together say no more than one of them: somewhere within the step. Taking all rows as independently wrong by
//! step^2/12 would follow the staircase where the joint is slow, which is where it turns.

/// Differences up to so many steps are looked at: beyond, digits and rounding blur what is a multiple.
const LARGEST: f64 = 40.0;

/// Share of the differences that must be multiples, and how near to one.
const MULTIPLES: (f64, f64) = (0.95, 0.1);

/// Differences a judgement needs.
const FEWEST: usize = 20;

/// Step of the columns of all stretches; 0 where they have none.
pub fn quantum<'a>(columns: impl Iterator<Item = &'a [f64]>) -> f64 {
    let mut steps: Vec<f64> = columns
        .flat_map(|column| column.windows(2).map(|w| (w[1] - w[0]).abs()))
        .filter(|step| *step > 0.0)
        .collect();
    if steps.len() < FEWEST {
        return 0.0;
    }
    steps.sort_by(f64::total_cmp);
    // Rounding in a file spreads one step over a few values: the middle of the smallest cluster.
    let least = steps[steps.len() / 200];
    let near = steps.partition_point(|step| *step < 1.5 * least);
    let from = steps.partition_point(|step| *step < 0.67 * least);
    if near - from < FEWEST / 2 {
        return 0.0;
    }
    let step = steps[(from + near) / 2];
    let small = &steps[..steps.partition_point(|other| *other < LARGEST * step)];
    let multiple = |other: &&f64| {
        let times = *other / step;
        (times - times.round()).abs() < MULTIPLES.1 && times.round() >= 1.0
    };
    let share = small.iter().filter(multiple).count() as f64 / small.len() as f64;
    if share >= MULTIPLES.0 { step } else { 0.0 }
}

/// A quantised column as it most likely was, with the variance of each value.
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
        // Travel of a row, which the crossing lies somewhere in.
        let travel = jump / shorter as f64;
        let line = 0.5 * (values[*here] + values[here - 1]);
        for (row, side) in [(here - 1, -0.5), (*here, 0.5)] {
            found[row] = line + side * travel;
            variances[row] = travel * travel / 12.0;
        }
    }
    (found, variances)
}
