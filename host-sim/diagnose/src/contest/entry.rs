//! One entry of the contest: the columns of a correction and a law, their products, and the search among them.

use super::bank::{Bank, Workspace};
use super::cause::backlash::GapGrid;
use super::cause::ripple::RippleOrders;
use super::cause::{Context, Variant, variants};
use super::correction::Correction;
use super::law::{Law, Shapes};
use super::ledger::{CauseKey, Hypothesis};
use super::rows::Rows;
use super::search::Search;
use std::collections::BTreeSet;

/// Prior cost of a correction.
const CORRECTION_PRICE: f64 = 0.04;

/// What the nonlinear causes are chosen from.
pub(crate) struct Waves {
    pub(crate) orders: RippleOrders,
    pub(crate) gaps: GapGrid,
}

/// Columns and products of one correction and law.
pub(crate) struct Entry {
    pub(crate) law: Law,
    pub(crate) correction: Correction,
    pub(crate) law_columns: Vec<Vec<f64>>,
    pub(crate) variants: Vec<Variant>,
    pub(crate) bank: Bank,
    pub(crate) friction_sign: f64,
}

impl Entry {
    pub(crate) fn new(
        rows: &Rows,
        shapes: &Shapes,
        law: &Law,
        correction: Correction,
        waves: &Waves,
    ) -> Self {
        let mut law_columns = shapes.columns(rows, law);
        let Level { level, residual, friction_sign } = Level::new(rows, &law_columns, law);
        let travel = law.stops[0];
        let Waves { orders, gaps } = waves;
        let context =
            Context { rows, shapes, travel, level: &level, orders, gaps, residual: &residual };
        let mut variants = variants(&context);
        if correction != Correction::None {
            let columns = variants.iter_mut().flat_map(|variant| &mut variant.columns);
            columns
                .chain(&mut law_columns)
                .for_each(|column| *column = correction.apply(rows, column));
        }
        let columns =
            law_columns.iter().chain(variants.iter().flat_map(|variant| &variant.columns));
        let columns: Vec<&[f64]> = columns.map(Vec::as_slice).collect();
        let bank = Bank::new(rows, &columns);
        Self { law: law.clone(), correction, law_columns, variants, bank, friction_sign }
    }

    /// Returns the columns of a set of variants, those of the law first.
    pub(crate) fn columns(&self, set: &[u16]) -> Vec<&[f64]> {
        let own = set.iter().flat_map(|variant| &self.variants[*variant as usize].columns);
        self.law_columns.iter().chain(own).map(Vec::as_slice).collect()
    }

    /// Returns the indices of a set's columns in the bank.
    pub(crate) fn indices(&self, set: &[u16]) -> Vec<usize> {
        Search::new(&self.bank, self.law_columns.len(), &self.variants, self.friction_sign)
            .columns(set)
    }

    pub(crate) fn search(&self, bank: usize) -> Vec<Hypothesis> {
        let mut search =
            Search::new(&self.bank, self.law_columns.len(), &self.variants, self.friction_sign);
        search.run(&[]);
        let scores = std::mem::take(&mut search.scores);
        let hypothesis = |(set, error): (Vec<u16>, f64)| {
            let mut causes: BTreeSet<CauseKey> = set
                .iter()
                .map(|at| &self.variants[*at as usize])
                .filter(|v| v.is_cause())
                .map(key)
                .collect();
            let mut price = search.price(&set) + self.law.price();
            if self.correction.is_cause() {
                causes.insert(CauseKey { cause: "channel-delay", follows: String::new() });
            }
            if self.correction != Correction::None {
                price += CORRECTION_PRICE;
            }
            Hypothesis { bank, set, causes, error, price }
        };
        scores.into_iter().filter(|(_, error)| error.is_finite()).map(hypothesis).collect()
    }
}

fn key(variant: &Variant) -> CauseKey {
    CauseKey { cause: variant.cause, follows: variant.follows.clone() }
}

/// The friction of a law, fitted to all rows.
pub(crate) struct Level {
    /// Friction torque over its RMS, positive in forward sliding.
    pub(crate) level: Vec<f64>,
    /// What the law leaves.
    residual: Vec<f64>,
    /// +1, or -1 if the friction drives the motion: the sign of the torque is reversed.
    friction_sign: f64,
}

impl Level {
    pub(crate) fn new(rows: &Rows, columns: &[Vec<f64>], law: &Law) -> Self {
        let all: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let bank = Bank::new(rows, &all);
        let indices: Vec<usize> = (0..all.len()).collect();
        let sizes = bank.fit(&indices, &mut Workspace::default());
        let stops = law.stops.len();
        let falls = stops + 1..stops + 1 + if law.has_falls { 3 } else { 0 };
        let is_friction = |at: usize| at < stops || falls.contains(&at);
        let sum = |row: usize, is_meant: &dyn Fn(usize) -> bool| {
            (0..all.len())
                .filter(|at| is_meant(*at))
                .map(|at| all[at][row] * sizes[at])
                .sum::<f64>()
        };
        let mut level = rows.map(|row| sum(row, &is_friction));
        let residual = rows.map(|row| rows.torque[row] - sum(row, &|_| true));
        let squares: f64 = level.iter().map(|v| v * v).sum();
        // The level is positive in forward sliding, whatever the sign of the logged torque.
        let along: f64 = level.iter().zip(&rows.velocity).map(|(a, b)| a * b).sum();
        let scale = along.signum() / ((squares / level.len().max(1) as f64).sqrt() + 1e-300);
        level.iter_mut().for_each(|v| *v *= scale);
        Self { level, residual, friction_sign: along.signum() }
    }
}
