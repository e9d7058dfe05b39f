//! Which rows are at rest.
//!
//! At rest a velocity sensor flickers about zero, and a bristle integrates the flicker: with a noise of
//! 2 mrad/s, plain LuGre with its true parameters misses by ten times the torque's noise, nearly all of it
//! here. So rest is decided, not averaged: a window of rows rests where its position neither runs nor bends by
//! more than its noise would, or, without a position, where the mean and the slope of its velocity are those
//! of noise about zero. A row rests if any window that holds it does.
//!
//! The window is as long as it takes to tell a hundredth of the usual speed from nothing. What rests for less
//! is left to the smoother. A window cannot say to the row where a joint starts, and a row at a start is a
//! thousandth of a radian; so each end of a rest is laid anew, where a start fits best that sets in with a
//! jump, a ramp or a bend of the velocity (one free size, least squares, each row tried).

use super::filter::{Noise, Series};
use std::ops::Range;

/// A speed below this share of the 95th percentile of speed is rest, if it lasts for a window.
const SLOW: f64 = 0.01;

/// Standard errors within which a mean, a slope or a bend counts as none.
const WITHIN: f64 = 3.0;

/// Scatter over what the noise makes, above which something moves.
const SCATTER: f64 = 1.7;

/// What a polynomial leaves of a turn, in standard deviations of the noise.
const TURN: f64 = 1.3;

/// So many standard deviations from its level a row is not at rest.
const OFF: f64 = 5.0;

/// A window's own scatter, so many times, is its noise where that is less: that of a few rows may be half
/// of what it should by chance.
const QUIETER: f64 = 3.0;

/// What is left of a rest must be so many rows.
const SHORTEST: usize = 3;

/// Shortest and longest window, rows.
const WINDOW: (usize, usize) = (8, 120);

/// Finds the rows at rest. `step` is that of a quantised position, `speed` the 95th percentile of the speed, per
/// median step.
pub fn at_rest(series: &Series, noise: &Noise, step: f64, speed: f64) -> Vec<bool> {
    let rows = series.len();
    let mut found = vec![false; rows];
    let by_position =
        series.position.as_ref().map(|q| (q, (noise.position + step * step / 12.0).sqrt()));
    let by_velocity = series.velocity.as_ref().map(|v| (v, series.velocity_variance(noise).sqrt()));
    let window = match (by_position, by_velocity) {
        (Some((_, sigma)), _) => (WITHIN * 12f64.sqrt() * sigma / (SLOW * speed)).powf(2.0 / 3.0),
        (None, Some((_, sigma))) => (WITHIN * sigma / (SLOW * speed)).powi(2),
        (None, None) => return found,
    };
    let window = (window.ceil().min(1e6) as usize).clamp(WINDOW.0, WINDOW.1);
    if rows < window {
        return found;
    }
    let rests = |from: usize| {
        let position = by_position.is_none_or(|(q, sigma)| {
            let shape = Shape::of(&q[from..from + window]);
            shape.runs(sigma) < WITHIN
                && shape.bends(sigma) < WITHIN
                && shape.scatter < SCATTER * sigma
        });
        let velocity = by_velocity.is_none_or(|(v, sigma)| {
            let shape = Shape::of(&v[from..from + window]);
            if by_position.is_some() {
                // The position decides; a velocity at rest may stand beside zero for a while.
                return shape.mean.abs() < WITHIN * sigma;
            }
            // By its own scatter where that is less: a slow steady slide is not the noise of a fast one.
            let mean =
                shape.mean.abs() * (window as f64).sqrt() / sigma.min(QUIETER * shape.scatter);
            !(mean >= WITHIN) && shape.runs(sigma) < WITHIN && shape.scatter < SCATTER * sigma
        });
        position && velocity
    };
    let mut rough: Vec<Range<usize>> = Vec::new();
    for from in 0..=rows - window {
        if rests(from) {
            match rough.last_mut() {
                Some(last) if last.end >= from => last.end = from + window,
                _ => rough.push(from..from + window),
            }
        }
    }
    for (index, rest) in rough.iter().enumerate() {
        let before = if index > 0 { rough[index - 1].end } else { 0 };
        let after = rough.get(index + 1).map_or(rows, |next| next.start);
        let columns = [(by_position, true), (by_velocity, false)];
        let seen = Seen { columns, rest: rest.clone(), window };
        if by_position.is_some() && seen.is_a_turn(rows) {
            continue;
        }
        let end = if rest.end == rows { rows } else { seen.end(after) };
        let start = if rest.start == 0 { 0 } else { seen.start(before) };
        let near = seen.near(rows);
        let (start, end) = (start.max(near.start), end.min(near.end));
        if end >= start + SHORTEST {
            found[start..end].fill(true);
        }
    }
    if let (None, Some((v, _))) = (by_position, by_velocity)
        && creeps(v, &found)
    {
        found.fill(false);
    }
    found
}

