//! The rival: a feed-forward by a table over speed, fitted to the same recordings.

use super::stand::performed;
use super::{ErrorFigures, GradeError, RivalRatio, Stand};
use compensator_core::{LawKind, TermKind};
use firmware::parameter_set::ParameterSet;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, Rows, identify_robustly};
use joint_tuning::Session;
use joint_tuning::motion::{Motion, standard};
use joint_tuning::score::{Scored, score};
use joint_tuning::trial_set::TunedSet;

/// Shares of the table's torque that are tried.
const SCALES: [f32; 3] = [1.0, 0.9, 0.7];
/// Pairs of blocks: rival and saved set.
const PAIRS: usize = 4;

/// Sets of the rival, with the saved set's loop gains.
pub struct Rival {
    candidates: Vec<TunedSet>,
    saved: TunedSet,
    motion: Motion,
}

impl Rival {
    /// Fits the table of a session that saved a set: a static law over speed, Stribeck or linear, whichever errs less on held-out
    /// runs.
    ///
    /// # Errors
    /// Returns an error if no static law can be fitted.
    pub fn new(session: &Session) -> Result<Self, GradeError> {
        let (Some(learnt), Some(set)) = (&session.learnt, &session.tried) else {
            return Err(GradeError::NothingLearnt);
        };
        let saved = TunedSet { set: set.clone(), position_gain: session.position_gain };
        let rows = Rows { tracks: &learnt.input.train, decimate: learnt.input.decimate };
        let fit = |law: LawKind| -> Result<Outcome, GradeError> {
            let spec = Spec::law(law).on(&[TermKind::UnmodelledInertia]);
            let base = spec.parameters()?;
            let (test, loss) = (learnt.input.test_rows(), learnt.input.loss);
            Ok(identify_robustly(loss, &spec, &base, rows, test, &FitOptions::default()))
        };
        let [stribeck, linear] = [fit(LawKind::Stribeck)?, fit(LawKind::Linear)?];
        let best = if linear.test.rmse < stribeck.test.rmse { linear } else { stribeck };
        let table = best.for_driver();
        let candidates = SCALES.iter().filter_map(|scale| {
            let mut set: ParameterSet = set.clone();
            let mut model = table.parameters.convert::<f32>();
            model.terms.retain(|term| *term != TermKind::UnmodelledInertia);
            model.envelope = set.friction.model.envelope;
            set.friction.model = model;
            set.friction.compensator.scale = *scale;
            set.validate().is_ok().then_some(TunedSet { set, position_gain: saved.position_gain })
        });
        Ok(Self { candidates: candidates.collect(), saved, motion: standard(&super::LIMITS) })
    }

    /// Returns the errors of the rival over those of the saved set, in blocks that alternate.
    ///
    /// # Errors
    /// Returns an error if the joint stops, or the driver would refuse every set of the rival.
    pub fn ratio(&self, stand: &Stand, session: &Session) -> Result<RivalRatio, GradeError> {
        let perform = |tuned: &TunedSet| self.perform(stand, session, tuned);
        let mut screened = Vec::new();
        for tuned in &self.candidates {
            let [reversal, rms] = perform(tuned)?.by_truth.both();
            screened.push((reversal * rms, tuned));
        }
        let best = screened.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, best) = best.ok_or(GradeError::NoRival)?;
        let (mut rival, mut saved) = (BlockErrors::default(), BlockErrors::default());
        for pair in 0..PAIRS {
            // Each goes first in every second pair.
            if pair % 2 == 0 {
                rival.add(&perform(best)?);
                saved.add(&perform(&self.saved)?);
            } else {
                saved.add(&perform(&self.saved)?);
                rival.add(&perform(best)?);
            }
        }
        let ratio = |of: fn(&BlockErrors) -> ErrorFigures<f64>| {
            let (rival, saved) = (of(&rival), of(&saved));
            ErrorFigures { reversal: rival.reversal / saved.reversal, rms: rival.rms / saved.rms }
        };
        Ok(RivalRatio {
            by_truth: ratio(|errors| errors.by_truth),
            by_encoder: ratio(|errors| errors.by_encoder),
        })
    }

    /// Performs the motion with a set, and returns its errors.
    fn perform(
        &self,
        stand: &Stand,
        session: &Session,
        tuned: &TunedSet,
    ) -> Result<BlockErrors, GradeError> {
        let options = super::options(0, super::LIMITS);
        let origin_rad = session.before.position_rad;
        let recording = performed(stand.client(), &options, origin_rad, tuned, &self.motion)?;
        let figures = |scored: Scored| {
            let scores = scored.scores;
            ErrorFigures { reversal: scores.reversal_error_rad, rms: scores.tracking_rms_rad }
        };
        let by_truth = figures(stand.truth().scored(&recording));
        Ok(BlockErrors { by_truth, by_encoder: figures(score(&recording, 1.0)) })
    }
}

/// Errors of a set over one block or several, rad.
#[derive(Clone, Copy)]
struct BlockErrors {
    by_truth: ErrorFigures<f64>,
    by_encoder: ErrorFigures<f64>,
}

impl Default for BlockErrors {
    fn default() -> Self {
        let none = ErrorFigures { reversal: 0.0, rms: 0.0 };
        Self { by_truth: none, by_encoder: none }
    }
}

impl BlockErrors {
    fn add(&mut self, block: &Self) {
        let pairs =
            [(&mut self.by_truth, block.by_truth), (&mut self.by_encoder, block.by_encoder)];
        for (sum, errors) in pairs {
            sum.reversal += errors.reversal;
            sum.rms += errors.rms;
        }
    }
}
