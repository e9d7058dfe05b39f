//! The contest itself: banks for each law and the corrections that help, one search in each, one ledger.
//!
//! The log as it is competes first, with every base law. The orders of waves are found in what the best model of that round
//! leaves. Corrections are then screened with the columns of the best hypothesis, because a delay shows only once the larger
//! causes are in the model, and those that help get banks of their own.

use super::bank::{Bank, Workspace};
use super::cause::backlash::GapGrid;
use super::cause::ripple::RippleOrders;
use super::cause::{Context, Variant, variants};
use super::correction::{Correction, TRIED};
use super::draws::Draws;
use super::law::{Law, Shapes};
use super::ledger::{CauseKey, Hypothesis, Ledger};
use super::outcome::{Outcome, Table};
use super::rows::Rows;
use super::search::Search;
use super::weights::weigh;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Share of the error that a correction must take to get a bank.
const MIN_CORRECTION_GAIN: f64 = 0.02;

/// Most corrections beside the log as it is.
const MOST_CORRECTIONS: usize = 2;

/// Prior cost of a correction.
const CORRECTION_PRICE: f64 = 0.04;

/// Most hypotheses in the draws.
const MOST_DRAWN: usize = 400;

/// Ratio of the cost to the best cost above which a hypothesis is not drawn.
const MAX_COST_RATIO: f64 = 1.6;

/// What the nonlinear causes are chosen from.
struct Waves {
    orders: RippleOrders,
    gaps: GapGrid,
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

/// Runs the contest. It sets the weights of the rows first.
pub fn contest(rows: &mut Rows) -> Outcome {
    let shapes = Shapes::new(rows);
    if let Some(law) = shapes.laws(rows).first() {
        weigh(rows, &shapes, law);
    }
    let rows = &*rows;
    let laws = shapes.laws(rows);
    let Some(first) = laws.first() else { return Outcome::default() };
    let mut waves = Waves { orders: RippleOrders::default(), gaps: GapGrid::new(rows, &shapes) };
    waves.orders = orders(rows, &Entry::new(rows, &shapes, first, Correction::None, &waves));
    let build = |(law, correction): &(&Law, Correction)| {
        Entry::new(rows, &shapes, law, *correction, &waves)
    };
    let first: Vec<(&Law, Correction)> = laws.iter().map(|law| (law, Correction::None)).collect();
    let mut entries: Vec<Entry> = first.par_iter().map(build).collect();
    let mut hypotheses: Vec<Hypothesis> = search_all(&entries, 0);
    let Some(best) = least(&hypotheses) else { return Outcome::default() };
    let corrections = screen(rows, &entries[best.bank], best);
    let best_law = entries[best.bank].law.clone();
    let second: Vec<(&Law, Correction)> = corrections.iter().map(|c| (&best_law, *c)).collect();
    let later: Vec<Entry> = second.par_iter().map(build).collect();
    hypotheses.extend(search_all(&later, entries.len()));
    entries.extend(later);
    let ledger = Ledger::new(hypotheses);
    let draws = draw(rows, &entries, &ledger);
    Outcome::new(rows, Table { entries: &entries, ledger: &ledger, draws: &draws })
}

impl Entry {
    fn new(rows: &Rows, shapes: &Shapes, law: &Law, correction: Correction, waves: &Waves) -> Self {
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

    fn search(&self, bank: usize) -> Vec<Hypothesis> {
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

fn search_all(entries: &[Entry], first: usize) -> Vec<Hypothesis> {
    let search = |(at, entry): (usize, &Entry)| entry.search(first + at);
    entries.par_iter().enumerate().flat_map(search).collect()
}

fn least(hypotheses: &[Hypothesis]) -> Option<&Hypothesis> {
    hypotheses.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()))
}

/// The friction of a law, fitted to all rows.
struct Level {
    /// Friction torque over its RMS, positive in forward sliding.
    level: Vec<f64>,
    /// What the law leaves.
    residual: Vec<f64>,
    /// +1, or -1 if the friction drives the motion: the sign of the torque is reversed.
    friction_sign: f64,
}

impl Level {
    fn new(rows: &Rows, columns: &[Vec<f64>], law: &Law) -> Self {
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

/// Finds the orders of waves in what the model with all other causes leaves.
fn orders(rows: &Rows, entry: &Entry) -> RippleOrders {
    let set: Vec<u16> = (0..entry.variants.len() as u16).collect();
    let residual = residual(rows, entry, &set);
    let Level { level, .. } = Level::new(rows, &entry.law_columns, &entry.law);
    RippleOrders::find(rows, &residual, &level)
}

/// Returns what a set of variants leaves, fitted to all rows.
fn residual(rows: &Rows, entry: &Entry, set: &[u16]) -> Vec<f64> {
    let sizes = entry.bank.fit(&entry.indices(set), &mut Workspace::default());
    let columns = entry.columns(set);
    rows.map(|row| {
        rows.torque[row] - columns.iter().zip(&sizes).map(|(c, size)| c[row] * size).sum::<f64>()
    })
}

/// Returns the corrections with which the columns of a hypothesis leave less.
fn screen(rows: &Rows, entry: &Entry, best: &Hypothesis) -> Vec<Correction> {
    let columns = entry.columns(&best.set);
    let error = |correction: &Correction| {
        let corrected: Vec<Vec<f64>> =
            columns.iter().map(|column| correction.apply(rows, column)).collect();
        let corrected: Vec<&[f64]> = corrected.iter().map(Vec::as_slice).collect();
        let bank = Bank::new(rows, &corrected);
        let all: Vec<usize> = (0..corrected.len()).collect();
        (bank.error(&all, &mut Workspace::default()), *correction)
    };
    let mut errors: Vec<(f64, Correction)> = TRIED.par_iter().map(error).collect();
    errors.retain(|(error, _)| *error < (1.0 - MIN_CORRECTION_GAIN) * best.error);
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    errors.into_iter().take(MOST_CORRECTIONS).map(|(_, correction)| correction).collect()
}

fn draw(rows: &Rows, entries: &[Entry], ledger: &Ledger) -> Draws {
    let most = MAX_COST_RATIO * ledger.best().map_or(0.0, Hypothesis::cost);
    let drawn: Vec<&Hypothesis> =
        ledger.hypotheses.iter().take_while(|h| h.cost() <= most).take(MOST_DRAWN).collect();
    let errors = |hypothesis: &&Hypothesis| {
        let entry = &entries[hypothesis.bank];
        entry.bank.block_errors(&entry.indices(&hypothesis.set), &mut Workspace::default())
    };
    let errors: Vec<Vec<f64>> = drawn.par_iter().map(errors).collect();
    Draws::new(rows, &drawn, &errors)
}
