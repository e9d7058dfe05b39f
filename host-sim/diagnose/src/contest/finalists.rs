//! Hypotheses of a contest that are to be fitted with the driver's law.

use super::cause::channel::channel_gain;
use super::cause_key::CauseKey;
use super::correction::Correction;
use super::detail::Detail;
use super::draws::{DRAWS, Draws};
use super::entry::{Entry, Origin};
use super::law::LawStart;
use super::ledger::{Hypothesis, Ledger};
use super::table::{Table, jackknife};
use compensator_core::ParameterId;
use friction_fit::ChannelGain;
use std::borrow::Cow;

/// Most finalists.
const MOST_FINALISTS: usize = 3;

/// Share of the draws that a hypothesis after the best one must win to be a finalist.
const MIN_WINS: f64 = 0.1;

/// Returns the hypotheses to be fitted with the driver's law: the best one first, then those that win draws.
pub(crate) fn finalists<'l>(ledger: &'l Ledger, draws: &Draws) -> Vec<&'l Hypothesis> {
    let wins = |hypothesis: &Hypothesis| {
        let won = draws.winners.iter().find(|(causes, _)| *causes == hypothesis.causes);
        won.map_or(0.0, |(_, wins)| *wins as f64 / DRAWS as f64)
    };
    let mut found: Vec<&Hypothesis> = Vec::new();
    for (at, hypothesis) in ledger.hypotheses.iter().enumerate() {
        let is_finalist = at == 0 || wins(hypothesis) >= MIN_WINS;
        if is_finalist && found.iter().all(|finalist| finalist.causes != hypothesis.causes) {
            found.push(hypothesis);
        }
        if found.len() == MOST_FINALISTS {
            break;
        }
    }
    found
}

/// A hypothesis to be fitted with the driver's law.
#[derive(Clone, Debug, Default)]
pub struct Finalist {
    /// Its correction of the log.
    pub correction: Correction,
    /// Where a fit of its law begins.
    pub law: LawStart,
    /// Its causes, in the order of the bank. The delay of a correction is not among them.
    pub causes: Vec<FinalistCause>,
    /// Channels of which the torque holds a share.
    pub shares: Vec<ChannelGain>,
    /// Held-out RMS error, unweighted.
    pub rmse: f64,
    /// Held-out RMS error without its causes, with its law and corrections, unweighted.
    pub law_rmse: f64,
    /// Squared error as a share of the least one in the log as it is.
    pub share_left: f64,
}

impl Finalist {
    /// Returns the share of the squared error that its causes take, by the linear fits.
    pub fn promised(&self) -> f64 {
        share_taken(self.law_rmse, self.rmse)
    }

    /// Returns the hypothesis without a cause, for a log on which none can be scored.
    pub fn without_cause() -> Self {
        let law = LawStart { name: "linear", ..LawStart::default() };
        Self { law, share_left: 1.0, ..Self::default() }
    }
}

/// Returns the share of a squared error that is taken, from RMS errors.
pub(crate) fn share_taken(before: f64, after: f64) -> f64 {
    1.0 - (after / before.max(f64::MIN_POSITIVE)).powi(2)
}

/// A cause of a finalist.
#[derive(Clone, Debug)]
pub struct FinalistCause {
    /// The cause and its column.
    pub key: CauseKey,
    /// What distinguishes its variant.
    pub detail: Detail,
    /// Coefficients of its columns.
    pub sizes: Vec<f64>,
    /// RMS of the torque that it contributes, Nm or N.
    pub torque_rms: f64,
    /// Standard error of `torque_rms` over the folds (a delete-one jackknife).
    pub torque_rms_error: f64,
}

impl Table<'_> {
    pub(super) fn finalist(&self, hypothesis: &Hypothesis) -> Finalist {
        let entry = &self.entries[hypothesis.bank];
        let columns = entry.columns(self.rows, &hypothesis.set);
        let sizes = entry.fit(&hypothesis.set);
        let folds = entry.fits_without_fold(&hypothesis.set);
        let mut alone = hypothesis.clone();
        alone.set.retain(|at| !entry.variants[*at as usize].is_cause());
        let (mut causes, mut shares) = (Vec::new(), Vec::new());
        for (variant, place) in entry.placed(&hypothesis.set) {
            if variant.is_cause() {
                let rms = |sizes: &[f64]| self.torque_rms(&columns[place.clone()], sizes);
                let drawn: Vec<f64> = folds.iter().map(|fold| rms(&fold[place.clone()])).collect();
                causes.push(FinalistCause {
                    key: variant.key.clone(),
                    detail: variant.detail.clone(),
                    torque_rms: rms(&sizes[place.clone()]),
                    torque_rms_error: jackknife(&drawn),
                    sizes: sizes[place].to_vec(),
                });
            } else {
                let regressors = variant.regressors().iter().zip(&sizes[place]);
                shares.extend(regressors.filter_map(|(of, size)| channel_gain(of, *size)));
            }
        }
        Finalist {
            correction: entry.correction,
            law: self.law_start(entry, &sizes),
            causes,
            shares,
            rmse: self.rmse(hypothesis),
            law_rmse: self.rmse(&alone),
            share_left: self.share_left(hypothesis),
        }
    }

    /// Returns the RMS of the torque of columns with these coefficients on the judged rows.
    fn torque_rms(&self, columns: &[Cow<'_, [f64]>], sizes: &[f64]) -> f64 {
        let judged = &self.rows.judged;
        let torque = |row: usize| -> f64 {
            columns.iter().zip(sizes).map(|(column, size)| column[row] * size).sum()
        };
        let squares: f64 = judged.iter().map(|row| torque(*row).powi(2)).sum();
        (squares / judged.len().max(1) as f64).sqrt()
    }

    /// Returns the error of a hypothesis as a share of the least one in the log as it is.
    fn share_left(&self, hypothesis: &Hypothesis) -> f64 {
        let is_plain = |other: &Hypothesis| self.entries[other.bank].correction == Correction::None;
        let without = self.ledger.least_error(is_plain);
        without.map_or(1.0, |without| (hypothesis.error / without).min(1.0))
    }

    /// Returns the parameters of an entry's law: those of the driver's law, or from the coefficients of its columns.
    fn law_start(&self, entry: &Entry, sizes: &[f64]) -> LawStart {
        let law = match &entry.base.origin {
            Origin::Kernel(parameters) => {
                let coulomb = parameters.get(ParameterId::CoulombTorque);
                return LawStart {
                    name: "lugre",
                    coulomb,
                    static_excess: parameters.get(ParameterId::StaticTorque) - coulomb,
                    stribeck_velocity: parameters.get(ParameterId::StribeckVelocity),
                    travel: coulomb / parameters.get(ParameterId::BristleStiffness),
                    viscous: parameters.get(ParameterId::ViscousFriction),
                };
            }
            Origin::Shapes(law) => law,
        };
        LawStart::of_shapes(self.rows, self.shapes, law, sizes)
    }
}
