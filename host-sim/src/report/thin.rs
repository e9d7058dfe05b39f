//! Fewer points that tell the same story.
//!
//! A log of a million rows makes a page that no browser opens, and a chart of a thousand pixels
//! cannot show it anyway. Leaving out every n-th point would be the wrong way: it drops the one
//! spike that mattered, and beats against anything periodic. Two ways are honest:
//! - A curve over time keeps the lowest and the highest point of each stretch, so its outline,
//!   with every spike, is that of the full data ([`thin_series`]).
//! - A cloud keeps points in proportion to how dense it is, and at least one from every place
//!   where there is any, so outliers stay ([`thin_scatter`]).
//!
//! Kept points are measured ones, in their order, never averages; chance plays no part.

use std::collections::BTreeMap;

/// The smallest sensible limit; a smaller `max_points` is raised to this.
const FEWEST: usize = 16;

/// At most `max_points` of a curve, in order: of every stretch of samples its lowest and its
/// highest value, and of the whole its ends. Where the data has a hole (a NaN in `x` or `y`), so
/// has the result. Values behind the shorter slice's end are ignored.
pub fn thin_series(x: &[f64], y: &[f64], max_points: usize) -> (Vec<f64>, Vec<f64>) {
    let length = x.len().min(y.len());
    let max_points = max_points.max(FEWEST);
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

/// At most `max_points` of a cloud of points, in their order. The plane is cut into a grid;
/// every cell that holds points keeps at least one, the rest is shared out by how many each
/// holds, and the outermost points stay. Points that are not finite are left out. Values behind
/// the shorter slice's end are ignored.
pub fn thin_scatter(x: &[f64], y: &[f64], max_points: usize) -> (Vec<f64>, Vec<f64>) {
    let solid: Vec<usize> =
        (0..x.len().min(y.len())).filter(|&i| x[i].is_finite() && y[i].is_finite()).collect();
    let take = |kept: &[usize]| kept.iter().map(|&i| (x[i], y[i])).unzip();
    let max_points = max_points.max(FEWEST);
    if solid.len() <= max_points {
        return take(&solid);
    }
    let outermost = [outermost(&solid, x), outermost(&solid, y)].concat();
    // At most a quarter of the points goes to "at least one per cell", the rest to proportion.
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

/// Where the lowest and the highest of these values are.
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

/// Which of `cells` equal parts of the range of these values a value lies in.
fn grid(outermost: &[usize], values: &[f64], cells: usize) -> impl Fn(f64) -> usize + use<> {
    let fold = |pick: fn(f64, f64) -> f64| outermost.iter().map(|&i| values[i]).reduce(pick);
    let low = fold(f64::min).unwrap_or(0.0);
    let high = fold(f64::max).unwrap_or(1.0);
    // Halves, since the width of the range itself may be more than the largest number.
    let width = (high / 2.0 - low / 2.0).max(f64::MIN_POSITIVE);
    move |value| {
        let part = (value / 2.0 - low / 2.0) / width;
        ((part * cells as f64) as usize).min(cells - 1)
    }
}

/// The values in steps of a hundred-thousandth of the largest: no chart shows more, and a page of
/// all digits is three times as long.
pub fn rounded(values: &[f64]) -> Vec<f64> {
    let largest = values.iter().filter(|v| v.is_finite()).fold(0.0f64, |most, v| most.max(v.abs()));
    if largest == 0.0 {
        return values.to_vec();
    }
    let exponent = 5 - largest.log10().floor() as i32;
    // Multiplying or dividing by a whole power of ten leaves the nearest number of few digits.
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
    fn values_are_cut_to_what_a_chart_shows() {
        assert_eq!(rounded(&[0.1 + 0.2, -1.234_567_89, f64::NAN])[..2], [0.3, -1.23457]);
        assert_eq!(rounded(&[1.0, 123_456_789.0]), [0.0, 123_457_000.0]);
        assert_eq!(rounded(&[0.0, 0.0]), [0.0, 0.0]);
    }
}
