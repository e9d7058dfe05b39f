//! The orders of an additive ripple, chosen one beside the other.
//!
//! Cogging and gear mesh are a few sines of the angle: a fundamental, its multiples, the neighbours of either
//! where a machine is not quite round. The spectrum over the angle ([`super::order`]) proposes; what decides is
//! least squares. A proposal's sine and cosine, rid of what the base model's own parameters and the orders
//! already chosen can explain, take so much off the squares of the residual:
//!
//! ```text
//! fall(n) = |P e|^2,  P the projection onto {sin n q, cos n q} beside base and chosen orders
//! ```
//!
//! The order is moved to where the fall is largest (a spectrum is as coarse as the range of the angle), and the
//! best proposal is chosen if it takes off enough. Multiples of a chosen order are always proposed: the
//! spectrum holds them against their neighbourhood, but a gear that has a fundamental has them for a reason.

use super::order::{Peak, Point, peaks};
use super::sensitivities::Sensitivities;
use super::train_test::TrainTest;
use std::f64::consts::TAU;

/// Rows looked at, at most: of more, every second, third, ...
const MOST_ROWS: usize = 60_000;

/// Peaks of a spectrum that are tried.
const PROPOSALS: usize = 6;

/// Multiples of a chosen order that are tried.
const MULTIPLES: [f64; 3] = [2.0, 3.0, 4.0];

/// An additional order takes off at least this share of the squares the first one took: less is not worth
/// two parameters and two sines in every sample of a driver.
const LEAST_OF_FIRST: f64 = 0.02;

/// A ripple is seen over so many of its periods at least; a slower one is a slope of the residual.
const PERIODS: f64 = 2.0;

/// Probability that the largest of all peaks of a spectrum without a ripple is as high.
const SIGNIFICANT: f64 = 0.01;

/// Steps of the search for the best order about a proposal, each of which narrows it by 0.618.
const NARROWINGS: usize = 14;

/// Orders of a ripple, the strongest first, and from how many they were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Orders {
    /// 1/rad.
    pub orders: Vec<f64>,
    /// How many orders the range of the angle can tell apart.
    pub independent: f64,
}

/// Rows of a log as columns of the angle, and what is already explained.
struct Rows {
    position: Vec<f64>,
    residual: Vec<f64>,
    /// Columns of unit length, at right angles to each other.
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

    /// What of a column the basis cannot make, at unit length; none where nothing is left.
    fn beside(&self, mut column: Vec<f64>) -> Option<Vec<f64>> {
        /// Share of a column's length below which it is made of the others.
        const DEPENDENT: f64 = 1e-6;
        let before = dot(&column, &column).sqrt();
        // Twice: once leaves rounding of the size of what was taken away.
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

    /// Takes a column into the basis and its share out of the residual.
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

    /// By how much the squares of the residual fall with this order.
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

    /// The whole order next to one that was found, if these rows hardly tell the two apart: what is on a shaft
    /// has a whole order, and one that is off by 0.003, as fits the noise of a robot's axis better by a few percent, is out of
    /// step by half a radian a hundred radians on, in a run that was left out.
    fn whole(&self, order: f64, fall: f64, apart: f64) -> f64 {
        /// Of the fall.
        const AS_WELL: f64 = 0.8;
        let whole = order.round();
        let near = whole >= 1.0 && (whole - order).abs() < apart;
        if near && self.fall(whole) >= AS_WELL * fall { whole } else { order }
    }

    /// The order within `reach` of a proposal at which the fall is largest, and that fall.
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

/// The strongest orders of what a fitted model leaves over, at most `count`, up to `most`; none near those
/// in `taken`, which belong to another cause. `turns` says whether a whole turn of the joint is a whole number of
/// periods of what is on its shaft: then a whole order that does as well is taken, and was chosen from fewer.
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
    // Two orders closer than this make one wave over the range.
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

    /// A shaft that turns to and fro over thirteen turns, a torque of these orders and sizes, noise.
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
    fn a_whole_order_of_the_shaft_is_found_whole() {
        let found = strongest_of(rows(&[(7.0, 0.5), (14.0, 0.2)]), 300.0, 2, &[1.0], true);
        assert_eq!(found.as_ref().map(|found| found.orders.clone()), Some(vec![7.0, 14.0]));
        assert!(found.unwrap().independent <= 300.0);
        let geared = strongest_of(rows(&[(7.4, 0.5)]), 300.0, 1, &[1.0], true).unwrap();
        assert!((geared.orders[0] - 7.4).abs() < 0.01, "{geared:?}");
    }

    #[test]
    fn a_fundamental_its_double_and_a_neighbour_are_found_in_that_order() {
        let found =
            strongest_of(rows(&[(7.0, 0.5), (14.0, 0.2), (6.0, 0.12)]), 300.0, 4, &[1.0], false);
        let orders = found.unwrap().orders;
        assert_eq!(orders.len(), 3, "{orders:?}");
        for (found, hidden) in orders.iter().zip([7.0, 14.0, 6.0]) {
            assert!((found - hidden).abs() < 2e-3, "{orders:?}");
        }
    }

    #[test]
    fn once_a_turn_is_left_to_gravity_and_noise_has_no_order() {
        let beside = strongest_of(rows(&[(1.0, 0.5)]), 300.0, 1, &[1.0], false);
        assert!(beside.is_none_or(|found| (found.orders[0] - 1.0).abs() > 0.5));
        // One spectrum in a hundred has so high a peak by its own word.
        let alarms = (0..30)
            .filter(|seed| strongest_of(rows_of(&[], *seed), 300.0, 4, &[1.0], false).is_some());
        let alarms = alarms.count();
        assert!(alarms <= 3, "{alarms} of 30 at 1 %");
    }

    #[test]
    fn what_the_base_explains_is_no_ripple() {
        let mut rows = rows(&[(9.0, 0.5)]);
        let wave = rows.wave(9.0);
        wave.into_iter().for_each(|column| rows.explain(column));
        assert_eq!(strongest_of(rows, 300.0, 4, &[], false), None);
    }
}
