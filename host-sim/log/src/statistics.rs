//! Robust statistics of a column: median, quantile, extent.
//!
//! All of them select values of the column; none interpolates but [`median_of_sorted`]. So a median of a quantised column
//! is a value that the column holds. The functions reorder the values, which avoids a copy. Without values they return
//! `None`. A positive NaN counts as larger than every number (the order of [`f64::total_cmp`]), so a column that may hold
//! some is filtered before.

use crate::work::checkpoint;

/// Returns the value at a share of the way from the least to the largest: rank `share * (n - 1)`, rounded.
pub fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    select(values, (last as f64 * share).round() as usize)
}

/// Returns the value that a share of the values is below: rank `share * n`, rounded down. It differs from [`quantile`] by one
/// rank in a short column.
pub fn quantile_by_count(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let rank = ((values.len() as f64 * share) as usize).min(last);
    select(&mut values, rank)
}

/// Returns the distance between the quantiles `share` and `1 - share`; 0 without values.
pub fn quantile_range(values: &mut [f64], share: f64) -> f64 {
    let ends = [1.0 - share, share].map(|share| quantile(values, share).unwrap_or_default());
    ends[0] - ends[1]
}

/// Returns the value in the middle; of an even number the upper one of the two.
pub fn median(values: &mut [f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Returns the value in the middle of sorted ones; of an even number the mean of the two, of none NaN.
pub fn median_of_sorted(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    match sorted.len() % 2 {
        _ if sorted.is_empty() => f64::NAN,
        1 => sorted[middle],
        _ => 0.5 * (sorted[middle - 1] + sorted[middle]),
    }
}

/// Returns the median of the steps forward of a clock; `None` if there is none.
pub fn median_step(time: &[f64]) -> Option<f64> {
    let steps = time.windows(2).map(|pair| pair[1] - pair[0]);
    median(&mut steps.filter(|step| *step > 0.0).collect::<Vec<_>>())
}

/// Returns the least and the largest value; infinities for no values.
pub fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| {
        [least.min(value), most.max(value)]
    })
}

/// Returns the correlation of two columns; 0 if one of them is constant.
pub fn correlation(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let count = pairs.clone().count().max(1) as f64;
    let mean_x = pairs.clone().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = pairs.clone().map(|(_, y)| y).sum::<f64>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        xx += (x - mean_x).powi(2);
        xy += (x - mean_x) * (y - mean_y);
        yy += (y - mean_y).powi(2);
    }
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// Returns the value at a rank, counted from 0.
fn select(values: &mut [f64], rank: usize) -> Option<f64> {
    checkpoint();
    (rank < values.len()).then(|| *values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_without_values_return_none() {
        assert_eq!([median(&mut []), quantile(&mut [], 0.9)], [None; 2]);
        assert_eq!(quantile_by_count(Vec::new(), 0.9), None);
        assert!(median_of_sorted(&[]).is_nan());
        assert_eq!(median_step(&[1.0, 1.0, 0.0]), None);
    }

    #[test]
    fn median_of_even_number_is_upper_value_or_mean() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(median(&mut values.clone()), Some(3.0));
        assert_eq!(median_of_sorted(&[1.0, 2.0, 3.0, 4.0]), 2.5);
        assert_eq!(median_of_sorted(&[1.0, 2.0, 3.0]), 2.0);
    }

    #[test]
    fn quantile_rounds_rank_and_quantile_by_count_cuts_it() {
        let values: Vec<f64> = (0..10).rev().map(f64::from).collect();
        assert_eq!(quantile(&mut values.clone(), 0.95), Some(9.0));
        assert_eq!(quantile(&mut values.clone(), 0.04), Some(0.0));
        assert_eq!(quantile_by_count(values.clone(), 0.89), Some(8.0));
        assert_eq!(quantile_by_count(values.clone(), 1.0), Some(9.0));
    }

    #[test]
    fn quantile_with_nan_counts_it_as_largest() {
        assert_eq!(quantile(&mut [f64::NAN, 2.0, 1.0], 0.5), Some(2.0));
        assert!(quantile(&mut [f64::NAN, 2.0, 1.0], 1.0).is_some_and(f64::is_nan));
    }
}
