//! The chart of the first screen: the torque over time, where the extension changes the prediction most.
//!
//! A whole run hides an effect that is small against the torque. The chart therefore shows a short window. Its place is
//! where base and extended model differ most relative to the error that remains, so that the difference is visible beside
//! the logged torque. Without an extension, it is where the base model is wrong most.

use super::Scene;
use super::figures::{AFTER, CURVE_POINTS, LOGGED};
use super::rows::{Stretch, times};
use crate::page::words::capitalised;
use crate::report::{Axis, Chart, Series, rounded};
use joint_log::number::significant;
use joint_log::statistics::extent;
use std::ops::Range;

/// Share of a segment that the window shows: short, so that the torque itself changes little in most windows.
const WINDOW_SHARE: f64 = 1.0 / 40.0;
/// Minimum number of rows of the window, for [`MEANS`] means of 15 rows each.
const MIN_WINDOW_ROWS: usize = 240;
/// Number of means over the window.
const MEANS: usize = 16;
/// Ratio of the squared effect to the squared error below which means are drawn. An effect of less than twice the error is
/// hidden in the noise of single rows.
const HIDDEN_EFFECT_RATIO: f64 = 4.0;

/// A window of held-out rows.
struct Window<'a> {
    stretch: &'a Stretch<'a>,
    rows: Range<usize>,
    /// Ratio of the squared effect to the squared error.
    ratio: f64,
}

/// Returns the window of a segment with the largest ratio of effect to error; `None` for a segment without judged rows.
fn window<'a>(scene: &Scene, stretch: &'a Stretch<'a>) -> Option<Window<'a>> {
    let count = stretch.track.len();
    let length = ((count as f64 * WINDOW_SHARE) as usize).max(MIN_WINDOW_ROWS).min(count);
    let floor = scene.about.found.noise_floor.powi(2).max(f64::MIN_POSITIVE);
    // Sums of effect and error up to each row.
    let (mut effect, mut error) = (vec![0.0], vec![0.0]);
    for row in 0..count {
        let (logged, base, extended) =
            (stretch.track.torque[row], stretch.before[row], stretch.after[row]);
        let [row_effect, row_error] = match (stretch.track.is_included(row), scene.is_extended()) {
            (false, _) => [0.0, 0.0],
            (true, true) => [(extended - base).powi(2), (logged - extended).powi(2)],
            (true, false) => [(logged - base).powi(2), 0.0],
        };
        effect.push(effect[row] + row_effect);
        error.push(error[row] + row_error);
    }
    let windows = (0..=count - length).map(|begin| {
        let rows = begin..begin + length;
        let sum = |of: &[f64]| of[rows.end] - of[rows.start];
        // An error below the noise floor is chance, and must not select the window.
        let ratio = sum(&effect) / sum(&error).max(length as f64 * floor);
        Window { stretch, rows, ratio }
    });
    windows.filter(|window| window.ratio > 0.0).max_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// Returns the chart; `None` if no model predicts a held-out row.
pub(super) fn chart(scene: &Scene) -> Option<Chart> {
    let windows = scene.held.stretches.iter().filter_map(|stretch| window(scene, stretch));
    let Window { stretch, rows, ratio } = windows.max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
    let time: Vec<f64> = times(stretch).collect();
    let curve = |name: &str, torque: &[f64]| {
        Series::thin_line(name, &time[rows.clone()], &torque[rows.clone()], CURVE_POINTS)
    };
    let length = (rows.len() / MEANS).max(1);
    // A mean over rows between which the torque changes shows neither.
    let base = &stretch.before[rows.clone()];
    let span = extent(base.iter().copied());
    let is_steady = span[1] - span[0] < MEANS as f64 * scene.about.found.noise_floor;
    let is_hidden = scene.is_extended() && ratio < HIDDEN_EFFECT_RATIO;
    let (logged, averaged) = if is_hidden && is_steady && length > 1 {
        let averaged =
            format!(" Each logged point is the mean of {length} rows with two standard errors.");
        (means(stretch, &time, &rows, length), averaged)
    } else {
        (curve(LOGGED, &stretch.track.torque).muted(), String::new())
    };
    let mut series = vec![logged];
    series.push(curve(scene.base(), stretch.before));
    if scene.is_extended() {
        series.push(curve(AFTER, stretch.after));
    }
    let run = &scene.about.input.data.runs[stretch.run].name;
    let shown_s = time[rows.end - 1] - time[rows.start];
    let place = match scene.is_extended() {
        true => "the extension changes the prediction most relative to the remaining error",
        false => "the error of the model is largest",
    };
    Some(Chart {
        title: format!("{} over time", capitalised(scene.torque())),
        caption: format!(
            "{} s of run {run}, held out, where {place}.{averaged}",
            significant(shown_s, 2)
        ),
        x: Axis::new("time since the start of the run (s)"),
        y: Axis::new(format!("{} ({})", scene.torque(), scene.unit())),
        series,
    })
}

/// Returns means of `length` logged rows each, with two standard errors.
fn means(stretch: &Stretch, time: &[f64], rows: &Range<usize>, length: usize) -> Series {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let groups = || rows.clone().step_by(length).map(|row| row..(row + length).min(rows.end));
    let whole = || groups().filter(|group| group.len() == length);
    let x: Vec<f64> = whole().map(|group| mean(&time[group])).collect();
    let y: Vec<f64> = whole().map(|group| mean(&stretch.track.torque[group])).collect();
    // The scatter about the model, because the torque itself may change within a group.
    let error = |group: Range<usize>| {
        let about = |row: usize| stretch.track.torque[row] - stretch.after[row];
        let about: Vec<f64> = group.map(about).collect();
        let middle = mean(&about);
        let squares: f64 = about.iter().map(|value| (value - middle).powi(2)).sum();
        2.0 * (squares / (length * length.saturating_sub(1).max(1)) as f64).sqrt()
    };
    let error = whole().map(error).collect();
    Series::line(LOGGED, rounded(&x), rounded(&y)).with_error(error).muted()
}
