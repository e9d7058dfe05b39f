//! Means of a residual over a quantity, with their standard errors.
//!
//! A cloud of many residuals hides small effects; means over bins show them. Neighbouring rows are correlated, so the
//! standard error is cluster-robust: rows that follow each other in one bin, up to twice the autocorrelation time, form
//! one observation (a *passage*). A bin with few passages has no error bar, because its standard error is not reliable.

use super::rows::Rows;
use friction_diagnose::Spacing;

/// Minimum number of rows in a bin; bins with fewer rows are left out.
const MIN_ROWS: usize = 6;

/// Minimum number of passages for an error bar.
const MIN_PASSAGES: usize = 4;

/// Mean of one bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mean {
    /// Mean of the quantity.
    pub x: f64,
    /// Mean of the residual.
    pub y: f64,
    /// Standard error of the mean of the residual; NaN with fewer than [`MIN_PASSAGES`] passages.
    pub error: f64,
    /// Lower quartile of the residual.
    pub low: f64,
    /// Upper quartile of the residual.
    pub high: f64,
}

/// Assignment of rows to bins.
pub(super) struct Bins {
    /// The bin of each row.
    of_row: Vec<Option<usize>>,
    /// True for the first row of each passage.
    begins: Vec<bool>,
    count: usize,
}

