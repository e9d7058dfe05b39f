//! Detection of rows at rest.
//!
//! At rest the velocity has noise about zero, and a bristle model integrates it. This causes most of the error of such
//! a model, so rest is decided and not averaged. A window of rows is at rest if its position has no slope and no
//! curvature beyond its noise. Without a position, mean and slope of its velocity must be those of noise about zero. A
//! row is at rest if any window that contains it is.
//!
//! The window is long enough to distinguish a hundredth of the usual speed from rest. Shorter rests are left to the
//! smoother. A window does not locate the start of a motion to a row, and a row at a start is a thousandth of a radian.
//! So each end of a rest is estimated again: every row is tried as the start of a jump, a ramp or a bend of the velocity
//! (one free size, least squares).

use super::filter::{Noise, Series};
use crate::work::checkpoint_at;
use std::ops::Range;

/// Maximum speed of rest, as a share of the 95th percentile of speed, if it lasts for a window.
const MAX_REST_SPEED: f64 = 0.01;

/// Maximum mean, slope or curvature that counts as zero, standard errors.
const MAX_ERRORS: f64 = 3.0;

/// Maximum scatter at rest, relative to the noise.
const MAX_SCATTER: f64 = 1.7;

/// Maximum residual of a polynomial at a reversal, standard deviations of the noise.
const MAX_REVERSAL_RESIDUAL: f64 = 1.3;

/// Maximum distance of a row at rest from its level, standard deviations.
const MAX_LEVEL_DISTANCE: f64 = 5.0;

/// Factor by which a window's own scatter may be below the noise: that of a few rows may be half of it by chance.
const SCATTER_FACTOR: f64 = 3.0;

/// Minimum length of a rest, rows.
const MIN_REST_ROWS: usize = 3;

/// Minimum length of the window, rows.
const MIN_WINDOW_ROWS: usize = 8;

/// Maximum length of the window, rows.
const MAX_WINDOW_ROWS: usize = 120;

/// A column that shows rest.
#[derive(Clone, Copy)]
struct RestColumn<'a> {
    values: &'a [f64],
    /// Standard deviation of its noise.
    sigma: f64,
    is_position: bool,
}

/// The columns that show rest: a position, a velocity or both.
struct RestColumns<'a> {
    columns: Vec<RestColumn<'a>>,
    has_position: bool,
    /// Length of the window, rows.
    window: usize,
}

/// Finds the rows at rest. `step` is that of a quantised position, `speed` the 95th percentile of the speed, per
/// median step.
pub fn at_rest(series: &Series, noise: &Noise, step: f64, speed: f64) -> Vec<bool> {
    let rows = series.len();
    let mut found = vec![false; rows];
    let position = series.position.as_ref().map(|values| {
        let sigma = (noise.position + step * step / 12.0).sqrt();
        RestColumn { values, sigma, is_position: true }
    });
    let velocity = series.velocity.as_ref().map(|values| {
        let sigma = series.velocity_variance(noise).sqrt();
        RestColumn { values, sigma, is_position: false }
    });
    let columns = position.into_iter().chain(velocity).collect();
    let Some(columns) = RestColumns::new(columns, speed) else { return found };
    let rough = columns.rough_rests(rows);
    for (index, rest) in rough.iter().enumerate() {
        let before = if index > 0 { rough[index - 1].end } else { 0 };
        let after = rough.get(index + 1).map_or(rows, |next| next.start);
        let seen = Rest { of: &columns, rest: rest.clone() };
        if columns.has_position && seen.is_a_turn(rows) {
            continue;
        }
        let end = if rest.end == rows { rows } else { seen.end(after) };
        let start = if rest.start == 0 { 0 } else { seen.start(before) };
        let near = seen.near(rows);
        let (start, end) = (start.max(near.start), end.min(near.end));
        if end >= start + MIN_REST_ROWS {
            found[start..end].fill(true);
        }
    }
    if !columns.has_position && creeps(columns.columns[0].values, &found) {
        found.fill(false);
    }
    found
}

impl<'a> RestColumns<'a> {
    /// Returns the columns with the length of their window; `None` without a column.
    fn new(columns: Vec<RestColumn<'a>>, speed: f64) -> Option<Self> {
        let RestColumn { sigma, is_position, .. } = *columns.first()?;
        let slow = MAX_REST_SPEED * speed;
        let window = match is_position {
            true => (MAX_ERRORS * 12f64.sqrt() * sigma / slow).powf(2.0 / 3.0),
            false => (MAX_ERRORS * sigma / slow).powi(2),
        };
        let window = (window.ceil().min(1e6) as usize).clamp(MIN_WINDOW_ROWS, MAX_WINDOW_ROWS);
        Some(Self { columns, has_position: is_position, window })
    }

