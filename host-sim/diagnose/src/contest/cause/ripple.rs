//! Waves of the angle: torque ripple, friction ripple, and an encoder's error.
//!
//! A torque ripple is added whichever way the joint turns, a friction ripple (`position-ripple`) scales the friction level, an
//! encoder's error is a wave of the motion itself and shows in speed and acceleration. The orders are found in what the largest
//! model without waves leaves: the amplitude at each whole multiple of a base frequency. A wave of which the log spans less
//! than one and a half periods is a slope and not a wave, and is refused.

use super::{Columns, Context, plain};
use crate::contest::rows::Rows;
use joint_log::JointKind;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Highest multiple of a turn, for a revolute joint.
const MOST_ORDERS_OF_TURN: usize = 210;

/// Highest multiple of the swing, for a linear joint or a small swing.
const MOST_ORDERS_OF_SWING: usize = 30;

/// Fewest periods within the swing of a run.
const MIN_PERIODS: f64 = 1.5;

/// Largest phase between two rows, rad: faster rows do not resolve the wave.
const MAX_STEP: f64 = 1.2;

/// Speed below which a row tells nothing of a wave, as a share of the top speed.
const MIN_SPEED: f64 = 0.01;

/// Most orders of one torque ripple.
const MOST_WAVES: usize = 6;

/// Fewest runs of a wave whose phase differs between runs.
const MIN_FREE_RUNS: usize = 5;

/// Highest order of such a wave.
const MOST_FREE_ORDERS: usize = 40;

/// Largest difference between the first positions of runs that begin alike, as a share of the swing.
const MAX_START: f64 = 0.01;

/// Most rows that are scanned for orders.
const MOST_SCANNED: usize = 15_000;

/// Orders of waves, in periods per rad or m times 2 pi.
#[derive(Clone, Debug, Default)]
pub struct RippleOrders {
    /// Of an added torque, the strongest first.
    pub torque: Vec<f64>,
    /// Of the friction level, the strongest first.
    pub level: Vec<f64>,
    /// A wave whose phase differs between the runs: its order, and the phase in each run, rad.
    pub by_run: Option<(f64, Vec<f64>)>,
}

impl RippleOrders {
    /// Finds the strongest orders in a residual. `level` is the friction level.
    pub fn find(rows: &Rows, residual: &[f64], level: &[f64]) -> Self {
        let (base, count) = base_order(rows);
        if count == 0 || !rows.has_position {
            return Self::default();
        }
        let least = (MIN_PERIODS * TAU / (rows.swing * base)).ceil().max(1.0) as usize;
        let has_gravity = rows.joint == JointKind::Revolute;
        let every = rows.judged.len().div_ceil(MOST_SCANNED);
        let judged = rows.judged.iter().copied().step_by(every);
        let moving: Vec<usize> = judged
            .filter(|row| rows.smooth_velocity[*row].abs() > MIN_SPEED * rows.top_speed)
            .collect();
        let grid = Grid { rows, moving, base, count };
        // The first order of a torque is gravity.
        let torque = grid.pursue(residual, None, least.max(if has_gravity { 2 } else { 1 }));
        let by_run = phases(rows, residual);
        Self { torque, level: grid.pursue(residual, Some(level), least), by_run }
    }
}

/// Multiples of a base frequency over the rows that resolve waves.
struct Grid<'a> {
    rows: &'a Rows,
    moving: Vec<usize>,
    base: f64,
    count: usize,
}

impl Grid<'_> {
    /// Returns the strongest orders, each found in what those before it leave. With a level, the waves scale it.
    fn pursue(&self, values: &[f64], level: Option<&[f64]>, least: usize) -> Vec<f64> {
        let level = |row: usize| level.map_or(1.0, |level| level[row]);
        let mut left: Vec<f64> = self.moving.iter().map(|row| values[*row]).collect();
        let mut orders = Vec::new();
        while orders.len() < MOST_WAVES {
            let powers = self.amplitudes(&left, level);
            let free = (least..=self.count)
                .filter(|order| powers[*order] > 0.0 && !orders.contains(order));
            let Some(best) = free.max_by(|a, b| powers[*a].total_cmp(&powers[*b])) else { break };
            self.remove(best as f64 * self.base, &mut left, level);
            orders.push(best);
        }
        orders.into_iter().map(|order| order as f64 * self.base).collect()
    }

    /// Returns the amplitude of each multiple over the rows that resolve it, in units of what noise would have; index 0 is not
    /// used.
    fn amplitudes(&self, values: &[f64], level: impl Fn(usize) -> f64) -> Vec<f64> {
        let (rows, base, count) = (self.rows, self.base, self.count);
        let mut sums = vec![(0.0, 0.0, 0.0, 0usize); count + 1];
        for (row, value) in self.moving.iter().zip(values) {
            let value = value * rows.weights[*row] * level(*row);
            let step = (rows.velocity[*row] * rows.step_s).abs() * base;
            let most = ((MAX_STEP / step.max(1e-12)) as usize).min(count);
            let (sine, cosine) = (base * rows.position[*row]).sin_cos();
            let (mut s, mut c) = (sine, cosine);
            for sum in &mut sums[1..=most] {
                *sum = (sum.0 + value * c, sum.1 + value * s, sum.2 + value * value, sum.3 + 1);
                (s, c) = (s * cosine + c * sine, c * cosine - s * sine);
            }
        }
        let enough = (self.moving.len() / 10).max(100);
        let amplitude = |(c, s, square, rows): &(f64, f64, f64, usize)| {
            if *rows < enough || *square <= 0.0 { 0.0 } else { ((c * c + s * s) / square).sqrt() }
        };
        sums.iter().map(amplitude).collect()
    }

    /// Subtracts the best wave of an order.
    fn remove(&self, order: f64, left: &mut [f64], level: impl Fn(usize) -> f64) {
        let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let waves: Vec<Vector3<f64>> = self
            .moving
            .iter()
            .map(|row| {
                let (s, c) = (order * self.rows.position[*row]).sin_cos();
                Vector3::new(1.0, s, c) * level(*row)
            })
            .collect();
        for ((wave, value), row) in waves.iter().zip(left.iter()).zip(&self.moving) {
            let weight = self.rows.weights[*row].powi(2);
            gram += wave * wave.transpose() * weight;
            right += wave * (value * weight);
        }
        let Some(sizes) = gram.lu().solve(&right) else { return };
        for (value, wave) in left.iter_mut().zip(&waves) {
            *value -= wave[1] * sizes[1] + wave[2] * sizes[2];
        }
    }
}

