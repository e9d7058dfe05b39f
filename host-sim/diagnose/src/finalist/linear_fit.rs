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

/// A candidate of an entrant.
#[derive(Clone, Copy)]
pub(super) struct Choice {
    /// Index of the entrant.
    pub(super) entrant: usize,
    /// Index of the candidate among those of the entrant.
    pub(super) candidate: usize,
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
        let mut place = |candidate: &Candidate| {
            next += candidate.regressors.len();
            next - candidate.regressors.len()..next
        };
        let places: Vec<Vec<Range<usize>>> = entrants
            .iter()
            .map(|entrant| entrant.candidates.iter().map(&mut place).collect())
            .collect();
        let candidates: Vec<&Candidate> =
            entrants.iter().flat_map(|entrant| &entrant.candidates).collect();
        let size = next + 1;
        let tracks: Vec<_> = log.train_tracks.iter().zip(&at.tracks).collect();
        let of_track = |(track, along): &(&Track, &TrackSensitivities)| {
            let columns = columns(log, at, track, along, &candidates);
            products(&columns, 0..columns[0].len())
        };
        let parts: Vec<DMatrix<f64>> = tracks.par_iter().map(of_track).collect();
        let products = parts.into_iter().fold(DMatrix::zeros(size, size), |sum, part| sum + part);
        let scale = (0..size).map(|at| products[(at, at)].sqrt().max(f64::MIN_POSITIVE)).collect();
        Self { products, scale, law: at.free.len(), places }
    }

    /// Solves for the law and some candidates.
    pub(super) fn solve(&self, chosen: &[Choice]) -> LinearSolution {
        let place = |choice: &Choice| &self.places[choice.entrant][choice.candidate];
        let places = || chosen.iter().map(place);
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
    pub(super) fn choose(&self) -> Vec<Choice> {
        let mut chosen: Vec<Choice> = Vec::new();
        for (entrant, places) in self.places.iter().enumerate() {
            let cost = |(candidate, place): (usize, &Range<usize>)| {
                let choice = Choice { entrant, candidate };
                let all = [chosen.as_slice(), &[choice]].concat();
                let price = (MIN_GAIN_PER_COEFFICIENT * place.len() as f64).exp();
                (self.solve(&all).sse * price, choice)
            };
            let costs = places.iter().enumerate().map(cost);
            let best = costs.min_by(|a, b| a.0.total_cmp(&b.0));
            chosen.extend(best.map(|(_, choice)| choice));
        }
        chosen
    }
}