impl Bins {
    /// Assigns rows to bins of `x`; rows where `x` is not finite are left out. `memory` is the autocorrelation time of the
    /// residual, in rows.
    pub fn new(rows: &Rows, x: &[f64], spacing: Spacing, count: usize, memory: f64) -> Self {
        let scale = |x: f64| match spacing {
            Spacing::Even | Spacing::Runs => x,
            Spacing::NarrowAtZero => x.signum() * x.abs().sqrt(),
            Spacing::Logarithmic if x > 0.0 => x.ln(),
            Spacing::Logarithmic => f64::NAN,
        };
        let scaled: Vec<f64> = x.iter().map(|x| scale(*x)).collect();
        let finite = || scaled.iter().copied().filter(|x| x.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let width = (finite().fold(f64::NEG_INFINITY, f64::max) - low) / count as f64;
        let place = |x: f64| {
            let at = if width > 0.0 { (x - low) / width } else { 0.0 };
            x.is_finite().then_some((at as usize).min(count - 1))
        };
        let mut of_row: Vec<Option<usize>> = scaled.iter().map(|x| place(*x)).collect();
        let mut begins = vec![false; of_row.len()];
        let mut runs: Vec<usize> = Vec::new();
        for stretch in &rows.stretches {
            if let Some(begin) = begins.get_mut(stretch.rows.start) {
                *begin = true;
            }
            if spacing == Spacing::Runs {
                let known = runs.iter().position(|run| *run == stretch.run);
                let run = known.unwrap_or_else(|| {
                    runs.push(stretch.run);
                    runs.len() - 1
                });
                for row in stretch.rows.clone() {
                    of_row[row] = x[row].is_finite().then_some(run);
                }
            }
        }
        let longest = (2.0 * memory).ceil().max(1.0) as usize;
        let mut length = 0;
        for row in 0..of_row.len() {
            let goes_on = row > 0 && !begins[row] && of_row[row] == of_row[row - 1];
            length = if goes_on && length < longest { length + 1 } else { 1 };
            begins[row] = length == 1;
        }
        let count = if spacing == Spacing::Runs { runs.len() } else { count };
        Self { of_row, begins, count }
    }

    /// Returns the weighted mean of `y` in each bin with enough rows. Rows where `y` is not finite are left out.
    pub fn means(&self, x: &[f64], y: &[f64], weight: Option<&[f64]>) -> Vec<Mean> {
        let weigh = |row: usize| weight.map_or(1.0, |weight| weight[row]);
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); self.count];
        for (row, bin) in self.of_row.iter().enumerate() {
            if let Some(bin) = bin.filter(|_| y[row].is_finite() && weigh(row) > 0.0) {
                members[bin].push(row);
            }
        }
        let mut means: Vec<Mean> = members
            .iter()
            .filter(|rows| rows.len() >= MIN_ROWS)
            .map(|rows| self.mean(rows, x, y, &weigh))
            .collect();
        means.sort_by(|a, b| a.x.total_cmp(&b.x));
        means
    }

    fn mean(&self, rows: &[usize], x: &[f64], y: &[f64], weigh: &dyn Fn(usize) -> f64) -> Mean {
        let all: f64 = rows.iter().map(|row| weigh(*row)).sum();
        let mean = |v: &[f64]| rows.iter().map(|row| weigh(*row) * v[*row]).sum::<f64>() / all;
        let at = mean(y);
        let (mut passages, mut squares, mut pull) = (0u32, 0.0, 0.0);
        let mut last = None;
        for row in rows {
            let goes_on = last == Some(row.wrapping_sub(1)) && !self.begins[*row];
            if !goes_on {
                squares += pull * pull;
                (passages, pull) = (passages + 1, 0.0);
            }
            pull += weigh(*row) * (y[*row] - at);
            last = Some(*row);
        }
        squares += pull * pull;
        let n = f64::from(passages);
        let error = match passages as usize >= MIN_PASSAGES {
            true => (squares * n / (n - 1.0)).sqrt() / all,
            false => f64::NAN,
        };
        let mut sorted: Vec<f64> = rows.iter().map(|row| y[*row]).collect();
        sorted.sort_by(f64::total_cmp);
        let quartile = |share: usize| sorted[(sorted.len() - 1) * share / 4];
        Mean { x: mean(x), y: at, error, low: quartile(1), high: quartile(3) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of one run without a model.
    fn rows(count: usize) -> Rows<'static> {
        Rows {
            stretches: Vec::new(),
            before: vec![0.0; count],
            after: vec![0.0; count],
            judged: vec![true; count],
            weight: vec![1.0; count],
            velocity: vec![1.0; count],
            fastest: 1.0,
            decimate: 1,
        }
    }

    #[test]
    fn means_of_correlated_rows_have_larger_errors() {
        // Two bins that alternate every ten rows; noise with standard deviation 1/sqrt(12) around 1 and -1.
        let mut state = 1u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let x: Vec<f64> = (0..4000).map(|row| f64::from(row / 10 % 2)).collect();
        let y: Vec<f64> = x.iter().map(|x| 2.0 * x - 1.0 + noise()).collect();
        let independent = Bins::new(&rows(4000), &x, Spacing::Even, 2, 0.5).means(&x, &y, None);
        assert_eq!(independent.len(), 2);
        for (mean, expected) in independent.iter().zip([-1.0, 1.0]) {
            assert!((mean.y - expected).abs() < 4.0 * mean.error, "{mean:?}");
            let error = (1.0 / 12.0 / 2000f64).sqrt();
            assert!((mean.error / error - 1.0).abs() < 0.1, "{mean:?}");
            assert!(mean.low < mean.y && mean.y < mean.high);
        }
        // Ten consecutive equal rows are one observation, so the error is larger.
        let y: Vec<f64> = y.chunks(10).flat_map(|part| [part[0]; 10]).collect();
        let together = Bins::new(&rows(4000), &x, Spacing::Even, 2, 20.0).means(&x, &y, None);
        assert!(together[0].error > 2.5 * independent[0].error, "{together:?}");
    }

    #[test]
    fn means_leave_out_sparse_bins_and_values_that_are_not_finite() {
        let x: Vec<f64> = (0..100).map(|row| if row < 97 { 0.1 } else { 1.0 }).collect();
        let y: Vec<f64> = (0..100).map(|row| if row % 2 == 0 { f64::NAN } else { 1.0 }).collect();
        let bins = Bins::new(&rows(100), &x, Spacing::Even, 10, 1.0);
        let means = bins.means(&x, &y, None);
        assert_eq!(means.len(), 1, "three rows are too few for a mean");
        assert_eq!(means[0].y, 1.0);
        let logarithmic = Bins::new(&rows(100), &[-1.0; 100], Spacing::Logarithmic, 10, 1.0);
        assert!(logarithmic.means(&x, &x, None).is_empty());
        let still = Bins::new(&rows(100), &[2.0; 100], Spacing::NarrowAtZero, 10, 1.0);
        assert_eq!(still.means(&[2.0; 100], &x, None).len(), 1);
    }
}
