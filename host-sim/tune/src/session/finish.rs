//! The end of a session: save or return, and the report.

use super::work::{Ended, Work};
use super::{Session, TuneUser};
use crate::learn::Learnt;
use crate::master::TRIAL_DEADLINE_MS;
use crate::motion::MotionLimits;
use crate::proof::Verdict;
use crate::recording::{Recording, constant_covariates};
use crate::score::Scored;
use crate::trial_set::{self, TunedSet};
use firmware::control::PERIOD_S;
use firmware::parameter_set::ParameterSet;
use friction_results::tune::{TuneBlock, TuneOutcome, TuneParameter, TuneReport, TuneTrial};
use joint_bus::bus::Bus;

impl<B: Bus> Work<'_, B> {
    /// Saves the new set or brings the former one back, and returns the result.
    pub(super) fn finish(
        mut self,
        ended: Result<Verdict, Ended>,
        user: &mut dyn TuneUser,
    ) -> Session {
        let verdict = ended.unwrap_or_else(|error| Verdict::returned(&error.to_string()));
        let mut warnings = self.before.warnings.clone();
        let outcome = if verdict.is_proven {
            match self.save(&verdict) {
                Ok(()) => TuneOutcome::Saved,
                Err(error) => self.return_former(&error.to_string(), &mut warnings),
            }
        } else {
            self.return_former(&verdict.why, &mut warnings)
        };
        let _ = self.master.leave();
        user.progress(match &outcome {
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
        if let Err(error) = self.disable() {
            warnings.push(format!("disarming: {error}"));
        }
        // A set that was kept and could not be stored is in RAM.
        let former = self.former();
        let returned = match (self.is_on_trial, self.is_kept) {
            (true, _) => trial_set::give_back(&mut self.master),
            (false, true) => trial_set::write(&mut self.master, &former),
            (false, false) => Ok(()),
        };
        if let Err(error) = returned {
            warnings.push(format!(
                "the return of the former set was not confirmed ({error}); the drive returns by itself {} s after the last \
                 renewal, and at every reset",
                f64::from(TRIAL_DEADLINE_MS) * 1e-3
            ));
        }
        let _ = self.master.restore_interpolation(self.before.interpolation);
        TuneOutcome::Returned(why.to_owned())
    }

    /// Keeps the new set, writes the record, and stores both.
    fn save(&mut self, verdict: &Verdict) -> Result<(), Ended> {
        let Some(tuned) = self.tried.clone() else {
            return Err(Ended::Why("no set was tried".to_owned()));
        };
        self.disable()?;
        trial_set::apply(&mut self.master, &tuned)?;
        self.master.restore_interpolation(self.before.interpolation)?;
        trial_set::keep(&mut self.master)?;
        (self.is_on_trial, self.is_kept) = (false, true);
        let record = trial_set::Record {
            time_s: self.options.now_s as u32,
            runs: crate::recording::identity(&self.recordings),
            before_crc: self.before.set.crc(),
            tuned_crc: tuned.set.crc(),
            gain_permille: (1e3 * verdict.tracking_gain()) as i16,
            cause: self.learnt.as_ref().map_or(0, Learnt::cause_number),
        };
        trial_set::save(&mut self.master, &record)?;
        Ok(())
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
            self.recordings.iter().map(|(own, _)| own.clone()).collect();
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
        let block = |(is_new, scored): &(bool, Scored)| TuneBlock {
            is_new: *is_new,
            values: scored.scores,
        };
        TuneReport {
            joint: self.options.joint.clone(),
            is_simulated: self.options.is_simulated,
            identity: self.before.facts.clone(),
            outcome,
            cause,
            probability,
            gains: verdict.gains.clone(),
            rounds: self.rounds.clone(),
            not_learnt,
            trial: TuneTrial { blocks: self.trial.iter().map(block).collect() },
            courses: self.courses.clone(),
            control: self.control.clone(),
            parameters: tried.map_or_else(Vec::new, |tuned| self.changes(tuned)),
            bounds_nm: tried.map_or([0.0; 2], |tuned| bounds_nm(&tuned.set)),
            warnings,
            seconds,
        }
    }

    fn changes(&self, tuned: &TunedSet) -> Vec<TuneParameter> {
        let listed = crate::names::differences(&self.before.set, &tuned.set);
        let mut all: Vec<TuneParameter> = listed
            .into_iter()
            .map(|(name, before, after)| TuneParameter { name, before, after })
            .collect();
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
