//! Bayesian bootstrap over blocks: how often the winning hypothesis holds a cause.
//!
//! Each draw weighs the blocks (or the runs, if there are many) with random numbers that sum to their count, and the
//! hypothesis of the least weighted error wins. The share of the draws in which it holds a cause is the cause's inclusion. The
//! same table says which cause stands in for another: those that win where the other does not.

use super::cause_key::CauseKey;
use super::ledger::Hypothesis;
use super::rows::Rows;
use joint_log::work::checkpoint;
use rand::SeedableRng;
use rand_distr::{Distribution, Exp1};
use rand_pcg::Pcg64;
use std::collections::{BTreeMap, BTreeSet};

/// Number of draws.
pub const DRAWS: usize = 800;

/// Number of runs from which on runs are drawn in place of blocks.
const MIN_RUNS: usize = 12;

/// Seed of the draws. It is constant, so that a log always gives the same draws.
const SEED: u64 = 0x636f_6e74_6573;

/// Probability of another cause where this one is absent, above which the two stand in for each other.
const MIN_SUBSTITUTION: f64 = 0.5;

/// Winners of the draws.
#[derive(Clone, Debug, Default)]
pub struct Draws {
    /// Share of the draws whose winner holds each cause.
    pub inclusion: BTreeMap<CauseKey, f64>,
    /// Number of draws that each set of causes won.
    pub winners: Vec<(BTreeSet<CauseKey>, usize)>,
}

/// Returns the sums of the errors of blocks over the units that are drawn: runs if there are at least
/// `min_runs`, else blocks.
pub fn unit_errors(rows: &Rows, errors: &[f64], min_runs: usize) -> Vec<f64> {
    if rows.runs.len() < min_runs {
        return errors.to_vec();
    }
    let mut sums = vec![0.0; rows.runs.len()];
    rows.run_of_block.iter().zip(errors).for_each(|(run, error)| sums[*run] += error);
    sums
}

impl Draws {
    /// Draws among hypotheses with their errors in every block.
    pub fn new(rows: &Rows, hypotheses: &[&Hypothesis], errors: &[Vec<f64>]) -> Self {
        let summed: Vec<Vec<f64>> = errors
            .iter()
            .zip(hypotheses)
            .map(|(errors, hypothesis)| {
                let price = hypothesis.price.exp();
                unit_errors(rows, errors, MIN_RUNS).into_iter().map(|error| error * price).collect()
            })
            .collect();
        let units = summed.first().map_or(0, Vec::len);
        let mut random = Pcg64::seed_from_u64(SEED);
        let mut wins = vec![0usize; hypotheses.len()];
        for _ in 0..DRAWS {
            checkpoint();
            let weights: Vec<f64> = (0..units).map(|_| Exp1.sample(&mut random)).collect();
            let error =
                |sums: &Vec<f64>| sums.iter().zip(&weights).map(|(e, w)| e * w).sum::<f64>();
            let best = summed.iter().map(error).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((best, _)) = best {
                wins[best] += 1;
            }
        }
        let mut by_causes: BTreeMap<BTreeSet<CauseKey>, usize> = BTreeMap::new();
        for (hypothesis, wins) in hypotheses.iter().zip(wins).filter(|(_, wins)| *wins > 0) {
            *by_causes.entry(hypothesis.causes.clone()).or_default() += wins;
        }
        let mut draws =
            Self { inclusion: BTreeMap::new(), winners: by_causes.into_iter().collect() };
        draws.winners.sort_by_key(|(_, wins)| std::cmp::Reverse(*wins));
        for (causes, wins) in &draws.winners {
            for cause in causes {
                *draws.inclusion.entry(cause.clone()).or_default() += *wins as f64 / DRAWS as f64;
            }
        }
        draws
    }

    /// Returns the causes that win where this one does not, and not where it does.
    pub fn substitutes(&self, cause: &CauseKey) -> Vec<CauseKey> {
        let share = |other: &CauseKey, with: bool| {
            let winners = self.winners.iter().filter(|(causes, _)| causes.contains(cause) == with);
            let (mut all, mut held) = (0, 0);
            for (causes, wins) in winners {
                all += wins;
                held += if causes.contains(other) { *wins } else { 0 };
            }
            if all < DRAWS / 100 { 0.0 } else { held as f64 / all as f64 }
        };
        let others = self.inclusion.keys().filter(|other| *other != cause);
        others
            .filter(|other| share(other, false) > MIN_SUBSTITUTION + share(other, true))
            .cloned()
            .collect()
    }
}
