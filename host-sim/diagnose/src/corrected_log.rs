//! The log as the search sees it: with the corrections that the log itself shows, and the base model fitted to it.
//!
//! The corrections are made in this order, and the base model is fitted again after each:
//!
//! 1. A late channel is compensated ([`late_channel`]), unless the options keep it as logged.
//! 2. Rows are weighted by the uncertainty of their motion ([`uncertain_motion`]).
//! 3. Rows with a wrong value are weighted by Huber's loss ([`friction_fit::robust`]), if the options ask for it.
//! 4. Runs are shifted to one phase, if the zero of the position differs from run to run ([`unknown_zero`]).
//! 5. Rows at rest are removed, if the base model does not describe them ([`super::baseline`]).
//!
//! Each step takes a fitted log and returns a fitted log; no later stage changes it.

use super::baseline::{self, Baseline};
use super::late_channel::{self, LateChannelKind};
use super::model::FittedModel;
use super::train_test::TrainTest;
use super::{DiagnosisOptions, uncertain_motion, unknown_zero};
use friction_fit::robust::Weighting;
use friction_fit::spec::SpecError;
use friction_fit::{Loss, Track};
use joint_log::JointKind;
use joint_log::log_check::LogFinding;

/// A log with its corrections and its base model.
#[derive(Clone, Debug)]
pub struct CorrectedLog {
    /// All rows. Proposals are evaluated on them.
    pub whole: TrainTest,
    /// The thinned rows. Causes are searched for on them.
    pub searched: TrainTest,
    /// The base model, fitted to `searched`.
    pub base: FittedModel,
    /// What is wrong with the log.
    pub findings: Vec<LogFinding>,
}

impl CorrectedLog {
    /// Makes all corrections.
    ///
    /// # Errors
    /// Returns an error if the base model already has as many terms as the core accepts.
    pub fn new(
        log: TrainTest,
        joint: JointKind,
        options: &DiagnosisOptions,
        progress: &dyn Fn(&str),
    ) -> Result<Self, SpecError> {
        let mut findings = options.log_findings.clone();
        progress("fitting the baseline");
        let fitted = FittedLog::new(log, options)?;
        let fitted = fitted.on_time(joint, options, &mut findings, progress)?;
        let fitted = fitted.weighed(options, progress)?.robust(options, progress)?;
        let FittedLog { mut whole, mut searched, base: Baseline { model: base, at_rest } } = fitted;
        if let Some(aligned) = unknown_zero::aligned(&whole, &base) {
            searched = aligned.thinned().into_owned();
            whole = aligned;
        }
        if let Some(at_rest) = &at_rest {
            (whole, searched) = (whole.without(at_rest), searched.without(at_rest));
        }
        Ok(Self { whole, searched, base, findings })
    }
}

/// A log with the base model fitted to its thinned rows.
struct FittedLog {
    whole: TrainTest,
    searched: TrainTest,
    base: Baseline,
}

impl FittedLog {
    fn new(whole: TrainTest, options: &DiagnosisOptions) -> Result<Self, SpecError> {
        let searched = whole.thinned().into_owned();
        let base = base(&searched, options)?;
        Ok(Self { whole, searched, base })
    }

    /// Compensates late channels until the log shows no other.
    fn on_time(
        self,
        joint: JointKind,
        options: &DiagnosisOptions,
        findings: &mut Vec<LogFinding>,
        progress: &dyn Fn(&str),
    ) -> Result<Self, SpecError> {
        let mut sought: Vec<LateChannelKind> = LateChannelKind::ALL.to_vec();
        sought.retain(|late| !options.as_logged.contains(&late.kind()));
        let mut fitted = self;
        while let Some(found) = late_channel::found(&fitted.searched, &fitted.base.model, &sought)?
        {
            progress("fitting the baseline with a delayed channel");
            sought.retain(|late| *late != found.late);
            let logged = fitted;
            let mut late = found;
            fitted = Self::new(late.lag_compensated(logged.whole.clone()), options)?;
            // Beside a law that lacked what the lateness hid, another shape and time may have stood in for it.
            if fitted.base.model.spec.law != logged.base.model.spec.law
                && let Some(nearer) =
                    late_channel::found(&logged.searched, &fitted.base.model, &[found.late])?
            {
                late = nearer;
                fitted = Self::new(late.lag_compensated(logged.whole), options)?;
            }
            findings.retain(|finding| finding.kind != late.late.kind());
            findings.push(late.finding(joint));
        }
        Ok(fitted)
    }

    /// Weights the rows by the uncertainty of their motion, if it is not exact.
    fn weighed(
        self,
        options: &DiagnosisOptions,
        progress: &dyn Fn(&str),
    ) -> Result<Self, SpecError> {
        let Some(weighed) = uncertain_motion::weighed(&self.whole, &self.base.model) else {
            return Ok(self);
        };
        progress("fitting the baseline to rows weighted by the uncertainty of their motion");
        Self::new(weighed.with_floor(), options)
    }

    /// Weights the rows by Huber's loss beside the base model, if the options ask for it.
    fn robust(
        self,
        options: &DiagnosisOptions,
        progress: &dyn Fn(&str),
    ) -> Result<Self, SpecError> {
        if options.loss == Loss::Squares {
            return Ok(self);
        }
        progress("fitting the baseline with a robust loss");
        let logged = self.whole.clone();
        let mut fitted = self;
        for _ in 0..ROBUST_ROUNDS {
            let model = &fitted.base.model;
            let weigh = Weighting::of(&logged.train_tracks, &model.parameters, model.resolution);
            let mut whole = logged.clone();
            whole.train_tracks = weigh.applied(&logged.train_tracks);
            whole.test_tracks = weigh.applied(&logged.test_tracks);
            whole.notes.push(format!(
                "the loss is huber: {} of {} rows differ from the rows beside them and count less",
                weigh.reduced,
                logged.train_tracks.iter().map(Track::len).sum::<usize>()
            ));
            fitted = Self::new(whole, options)?;
        }
        Ok(fitted)
    }
}

/// Number of fits with Huber's weights. The causes are fitted with the last weights, which then hardly change.
const ROBUST_ROUNDS: usize = 2;

fn base(log: &TrainTest, options: &DiagnosisOptions) -> Result<Baseline, SpecError> {
    match (&options.given, &options.model) {
        (Some((spec, parameters)), _) => baseline::asked_for(log, spec, Some(parameters)),
        (None, Some(spec)) => baseline::asked_for(log, &spec.clone().on(&log.rigid_body), None),
        (None, None) => baseline::choose(log),
    }
}
