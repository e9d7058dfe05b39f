//! Selection of the orders of an additive ripple.
//!
//! Cogging and gear mesh add a few sines of the angle to the torque. These are a fundamental, its
//! multiples, and neighbours of both if a machine is not perfectly round. The spectrum over the
//! angle ([`super::order`]) proposes orders, and least squares selects them. The sine and cosine of
//! a proposal are made orthogonal to the regressors of the base model and to the chosen orders.
//! They then reduce the residual's sum of squares by:
//!
//! ```text
//! fall(n) = |P e|^2,  P the projection onto {sin n q, cos n q}, orthogonal to base and chosen orders
//! ```
//!
//! The order is refined to the largest reduction, because the range of the angle limits the
//! resolution of the spectrum. The best proposal is chosen if its reduction is large enough.
//! Multiples of a chosen order are always proposed. The spectrum compares each of them only with
//! its neighbourhood, although a gear with a fundamental usually has multiples.

use super::order::{Peak, Point, peaks};
use super::sensitivities::Sensitivities;
use super::train_test::TrainTest;
use std::f64::consts::TAU;

/// Largest number of rows that are evaluated. A longer log is subsampled evenly.
const MOST_ROWS: usize = 60_000;

/// Number of spectral peaks that are evaluated for each order.
const PROPOSALS: usize = 6;

/// Multiples of a chosen order that are evaluated.
const MULTIPLES: [f64; 3] = [2.0, 3.0, 4.0];

/// Smallest error reduction of an additional order, as a share of the largest one. A smaller
/// reduction does not justify two parameters and two sines in every sample of a driver.
const LEAST_OF_FIRST: f64 = 0.02;

/// Fewest periods of a ripple in the range of the angle. A slower ripple cannot be distinguished
/// from a trend.
const PERIODS: f64 = 2.0;

/// Significance level: the probability that the largest peak of a spectrum without a ripple is as
/// high.
const SIGNIFICANT: f64 = 0.01;

/// Number of golden-section steps that refine an order. Each step narrows the interval by the
/// factor 0.618.
const NARROWINGS: usize = 14;

/// Orders of a ripple, the strongest first, and the number of alternatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Orders {
    /// Orders, 1/rad.
    pub orders: Vec<f64>,
    /// Number of orders that the range of the angle can distinguish.
    pub independent: f64,
}