/// Whether what was taken for rest goes one way on the whole: then it is a slow slide, window by window as
/// quiet as rest.
fn creeps(velocity: &[f64], at_rest: &[bool]) -> bool {
    let resting = || velocity.iter().zip(at_rest).filter(|(_, rests)| **rests).map(|(v, _)| v);
    let count = resting().count() as f64;
    let (sum, squares) = resting().fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
    count > 0.0 && sum * sum > WITHIN * WITHIN * squares
}

/// What a rest is seen through: columns with their noise, `true` for a position.
struct Seen<'a> {
    columns: [(Option<(&'a Vec<f64>, f64)>, bool); 2],
    rest: Range<usize>,
    window: usize,
}

impl Seen<'_> {
    /// The first row after the rest; rows from `limit` on are another's.
    fn end(&self, limit: usize) -> usize {
        let Range { start, end } = self.rest;
        let first = (start + 1).max(end.saturating_sub(2 * self.window));
        let last = (end + self.window).min(limit);
        let candidates = first..(end + self.window / 2).min(last.saturating_sub(2)).max(first + 1);
        self.best(candidates, |at, by| (by > 0 && at + by < last).then(|| at + by), last - first)
    }

    /// The first row of the rest.
    fn start(&self, limit: usize) -> usize {
        let Range { start, end } = self.rest;
        let last = (end - 1).min(start + 2 * self.window);
        let first = start.saturating_sub(self.window).max(limit);
        let candidates = start.saturating_sub(self.window / 2).max(first + 2).min(last)..last + 1;
        let back = |at: usize, by: usize| (at >= first + by).then(|| at - by);
        // Counted from the last row: backwards a stop is a start.
        self.best(candidates, |at, by| if by > 0 { back(at, by) } else { None }, last - first)
    }

    /// The row of `candidates` from which a start fits best. `row(at, by)` is the row `by` rows into the
    /// motion, `None` beyond what is looked at.
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
                for (column, is_position) in &self.columns {
                    let Some((values, sigma)) = column else { continue };
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
                // What such a start explains of all that is not rest.
                let explained = if square > 0.0 { product * product / square } else { 0.0 };
                if explained > best.0 {
                    best = (explained, at);
                }
            }
        }
        best.1
    }

    /// Whether one bend of the motion explains the rest and half its length on either side: a joint
    /// that turns stands within a step of its encoder, too.
    fn is_a_turn(&self, rows: usize) -> bool {
        let half = (self.rest.end - self.rest.start).div_ceil(2);
        let (from, to) = (self.rest.start.saturating_sub(half), (self.rest.end + half).min(rows));
        self.columns.iter().all(|(column, is_position)| {
            let Some((values, sigma)) = column else { return true };
            let degree = if *is_position { 3 } else { 2 };
            left_by_polynomial(&values[from..to], degree) < TURN * sigma
        })
    }

    /// Whether a row is so far from rest that it does not.
    fn is_off(&self, row: usize, middle: usize) -> bool {
        self.columns.iter().any(|(column, is_position)| {
            let Some((values, sigma)) = column else { return false };
            let level = if *is_position { self.level(values, middle) } else { 0.0 };
            (values[row] - level).abs() > OFF * sigma
        })
    }

    /// The rows around the middle of the rest, as far as none is off.
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

    /// The position at rest: the mean over the middle of it.
    fn level(&self, values: &[f64], middle: usize) -> f64 {
        let half = (self.rest.end - self.rest.start) / 4;
        let part = &values[middle - half..=middle + half];
        part.iter().sum::<f64>() / part.len() as f64
    }
}

/// A window of values as level, slope, bend and what is left.
struct Shape {
    mean: f64,
    slope: f64,
    bend: f64,
    scatter: f64,
    count: f64,
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
        let (slope_norm, bend_norm) = norms(count);
        let left = squares - count * mean * mean;
        Self {
            mean: mean + origin,
            slope: slope / slope_norm.sqrt(),
            bend: bend / bend_norm.sqrt(),
            scatter: (left.max(0.0) / count).sqrt(),
            count,
        }
    }

    /// The slope in its standard errors.
    fn runs(&self, sigma: f64) -> f64 {
        debug_assert!(self.count > 0.0);
        self.slope.abs() / sigma
    }

    /// The bend in its standard errors.
    fn bends(&self, sigma: f64) -> f64 {
        self.bend.abs() / sigma
    }
}

/// RMS of what the best polynomial of a degree leaves of values on an even grid.
fn left_by_polynomial(values: &[f64], degree: usize) -> f64 {
    let count = values.len();
    let middle = 0.5 * (count as f64 - 1.0);
    let grid: Vec<f64> = (0..count).map(|i| (i as f64 - middle) / middle.max(1.0)).collect();
    let mut left: Vec<f64> = values.iter().map(|value| value - values[0]).collect();
    // Forsythe's recurrence: polynomials orthogonal on the grid, one after another.
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

/// Squared norms of the linear and the quadratic orthogonal polynomial on `count` even points.
fn norms(count: f64) -> (f64, f64) {
    let n2 = count * count;
    (count * (n2 - 1.0) / 12.0, count * (n2 - 1.0) * (n2 - 4.0) / 180.0)
}
