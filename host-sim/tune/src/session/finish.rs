//! The end of a session: save or return, and the report.

use super::candidates::is_active;
use super::work::Work;
use super::{Session, SessionError};
use crate::learn::Learnt;
use crate::master::TRIAL_DEADLINE_MS;
use crate::motion::MotionLimits;
use crate::names::{Difference, differences};
use crate::proof::Verdict;
use crate::recording::{Recording, constant_covariates};
use crate::trial_set::{self, TunedSet};
use firmware::control::PERIOD_S;
use firmware::parameter_set::ParameterSet;
use friction_results::tune::{
    TuneArm, TuneBlock, TuneOutcome, TuneParameter, TuneQuantity, TuneReport, TuneTrial,
};
use joint_bus::bus::Bus;

impl<B: Bus> Work<'_, B> {
    /// Saves the new set or brings the former one back, and returns the result.
    pub(super) fn finish(mut self, ended: Result<Verdict, SessionError>) -> Session {
        let verdict = ended.unwrap_or_else(|error| Verdict::returned(&error.to_string()));
        let mut warnings = self.before.warnings.clone();
        warnings.extend(self.remarks(&verdict));
        let outcome = if verdict.proven.is_some() {
            match self.save(&verdict) {
                Ok(()) => TuneOutcome::Saved,
                Err(error) => self.return_former(&error.to_string(), &mut warnings),
            }
        } else {
            self.return_former(&verdict.why, &mut warnings)
        };
        let _ = self.master.leave();
        self.user.progress(match &outcome {
            TuneOutcome::Saved => "saved: the new parameters are in the flash of the joint",
            TuneOutcome::Returned(_) => "the former parameters are active",
        });
        let report = self.report(outcome, &verdict, warnings);
        let position_gain =
            self.tried.as_ref().map_or(self.before.position_gain, |tuned| tuned.position_gain);
        Session {
            report,
            position_gain,
            recordings: self.recordings,
            learnt: self.learnt,
            before: self.before,
            tried: self.tried.map(|tuned| tuned.set),
        }
    }

    /// Disarms the joint and brings the stored set back, as far as the joint answers.
    fn return_former(&mut self, why: &str, warnings: &mut Vec<String>) -> TuneOutcome {
        if let Err(error) = self.master.disable_if_enabled() {
            warnings.push(format!("disarming: {error}"));
        }
        if self.master.has_trial()
            && let Err(error) = trial_set::give_back(&mut self.master)
        {
            warnings.push(format!(
                "the return of the former set was not confirmed ({error}); the drive returns by itself at most {} s after \
                 the last renewal, and at every reset",
                f64::from(5 * TRIAL_DEADLINE_MS) * 1e-3
            ));
        }
        TuneOutcome::Returned(why.to_owned())
    }

    /// Returns what the user must know of the laws that were tried.
    fn remarks(&self, verdict: &Verdict) -> Vec<String> {
        let tried = self.tried.as_ref().filter(|tuned| is_active(&tuned.set));
        let mut remarks = Vec::new();
        if tried.is_some() && verdict.proven != Some(TuneArm::NewLoop) {
            remarks.push(
                "the law that was tried can supply energy (allow_active): compensation can keep the joint moving"
                    .to_owned(),
            );
        }
        if self.before.set.friction.model.choices.allow_active {
            remarks.push(
                "allow_active is set in the stored parameters and stays set: no law is checked for passivity"
                    .to_owned(),
            );
        }
        remarks.extend(self.offer.clone());
        if verdict.proven == Some(TuneArm::NewLoop) && !verdict.why.is_empty() {
            remarks.push(format!("the friction model is the former one: {}", verdict.why));
        }
        remarks
    }

    /// Writes the record, and keeps and stores it with the new set.
    fn save(&mut self, verdict: &Verdict) -> Result<(), SessionError> {
        let tuned = self.tried.clone().ok_or(SessionError::NothingTried)?;
        self.master.disable_if_enabled()?;
        trial_set::apply(&mut self.master, &tuned)?;
        self.master.set_interpolation(self.before.interpolation)?;
        self.master.set_following_window(self.before.following)?;
        let has_model = verdict.proven == Some(TuneArm::New);
        let cause = self.learnt.as_ref().filter(|_| has_model);
        let record = trial_set::Record {
            time_s: self.options.now_s as u32,
            runs: crate::recording::identity(&self.recordings),
            before_crc: self.before.set.crc(),
            tuned_crc: tuned.set.crc(),
            gain_permille: (1e3 * verdict.tracking_gain()) as i16,
            cause: cause.map_or(0, Learnt::cause_number),
        };
        Ok(trial_set::keep_and_save(&mut self.master, &record)?)
    }

    fn report(
        &mut self,
        outcome: TuneOutcome,
        verdict: &Verdict,
        warnings: Vec<String>,
    ) -> TuneReport {
        let seconds = self.elapsed_s();
        let (cause, probability) =
            self.learnt.as_ref().map_or(("none".to_owned(), 0.0), Learnt::cause);
        let recordings: Vec<Recording> =
            self.recordings.iter().map(|(recording, _)| recording.clone()).collect();
        let mut not_learnt = constant_covariates(&recordings);
        let MotionLimits { range_rad, speed_rad_s, .. } = self.options.limits;
        not_learnt.push(format!(
            "only positions within {range_rad} rad of {:.3} rad and speeds up to {speed_rad_s} rad/s were visited",
            self.before.position_rad
        ));
        if let Some(learnt) = &self.learnt
            && !learnt.is_settled()
        {
            not_learnt.push(format!(
                "the cause is not settled: {cause} has a probability of {probability:.2}"
            ));
        }
        let tried = self.tried.as_ref();
        let blocks = self.trial.iter().flatten().map(|(arm, scored)| TuneBlock {
            arm: *arm,
            values: TuneQuantity::ALL.map(|quantity| scored.scores.of(quantity)),
        });
        let trial = TuneTrial { blocks: blocks.collect() };
        let last = trial.arms().into_iter().find(|arm| *arm != TuneArm::Former);
        let arm = verdict.proven.or(last).unwrap_or(TuneArm::New);
        TuneReport {
            joint: self.options.joint.clone(),
            is_simulated: self.options.is_simulated,
            identity: self.before.facts.clone(),
            outcome,
            cause,
            probability,
            arm,
            gains: verdict.gains.clone(),
            parts: verdict.parts.clone(),
            rounds: self.rounds.clone(),
            not_learnt,
            trial,
            courses: [TuneArm::Former, arm].map(|shown| self.courses[shown as usize].clone()),
            control: self.control.clone(),
            parameters: tried.map_or_else(Vec::new, |tuned| self.changes(tuned)),
            bounds_nm: tried.map_or([0.0; 2], |tuned| bounds_nm(&tuned.set)),
            warnings,
            seconds,
        }
    }

    fn changes(&self, tuned: &TunedSet) -> Vec<TuneParameter> {
        let of_set = differences(&self.before.set, &tuned.set).into_iter();
        let listed = |Difference { name, before, after }| TuneParameter { name, before, after };
        let mut all: Vec<TuneParameter> = of_set.map(listed).collect();
        if tuned.position_gain != self.before.position_gain {
            all.push(TuneParameter {
                name: "drive.position_gain".into(),
                before: self.before.position_gain.to_string(),
                after: tuned.position_gain.to_string(),
            });
        }
        all
    }
}

/// Returns the bounds of the compensation torque and of the bristle torque of a set, Nm, for every input.
fn bounds_nm(set: &ParameterSet) -> [f64; 2] {
    let compensator = &set.friction.compensator;
    let Ok([state, friction]) = set.friction.model.largest_torques_nm(PERIOD_S) else {
        return [f64::from(compensator.torque_limit_nm), f64::NAN];
    };
    [f64::from(compensator.torque_limit_nm.min(compensator.scale * friction)), f64::from(state)]
}
