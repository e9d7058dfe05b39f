//! Orders of waves of the angle, found in what a model without waves leaves.
//!
//! The strongest order is scanned for, then those that are related to it, each in what the law and the orders before it leave. A gear
//! between motor and joint gives orders that are no whole number. A wave of which the log spans less than one and a half periods is a
//! slope and not a wave, and is refused.

use super::bank::{Bank, Workspace};
use super::rows::Rows;
use super::solve::{dot, lanes, solve_in_place};
use joint_log::JointKind;
use joint_log::statistics::extent;
use joint_log::work::{checkpoint, checkpoint_at};
use std::f64::consts::TAU;

/// Highest order, in periods per turn, for a revolute joint.
const HIGHEST_ORDER: f64 = 210.0;

/// Highest multiple of the swing, for a linear joint.
const MOST_ORDERS_OF_SWING: f64 = 30.0;

/// Steps of the scanned orders in one period over the positions of the log. A wave between two steps loses 10 % of its amplitude.
const STEPS: f64 = 2.0;

/// Most orders that are scanned.
const MOST_SCANNED_ORDERS: usize = 1500;

/// Relative difference of the strongest orders of two lists below which they are alike.
const SAME_FIRST_ORDER: f64 = 0.005;

/// Ridge of the fits of a pursuit, relative to columns of length one.
const RIDGE: f64 = 1e-6;

/// Distance from a whole order of a turn, in steps, within which the whole one competes as well.
const NEAR_WHOLE: f64 = 1.0;

/// Ratio of amplitudes from which on a whole order is taken instead of a stronger one near it.
const NEARLY_AS_STRONG: f64 = 0.97;

/// Parts of an order whose multiples are related to it: the strongest order may be a harmonic itself.
const FRACTIONS: [f64; 2] = [1.0, 0.5];

/// Distances of the orders beside a multiple of an order, in periods per turn; the first is the multiple itself.
const SIDEBANDS: [f64; 5] = [0.0, 1.0, -1.0, 2.0, -2.0];

/// Distance from a related order, in steps, within which a scanned order is that order.
const NEAR_RELATED: f64 = 0.75;

/// Largest step of the scanned orders with which sidebands are told apart: the positions span nearly a turn.
const MAX_STEP_OF_SIDEBANDS: f64 = 0.55;

/// Share of the error that another order must take.
const MIN_ORDER_GAIN: f64 = 0.004;

/// Fewest periods within the positions of the log.
const MIN_PERIODS: f64 = 1.5;

/// Largest phase between two rows, rad: faster rows do not resolve the wave.
const MAX_STEP: f64 = 3.0;

/// Speed below which a row tells nothing of a wave, as a share of the top speed.
const MIN_SPEED: f64 = 0.01;

/// Most orders of one torque ripple.
pub(super) const MOST_WAVES: usize = 6;

/// Fewest runs of a wave whose phase differs between runs.
const MIN_FREE_RUNS: usize = 5;

/// Highest order of such a wave. It covers one turn of the shaft, some bearings and a spur gear.
pub(crate) const MOST_FREE_ORDERS: usize = 40;

/// Largest difference between the first positions of runs that begin alike, as a share of the swing.
const MAX_START: f64 = 0.01;

/// Orders whose waves are computed at once.
const ORDERS_AT_ONCE: usize = 4;

/// Most rows that are scanned for orders.
const MOST_SCANNED: usize = 6_000;

/// Orders of waves, in periods per rad or m times 2 pi.
#[derive(Clone, Debug, Default)]
pub struct RippleOrders {
    /// Of an added torque, the strongest first.
    pub torque: Vec<f64>,
    /// Of the friction level, the strongest first.
    pub level: Vec<f64>,
    /// A wave whose phase differs between the runs.
    pub free_phase: Option<FreePhaseWave>,
}

/// A wave with a phase of its own in each run.
#[derive(Clone, Debug)]
pub struct FreePhaseWave {
    /// Its order, in periods per turn.
    pub order: f64,
    /// Its phase in each run, rad.
    pub phases_rad: Vec<f64>,
}

