//! One linear fit of a residual by the parameters of a law and by the terms of causes, jointly.
//!
//! The columns are the derivatives of the law and the regressors of candidates. Their products are computed once, so that a set of
//! candidates is a choice of rows and columns of one matrix.

use crate::candidate::Candidate;
use crate::cause::Cause;
use crate::columns::{columns, products};
use crate::sensitivities::{Sensitivities, TrackSensitivities};
use crate::train_test::TrainTest;
use friction_fit::Track;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Ridge of the linear fit, relative to columns of unit length.
const RIDGE: f64 = 1e-6;

/// Share of the squared error that a candidate must remove for each coefficient that it has more than another one.
const MIN_GAIN_PER_COEFFICIENT: f64 = 0.01;

/// A cause with the candidates by which it may enter the model.
pub(super) struct Entrant {
    pub(super) cause: &'static Cause,
    pub(super) candidates: Vec<Candidate>,
}

/// Products of the columns of a law and of candidates with the residual.
pub(super) struct LinearFit {
    products: DMatrix<f64>,
    scale: Vec<f64>,
    /// Number of columns of the law.
    law: usize,
    /// Columns of each candidate of each entrant.
    places: Vec<Vec<Range<usize>>>,
}

/// Solution of a linear fit.
pub(super) struct LinearSolution {
    /// Changes of the law's parameters.
    pub(super) law: Vec<f64>,
    /// Coefficients of each candidate.
    pub(super) candidates: Vec<Vec<f64>>,
    sse: f64,
}

impl LinearFit {
    pub(super) fn new(log: &TrainTest, at: &Sensitivities, entrants: &[Entrant]) -> Self {
        let mut next = at.free.len();
        let mut regressors = Vec::new();
        let mut place = |candidate: &Candidate| {
            next += candidate.regressors.len();
            next - candidate.regressors.len()..next
        };
        let mut places: Vec<Vec<Range<usize>>> = Vec::new();
        for entrant in entrants {
            places.push(entrant.candidates.iter().map(&mut place).collect());
            for candidate in &entrant.candidates {
                let covariate = candidate.follows.as_ref().and_then(|follows| follows.covariate);
                regressors.extend(candidate.regressors.iter().map(|by| (by, covariate)));
            }
        }
        let size = next + 1;
        let tracks: Vec<_> = log.train_tracks.iter().zip(&at.tracks).collect();
        let of_track = |(track, along): &(&Track, &TrackSensitivities)| {
            let columns = columns(log, at, (track, along), &regressors);
            products(&columns, 0..columns[0].len())
        };
        let parts: Vec<DMatrix<f64>> = tracks.par_iter().map(of_track).collect();
        let products = parts.into_iter().fold(DMatrix::zeros(size, size), |sum, part| sum + part);
        let scale = (0..size).map(|at| products[(at, at)].sqrt().max(f64::MIN_POSITIVE)).collect();
        Self { products, scale, law: at.free.len(), places }
    }

    /// Solves for the law and some candidates: the index of an entrant, and of its candidate.
    pub(super) fn solve(&self, candidates: &[(usize, usize)]) -> LinearSolution {
        let places = || candidates.iter().map(|(entrant, at)| &self.places[*entrant][*at]);
        let all: Vec<usize> = (0..self.law).chain(places().cloned().flatten()).collect();
        let last = self.products.nrows() - 1;
        let scaled = |a: usize, b: usize| self.products[(a, b)] / (self.scale[a] * self.scale[b]);
        let ridge = |i: usize, j: usize| if i == j { RIDGE } else { 0.0 };
        let system =
            DMatrix::from_fn(all.len(), all.len(), |i, j| scaled(all[i], all[j]) + ridge(i, j));
        let right = DVector::from_fn(all.len(), |i, _| scaled(all[i], last));
        let solution = Cholesky::new(system)
            .map_or_else(|| DVector::zeros(all.len()), |factor| factor.solve(&right));
        let square = self.products[(last, last)];
        let sse = square * (1.0 - solution.dot(&right));
        let mut sizes =
            all.iter().zip(solution.iter()).map(|(at, x)| x * self.scale[last] / self.scale[*at]);
        let law = sizes.by_ref().take(self.law).collect();
        let candidates = places().map(|place| sizes.by_ref().take(place.len()).collect()).collect();
        LinearSolution { law, candidates, sse }
    }

    /// Chooses the candidate of each entrant, one entrant after the other.
    pub(super) fn choose(&self) -> Vec<(usize, usize)> {
        let mut chosen: Vec<(usize, usize)> = Vec::new();
        for (entrant, places) in self.places.iter().enumerate() {
            let cost = |(at, place): (usize, &Range<usize>)| {
                let all = [chosen.as_slice(), &[(entrant, at)]].concat();
                let price = (MIN_GAIN_PER_COEFFICIENT * place.len() as f64).exp();
                (self.solve(&all).sse * price, at)
            };
            let costs = places.iter().enumerate().map(cost);
            let best = costs.min_by(|a, b| a.0.total_cmp(&b.0));
            chosen.extend(best.map(|(_, at)| (entrant, at)));
        }
        chosen
    }
}
