//! Hypotheses on the difference of two positions and on the torque, fitted to some blocks.
//!
//! The columns that all hypotheses share are eliminated first. What remains are few columns whose coefficients have a known
//! sign: the torsion of a gear lags the torque, less a share of the motor's friction that is 0 to 1, and play lags the motion.

use super::blocks::{Blocks, DIFFERENCE, DIRECTION, DIRECTIONS, NUISANCES, OPERATORS, TORQUE};
use nalgebra::{DMatrix, DVector};

/// Ridge of the columns, as a share of their squares.
const RIDGE: f64 = 1e-7;

/// Least and greatest travel of the stop operator over the lag that it makes. A load that coasts shortens the travel.
const WIDTH_RATIOS: [f64; 2] = [0.35, 2.5];

/// A combination of columns: their numbers and factors.
type Combination = Vec<(usize, f64)>;

/// A hypothesis, fitted.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit {
    /// Sum of squared errors on the rows of the fit.
    pub error: f64,
    /// Coefficients of all columns; that of the target is -1.
    pub coefficients: Vec<f64>,
    /// Range of the operator's part, in the unit of the target; 0 without one.
    pub size: f64,
    /// Number of the operator.
    pub operator: usize,
}

/// Sums of products over some blocks, without what the first columns explain.
pub(super) struct Regression<'a> {
    blocks: &'a Blocks,
    eliminated: usize,
    /// Products of the other columns.
    reduced: DMatrix<f64>,
    /// Coefficients of the first columns for each of the others.
    shared: DMatrix<f64>,
}

impl<'a> Regression<'a> {
    /// Sums the blocks and eliminates the columns of position, velocity, acceleration and angle.
    pub fn new(blocks: &'a Blocks, is_in: impl Fn(usize) -> bool) -> Self {
        let columns = blocks.columns;
        let mut gram = DMatrix::zeros(columns, columns);
        for (at, products) in blocks.grams.iter().enumerate() {
            if is_in(at) {
                gram += products;
            }
        }
        let (eliminated, rest) = (NUISANCES, columns - NUISANCES);
        let mut system = gram.view((0, 0), (eliminated, eliminated)).into_owned();
        let largest = system.diagonal().max().max(f64::MIN_POSITIVE);
        (0..eliminated).for_each(|at| system[(at, at)] += RIDGE * largest);
        let cross = gram.view((0, eliminated), (eliminated, rest)).into_owned();
        let shared = system
            .cholesky()
            .map_or_else(|| DMatrix::zeros(eliminated, rest), |factor| factor.solve(&cross));
        let reduced = gram.view((eliminated, eliminated), (rest, rest)) - cross.tr_mul(&shared);
        Self { blocks, eliminated, reduced, shared }
    }

    /// Fits the difference with the torsion of the gear alone.
    pub fn torsion(&self) -> Fit {
        self.fit(DIFFERENCE, &self.torsions())
    }

    /// Fits the difference with torsion and play.
    pub fn play(&self) -> Fit {
        self.lag(self.torsion(), &self.torsions())
    }

    /// Fits the difference with a lag of the motion, whatever makes it.
    pub fn lost_motion(&self) -> Fit {
        self.lag(self.fit(DIFFERENCE, &[]), &[])
    }

    /// Fits the torque with each operator in place of the load's friction. The motor's friction has the directions.
    pub fn torque_behind(&self) -> Vec<Fit> {
        let directions: Vec<Combination> =
            (0..DIRECTIONS).map(|at| vec![(DIRECTION + at, 1.0)]).collect();
        let fit = |operator: usize| {
            let of_load = vec![(OPERATORS + operator, 1.0)];
            let columns: Vec<Combination> = directions.iter().cloned().chain([of_load]).collect();
            let mut fit = self.fit(TORQUE, &columns);
            fit.size = fit.coefficients[OPERATORS + operator];
            fit.operator = operator;
            fit
        };
        (0..self.blocks.columns - OPERATORS).map(fit).collect()
    }