impl RippleOrders {
    /// Finds the strongest orders in what a model leaves. `columns` are those of the model, `level` its friction level.
    pub fn find(
        rows: &Rows,
        residual: &[f64],
        columns: &[impl AsRef<[f64]>],
        level: &[f64],
    ) -> Self {
        if !rows.has_position {
            return Self::default();
        }
        let columns: Vec<&[f64]> = columns.iter().map(AsRef::as_ref).collect();
        let columns = columns.as_slice();
        let scan = Scan::new(rows);
        // The first order of a torque is gravity.
        let least = if rows.joint == JointKind::Revolute { 1.5 } else { 0.0 };
        let torque = scan.pursue(residual, columns, |_| 1.0, least);
        let of_level = scan.pursue(residual, columns, |row| level[row], 0.0);
        Self {
            torque: helpful(rows, columns, torque, |_| 1.0),
            level: helpful(rows, columns, of_level, |row| level[row]),
            free_phase: free_phase(rows, residual),
        }
    }

    /// Returns true if the strongest orders of both are the same.
    pub fn is_like(&self, other: &Self) -> bool {
        let alike = |a: &[f64], b: &[f64]| match (a.first(), b.first()) {
            (Some(a), Some(b)) => (a / b - 1.0).abs() < SAME_FIRST_ORDER,
            (_, None) => true,
            (None, Some(_)) => false,
        };
        alike(&self.torque, &other.torque) && alike(&self.level, &other.level)
    }
}

/// Returns the orders that lower the held-out error beside the law and the orders before them.
fn helpful(
    rows: &Rows,
    law: &[&[f64]],
    orders: Vec<f64>,
    of: impl Fn(usize) -> f64 + Copy,
) -> Vec<f64> {
    let pairs: Vec<Vec<f64>> = orders.iter().flat_map(|order| waves(rows, *order, of)).collect();
    let columns: Vec<&[f64]> = law.iter().copied().chain(pairs.iter().map(Vec::as_slice)).collect();
    let bank = Bank::new(rows, &columns);
    let mut work = Workspace::default();
    let mut set: Vec<usize> = (0..law.len()).collect();
    let mut error = bank.error(&set, &mut work);
    let mut helps = |index: usize| {
        let first = law.len() + 2 * index;
        set.extend([first, first + 1]);
        let next = bank.error(&set, &mut work);
        let helps = next < (1.0 - MIN_ORDER_GAIN) * error;
        if helps {
            error = next;
        } else {
            set.truncate(set.len() - 2);
        }
        helps
    };
    let kept = orders.into_iter().enumerate().filter(|(index, _)| helps(*index));
    kept.map(|(_, order)| order).collect()
}

/// Orders from a wave of which a run spans one and a half periods to the highest, over the rows that resolve waves.
struct Scan<'a> {
    rows: &'a Rows,
    moving: Vec<usize>,
    grid: Grid,
    /// The whole orders, if the positions span so many turns that the steps of the other grid miss waves.
    wholes: Option<Grid>,
}

/// Orders at equal steps.
#[derive(Clone, Copy)]
struct Grid {
    least: f64,
    step: f64,
    count: usize,
}

impl Grid {
    fn order(&self, index: f64) -> f64 {
        self.least + self.step * index
    }
}

impl<'a> Scan<'a> {
    fn new(rows: &'a Rows) -> Self {
        let every = rows.judged.len().div_ceil(MOST_SCANNED);
        let judged = rows.judged.iter().copied().step_by(every);
        let moving: Vec<usize> = judged
            .filter(|row| rows.smooth_velocity[*row].abs() > MIN_SPEED * rows.top_speed)
            .collect();
        let period = TAU / rows.span;
        let least = MIN_PERIODS * period;
        let highest = match rows.joint {
            JointKind::Revolute => HIGHEST_ORDER,
            JointKind::Prismatic => MOST_ORDERS_OF_SWING * period,
        };
        let span = (highest - least).max(0.0);
        let step = (period / STEPS).max(span / MOST_SCANNED_ORDERS as f64).max(f64::MIN_POSITIVE);
        let grid = Grid { least, step, count: (span / step) as usize };
        let is_coarse = rows.joint == JointKind::Revolute && step > period / STEPS;
        let whole = least.ceil().max(1.0);
        let wholes = Grid { least: whole, step: 1.0, count: (highest - whole).max(0.0) as usize };
        Self { rows, moving, grid, wholes: is_coarse.then_some(wholes) }
    }

