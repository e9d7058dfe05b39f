//! Reduction of the number of points in a chart.
//!
//! A browser cannot draw a million points, and a chart of a thousand pixels cannot show them. Keeping every n-th point
//! would drop spikes and alias periodic signals. Two methods keep the visible content:
//! - A curve over time keeps the minimum and maximum of each segment, so its outline and every spike remain
//!   ([`thin_series`]).
//! - A scatter plot keeps points in proportion to their density, and at least one of every occupied cell, so outliers
//!   remain ([`thin_scatter`]).
//!
//! The kept points are original points in their order, not averages. The selection is deterministic.

use std::collections::BTreeMap;

/// Minimum number of kept points; a smaller `max_points` is raised to this.
const MIN_POINTS: usize = 16;

/// Returns at most `max_points` points of a curve, in order: the minimum and maximum of every segment, and both ends. A
/// gap in the data (NaN in `x` or `y`) remains a gap. If the slices differ in length, the shorter length applies.
pub fn thin_series(x: &[f64], y: &[f64], max_points: usize) -> (Vec<f64>, Vec<f64>) {
    let length = x.len().min(y.len());
    let max_points = max_points.max(MIN_POINTS);
    if length <= max_points {
        return (x[..length].to_vec(), y[..length].to_vec());
    }
    let is_hole = |i: usize| !(x[i].is_finite() && y[i].is_finite());
    let kept_per_stretch = if (0..length).any(is_hole) { 3 } else { 2 };
    let stretches = (max_points - 2) / kept_per_stretch;

    let mut kept = vec![0];
    for stretch in 0..stretches {
        let (from, to) = (stretch * length / stretches, (stretch + 1) * length / stretches);
        let solid = || (from..to).filter(|&i| !is_hole(i));
        let by_value = |&a: &usize, &b: &usize| y[a].total_cmp(&y[b]);
        let mut here =
            [solid().min_by(by_value), solid().max_by(by_value), (from..to).find(|&i| is_hole(i))];
        here.sort_unstable();
        kept.extend(here.into_iter().flatten());
    }
    kept.push(length - 1);
    kept.dedup();
    kept.iter().map(|&i| (x[i], y[i])).unzip()
}

/// Returns at most `max_points` points of a scatter plot, in order. The plane is divided into a grid. Every occupied cell
/// keeps at least one point, the others are distributed in proportion to the points of each cell, and the outermost
/// points are kept. Points that are not finite are left out. If the slices differ in length, the shorter length applies.
pub fn thin_scatter(x: &[f64], y: &[f64], max_points: usize) -> (Vec<f64>, Vec<f64>) {
    let solid: Vec<usize> =
        (0..x.len().min(y.len())).filter(|&i| x[i].is_finite() && y[i].is_finite()).collect();
    let take = |kept: &[usize]| kept.iter().map(|&i| (x[i], y[i])).unzip();
    let max_points = max_points.max(MIN_POINTS);
    if solid.len() <= max_points {
        return take(&solid);
    }
    let outermost = [outermost(&solid, x), outermost(&solid, y)].concat();
    // At most a quarter of the points is used for one point per cell, the rest is distributed in proportion.
    let side = ((max_points / 4) as f64).sqrt() as usize;
    let (column, row) = (grid(&outermost, x, side), grid(&outermost, y, side));

    let mut cells: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for &i in &solid {
        cells.entry((column(x[i]), row(y[i]))).or_default().push(i);
    }
    let to_share = max_points - outermost.len() - cells.len();
    let mut kept = outermost;
    for cell in cells.values() {
        let share = 1 + to_share * (cell.len() - 1) / solid.len();
        kept.extend((0..share).map(|k| cell[k * cell.len() / share]));
    }
    kept.sort_unstable();
    kept.dedup();
    take(&kept)
}

/// Returns the indices of the minimum and the maximum.
fn outermost(among: &[usize], values: &[f64]) -> Vec<usize> {
    let by_value = |&&a: &&usize, &&b: &&usize| values[a].total_cmp(&values[b]);
    among
        .iter()
        .min_by(by_value)
        .into_iter()
        .chain(among.iter().max_by(by_value))
        .copied()
        .collect()
}

/// Returns a function that maps a value to one of `cells` equal parts of the range.
fn grid(outermost: &[usize], values: &[f64], cells: usize) -> impl Fn(f64) -> usize + use<> {
    let fold = |pick: fn(f64, f64) -> f64| outermost.iter().map(|&i| values[i]).reduce(pick);
    let low = fold(f64::min).unwrap_or(0.0);
    let high = fold(f64::max).unwrap_or(1.0);
    // Halved, because the width of the range may exceed the largest finite number.
    let width = (high / 2.0 - low / 2.0).max(f64::MIN_POSITIVE);
    move |value| {
        let part = (value / 2.0 - low / 2.0) / width;
        ((part * cells as f64) as usize).min(cells - 1)
    }
}

/// Rounds the values to steps of 1e-5 of the largest one. A chart does not show more digits, and they would make the page
/// three times as large.
pub fn rounded(values: &[f64]) -> Vec<f64> {
    let largest = values.iter().filter(|v| v.is_finite()).fold(0.0f64, |most, v| most.max(v.abs()));
    if largest == 0.0 {
        return values.to_vec();
    }
    let exponent = 5 - largest.log10().floor() as i32;
    // Multiplying and dividing by a power of ten gives the nearest number with few digits.
    let power = 10f64.powi(exponent.abs());
    let round = |value: &f64| match exponent {
        0.. => (value * power).round() / power,
        _ => (value / power).round() * power,
    };
    values.iter().map(round).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_keeps_five_digits_of_the_largest_value() {
        assert_eq!(rounded(&[0.1 + 0.2, -1.234_567_89, f64::NAN])[..2], [0.3, -1.23457]);
        assert_eq!(rounded(&[1.0, 123_456_789.0]), [0.0, 123_457_000.0]);
        assert_eq!(rounded(&[0.0, 0.0]), [0.0, 0.0]);
    }
}
