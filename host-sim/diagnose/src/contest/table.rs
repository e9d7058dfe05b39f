//! All that a contest has scored.

use super::draws::Draws;
use super::entry::Entry;
use super::law::Shapes;
use super::ledger::{Hypothesis, Ledger};
use super::rows::Rows;

/// What an outcome and its finalists are made of.
pub(crate) struct Table<'a> {
    pub(crate) rows: &'a Rows,
    pub(crate) shapes: &'a Shapes,
    pub(crate) entries: &'a [Entry],
    pub(crate) ledger: &'a Ledger,
    pub(crate) draws: &'a Draws,
}

impl Table<'_> {
    /// Returns the unweighted held-out RMS error of a hypothesis.
    pub(super) fn rmse(&self, hypothesis: &Hypothesis) -> f64 {
        let (rows, entry) = (self.rows, &self.entries[hypothesis.bank]);
        let columns = entry.columns(rows, &hypothesis.set);
        let fits = entry.fits_without_fold(&hypothesis.set);
        let mut squares = 0.0;
        for (block, fold) in rows.blocks.iter().zip(&rows.fold_of_block) {
            for row in &rows.judged[block.clone()] {
                let model: f64 = columns
                    .iter()
                    .zip(&fits[*fold])
                    .map(|(c, size)| rows.judged_value(c, *row) * size)
                    .sum();
                squares += (rows.judged_value(&rows.torque, *row) - model).powi(2);
            }
        }
        (squares / rows.judged.len().max(1) as f64).sqrt()
    }
}

/// Returns the standard error of a value from its values without one fold each.
pub(super) fn jackknife(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count.max(1.0);
    ((count - 1.0).max(0.0) / count.max(1.0)
        * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>())
    .sqrt()
}
