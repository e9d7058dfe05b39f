//! Adaptation of the friction levels to the joint (2044h): it learns in the background, and the loop takes the gains.
//!
//! Every [`REPORTS`] reports of the loop make one observation of [`Adaptation`]. New gains go to the interrupt through a
//! queue of their own, which multiplies a few coefficients and keeps the state of the model. A set that becomes active
//! starts at its own values again: what was learnt belongs to the set that it was learnt with. While a set is on trial,
//! nothing is learnt, because a trial compares sets.

use super::{Device, InputSource};
use crate::control::{Covariates, LoopFlags};
use crate::drive_settings::DriveSettings;
use crate::driver::loop_data::{LoopReport, REPORT_PERIOD_S};
use crate::node::dictionary::records::AdaptationObject;
use crate::node::sdo::Abort;
use crate::parameter_set::ParameterSet;
use compensator_core::adaptation::{
    Adaptation, AdaptationParameters, FOLLOWED, Frozen, Gains, MAX_GAINS, Observation,
};
use compensator_core::model::Sample;
use compensator_core::{Flags, Reading, refusal, text};
use embedded_storage::nor_flash::NorFlash;

/// Reports of one observation: together as short as the presliding of a slow joint, and long enough that the steady torque of
/// the law, which is computed for each gain, takes a few percent of the processor.
const REPORTS: u8 = 5;

/// Age above which a covariate counts as missing, s.
const FRESH_S: f32 = 0.5;

/// Modes of 2044h:1.
const OFF: u8 = 0;
const ON: u8 = 1;

/// Orders of 2044h:5.
const ADOPT: u8 = 1;
const DISCARD: u8 = 2;

/// Limits that hold the torque back, so that it is not that of friction.
const LIMITING: LoopFlags = LoopFlags::CURRENT_LIMITED
    .union(LoopFlags::VOLTAGE_LIMITED)
    .union(LoopFlags::BRAKING_LIMITED)
    .union(LoopFlags::CROSS_FADING);
/// The same, of the compensator.
const LIMITING_MODEL: Flags = Flags::TORQUE_LIMITED.union(Flags::CURRENT_LIMITED);
/// Inputs of the model that are too old. A single implausible reading, such as noise below zero, is replaced by the last one.
const STALE: Flags = Flags::VELOCITY_INVALID
    .union(Flags::POSITION_STALE)
    .union(Flags::ACCELERATION_STALE)
    .union(Flags::RADIAL_FORCE_STALE)
    .union(Flags::PRESSURE_STALE)
    .union(Flags::TEMPERATURE_STALE)
    .union(Flags::LOAD_TORQUE_STALE)
    .union(Flags::AUXILIARY_STALE);

/// Sums over the reports of one observation.
#[derive(Clone, Copy, Debug, Default)]
struct ReportSums {
    reports: u8,
    velocity_rad_s: f32,
    torque_nm: f32,
    loop_flags: LoopFlags,
    flags: Flags,
}

/// State of the adaptation of a driver.
#[derive(Debug)]
pub(super) struct JointAdaptation {
    /// `None` if it is off, or if it cannot be built for the set.
    learner: Option<Adaptation>,
    sums: ReportSums,
    /// Mean velocity of the last observation, rad/s.
    last_rad_s: f32,
    covariates: Covariates,
    /// Reason of the driver that nothing is learnt.
    blocked: Frozen,
    /// Time since something was learnt, s.
    age_s: f32,
    /// Number of the gains, which the link compares with what it sent last.
    number: u32,
}

impl Default for JointAdaptation {
    fn default() -> Self {
        Self {
            learner: None,
            sums: ReportSums::default(),
            last_rad_s: 0.0,
            covariates: Covariates::MISSING,
            blocked: Frozen::Off,
            age_s: 0.0,
            number: 0,
        }
    }
}