    /// Returns the rows in windows at rest.
    fn rough_rests(&self, rows: usize) -> Vec<Range<usize>> {
        let mut rough: Vec<Range<usize>> = Vec::new();
        for from in 0..(rows + 1).saturating_sub(self.window) {
            checkpoint_at(from);
            if self.columns.iter().all(|column| self.rests(column, from)) {
                match rough.last_mut() {
                    Some(last) if last.end >= from => last.end = from + self.window,
                    _ => rough.push(from..from + self.window),
                }
            }
        }
        rough
    }

    /// Returns true if a column shows rest in the window that begins at a row.
    fn rests(&self, column: &RestColumn, from: usize) -> bool {
        let sigma = column.sigma;
        let shape = Shape::of(&column.values[from..from + self.window]);
        let is_straight = shape.runs(sigma) < MAX_ERRORS && shape.scatter < MAX_SCATTER * sigma;
        if column.is_position {
            return is_straight && shape.bends(sigma) < MAX_ERRORS;
        }
        if self.has_position {
            // The position decides; the velocity at rest may have an offset for a while.
            return shape.mean.abs() < MAX_ERRORS * sigma;
        }
        // Its own scatter is used if it is less: a slow steady slide has less noise than a fast one.
        let mean = shape.mean.abs() * (self.window as f64).sqrt()
            / sigma.min(SCATTER_FACTOR * shape.scatter);
        (mean < MAX_ERRORS || mean.is_nan()) && is_straight
    }
}

/// Returns true if the rows at rest move in one direction on average. Then they are a slow slide, of which each window
/// looks like rest.
fn creeps(velocity: &[f64], at_rest: &[bool]) -> bool {
    let resting = || velocity.iter().zip(at_rest).filter(|(_, rests)| **rests).map(|(v, _)| v);
    let count = resting().count() as f64;
    let (sum, squares) = resting().fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
    count > 0.0 && sum * sum > MAX_ERRORS * MAX_ERRORS * squares
}

/// A rest with the columns that show it.
struct Rest<'a> {
    of: &'a RestColumns<'a>,
    rest: Range<usize>,
}

impl Rest<'_> {
    /// Returns the first row after the rest. Rows from `limit` belong to another rest.
    fn end(&self, limit: usize) -> usize {
        let Range { start, end } = self.rest;
        let first = (start + 1).max(end.saturating_sub(2 * self.of.window));
        let last = (end + self.of.window).min(limit);
        let candidates =
            first..(end + self.of.window / 2).min(last.saturating_sub(2)).max(first + 1);
        self.best(candidates, |at, by| (by > 0 && at + by < last).then(|| at + by), last - first)
    }

    /// Returns the first row of the rest.
    fn start(&self, limit: usize) -> usize {
        let Range { start, end } = self.rest;
        let last = (end - 1).min(start + 2 * self.of.window);
        let first = start.saturating_sub(self.of.window).max(limit);
        let candidates =
            start.saturating_sub(self.of.window / 2).max(first + 2).min(last)..last + 1;
        let back = |at: usize, by: usize| (at >= first + by).then(|| at - by);
        // Counted from the last row: in reverse a stop is a start.
        self.best(candidates, |at, by| if by > 0 { back(at, by) } else { None }, last - first)
    }

    /// Returns the row of `candidates` at which a start fits best. `row(at, by)` is the row `by` rows after the start,
    /// or `None` outside the evaluated rows.
    fn best(
        &self,
        candidates: Range<usize>,
        row: impl Fn(usize, usize) -> Option<usize>,
        most: usize,
    ) -> usize {
        let mut best = (f64::NEG_INFINITY, candidates.start);
        let middle = self.middle();
        for at in candidates {
            for power in [1, 2, 3] {
                let (mut product, mut square) = (0.0, 0.0);
                for RestColumn { values, sigma, is_position } in &self.of.columns {
                    let level = if *is_position { self.level(values, middle) } else { 0.0 };
                    for by in 1..=most {
                        let Some(row) = row(at, by) else { break };
                        let shape = if *is_position {
                            (by as f64).powi(power)
                        } else {
                            f64::from(power) * (by as f64).powi(power - 1)
                        };
                        product += shape * (values[row] - level) / (sigma * sigma);
                        square += shape * shape / (sigma * sigma);
                    }
                }
                // The variance that such a start explains.
                let explained = if square > 0.0 { product * product / square } else { 0.0 };
                if explained > best.0 {
                    best = (explained, at);
                }
            }
        }
        best.1
    }

    /// Returns true if one bend of the motion explains the rest and half its length on either side. A reversing joint
    /// also stays within one encoder step for some rows.
    fn is_a_turn(&self, rows: usize) -> bool {
        let half = (self.rest.end - self.rest.start).div_ceil(2);
        let (from, to) = (self.rest.start.saturating_sub(half), (self.rest.end + half).min(rows));
        self.of.columns.iter().all(|RestColumn { values, sigma, is_position }| {
            let degree = if *is_position { 3 } else { 2 };
            left_by_polynomial(&values[from..to], degree) < MAX_REVERSAL_RESIDUAL * sigma
        })
    }

    /// Returns true if a row is too far from the level to be at rest.
    fn is_off(&self, row: usize, middle: usize) -> bool {
        self.of.columns.iter().any(|RestColumn { values, sigma, is_position }| {
            let level = if *is_position { self.level(values, middle) } else { 0.0 };
            (values[row] - level).abs() > MAX_LEVEL_DISTANCE * sigma
        })
    }

    /// Returns the rows around the middle of the rest, up to the first that is off.
    fn near(&self, rows: usize) -> Range<usize> {
        let middle = self.middle();
        let is_off = |row: &usize| self.is_off(*row, middle);
        let end = (middle..rows).find(is_off).unwrap_or(rows);
        let start = (0..middle).rev().find(is_off).map_or(0, |row| row + 1);
        start..end
    }

    fn middle(&self) -> usize {
        self.rest.start + (self.rest.end - self.rest.start) / 2
    }

    /// Returns the position at rest: the mean over its middle.
    fn level(&self, values: &[f64], middle: usize) -> f64 {
        let half = (self.rest.end - self.rest.start) / 4;
        let part = &values[middle - half..=middle + half];
        part.iter().sum::<f64>() / part.len() as f64
    }
}

