//! Search over sets of causes in one bank: a beam with add, drop and swap.
//!
//! The beam adds one variant at a time to its best sets. Adding alone keeps what stood in for a later, better cause, so the
//! best set is then improved by every drop and swap until none helps. No hypothesis is discarded: every score stays in the
//! ledger, and what is returned is the best that was seen.

use super::bank::{Bank, Workspace};
use super::cause::Variant;
use std::collections::HashMap;

/// Number of sets that the beam keeps.
const BEAM: usize = 6;

/// Most causes of a hypothesis.
const MOST_CAUSES: usize = 6;

/// Share of the error that the next cause must take for the beam to go on.
const MIN_STEP: f64 = 0.005;

/// Rounds of drops and swaps.
const ROUNDS: usize = 4;

/// A set of variants, ascending.
pub type CauseSet = Vec<u16>;

/// The search in one bank.
pub struct Search<'a> {
    bank: &'a Bank,
    variants: &'a [Variant],
    /// Bank columns of the law.
    law: usize,
    /// First bank column of each variant.
    first: Vec<usize>,
    work: Workspace,
    /// Held-out error of every set that was scored.
    pub scores: HashMap<CauseSet, f64>,
}

impl<'a> Search<'a> {
    /// Prepares a search. The bank holds the law's columns, then those of the variants in order.
    pub fn new(bank: &'a Bank, law: usize, variants: &'a [Variant]) -> Self {
        let mut at = law;
        let first = variants.iter().map(|variant| {
            at += variant.width();
            at - variant.width()
        });
        let first = first.collect();
        let work = Workspace::default();
        Self { bank, variants, law, first, work, scores: HashMap::new() }
    }

    /// Returns the bank columns of a set.
    pub fn columns(&self, set: &[u16]) -> Vec<usize> {
        let mut columns: Vec<usize> = (0..self.law).collect();
        for variant in set {
            let (first, count) =
                (self.first[*variant as usize], self.variants[*variant as usize].width());
            columns.extend(first..first + count);
        }
        columns
    }

    /// Returns the prior cost of a set.
    pub fn price(&self, set: &[u16]) -> f64 {
        set.iter().map(|variant| self.variants[*variant as usize].price).sum()
    }

    /// Runs the search.
    pub fn run(&mut self) {
        let mut beam: Vec<CauseSet> = vec![Vec::new()];
        let mut best = self.cost(&[]);
        for _ in 0..MOST_CAUSES {
            let longer = self.longer(&beam);
            let Some(first) = longer.first().map(|(cost, _)| *cost) else { break };
            if first > (1.0 - MIN_STEP) * best {
                break;
            }
            best = first;
            beam = longer.into_iter().take(BEAM).map(|(_, set)| set).collect();
        }
        self.improve(beam[0].clone());
    }

    /// Returns the sets of the beam with one more variant, by cost.
    fn longer(&mut self, beam: &[CauseSet]) -> Vec<(f64, CauseSet)> {
        let mut found: HashMap<CauseSet, f64> = HashMap::new();
        for set in beam {
            for variant in 0..self.variants.len() as u16 {
                if self.fits(set, variant) {
                    let longer = with(set, variant);
                    let cost = self.cost(&longer);
                    found.insert(longer, cost);
                }
            }
        }
        let mut sorted: Vec<(f64, CauseSet)> =
            found.into_iter().map(|(set, cost)| (cost, set)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        sorted
    }

    /// Improves a set by drops, swaps and additions until none helps.
    fn improve(&mut self, mut set: CauseSet) {
        for _ in 0..ROUNDS {
            let mut best = (self.cost(&set), set.clone());
            let mut near: Vec<CauseSet> = Vec::new();
            for at in 0..set.len() {
                let mut less = set.clone();
                less.remove(at);
                for variant in 0..self.variants.len() as u16 {
                    if self.fits(&less, variant) && variant != set[at] {
                        near.push(with(&less, variant));
                    }
                }
                near.push(less);
            }
            for variant in 0..self.variants.len() as u16 {
                if set.len() < MOST_CAUSES && self.fits(&set, variant) {
                    near.push(with(&set, variant));
                }
            }
            for other in near {
                let cost = self.cost(&other);
                if cost < best.0 {
                    best = (cost, other);
                }
            }
            if best.1 == set {
                return;
            }
            set = best.1;
        }
    }

    /// Returns true if a variant may join a set: a set holds one variant of each cause and column.
    fn fits(&self, set: &[u16], variant: u16) -> bool {
        let joining = &self.variants[variant as usize];
        set.iter().all(|other| {
            let other = &self.variants[*other as usize];
            other.key != joining.key
        })
    }

    /// Returns true if no coefficient of a set that was evaluated last has a physically impossible sign: a negative mass, a seal
    /// that pressure relieves.
    fn is_possible(&self, set: &[u16], columns: &[usize]) -> bool {
        if set.iter().all(|at| self.variants[*at as usize].sign == 0.0) {
            return true;
        }
        let sizes = self.bank.sizes(columns, &self.work);
        let mut at = self.law;
        set.iter().all(|index| {
            let variant = &self.variants[*index as usize];
            at += variant.width();
            variant.sign * sizes[at - variant.width()] >= 0.0
        })
    }

    /// Returns the held-out error of a set with its prior cost.
    fn cost(&mut self, set: &[u16]) -> f64 {
        let error = match self.scores.get(set) {
            Some(error) => *error,
            None => {
                let columns = self.columns(set);
                let error = self.bank.error(&columns, &mut self.work);
                let error = if self.is_possible(set, &columns) { error } else { f64::INFINITY };
                self.scores.insert(set.to_vec(), error);
                error
            }
        };
        error * self.price(set).exp()
    }
}

fn with(set: &[u16], variant: u16) -> CauseSet {
    let mut longer = set.to_vec();
    let at = longer.partition_point(|other| *other < variant);
    longer.insert(at, variant);
    longer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::cause::ColumnSource;
    use crate::contest::rows::tests::example;
    use crate::contest::{CauseKey, Detail};

    fn variant(cause: &'static str, column: Vec<f64>) -> Variant {
        Variant {
            key: CauseKey { cause, columns: Vec::new() },
            detail: Detail::Only,
            source: ColumnSource::Simulated(column.into()),
            price: 0.02,
            sign: 1.0,
        }
    }

    #[test]
    fn run_on_a_sum_and_its_parts_swaps_to_the_parts() {
        let rows = example();
        let sign: Vec<f64> = rows.velocity.iter().map(|v| v.signum()).collect();
        let pressure = &rows.covariates[0].scaled;
        let level: Vec<f64> = sign.iter().zip(pressure).map(|(s, p)| s * p).collect();
        let decoy: Vec<f64> =
            level.iter().zip(&rows.acceleration).map(|(a, b)| a + 0.3 * b).collect();
        let bank = Bank::new(&rows, &[&sign, &rows.velocity, &decoy, &level]);
        let variants = [variant("decoy", decoy), variant("pressure", level)];
        let mut search = Search::new(&bank, 2, &variants);
        search.run();
        let best = search.scores.iter().min_by(|a, b| {
            let cost = |of: &(&CauseSet, &f64)| *of.1 * search.price(of.0).exp();
            cost(a).total_cmp(&cost(b))
        });
        assert_eq!(best.unwrap().0, &vec![1]);
    }
}
