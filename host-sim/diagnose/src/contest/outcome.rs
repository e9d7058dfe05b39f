//! The result of a contest: the best hypothesis, and for each cause the figures from which a probability follows.

use super::bank::Workspace;
use super::cause_key::CauseKey;
use super::detail::Detail;
use super::draws;
use super::finalists::{Finalist, finalists};
use super::ledger::Hypothesis;
use super::linear::LinearAnswer;
use super::table::{Table, jackknife};
use crate::evaluation::{self, Gain};
use std::collections::BTreeSet;

/// Least inclusion of a cause in the report.
const MIN_INCLUSION: f64 = 0.02;

/// Share of what a cause takes last that is lost with another cause that stands in for it, at most.
const MAX_STAND_IN_LOSS: f64 = 0.3;

/// Number of runs from which on errors are compared by run: blocks of one run are not independent.
const MIN_RUNS: usize = 5;

/// Ratio of a law's cost to the least cost below which it is competitive.
const MAX_LAW_COST: f64 = 1.3;

/// The evidence for a cause.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// The cause and its column.
    pub key: CauseKey,
    /// Detail of its variant in the best hypothesis.
    pub detail: Detail,
    /// True if the best hypothesis holds it.
    pub is_in_best: bool,
    /// Share of the draws whose winner holds it.
    pub inclusion: f64,
    /// Share of the base error that it takes alone.
    pub alone: f64,
    /// The same in standard errors over the blocks or runs.
    pub alone_in_errors: f64,
    /// Share of the base error that it takes last: the best hypothesis without it, other causes unchanged.
    pub last: f64,
    /// As `last`, but the other causes may change: what no other cause can take.
    pub irreplaceable: f64,
    /// What it takes last, in standard errors over the blocks or runs.
    pub last_in_errors: f64,
    /// Share of the blocks or runs in which the error falls when it is taken last.
    pub units_gained: f64,
    /// Share of the RMS error that it takes last, with its interval over the blocks or runs.
    pub gain: Gain,
    /// RMS of what it takes last, as a share of the RMS torque.
    pub torque_share: f64,
    /// Share of the error that it takes alone beside a law that also has slip of a free shape; `alone` without such a law.
    pub beside_slip: f64,
    /// Its largest coefficient, in standard errors over the folds (a delete-one jackknife).
    pub size_in_errors: f64,
    /// Share of the competitive laws whose own best hypothesis holds it.
    pub laws: f64,
    /// Causes that stand in for it.
    pub confusable_with: Vec<CauseKey>,
}

impl Figures {
    /// Returns the materiality: the mean of what the cause takes alone and last.
    pub fn materiality(&self) -> f64 {
        0.5 * (self.alone + self.last)
    }
}

/// The result of a contest.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Base law of the best hypothesis.
    pub law: &'static str,
    /// True if the base law's friction is negative: the sign of the torque is reversed.
    pub is_reversed: bool,
    /// Causes with their figures, by materiality among those of the best hypothesis, then by inclusion.
    pub causes: Vec<Figures>,
    /// Held-out RMS error of the best law without a cause, unweighted.
    pub base_rmse: f64,
    /// Held-out RMS error of the best hypothesis, unweighted.
    pub rmse: f64,
    /// Ratio of the weighted squared errors of the best hypothesis and of the best law.
    pub error_ratio: f64,
    /// Weighted held-out RMS error of the best hypothesis, in noise floors.
    pub floors: f64,
    /// The same of the best law without a cause.
    pub base_floors: f64,
    /// Error that the noise and the uncertain motion alone leave.
    pub noise_floor: f64,
    /// Number of runs.
    pub runs: usize,
    /// Number of hypotheses that were scored.
    pub hypotheses: usize,
    /// Hypotheses to be fitted with the driver's law: the best one first, then those that win draws.
    pub finalists: Vec<Finalist>,
    /// Coulomb and viscous friction with the rigid-body parts.
    pub plain: LinearAnswer,
    /// The best hypothesis that is a model for other logs.
    pub linear: Option<LinearAnswer>,
}

/// Fall of the error from one hypothesis to another, over blocks or runs.
#[derive(Default)]
struct Fall {
    /// Mean fall, in its standard errors.
    in_errors: f64,
    /// Share of the blocks or runs in which the error falls.
    units_gained: f64,
    gain: Gain,
}