    /// Returns the best fit with a stop operator beside others, or the fit without one.
    fn lag(&self, without: Fit, others: &[Combination]) -> Fit {
        let mut best = without;
        for (operator, stop) in self.blocks.operators.iter().enumerate() {
            let column = OPERATORS + operator;
            let columns: Vec<Combination> =
                others.iter().cloned().chain([vec![(column, -1.0)]]).collect();
            let mut fit = self.fit(DIFFERENCE, &columns);
            fit.size = -2.0 * fit.coefficients[column];
            fit.operator = operator;
            let is_wide = |ratio: f64| (WIDTH_RATIOS[0]..WIDTH_RATIOS[1]).contains(&ratio);
            if fit.error < best.error && fit.size > 0.0 && is_wide(stop.travel / fit.size) {
                best = fit;
            }
        }
        best
    }

    /// Returns the torsions that a gear may have: by the torque less none or all of the motor's friction at all or at low speeds.
    /// Their sums with coefficients of at least 0 are all others.
    fn torsions(&self) -> Vec<Combination> {
        let directions: Vec<Combination> =
            (0..DIRECTIONS).map(|at| vec![(DIRECTION + at, 1.0)]).collect();
        let (_, levels) = self.solve(TORQUE, &directions);
        let level = |at: usize| (DIRECTION + at, levels[at].max(0.0));
        let low: Combination = (1..DIRECTIONS).map(level).collect();
        let parts = [vec![], vec![level(0)], low.clone(), [vec![level(0)], low].concat()];
        let torsion = |friction: Combination| {
            [(TORQUE, -1.0)].into_iter().chain(friction).collect::<Combination>()
        };
        parts.map(torsion).into()
    }

    /// Fits a target with coefficients of at least 0: the best of all subsets whose solution has that sign.
    fn fit(&self, target: usize, columns: &[Combination]) -> Fit {
        let mut best = (f64::INFINITY, Vec::new());
        for subset in 0..1usize << columns.len() {
            let chosen: Vec<Combination> = (0..columns.len())
                .filter(|at| subset & (1 << at) != 0)
                .map(|at| columns[at].clone())
                .collect();
            let (error, sizes) = self.solve(target, &chosen);
            if error < best.0 && sizes.iter().all(|size| *size >= 0.0) {
                let terms = chosen.iter().zip(&sizes).flat_map(|(combination, size)| {
                    combination.iter().map(move |(column, factor)| (*column, factor * size))
                });
                best = (error, terms.collect());
            }
        }
        let (error, terms) = best;
        Fit { error, coefficients: self.all(target, &terms), size: 0.0, operator: 0 }
    }

    /// Returns the error of combinations of columns and their sizes.
    fn solve(&self, target: usize, columns: &[Combination]) -> (f64, Vec<f64>) {
        let product = |a: &[(usize, f64)], b: &[(usize, f64)]| -> f64 {
            let pairs = a.iter().flat_map(|a| b.iter().map(move |b| (a, b)));
            let from = self.eliminated;
            pairs.map(|((a, x), (b, y))| x * y * self.reduced[(*a - from, *b - from)]).sum()
        };
        let count = columns.len();
        let all = product(&[(target, 1.0)], &[(target, 1.0)]);
        let mut gram = DMatrix::from_fn(count, count, |a, b| product(&columns[a], &columns[b]));
        (0..count).for_each(|at| gram[(at, at)] *= 1.0 + RIDGE);
        let right = DVector::from_fn(count, |at, _| product(&columns[at], &[(target, 1.0)]));
        match gram.cholesky() {
            Some(factor) => {
                let sizes = factor.solve(&right);
                (all - sizes.dot(&right), sizes.iter().copied().collect())
            }
            None => (f64::INFINITY, vec![0.0; count]),
        }
    }

    /// Returns the coefficients of all columns.
    fn all(&self, target: usize, terms: &[(usize, f64)]) -> Vec<f64> {
        let mut found = vec![0.0; self.blocks.columns];
        for (column, size) in terms.iter().copied().chain([(target, -1.0)]) {
            found[column] += size;
            for (at, coefficient) in found.iter_mut().take(self.eliminated).enumerate() {
                *coefficient -= size * self.shared[(at, column - self.eliminated)];
            }
        }
        found
    }
}