impl JointAdaptation {
    /// Starts at the tuned set, with these settings.
    fn follow(&mut self, set: &ParameterSet, settings: &DriveSettings) {
        let parameters = AdaptationParameters {
            least_gain: f32::from(settings.adapt_least_permille) * 1e-3,
            largest_gain: f32::from(settings.adapt_most_permille) * 1e-3,
            memory_s: f32::from(settings.adapt_memory_s),
            least_velocity_rad_s: set.watch.least_velocity_rad_s,
            noise_nm: set.watch.band_nm,
            ..AdaptationParameters::default()
        };
        let period_s = f32::from(REPORTS) * REPORT_PERIOD_S;
        self.learner = match settings.adapt {
            OFF => None,
            _ => Adaptation::build(&set.friction.model, &parameters, period_s).ok(),
        };
        self.blocked = Frozen::Off;
        self.sums = ReportSums::default();
        self.age_s = 0.0;
        self.number = self.number.wrapping_add(1);
    }

    /// Returns true if the joint has learnt levels, or may learn them.
    pub(super) const fn is_active(&self) -> bool {
        self.learner.is_some()
    }

    /// Keeps the covariates that the loop receives.
    pub(super) fn take_covariates(&mut self, covariates: &Covariates) {
        self.covariates = *covariates;
    }

    /// Returns the gains in use, and their number.
    pub(super) fn gains(&self) -> (u32, Gains<f32>) {
        (self.number, self.learner.as_ref().map(|learner| *learner.gains()).unwrap_or_default())
    }

    /// Processes a report; `blocked` is a reason of the driver to learn nothing.
    fn step(&mut self, report: &LoopReport, blocked: Option<Frozen>, campaign_time_h: f32) {
        let Some(learner) = &mut self.learner else { return };
        let sums = &mut self.sums;
        sums.reports += 1;
        sums.velocity_rad_s += report.velocity_rad_s;
        // The friction of the model is part of the residual: the sum is the torque less inertia and load.
        sums.torque_nm += report.residual_torque_nm + report.friction_torque_nm;
        sums.loop_flags |= report.loop_flags;
        sums.flags |= report.flags;
        if sums.reports < REPORTS {
            return;
        }
        let sums = core::mem::take(sums);
        let share = 1.0 / f32::from(REPORTS);
        let velocity_rad_s = share * sums.velocity_rad_s;
        let acceleration_rad_s2 =
            (velocity_rad_s - self.last_rad_s) * share * (1.0 / REPORT_PERIOD_S);
        self.last_rad_s = velocity_rad_s;
        let limited = sums.loop_flags.intersects(LIMITING) || sums.flags.intersects(LIMITING_MODEL);
        let blocked = blocked
            .or(limited.then_some(Frozen::Saturated))
            .or(sums.flags.intersects(STALE).then_some(Frozen::Inputs));
        let fresh = |reading: &Reading<f32>| {
            (reading.age_s >= 0.0 && reading.age_s < FRESH_S).then_some(reading.value)
        };
        let covariates = &self.covariates;
        let present = |reading: &Reading<f32>| fresh(reading).unwrap_or(0.0);
        // The compensator reads sizes, too.
        let size = |reading: &Reading<f32>| present(reading).max(0.0);
        let sample = Sample {
            velocity_rad_s,
            acceleration_rad_s2,
            position_rad: if report.position_rad.is_nan() { 0.0 } else { report.position_rad },
            position_weight: if report.position_rad.is_nan() { 0.0 } else { 1.0 },
            radial_force_n: size(&covariates.radial_force_n),
            pressure_diff_mpa: size(&covariates.pressure_diff_mpa),
            temperature_c: present(&covariates.temperature_c),
            load_torque_nm: present(&covariates.load_torque_nm),
            auxiliary: present(&covariates.auxiliary),
            campaign_time_h,
            ..Sample::default()
        };
        let followed = FOLLOWED.map(|quantity| {
            self.covariates.get_mut(quantity).map(|reading| *reading).and_then(|at| fresh(&at))
        });
        let observation =
            Observation { sample, torque_nm: share * sums.torque_nm, followed, blocked };
        let learnt_s = learner.learnt_s();
        if learner.step(&observation) {
            self.number = self.number.wrapping_add(1);
        }
        self.blocked = learner.frozen();
        self.age_s += f32::from(REPORTS) * REPORT_PERIOD_S;
        if learner.learnt_s() > learnt_s {
            self.age_s = 0.0;
        }
    }
}