    /// Returns the strongest order above `least` of waves times `of`, then those that are related to it, each found in what the
    /// law and those before it leave: the neighbours of a strong order are strong as well.
    fn pursue(
        &self,
        residual: &[f64],
        law: &[&[f64]],
        of: impl Fn(usize) -> f64 + Copy,
        least: f64,
    ) -> Vec<f64> {
        let weighed = |column: &dyn Fn(usize) -> f64| -> Vec<f64> {
            self.moving.iter().map(|row| self.rows.weights[*row] * column(*row)).collect()
        };
        let target = weighed(&|row| residual[row]);
        let mut columns: Vec<Vec<f64>> =
            law.iter().map(|column| weighed(&|row| column[row])).collect();
        let mut left = target.clone();
        let mut orders: Vec<f64> = Vec::new();
        while orders.len() < MOST_WAVES {
            let Some(order) = self.strongest(&left, of, least, &orders) else { break };
            orders.push(order);
            columns.push(weighed(&|row| of(row) * (order * self.rows.position[row]).sin()));
            columns.push(weighed(&|row| of(row) * (order * self.rows.position[row]).cos()));
            left = unexplained(&target, &columns);
        }
        orders
    }

    /// Returns the strongest order that is not among others; a whole one if it is nearly as strong.
    fn strongest(
        &self,
        values: &[f64],
        of: impl Fn(usize) -> f64 + Copy,
        least: f64,
        others: &[f64],
    ) -> Option<f64> {
        let is_new = |order: f64| others.iter().all(|other| (order - other).abs() > self.grid.step);
        let is_related =
            |order: f64| others.first().is_none_or(|first| self.is_related(order, *first));
        let strongest = |grid: &Grid| {
            let powers = self.amplitudes(values, of, grid);
            let free = (0..powers.len()).filter(|index| {
                let order = grid.order(*index as f64);
                powers[*index] > 0.0 && order >= least && is_new(order) && is_related(order)
            });
            let peak = free.max_by(|a, b| powers[*a].total_cmp(&powers[*b]))?;
            Some((powers[peak], peak, powers))
        };
        let fine = strongest(&self.grid);
        let whole = self.wholes.and_then(|grid| Some((strongest(&grid)?, grid)));
        if let Some(((power, peak, _), grid)) = whole
            && fine.as_ref().is_none_or(|(fine, ..)| *fine < power)
        {
            return Some(grid.order(peak as f64));
        }
        let (_, peak, powers) = fine?;
        let found = self.grid.order(refined(peak, &powers));
        let whole = found.round();
        let is_near = self.rows.joint == JointKind::Revolute
            && (found - whole).abs() < NEAR_WHOLE * self.grid.step
            && whole >= least.max(self.grid.least)
            && is_new(whole);
        let amplitude = |order: f64| self.amplitude(values, of, order);
        let takes_whole = is_near && amplitude(whole) > NEARLY_AS_STRONG * amplitude(found);
        Some(if takes_whole { whole } else { found })
    }

    /// Returns true if an order may belong to the same part as another: a multiple of it or of its half, or a sideband of a
    /// multiple of a whole order once or twice a turn, as of an eccentric part. Waves of unrelated orders together can follow
    /// anything, such as the error of an inaccurate law.
    fn is_related(&self, order: f64, first: f64) -> bool {
        let is_near = |order: f64, multiple: f64| {
            let nearest = (order / multiple).round().max(1.0) * multiple;
            (order - nearest).abs() < NEAR_RELATED * self.grid.step
        };
        let has_turns = self.rows.joint == JointKind::Revolute
            && self.grid.step < MAX_STEP_OF_SIDEBANDS
            && first == first.round();
        let sidebands: &[f64] = if has_turns { &SIDEBANDS } else { &SIDEBANDS[..1] };
        FRACTIONS.iter().any(|fraction| is_near(order, fraction * first))
            || sidebands.iter().any(|aside| is_near(order + aside, first))
    }

    /// Returns the amplitude of one order.
    fn amplitude(&self, values: &[f64], of: impl Fn(usize) -> f64, order: f64) -> f64 {
        checkpoint();
        let sum = self.moving.iter().zip(values).fold((0.0, 0.0), |(s, c), (row, value)| {
            let (sine, cosine) = (order * self.rows.position[*row]).sin_cos();
            let value = value * of(*row);
            (s + value * sine, c + value * cosine)
        });
        sum.0.hypot(sum.1)
    }

