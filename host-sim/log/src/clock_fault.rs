//! Time columns that are no clock: they stand still, or hold the step between rows.
//!
//! Such a column has no error row by row, because stamps may repeat. Without this check, a log without times would be
//! fitted as if inertia, delays and drift could be judged.

use super::options::MAX_BAD_SHARE;

/// Rows that share a stamp, for the clock to stand still. Fewer may be a coarse clock.
const MIN_EQUAL_ROWS: usize = 20;

/// The same in the usual number of rows that share a stamp.
const MIN_EQUAL_RATIO: usize = 20;

/// Range of 90 % of the steps between rows, in median steps. Stamps in random order have a tenth to nearly twice the median.
const STEP_SPREAD: (f64, f64) = (0.3, 3.0);

/// Maximum share of distinct values in a column of steps whose spread is larger. Stamps in random order are distinct.
const MAX_DISTINCT_STEPS: f64 = 0.5;

/// Why a column is no clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ClockFault {
    /// One stamp, s, is in this number of rows, from the first one on.
    StandsStill { first: usize, rows: usize, stamp_s: f64 },
    /// The values are steps between rows, with this median, s.
    Steps { median_s: f64 },
}

/// Returns true if the values of a column may be the steps between rows, as the size of a step in any unit of time shows.
pub(super) fn is_step_column(values: &[f64]) -> bool {
    match clock_fault(values) {
        Some(ClockFault::Steps { .. }) => true,
        Some(ClockFault::StandsStill { rows, stamp_s, .. }) => {
            rows == values.len() && stamp_s > 0.0
        }
        None => false,
    }
}

/// Returns why the times of a run, in the order of the file, are no clock.
pub(super) fn clock_fault(time: &[f64]) -> Option<ClockFault> {
    stands_still(time).or_else(|| steps(time))
}

fn stands_still(time: &[f64]) -> Option<ClockFault> {
    let mut sizes: Vec<usize> = time.chunk_by(|a, b| a == b).map(<[f64]>::len).collect();
    let largest = sizes.iter().copied().enumerate().rev().max_by_key(|(_, size)| *size);
    let (at, rows) = largest.filter(|(_, rows)| *rows >= MIN_EQUAL_ROWS)?;
    let first = sizes[..at].iter().sum();
    if rows < time.len() {
        let middle = sizes.len() / 2;
        let usual = *sizes.select_nth_unstable(middle).1;
        if rows < MIN_EQUAL_RATIO * usual || rows as f64 <= MAX_BAD_SHARE * time.len() as f64 {
            return None;
        }
    }
    Some(ClockFault::StandsStill { first, rows, stamp_s: time[first] })
}

fn steps(time: &[f64]) -> Option<ClockFault> {
    let rows = time.len();
    let backward = time.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if rows < MIN_EQUAL_ROWS || backward as f64 <= MAX_BAD_SHARE * rows as f64 {
        return None;
    }
    let sorted = |part: &[f64]| {
        let mut sorted = part.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted
    };
    let quantile =
        |sorted: &[f64], share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    let all = sorted(time);
    let [low, quarter, median, three_quarters, high] =
        [0.05, 0.25, 0.5, 0.75, 0.95].map(|share| quantile(&all, share));
    let distinct = all.chunk_by(|a, b| a == b).count();
    let is_narrow = low >= STEP_SPREAD.0 * median && high <= STEP_SPREAD.1 * median;
    let third = rows / 3;
    let [early, late] =
        [&time[..third], &time[rows - third..]].map(|part| quantile(&sorted(part), 0.5));
    // The times of a clock grow by more than their quartiles are apart, also if rows of several recordings alternate.
    let advances = (late - early).abs() > (three_quarters - quarter).max(0.5 * median);
    let is_step = all[0] >= 0.0
        && median > 0.0
        && !advances
        && (is_narrow || (distinct as f64) < MAX_DISTINCT_STEPS * rows as f64);
    is_step.then_some(ClockFault::Steps { median_s: median })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(rows: usize, time: impl Fn(usize) -> f64) -> Option<ClockFault> {
        clock_fault(&(0..rows).map(time).collect::<Vec<f64>>())
    }

    #[test]
    fn clock_fault_with_constant_time_says_it_stands_still() {
        let fault = |first, rows, stamp_s| Some(ClockFault::StandsStill { first, rows, stamp_s });
        assert_eq!(clock(200, |_| 0.0035), fault(0, 200, 0.0035));
        let halts = |row: usize| 0.01 * (row.min(60) + row.saturating_sub(100)) as f64;
        assert_eq!(clock(200, halts), fault(60, 41, 0.6));
    }

    #[test]
    fn clock_fault_with_uneven_steps_says_so() {
        let jitter = |row: usize| 0.0035 + 1e-5 * (row * 37 % 11) as f64;
        assert_eq!(clock(300, jitter), Some(ClockFault::Steps { median_s: 0.0035 + 5e-5 }));
        let bursts = |row: usize| if row.is_multiple_of(3) { 0.0 } else { 0.004 };
        assert_eq!(clock(300, bursts), Some(ClockFault::Steps { median_s: 0.004 }));
    }

    #[test]
    fn clock_fault_with_clock_returns_none() {
        assert_eq!(clock(10, |_| 7.0), None, "a few rows");
        assert_eq!(clock(300, |row| (row / 40) as f64), None, "a coarse clock");
        assert_eq!(clock(300, |row| 0.01 * (row % 100) as f64), None, "three recordings");
        assert_eq!(clock(300, |row| 0.01 * (row * 77 % 300) as f64), None, "in another order");
        assert_eq!(
            clock(300, |row| 0.01 * (row / 2) as f64 + (row % 2) as f64),
            None,
            "two clocks"
        );
        assert_eq!(clock(300, |row| 3.0 - 0.01 * row as f64), None, "backwards");
    }
}
