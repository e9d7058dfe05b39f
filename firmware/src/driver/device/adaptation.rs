//! Adaptation of the friction levels to the joint (2044h): it learns in the background, and the loop takes the gains.
//!
//! A joint on its sensors learns from the reports of the loop. New gains go to the interrupt through a queue of their own,
//! which multiplies a few coefficients and keeps the state of the model. A joint in HIL learns at each SYNC. A set that
//! becomes active starts at its own values again: what was learnt belongs to the set that it was learnt with. While a set is
//! on trial, nothing is learnt, because a trial compares sets.

use super::{Device, JointBase};
use crate::driver::loop_data::NumberedGains;
use crate::level_learner::{LearningSample, OFF, ON, ON_IN_EVERY_MODE};
use crate::node::dictionary::records::AdaptationObject;
use crate::node::sdo::Abort;
use compensator_core::adaptation::{Adaptation, FOLLOWED, Frozen, Gains, MAX_GAINS};
use compensator_core::{refusal, text};
use embedded_storage::nor_flash::NorFlash;

/// Orders of 2044h:5.
const ADOPT: u8 = 1;
const DISCARD: u8 = 2;

impl<F: NorFlash> Device<F> {
    /// Learns from a report of a joint on its sensors.
    pub(super) fn step_adaptation(&mut self) {
        if self.base.settings.is_in_hil() {
            return;
        }
        let is_driven =
            self.base.supervisor.is_compensation_allowed() && !self.motion.is_commissioning();
        let blocked = self.learning_blocked_by().or((!is_driven).then_some(Frozen::NotArmed));
        let report = self.base.report();
        let sample = LearningSample {
            velocity_rad_s: report.velocity_rad_s,
            position_rad: report.position_rad,
            // The friction of the model is part of the residual: the sum is the torque less inertia and load.
            torque_nm: report.residual_torque_nm + report.friction_torque_nm,
            loop_flags: report.loop_flags,
            flags: report.flags,
            campaign_time_h: self.base.settings.campaign_h
                + self.base.now_us as f32 * (1e-6 / 3600.0),
        };
        self.adaptation.step(&sample, blocked);
    }

    /// Returns the reason of settings and trials to learn nothing.
    pub(super) const fn learning_blocked_by(&self) -> Option<Frozen> {
        let is_on = matches!(self.base.settings.drive.adapt, ON | ON_IN_EVERY_MODE);
        if is_on && !self.trial.is_open() { None } else { Some(Frozen::Hold) }
    }

    /// Starts the adaptation at the active set.
    #[inline(never)]
    pub(super) fn restart_adaptation(&mut self) {
        let JointBase { staging, settings, .. } = &self.base;
        self.adaptation.restart(staging.active(), &settings.drive, settings.sample_period_s());
    }

    /// Returns the present values.
    pub(crate) fn adaptation_object(&self) -> AdaptationObject {
        let drive = &self.base.settings.drive;
        let learner = self.adaptation.learner();
        let followed = learner.and_then(Adaptation::followed);
        let place = |quantity| FOLLOWED.iter().position(|candidate| *candidate == quantity);
        AdaptationObject {
            mode: drive.adapt.into(),
            least_gain_permille: drive.adapt_least_permille.into(),
            largest_gain_permille: drive.adapt_most_permille.into(),
            memory_s: drive.adapt_memory_s.into(),
            order: 0,
            frozen: self.adaptation.frozen() as u32,
            learnt_s: learner.map_or(0.0, Adaptation::learnt_s).to_bits(),
            age_s: self.adaptation.age_s().to_bits(),
            constant_torque_nm: learner.map_or(0.0, Adaptation::constant_torque_nm).to_bits(),
            follows: followed
                .and_then(|followed| place(followed.quantity))
                .map_or(0, |place| place as u32 + 1),
            follows_share: followed.map_or(0.0, |followed| followed.share).to_bits(),
        }
    }

    /// Returns the gains for the loop. In a torque mode no loop of this driver bounds the speed of a joint whose friction has
    /// ended since it was learnt, so that the set is the most that applies.
    pub fn learnt(&self) -> NumberedGains {
        let gains = self.adaptation.gains();
        let is_bounded = self.motion.mover(&self.base).is_torque()
            && self.base.settings.drive.adapt != ON_IN_EVERY_MODE;
        // The bounded gains have odd numbers.
        let number = self.adaptation.number().wrapping_mul(2).wrapping_add(is_bounded.into());
        if !is_bounded {
            return NumberedGains { number, gains };
        }
        let bounded = gains.to_array().map(|gain| gain.min(1.0));
        NumberedGains { number, gains: Gains::from_array(&bounded) }
    }

    /// Returns the gains in use as words.
    pub(crate) fn learnt_gains(&self) -> [u32; MAX_GAINS] {
        self.adaptation.gains().to_array().map(f32::to_bits)
    }

    /// Returns the standard deviations of the gains as words; 0 if the adaptation is off.
    pub(crate) fn gain_deviations(&self) -> [u32; MAX_GAINS] {
        let learner = self.adaptation.learner();
        learner.map(Adaptation::deviations).unwrap_or_default().map(f32::to_bits)
    }

    /// Writes a setting or an order.
    pub(crate) fn write_adaptation(
        &mut self,
        at_index: u16,
        place: u8,
        number: u32,
    ) -> Result<(), Abort> {
        if place != AdaptationObject::ORDER {
            let before = self.base.settings.drive;
            self.set_drive_setting(at_index, place, number)?;
            let after = self.base.settings.drive;
            // On and hold differ in what is learnt only, so that what was learnt stays.
            let keeps =
                place == AdaptationObject::MODE && before.adapt != OFF && after.adapt != OFF;
            if !keeps && before != after {
                self.restart_adaptation();
            }
            return Ok(());
        }
        match number as u8 {
            ADOPT => self.adopt_learnt(),
            DISCARD => {
                self.restart_adaptation();
                Ok(())
            }
            order => {
                let why = refusal!("order = {u32}: must be 1 (adopt) or 2 (discard)", order);
                Err(self.base.refuse(Abort::Value, why))
            }
        }
    }

    /// Makes the set with the gains in use the active one; it is saved with 1010h:1.
    fn adopt_learnt(&mut self) -> Result<(), Abort> {
        self.refuse_in_trial()?;
        let Some(learner) = self.adaptation.learner() else {
            let why = text!("nothing is learnt: the adaptation is off (2044h:1)");
            return Err(self.base.refuse(Abort::State, why));
        };
        let learnt = learner.learnt_parameters();
        self.base.staging.discard();
        self.base.staging.staged_mut().friction.model = learnt;
        let adopted = self.commit(self.base.staging.staged_crc());
        if adopted.is_err() {
            self.base.staging.discard();
        }
        adopted
    }
}