    /// Returns the amplitude of each order over the rows that resolve it, in units of what noise would have. `values` belong to
    /// the moving rows.
    fn amplitudes(&self, values: &[f64], of: impl Fn(usize) -> f64, grid: &Grid) -> Vec<f64> {
        let rows = self.rows;
        let groups = grid.count.div_ceil(ORDERS_AT_ONCE);
        let mut sums = vec![[[0.0; ORDERS_AT_ONCE]; 2]; groups];
        // Square and number of the rows whose highest order is the one before.
        let mut ends = vec![(0.0, 0usize); grid.count + 1];
        for (index, (row, value)) in self.moving.iter().zip(values).enumerate() {
            checkpoint_at(index);
            let value = value * of(*row);
            let position = rows.position[*row];
            let travel = (rows.velocity[*row] * rows.step_s).abs().max(1e-12);
            let most = ((MAX_STEP / travel - grid.least) / grid.step).max(0.0) as usize;
            let most = most.min(grid.count);
            ends[most] = (ends[most].0 + value * value, ends[most].1 + 1);
            let first: [f64; ORDERS_AT_ONCE] = lanes(|at| grid.order(at as f64) * position);
            let (mut s, mut c) = (first.map(f64::sin), first.map(f64::cos));
            s.iter_mut().chain(&mut c).for_each(|wave| *wave *= value);
            let (sine, cosine) = (ORDERS_AT_ONCE as f64 * grid.step * position).sin_cos();
            let (whole, rest) = (most / ORDERS_AT_ONCE, most % ORDERS_AT_ONCE);
            for [cosines, sines] in &mut sums[..whole] {
                *cosines = lanes(|at| cosines[at] + c[at]);
                *sines = lanes(|at| sines[at] + s[at]);
                let before = s;
                s = lanes(|at| s[at] * cosine + c[at] * sine);
                c = lanes(|at| c[at] * cosine - before[at] * sine);
            }
            for at in 0..rest {
                sums[whole][0][at] += c[at];
                sums[whole][1][at] += s[at];
            }
        }
        let enough = (self.moving.len() / 10).max(100);
        let mut amplitudes = vec![0.0; grid.count];
        let (mut square, mut count) = ends[grid.count];
        for (order, amplitude) in amplitudes.iter_mut().enumerate().rev() {
            let [cosines, sines] = &sums[order / ORDERS_AT_ONCE];
            let at = order % ORDERS_AT_ONCE;
            if count >= enough && square > 0.0 {
                *amplitude = ((cosines[at] * cosines[at] + sines[at] * sines[at]) / square).sqrt();
            }
            (square, count) = (square + ends[order].0, count + ends[order].1);
        }
        amplitudes
    }
}

/// Returns the place of a peak between the steps, by a parabola through three powers.
fn refined(peak: usize, powers: &[f64]) -> f64 {
    let at = |index: usize| powers.get(index).copied().unwrap_or_default();
    let (before, highest, after) = (at(peak.wrapping_sub(1)), at(peak), at(peak + 1));
    let bend = before - 2.0 * highest + after;
    let shift = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    peak as f64 + shift.clamp(-0.5, 0.5)
}

/// Returns what a fit of columns leaves of a target.
fn unexplained(target: &[f64], columns: &[Vec<f64>]) -> Vec<f64> {
    let size = columns.len();
    let norm: Vec<f64> =
        columns.iter().map(|column| dot(column, column).sqrt().max(1e-300)).collect();
    let mut gram = vec![[0.0]; size * size];
    let mut sizes = vec![[0.0]; size];
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns[..=i].iter().enumerate() {
            gram[i * size + j] = [dot(a, b) / (norm[i] * norm[j])];
        }
        gram[i * size + i][0] += RIDGE;
        sizes[i] = [dot(a, target) / norm[i]];
    }
    solve_in_place(&mut gram, &mut sizes, size);
    let mut left = target.to_vec();
    for ((column, [size]), norm) in columns.iter().zip(&sizes).zip(&norm) {
        let size = size / norm;
        left.iter_mut().zip(column).for_each(|(left, value)| *left -= size * value);
    }
    left
}