impl Outcome {
    pub(crate) fn new(table: &Table) -> Self {
        let rows = table.rows;
        let Some(best) = table.ledger.best() else { return Self::default() };
        let Some(base) = table.ledger.without_cause() else { return Self::default() };
        let mut causes: Vec<Figures> = table
            .draws
            .inclusion
            .keys()
            .chain(&best.causes)
            .collect::<BTreeSet<_>>()
            .into_iter()
            .map(|key| table.figures(key, best, base.error))
            .filter(|figures| figures.is_in_best || figures.inclusion >= MIN_INCLUSION)
            .collect();
        causes.sort_by(|a, b| {
            let order = b.is_in_best.cmp(&a.is_in_best);
            order.then(b.materiality().total_cmp(&a.materiality()))
        });
        let entry = &table.entries[best.bank];
        let floors = |error: f64| (error / rows.weight()).sqrt() / rows.noise_floor;
        Self {
            law: entry.base.name,
            is_reversed: rows.is_reversed,
            causes,
            base_rmse: table.rmse(base),
            rmse: table.rmse(best),
            error_ratio: best.error / base.error.max(f64::MIN_POSITIVE),
            floors: floors(best.error),
            base_floors: floors(base.error),
            noise_floor: rows.noise_floor,
            runs: rows.runs.len(),
            hypotheses: table.ledger.hypotheses.len(),
            finalists: finalists(table.ledger, table.draws)
                .into_iter()
                .map(|hypothesis| table.finalist(hypothesis))
                .collect(),
            linear: None,
            plain: LinearAnswer::default(),
        }
    }
}