/// Rows of a log as functions of the angle, and a basis of the explained part.
struct Rows {
    position: Vec<f64>,
    residual: Vec<f64>,
    /// Orthonormal columns.
    basis: Vec<Vec<f64>>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Rows {
    fn of(log: &TrainTest, at: &Sensitivities) -> Self {
        let total: usize = at.tracks.iter().map(|track| track.residual.len()).sum();
        let stride = total.div_ceil(MOST_ROWS).max(1);
        let mut rows = Self { position: Vec::new(), residual: Vec::new(), basis: Vec::new() };
        let mut nuisance = vec![Vec::new(); at.free.len()];
        for (track, model) in log.train_tracks.iter().zip(&at.tracks) {
            for row in (0..track.len()).step_by(stride).filter(|row| track.is_included(*row)) {
                rows.position.push(track.samples[row].position_rad);
                rows.residual.push(model.residual[row]);
                for (column, own) in nuisance.iter_mut().zip(&model.jacobian) {
                    column.push(own[row]);
                }
            }
        }
        for column in nuisance {
            rows.explain(column);
        }
        rows
    }

    /// Returns the part of a column that is orthogonal to the basis, at unit length; `None` for a
    /// dependent column.
    fn beside(&self, mut column: Vec<f64>) -> Option<Vec<f64>> {
        /// Share of a column's length below which it counts as linearly dependent.
        const DEPENDENT: f64 = 1e-6;
        let before = dot(&column, &column).sqrt();
        // The second pass removes the rounding error of the first.
        for _ in 0..2 {
            for own in &self.basis {
                let share = dot(own, &column);
                column.iter_mut().zip(own).for_each(|(c, o)| *c -= share * o);
            }
        }
        let length = dot(&column, &column).sqrt();
        if length.is_nan() || length <= DEPENDENT * before {
            return None;
        }
        column.iter_mut().for_each(|c| *c /= length);
        Some(column)
    }

    /// Adds a column to the basis and removes its projection from the residual.
    fn explain(&mut self, column: Vec<f64>) {
        if let Some(column) = self.beside(column) {
            let share = dot(&column, &self.residual);
            self.residual.iter_mut().zip(&column).for_each(|(r, c)| *r -= share * c);
            self.basis.push(column);
        }
    }

    fn wave(&self, order: f64) -> [Vec<f64>; 2] {
        let waves = self.position.iter().map(|q| (order * q).sin_cos());
        let (sine, cosine) = waves.unzip();
        [sine, cosine]
    }

    /// Returns the reduction of the residual's sum of squares by this order, Nm^2.
    fn fall(&self, order: f64) -> f64 {
        let [sine, cosine] = self.wave(order);
        let Some(sine) = self.beside(sine) else { return 0.0 };
        let of_sine = dot(&sine, &self.residual);
        let Some(mut cosine) = self.beside(cosine) else { return of_sine * of_sine };
        let share = dot(&sine, &cosine);
        cosine.iter_mut().zip(&sine).for_each(|(c, s)| *c -= share * s);
        let length = dot(&cosine, &cosine).sqrt();
        let of_cosine = if length > 1e-6 { dot(&cosine, &self.residual) / length } else { 0.0 };
        of_sine * of_sine + of_cosine * of_cosine
    }

    /// Returns the nearest whole order if it explains the residual nearly as well; otherwise
    /// `order`.
    ///
    /// A ripple of the shaft has a whole order. Noise makes a fitted order slightly wrong. The
    /// phase error grows with the angle and becomes large in a held-out run many turns away.
    fn whole(&self, order: f64, fall: f64, apart: f64) -> f64 {
        /// Smallest error reduction of the whole order, as a share of that of the given order.
        const AS_WELL: f64 = 0.8;
        let whole = order.round();
        let near = whole >= 1.0 && (whole - order).abs() < apart;
        if near && self.fall(whole) >= AS_WELL * fall { whole } else { order }
    }

    /// Returns the order within `reach` of a proposal with the largest error reduction, and that
    /// reduction.
    fn sharpened(&self, order: f64, reach: f64) -> (f64, f64) {
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let (mut low, mut high) = (order - reach, order + reach);
        let mut inner = [high - golden * (high - low), low + golden * (high - low)];
        let mut falls = inner.map(|order| self.fall(order));
        for _ in 0..NARROWINGS {
            if falls[0] > falls[1] {
                high = inner[1];
                inner = [high - golden * (high - low), inner[0]];
                falls = [self.fall(inner[0]), falls[0]];
            } else {
                low = inner[0];
                inner = [inner[1], low + golden * (high - low)];
                falls = [falls[1], self.fall(inner[1])];
            }
        }
        if falls[0] > falls[1] { (inner[0], falls[0]) } else { (inner[1], falls[1]) }
    }
}

/// Returns the strongest orders in the residual of a fitted model, at most `count` and not above
/// `most`.
///
/// Orders close to those in `taken` are excluded, because they belong to another cause. `turns` is
/// true if a whole turn of the joint is a whole number of periods. A whole order that fits nearly
/// as well is then preferred, and the number of alternatives is smaller. Returns `None` if no order
/// passes.
pub fn strongest(
    log: &TrainTest,
    at: &Sensitivities,
    most: f64,
    count: usize,
    taken: &[f64],
    turns: bool,
) -> Option<Orders> {
    strongest_of(Rows::of(log, at), most, count, taken, turns)
}

fn strongest_of(
    mut rows: Rows,
    most: f64,
    count: usize,
    taken: &[f64],
    turns: bool,
) -> Option<Orders> {
    let ends = |(low, high): (f64, f64), q: &f64| (low.min(*q), high.max(*q));
    let (low, high) = rows.position.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    // Two orders closer than this cannot be distinguished over the range.
    let apart = TAU / (high - low);
    let mut found = Orders { orders: Vec::new(), independent: 1.0 };
    let mut first = 0.0;
    while found.orders.len() < count {
        let points: Vec<Point> = rows
            .position
            .iter()
            .zip(&rows.residual)
            .map(|(position, residual)| Point { position: *position, weighed: *residual })
            .collect();
        let spectrum: Vec<Peak> = peaks(&points, most, PROPOSALS);
        if let Some(peak) = spectrum.first() {
            found.independent = peak.independent;
        }
        let proposed = spectrum.iter().filter(|peak| peak.p_value < SIGNIFICANT);
        let multiples = found.orders.iter().flat_map(|order| MULTIPLES.map(|times| times * order));
        let is_open = |order: &f64| {
            let mut near = taken.iter().chain(&found.orders);
            *order >= PERIODS * apart && *order <= most && near.all(|n| (n - order).abs() > apart)
        };
        let best = proposed
            .map(|peak| peak.order)
            .chain(multiples)
            .filter(is_open)
            .map(|order| (order, rows.fall(order)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((order, _)) = best else { break };
        let (order, fall) = rows.sharpened(order, 0.5 * apart);
        let order = if turns { rows.whole(order, fall, apart) } else { order };
        if fall <= LEAST_OF_FIRST * first {
            break;
        }
        first = f64::max(first, fall);
        for column in rows.wave(order) {
            rows.explain(column);
        }
        found.orders.push(order);
    }
    if turns && found.orders.iter().all(|order| order.fract() == 0.0) {
        found.independent = found.independent.min(most);
    }
    (!found.orders.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// Returns rows of a shaft that oscillates over thirteen turns, with torques of these orders
    /// and sizes, and noise.
    fn rows(waves: &[(f64, f64)]) -> Rows {
        rows_of(waves, 3)
    }

    fn rows_of(waves: &[(f64, f64)], seed: u64) -> Rows {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut rows = Rows { position: Vec::new(), residual: Vec::new(), basis: Vec::new() };
        for at in 0..20_000 {
            let q = 40.0 * (f64::from(at) * 1.1e-3).sin();
            let noise: f64 = random.random_range(-0.5..0.5);
            let torque: f64 = waves.iter().map(|(n, size)| size * (n * q + 0.4).sin()).sum();
            rows.position.push(q);
            rows.residual.push(torque + noise);
        }
        rows
    }

    #[test]
    fn harmonics_with_whole_order_returns_whole_order() {
        let found = strongest_of(rows(&[(7.0, 0.5), (14.0, 0.2)]), 300.0, 2, &[1.0], true);
        assert_eq!(found.as_ref().map(|found| found.orders.clone()), Some(vec![7.0, 14.0]));
        assert!(found.unwrap().independent <= 300.0);
        let geared = strongest_of(rows(&[(7.4, 0.5)]), 300.0, 1, &[1.0], true).unwrap();
        assert!((geared.orders[0] - 7.4).abs() < 0.01, "{geared:?}");
    }

    #[test]
    fn harmonics_with_three_orders_returns_them_in_order() {
        let found =
            strongest_of(rows(&[(7.0, 0.5), (14.0, 0.2), (6.0, 0.12)]), 300.0, 4, &[1.0], false);
        let orders = found.unwrap().orders;
        assert_eq!(orders.len(), 3, "{orders:?}");
        for (found, hidden) in orders.iter().zip([7.0, 14.0, 6.0]) {
            assert!((found - hidden).abs() < 2e-3, "{orders:?}");
        }
    }

    #[test]
    fn harmonics_with_order_one_or_noise_is_empty() {
        let context = strongest_of(rows(&[(1.0, 0.5)]), 300.0, 1, &[1.0], false);
        assert!(context.is_none_or(|found| (found.orders[0] - 1.0).abs() > 0.5));
        // At the significance level, one spectrum in a hundred has a peak.
        let alarms = (0..30)
            .filter(|seed| strongest_of(rows_of(&[], *seed), 300.0, 4, &[1.0], false).is_some());
        let alarms = alarms.count();
        assert!(alarms <= 3, "{alarms} of 30 at 1 %");
    }

    #[test]
    fn harmonics_with_explained_ripple_is_empty() {
        let mut rows = rows(&[(9.0, 0.5)]);
        let wave = rows.wave(9.0);
        wave.into_iter().for_each(|column| rows.explain(column));
        assert_eq!(strongest_of(rows, 300.0, 4, &[], false), None);
    }
}
