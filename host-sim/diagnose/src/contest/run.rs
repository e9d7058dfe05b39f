//! The contest itself: banks for each law and the corrections that help, one search in each, one ledger.
//!
//! The log as it is competes first, with every base law. The orders of waves are found in what the best model of that round
//! leaves. Corrections are then screened with the columns of the best hypothesis, because a delay shows only once the larger
//! causes are in the model, and those that help get banks of their own.

use super::bank::{Bank, Workspace};
use super::cause::backlash::GapGrid;
use super::cause::ripple::RippleOrders;
use super::correction::{Correction, TRIED};
use super::draws::Draws;
use super::entry::{Entry, Level, Waves};
use super::law::{Law, Shapes};
use super::ledger::{Hypothesis, Ledger};
use super::outcome::{Outcome, Table};
use super::rows::Rows;
use super::weights::weigh;
use rayon::prelude::*;

/// Share of the error that a correction must take to get a bank.
const MIN_CORRECTION_GAIN: f64 = 0.02;

/// Most corrections beside the log as it is.
const MOST_CORRECTIONS: usize = 2;

/// Most hypotheses in the draws.
const MOST_DRAWN: usize = 400;

/// Ratio of the cost to the best cost above which a hypothesis is not drawn.
const MAX_COST_RATIO: f64 = 1.6;

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
    Outcome::new(rows, Table { shapes: &shapes, entries: &entries, ledger: &ledger, draws: &draws })
}

fn search_all(entries: &[Entry], first: usize) -> Vec<Hypothesis> {
    let search = |(at, entry): (usize, &Entry)| entry.search(first + at);
    entries.par_iter().enumerate().flat_map(search).collect()
}

fn least(hypotheses: &[Hypothesis]) -> Option<&Hypothesis> {
    hypotheses.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()))
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