impl<F: NorFlash> Device<F> {
    /// Learns from a report.
    // Not inlined: every report would make room on the stack for an observation.
    #[inline(never)]
    pub(super) fn step_adaptation(&mut self) {
        let is_learning = self.settings.drive.adapt == ON && !self.trial.is_open();
        let drives = self.settings.source == InputSource::Sensors
            && self.supervisor.is_compensation_allowed()
            && !self.is_commissioning();
        let blocked = if !is_learning {
            Some(Frozen::Hold)
        } else if !drives {
            Some(Frozen::NotArmed)
        } else {
            None
        };
        let campaign_h = self.settings.campaign_h + self.now_us as f32 * (1e-6 / 3600.0);
        self.adaptation.step(self.current_loop.report(), blocked, campaign_h);
    }

    /// Starts the adaptation at the active set.
    pub(super) fn restart_adaptation(&mut self) {
        self.adaptation.follow(self.staging.active(), &self.settings.drive);
    }

    /// Returns the present values.
    pub(in crate::driver) fn adaptation_object(&self) -> AdaptationObject {
        let drive = &self.settings.drive;
        let learner = self.adaptation.learner.as_ref();
        let followed = learner.and_then(Adaptation::followed);
        let place = |quantity| FOLLOWED.iter().position(|own| *own == quantity);
        AdaptationObject {
            mode: drive.adapt.into(),
            least_gain_permille: drive.adapt_least_permille.into(),
            largest_gain_permille: drive.adapt_most_permille.into(),
            memory_s: drive.adapt_memory_s.into(),
            order: 0,
            frozen: self.adaptation.blocked as u32,
            learnt_s: learner.map_or(0.0, Adaptation::learnt_s).to_bits(),
            age_s: self.adaptation.age_s.to_bits(),
            constant_torque_nm: learner.map_or(0.0, Adaptation::constant_torque_nm).to_bits(),
            follows: followed
                .and_then(|followed| place(followed.quantity))
                .map_or(0, |place| place as u32 + 1),
            follows_share: followed.map_or(0.0, |followed| followed.share).to_bits(),
        }
    }

    /// Returns the gains in use, and their number.
    pub(in crate::driver) fn learnt(&self) -> (u32, Gains<f32>) {
        self.adaptation.gains()
    }

    /// Returns the gains in use as words.
    pub(in crate::driver) fn learnt_gains(&self) -> [u32; MAX_GAINS] {
        self.adaptation.gains().1.to_array().map(f32::to_bits)
    }

    /// Returns the standard deviations of the gains as words; 0 if the adaptation is off.
    pub(in crate::driver) fn gain_deviations(&self) -> [u32; MAX_GAINS] {
        let learner = self.adaptation.learner.as_ref();
        learner.map(Adaptation::deviations).unwrap_or_default().map(f32::to_bits)
    }

    /// Writes a setting or an order.
    pub(in crate::driver) fn write_adaptation(
        &mut self,
        at_index: u16,
        place: u8,
        number: u32,
    ) -> Result<(), Abort> {
        if place != AdaptationObject::ORDER {
            let before = self.settings.drive;
            self.set_drive_setting(at_index, place, number).unwrap_or(Err(Abort::ReadOnly))?;
            let after = self.settings.drive;
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
                Err(self.staging.refuse(Abort::Value, why))
            }
        }
    }

    /// Makes the set with the gains in use the active one; it is saved with 1010h:1.
    fn adopt_learnt(&mut self) -> Result<(), Abort> {
        self.refuse_in_trial()?;
        let Some(learner) = &self.adaptation.learner else {
            let why = text!("nothing is learnt: the adaptation is off (2044h:1)");
            return Err(self.staging.refuse(Abort::State, why));
        };
        let learnt = learner.learnt_parameters();
        self.staging.discard();
        self.staging.staged_mut().friction.model = learnt;
        let (_, crc) = self.staging.crcs();
        let adopted = self.commit(crc);
        if adopted.is_err() {
            self.staging.discard();
        }
        adopted
    }
}
