//! Every hypothesis that was scored, and what each cause takes.
//!
//! A hypothesis is a correction of the log, a base law and a set of causes. All of them stay here with their held-out error, so
//! that questions are answered without another fit: the best hypothesis, the best without a cause, a cause alone.

use super::cause_key::CauseKey;
use super::search::CauseSet;
use std::collections::BTreeSet;

/// A hypothesis with its score.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Index of its bank.
    pub bank: usize,
    /// Its variants in that bank.
    pub set: CauseSet,
    /// Its causes, that of the correction included.
    pub causes: BTreeSet<CauseKey>,
    /// Held-out squared error.
    pub error: f64,
    /// Prior cost.
    pub price: f64,
}

impl Hypothesis {
    /// Returns the held-out error with the prior cost.
    pub fn cost(&self) -> f64 {
        self.error * self.price.exp()
    }
}

/// All hypotheses.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    /// In the order of their cost.
    pub hypotheses: Vec<Hypothesis>,
}

impl Ledger {
    /// Collects hypotheses.
    pub fn new(mut hypotheses: Vec<Hypothesis>) -> Self {
        hypotheses.sort_by(|a, b| {
            let order = a.cost().total_cmp(&b.cost()).then_with(|| a.bank.cmp(&b.bank));
            order.then_with(|| a.set.cmp(&b.set))
        });
        Self { hypotheses }
    }

    /// Returns the best hypothesis.
    pub fn best(&self) -> Option<&Hypothesis> {
        self.hypotheses.first()
    }

    /// Returns the least error of the hypotheses that meet a condition.
    pub fn least_error(&self, is_meant: impl Fn(&Hypothesis) -> bool) -> Option<f64> {
        self.hypotheses.iter().filter(|h| is_meant(h)).map(|h| h.error).min_by(f64::total_cmp)
    }

    /// Returns the hypothesis of least error without a cause.
    pub fn without_cause(&self) -> Option<&Hypothesis> {
        self.with_causes(&BTreeSet::new())
    }

    /// Returns the hypothesis of least error with exactly these causes.
    pub fn with_causes(&self, causes: &BTreeSet<CauseKey>) -> Option<&Hypothesis> {
        let with_same = self.hypotheses.iter().filter(|hypothesis| hypothesis.causes == *causes);
        with_same.min_by(|a, b| a.error.total_cmp(&b.error))
    }
}
