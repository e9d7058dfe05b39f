//! The best hypothesis of the contest as a model for other logs.
//!
//! A hypothesis whose columns mean the same on another log, a law of stops with causes that are regressors, is a model as it is:
//! its coefficients are those of one least squares on all rows, in which friction levels, viscous friction and inertia are not
//! negative.

use super::bank::Workspace;
use super::cause::CHANNEL_GAIN;
use super::entry::{Entry, Origin};
use super::law::{COULOMB, STRIBECK, Shapes};
use super::ledger::{Hypothesis, Ledger};
use super::rows::Rows;
use friction_fit::linear::{LinearModel, LinearTerm};
use friction_fit::measurement::{ChannelGain, Measurement};

/// The best hypothesis that is a model for other logs.
#[derive(Clone, Debug)]
pub struct LinearAnswer {
    /// Name of its law.
    pub law: &'static str,
    /// The model of the torque at the shaft.
    pub model: LinearModel,
    /// What lies between the shaft and the log.
    pub measurement: Measurement,
    /// What a fit without a row's fold leaves of the row, for all rows.
    pub held_out: Vec<f64>,
}

/// Returns the hypothesis of the least cost that is a model for other logs, with the law of its entry.
pub(crate) fn transferable<'l>(entries: &[Entry], ledger: &'l Ledger) -> Option<&'l Hypothesis> {
    ledger.hypotheses.iter().find(|hypothesis| {
        let entry = &entries[hypothesis.bank];
        let variants = hypothesis.set.iter().map(|at| &entry.variants[*at as usize]);
        let is_transferable = |variant: &super::cause::Variant| {
            let factors = variant.regressors.iter().flat_map(|regressor| &regressor.factors);
            !variant.regressors.is_empty() && factors.clone().all(|own| own.is_transferable())
        };
        matches!(entry.base.origin, Origin::Shapes(_)) && variants.clone().all(is_transferable)
    })
}

/// Returns a hypothesis as a model, with what it leaves. Its columns must be in the entry.
pub(crate) fn answer(
    rows: &Rows,
    shapes: &Shapes,
    entry: &Entry,
    hypothesis: &Hypothesis,
) -> Option<LinearAnswer> {
    let Origin::Shapes(law) = &entry.base.origin else { return None };
    let term = |part: &str, factors| LinearTerm { part: part.into(), size: 0.0, factors };
    let law = shapes.regressors(rows, law).into_iter();
    let mut parts: Vec<(&str, LinearTerm)> =
        law.map(|(name, own)| (name, term(name, own))).collect();
    let law_columns = parts.len();
    for variant in hypothesis.set.iter().map(|at| &entry.variants[*at as usize]) {
        let own = variant.regressors.iter().cloned();
        parts.extend(own.map(|own| (variant.cause, term(variant.cause, own))));
    }
    let sizes = entry.bank.fit(&entry.indices(&hypothesis.set), &mut Workspace::default());
    let held_out = held_out(rows, entry, hypothesis);
    let level = parts[..law_columns].iter().zip(&entry.base.sizes);
    let level = level.filter(|((name, _), _)| [COULOMB, STRIBECK].contains(name));
    let level = level.map(|((_, term), size)| LinearTerm {
        size: size * entry.base.level_scale,
        ..term.clone()
    });
    let level = level.collect();
    let sign = if rows.is_reversed { -1.0 } else { 1.0 };
    let (torque_delay_s, torque_low_pass) = entry.correction.of_torque(rows.step_s);
    let mut measurement = Measurement {
        torque_delay_s,
        torque_low_pass,
        torque_sign: sign,
        channel_gains: Vec::new(),
    };
    let mut terms = Vec::new();
    for ((name, term), size) in parts.iter().zip(sizes) {
        match *name {
            CHANNEL_GAIN => measurement.channel_gains.extend(channel_gain(term, sign * size)),
            _ if size == 0.0 => {}
            _ => terms.push(LinearTerm { size, ..term.clone() }),
        }
    }
    let model = LinearModel { level, terms };
    Some(LinearAnswer { law: entry.base.name, model, measurement, held_out })
}

/// Returns what fits without a row's fold leave of each row. The rows between two judged ones belong to the block of the first.
fn held_out(rows: &Rows, entry: &Entry, hypothesis: &Hypothesis) -> Vec<f64> {
    let indices = entry.indices(&hypothesis.set);
    let columns = entry.columns(&hypothesis.set);
    let fits = entry.bank.fits_without_fold(&indices, &mut Workspace::default());
    let mut left = rows.torque.clone();
    for (block, judged) in rows.blocks.iter().enumerate() {
        let run = &rows.runs[rows.run_of_block[block]];
        let is_first = block == 0 || rows.run_of_block[block - 1] != rows.run_of_block[block];
        let is_last = rows.run_of_block.get(block + 1) != Some(&rows.run_of_block[block]);
        let from = if is_first { run.start } else { rows.judged[judged.start] };
        let to = if is_last { run.end } else { rows.judged[judged.end] };
        let sizes = &fits[rows.fold_of_block[block]];
        for (column, size) in columns.iter().zip(sizes) {
            for (left, value) in left[from..to].iter_mut().zip(&column[from..to]) {
                *left -= size * value;
            }
        }
    }
    left
}

/// Returns the share of a channel whose values less their mean, over their spread, have this coefficient.
fn channel_gain(term: &LinearTerm, size: f64) -> Option<ChannelGain> {
    use friction_fit::linear::Factor;
    match term.factors.factors.first()? {
        Factor::Column { name, mean, spread, .. } => {
            Some(ChannelGain { column: name.clone(), gain: size / spread, mean: *mean })
        }
        _ => None,
    }
}