impl Table<'_> {
    fn figures(&self, key: &CauseKey, best: &Hypothesis, base: f64) -> Figures {
        let rows = self.rows;
        let is_in_best = best.causes.contains(key);
        let alone = self.ledger.with_causes(&BTreeSet::from([key.clone()]));
        let beside_none = alone.zip(self.ledger.without_cause());
        let mut others = best.causes.clone();
        // Without it, a coefficient of another cause may be impossible. Such a set is no hypothesis, but shows what the cause takes.
        let reduced = self.without(key, best);
        let (with, without) = if is_in_best {
            others.remove(key);
            (Some(best), self.ledger.with_causes(&others).or(reduced.as_ref()))
        } else {
            others.insert(key.clone());
            (self.ledger.with_causes(&others), Some(best))
        };
        let pair = with.zip(without);
        let alone_share = alone.map_or(0.0, |alone| (base - alone.error) / base);
        let last = pair.map_or(0.0, |(with, without)| (without.error - with.error) / base);
        let fall = |(with, without)| self.fall(with, without);
        let last_fall = pair.map(fall).unwrap_or_default();
        let squares =
            rows.judged.iter().map(|row| (rows.weights[*row] * rows.torque[*row]).powi(2));
        let torque = squares.sum::<f64>().max(f64::MIN_POSITIVE);
        let with = self.ledger.least_error(|h| h.causes.contains(key)).unwrap_or(base);
        let without = self.ledger.least_error(|h| !h.causes.contains(key)).unwrap_or(base);
        let mut of_best = self.entries[best.bank].chosen(&best.set);
        let detail = of_best.find(|v| v.key == *key).map(|v| v.detail.clone());
        Figures {
            key: key.clone(),
            detail: detail.unwrap_or_default(),
            is_in_best,
            inclusion: self.draws.inclusion.get(key).copied().unwrap_or_default(),
            alone: alone_share,
            alone_in_errors: beside_none.map(fall).unwrap_or_default().in_errors,
            last,
            irreplaceable: (without - with) / base,
            last_in_errors: last_fall.in_errors,
            units_gained: last_fall.units_gained,
            gain: last_fall.gain,
            torque_share: (last.max(0.0) * base / torque).sqrt(),
            beside_slip: self.beside_slip(key).unwrap_or(alone_share),
            size_in_errors: pair.map_or(0.0, |(with, _)| self.size_in_errors(key, with)),
            laws: self.laws_with(key),
            confusable_with: self.stand_ins(key, best, last * base),
        }
    }

    /// Returns a hypothesis without one of its causes; `None` if it has the cause by its correction or not at all.
    fn without(&self, key: &CauseKey, hypothesis: &Hypothesis) -> Option<Hypothesis> {
        let entry = &self.entries[hypothesis.bank];
        let is_other = |at: &u16| entry.variants[*at as usize].key != *key;
        let set: Vec<u16> = hypothesis.set.iter().copied().filter(is_other).collect();
        if set.len() == hypothesis.set.len() {
            return None;
        }
        let error = entry.bank.error(&entry.indices(&set), &mut Workspace::default());
        Some(Hypothesis { set, error, ..hypothesis.clone() })
    }

    /// Returns the causes that stand in for one: those that win the draws where it does not, and those that the best
    /// hypothesis without it holds in its place, if it loses little by that.
    fn stand_ins(&self, key: &CauseKey, best: &Hypothesis, last: f64) -> Vec<CauseKey> {
        let mut found = self.draws.substitutes(key);
        let others = self.ledger.hypotheses.iter().filter(|h| !h.causes.contains(key));
        let without = others.min_by(|a, b| a.cost().total_cmp(&b.cost()));
        if let Some(without) = without
            && best.causes.contains(key)
            && without.error - best.error < MAX_STAND_IN_LOSS * last
        {
            let new = without.causes.difference(&best.causes).cloned();
            found.extend(new.filter(|new| !found.contains(new)).collect::<Vec<_>>());
        }
        found
    }

    /// Returns the fall of the error from one hypothesis to another.
    fn fall(&self, with: &Hypothesis, without: &Hypothesis) -> Fall {
        let [with, without] = [with, without].map(|hypothesis| {
            let entry = &self.entries[hypothesis.bank];
            let errors = entry.bank.block_errors(&entry.indices(&hypothesis.set));
            draws::unit_errors(self.rows, &errors, MIN_RUNS)
        });
        let falls: Vec<f64> = without.iter().zip(&with).map(|(a, b)| a - b).collect();
        let count = falls.len().max(2) as f64;
        let mean = falls.iter().sum::<f64>() / count;
        let variance = falls.iter().map(|fall| (fall - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let gained = falls.iter().filter(|fall| **fall > 0.0).count() as f64;
        let pairs: Vec<[f64; 2]> = without.into_iter().zip(with).map(|(a, b)| [a, b]).collect();
        Fall {
            in_errors: mean / (variance / count).sqrt().max(f64::MIN_POSITIVE),
            units_gained: gained / count,
            gain: evaluation::gain_of_units(&pairs, 0),
        }
    }

    /// Returns what a cause takes alone, as a share, beside the best law with slip of a free shape.
    fn beside_slip(&self, key: &CauseKey) -> Option<f64> {
        let has_slip = |h: &&Hypothesis| self.entries[h.bank].base.has_slip;
        let best = self.ledger.hypotheses.iter().find(has_slip)?.bank;
        let in_entry = || self.ledger.hypotheses.iter().filter(move |h| h.bank == best);
        let plain = in_entry().find(|h| h.causes.is_empty())?.error;
        let alone = in_entry().filter(|h| h.causes.len() == 1 && h.causes.contains(key));
        let alone = alone.map(|h| h.error).min_by(f64::total_cmp);
        Some(alone.map_or(0.0, |alone| (plain - alone) / plain))
    }

    /// Returns the largest coefficient of a cause in a hypothesis over its standard error.
    fn size_in_errors(&self, key: &CauseKey, hypothesis: &Hypothesis) -> f64 {
        let entry = &self.entries[hypothesis.bank];
        let whole = entry.fit(&hypothesis.set);
        let folds = entry.fits_without_fold(&hypothesis.set);
        let of_cause = entry.placed(&hypothesis.set).filter(|(variant, _)| variant.key == *key);
        let in_errors = |column: usize| {
            let values: Vec<f64> = folds.iter().map(|fold| fold[column]).collect();
            let error = jackknife(&values).max(1e-12 * whole[column].abs());
            whole[column].abs() / error.max(f64::MIN_POSITIVE)
        };
        of_cause.flat_map(|(_, place)| place).map(in_errors).fold(0.0, f64::max)
    }

    /// Returns the share of the competitive laws whose own best hypothesis holds a cause.
    fn laws_with(&self, key: &CauseKey) -> f64 {
        let least = |at: usize| {
            let in_entry = self.ledger.hypotheses.iter().filter(move |h| h.bank == at);
            in_entry.min_by(|a, b| a.cost().total_cmp(&b.cost()))
        };
        let best: Vec<&Hypothesis> = (0..self.entries.len()).filter_map(least).collect();
        let most = best.iter().map(|h| h.cost()).fold(f64::INFINITY, f64::min) * MAX_LAW_COST;
        let competitive: Vec<&Hypothesis> = best.into_iter().filter(|h| h.cost() <= most).collect();
        let holding = competitive.iter().filter(|h| h.causes.contains(key)).count();
        holding as f64 / competitive.len().max(1) as f64
    }
}