/// Returns the strongest wave whose phase is free in each run, if the position's zero is not the shaft's: every run begins at the
/// same position.
fn free_phase(rows: &Rows, residual: &[f64]) -> Option<FreePhaseWave> {
    let starts = rows.runs.iter().map(|run| rows.position[run.start]);
    let [low, high] = extent(starts);
    let begins_alike = high - low < MAX_START * rows.swing;
    if rows.joint != JointKind::Revolute || rows.runs.len() < MIN_FREE_RUNS || !begins_alike {
        return None;
    }
    let mut sums = vec![vec![(0.0, 0.0); rows.runs.len()]; MOST_FREE_ORDERS + 1];
    for (run, range) in rows.runs.iter().enumerate() {
        let mean = residual[range.clone()].iter().sum::<f64>() / range.len() as f64;
        for row in range.clone() {
            let value = (residual[row] - mean) / (range.len() as f64).sqrt();
            let (sine, cosine) = rows.position[row].sin_cos();
            let (mut s, mut c) = (sine, cosine);
            for sums in &mut sums[1..] {
                sums[run] = (sums[run].0 + value * s, sums[run].1 + value * c);
                (s, c) = (s * cosine + c * sine, c * cosine - s * sine);
            }
        }
    }
    let power = |order: &usize| sums[*order].iter().map(|(s, c)| s * s + c * c).sum::<f64>();
    let best = (1..=MOST_FREE_ORDERS).max_by(|a, b| power(a).total_cmp(&power(b)))?;
    let phases_rad = sums[best].iter().map(|(s, c)| c.atan2(*s)).collect();
    Some(FreePhaseWave { order: best as f64, phases_rad })
}

/// Returns sine and cosine of an order, times a factor.
fn waves(rows: &Rows, order: f64, of: impl Fn(usize) -> f64 + Copy) -> [Vec<f64>; 2] {
    let wave = |wave: fn(f64) -> f64| rows.map(|row| wave(order * rows.position[row]) * of(row));
    [wave(f64::sin), wave(f64::cos)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::rows::tests::example;

    #[test]
    fn is_related_of_harmonics_and_sidebands_is_true_and_of_other_orders_is_false() {
        let mut rows = example();
        rows.span = 200.0;
        let scan = Scan::new(&rows);
        assert!([14.0, 28.0, 3.5, 6.0, 8.0, 15.0].iter().all(|order| scan.is_related(*order, 7.0)));
        assert!([10.1, 24.9, 2.9].iter().all(|order| !scan.is_related(*order, 7.0)));
    }

    /// Returns the example with positions that span `factor` times as much, and a wave of the position as its torque.
    fn with_wave(factor: f64, order: f64) -> Rows {
        let mut rows = example();
        rows.motion.position.iter_mut().for_each(|q| *q *= factor);
        rows.swing *= factor;
        rows.span *= factor;
        rows.motion.velocity.iter_mut().for_each(|v| *v *= 10.0);
        rows.motion.smooth_velocity = rows.velocity.clone();
        rows.torque = rows.position.iter().map(|q| (order * q + 0.4).sin()).collect();
        rows
    }

    #[test]
    fn find_of_wave_over_many_turns_returns_its_whole_order() {
        let rows = with_wave(2e3, 36.0);
        let found = RippleOrders::find(&rows, &rows.torque, &[[]; 0], &rows.torque);
        assert_eq!(found.torque.first(), Some(&36.0));
    }

    #[test]
    fn find_of_wave_returns_its_order_first() {
        let mut rows = with_wave(10.0, 7.0);
        let wave = rows.torque.clone();
        let level: Vec<f64> = rows.velocity.iter().map(|v| v.signum()).collect();
        let columns = [level.as_slice()];
        let found = RippleOrders::find(&rows, &wave, &columns, &level);
        assert_eq!(found.torque[0], 7.0);
        let scaled: Vec<f64> = wave.iter().zip(&level).map(|(wave, level)| wave * level).collect();
        rows.torque = scaled.clone();
        assert_eq!(RippleOrders::find(&rows, &scaled, &columns, &level).level[0], 7.0);
    }
}