/// Returns the base frequency and the number of its multiples: of a turn, or of the swing.
fn base_order(rows: &Rows) -> (f64, usize) {
    if rows.joint == JointKind::Revolute {
        return (1.0, MOST_ORDERS_OF_TURN);
    }
    (TAU / rows.swing, MOST_ORDERS_OF_SWING)
}

/// Returns the strongest wave whose phase is free in each run, if the position's zero is not the shaft's: every run begins at the
/// same position.
fn phases(rows: &Rows, residual: &[f64]) -> Option<(f64, Vec<f64>)> {
    let starts = rows.runs.iter().map(|run| rows.position[run.start]);
    let (low, high) =
        starts.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), q| (a.min(q), b.max(q)));
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
    Some((best as f64, sums[best].iter().map(|(s, c)| c.atan2(*s)).collect()))
}

fn waves(rows: &Rows, orders: &[f64], of: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
    let mut columns = Vec::new();
    for order in orders {
        let pair: Vec<(f64, f64)> = rows.position.iter().map(|q| (order * q).sin_cos()).collect();
        columns.push(rows.map(|row| pair[row].0 * of(row)));
        columns.push(rows.map(|row| pair[row].1 * of(row)));
    }
    columns
}

fn name(orders: &[f64]) -> String {
    let list: Vec<String> = orders.iter().map(|order| format!("{order:.4}")).collect();
    format!("order {}", list.join(", "))
}

pub(super) fn torque_ripple(context: &Context) -> Vec<Columns> {
    let orders = &context.orders.torque;
    let sets = [1, 3, MOST_WAVES].into_iter().filter(|count| *count <= orders.len());
    let whole = sets.map(|count| {
        plain(&name(&orders[..count]), waves(context.rows, &orders[..count], |_| 1.0))
    });
    whole.chain(free_phase(context)).collect()
}

/// The wave whose phase differs between the runs, and its first harmonic.
fn free_phase(context: &Context) -> Option<Columns> {
    let (order, phases) = context.orders.by_run.as_ref()?;
    let rows = context.rows;
    let mut shifted = rows.clone();
    for (run, phase) in rows.runs.iter().zip(phases) {
        shifted.position[run.clone()].iter_mut().for_each(|q| *q += phase / order);
    }
    let orders = [*order, 2.0 * order];
    Some(plain(
        &format!("{}, another phase in each run", name(&orders)),
        waves(&shifted, &orders, |_| 1.0),
    ))
}

pub(super) fn position_ripple(context: &Context) -> Vec<Columns> {
    let orders = context.orders.level.iter().take(2);
    orders
        .map(|order| {
            plain(&name(&[*order]), waves(context.rows, &[*order], |row| context.level[row]))
        })
        .collect()
}

/// An error `e(q)` of the encoder makes `e' v` of the speed and `e'' v^2 + e' a` of the acceleration.
pub(super) fn encoder_error(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.rigid_body.inertia || !rows.has_position || rows.joint != JointKind::Revolute {
        return Vec::new();
    }
    let mut orders: Vec<f64> = vec![1.0, 2.0];
    orders.extend(context.orders.torque.iter().take(2).filter(|order| **order > 2.0));
    let variant = |order: &f64| {
        let mut columns = waves(rows, &[*order], |row| rows.velocity[row].powi(2));
        columns.extend(waves(rows, &[*order], |row| rows.acceleration[row]));
        plain(&name(&[*order]), columns)
    };
    orders.iter().map(variant).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::rows::tests::example;

    #[test]
    fn find_of_wave_returns_its_order_first() {
        let mut rows = example();
        rows.position.iter_mut().for_each(|q| *q *= 10.0);
        rows.swing *= 10.0;
        rows.velocity.iter_mut().for_each(|v| *v *= 10.0);
        rows.smooth_velocity = rows.velocity.clone();
        let wave: Vec<f64> = rows.position.iter().map(|q| (7.0 * q + 0.4).sin()).collect();
        let level: Vec<f64> = rows.velocity.iter().map(|v| v.signum()).collect();
        let found = RippleOrders::find(&rows, &wave, &level);
        assert_eq!(found.torque[0], 7.0);
        let scaled: Vec<f64> = wave.iter().zip(&level).map(|(wave, level)| wave * level).collect();
        assert_eq!(RippleOrders::find(&rows, &scaled, &level).level[0], 7.0);
    }
}