/// Mean, slope, curvature and residual of a window.
struct Shape {
    mean: f64,
    slope: f64,
    bend: f64,
    scatter: f64,
}

impl Shape {
    fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        // Orthogonal polynomials on an even grid.
        let middle = 0.5 * (count - 1.0);
        let first = |i: usize| i as f64 - middle;
        let square = (count * count - 1.0) / 12.0;
        let second = |i: usize| first(i) * first(i) - square;
        let origin = values[0];
        let (mut mean, mut slope, mut bend, mut squares) = (0.0, 0.0, 0.0, 0.0);
        for (i, value) in values.iter().enumerate() {
            let value = value - origin;
            mean += value;
            slope += first(i) * value;
            bend += second(i) * value;
            squares += value * value;
        }
        mean /= count;
        // The squared norms of both polynomials.
        let (slope_norm, bend_norm) =
            (count * square, count * square * (count * count - 4.0) / 15.0);
        let left = squares - count * mean * mean;
        Self {
            mean: mean + origin,
            slope: slope / slope_norm.sqrt(),
            bend: bend / bend_norm.sqrt(),
            scatter: (left.max(0.0) / count).sqrt(),
        }
    }

    /// Returns the slope in standard errors.
    fn runs(&self, sigma: f64) -> f64 {
        self.slope.abs() / sigma
    }

    /// Returns the curvature in standard errors.
    fn bends(&self, sigma: f64) -> f64 {
        self.bend.abs() / sigma
    }
}

/// Returns the RMS residual of the best polynomial of a degree on an even grid.
fn left_by_polynomial(values: &[f64], degree: usize) -> f64 {
    let count = values.len();
    let middle = 0.5 * (count as f64 - 1.0);
    let grid: Vec<f64> = (0..count).map(|i| (i as f64 - middle) / middle.max(1.0)).collect();
    let mut left: Vec<f64> = values.iter().map(|value| value - values[0]).collect();
    // Forsythe's recurrence: polynomials orthogonal on the grid.
    let (mut before, mut now) = (vec![0.0; count], vec![1.0; count]);
    let mut norm_before = 1.0;
    for order in 0..=degree {
        let norm: f64 = now.iter().map(|p| p * p).sum();
        if norm <= 0.0 {
            break;
        }
        let product: f64 = now.iter().zip(&left).map(|(p, v)| p * v).sum();
        left.iter_mut().zip(&now).for_each(|(v, p)| *v -= product / norm * p);
        let ratio = if order > 0 { norm / norm_before } else { 0.0 };
        let next = |i: usize| grid[i] * now[i] - ratio * before[i];
        let next: Vec<f64> = (0..count).map(next).collect();
        (before, now, norm_before) = (now, next, norm);
    }
    (left.iter().map(|v| v * v).sum::<f64>() / count.saturating_sub(degree + 1).max(1) as f64)
        .sqrt()
}
