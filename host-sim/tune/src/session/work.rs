//! The steps of a session up to its trial.

use super::candidates::{Laws, gains_of, is_active, with_gains};
use super::{SessionError, TuneOptions, TuneUser, has_active};
use crate::experiment::{Experiment, library, most_informative, survey};
use crate::frequency::{self, LoopGains};
use crate::learn::{Learnt, learn};
use crate::master::{Master, MasterError, TARGET_TIME};
use crate::motion::{Motion, MotionLimits};
use crate::preflight::{FollowingWindow, Found, check_heat};
use crate::proof::{self, Means, Round};
use crate::recording::Recording;
use crate::score::{Scored, score};
use crate::trial_set::{self, TunedSet};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AccessObject;
use friction_results::tune::{TuneCourse, TuneLoop, TuneRound};
use joint_bus::bus::Bus;

/// Most blocks of a trial, for which the study leaves time, and the fewest.
pub(super) const TRIAL_BLOCKS: usize = 12;
const LEAST_BLOCKS: f64 = 9.0;
/// Time between two motions, s: changing the set, arming, and moving to the origin.
pub(super) const PAUSE_S: f64 = 1.5;
/// Expected log likelihood ratio from which a further motion is worth its time.
const WORTHWHILE_NATS: f64 = 3.0;
/// Most motions that are chosen after the survey.
const MAX_CHOSEN: usize = 3;
/// Shares of the designed loop gains that are tried, until one is usable.
const GAIN_SHARES: [f64; 3] = [1.0, 0.5, 0.25];
/// Ratio of the position error to the worst one of the baseline at which a motion is ended.
const ERROR_GUARD: f64 = 2.5;
/// Least guard, rad.
const MIN_GUARD_RAD: f64 = 0.02;
/// Guard of the baseline and least guard of a motion of the study, as a share of the range.
const STUDY_GUARD: f64 = 0.5;
/// Time for which the drive itself permits this error (6066h), ms: the host ends a motion earlier.
const FOLLOWING_MS: u16 = 100;
/// Cost by which a law that can give out energy must be better than a passive one.
const ACTIVE_COST: f64 = 0.05;

/// Time after which the service level of a locked joint is opened again, ns: it ends ten minutes after an unlock, and the
/// renewals of a trial need it.
const UNLOCK_NS: u64 = 300_000_000_000;
/// Reason of a block that is performed with a candidate.
const CANDIDATE: &str = "a candidate";

/// The state of a session.
pub(super) struct Work<'a, B> {
    pub(super) master: Master<B>,
    pub(super) options: &'a TuneOptions,
    pub(super) motion: Motion,
    pub(super) before: Found,
    began_ns: u64,
    pub(super) recordings: Vec<(Recording, String)>,
    pub(super) rounds: Vec<TuneRound>,
    pub(super) learnt: Option<Learnt>,
    pub(super) control: Option<TuneLoop>,
    /// Set with which the joint is studied; `None` for the stored one.
    study_set: Option<TunedSet>,
    /// The best set so far; `None` if none is better than the former one.
    best: Option<Candidate>,
    pub(super) tried: Option<TunedSet>,
    /// What the passive laws lack, as a sentence.
    pub(super) offer: Option<String>,
    pub(super) trial: Vec<Round>,
    /// The last performance with each set of the trial.
    pub(super) courses: [TuneCourse; 3],
    /// Bus time of the last unlock, ns.
    unlocked_ns: u64,
    /// Position error at which a block of the trial is ended, rad.
    guard_rad: f64,
    pub(super) user: &'a mut dyn TuneUser,
}

/// A set that is better than the former one in its first block.
struct Candidate {
    /// Cost beside the former set, below 0.
    cost: f64,
    tuned: TunedSet,
}

/// Returns the time that the shortest session takes on the bus, s: baseline, survey, a candidate, and the fewest blocks.
pub(super) fn least_seconds(motion: &Motion, limits: &MotionLimits) -> f64 {
    let blocks = 3.0 + LEAST_BLOCKS;
    let studied = survey(limits)
        .into_iter()
        .map(|experiment| experiment.motion)
        .chain(frequency::motion(limits));
    let studied: f64 = studied.map(|motion| motion.seconds() + PAUSE_S).sum();
    studied + blocks * (motion.seconds() + PAUSE_S)
}

impl<'a, B: Bus> Work<'a, B> {
    pub(super) fn new(
        master: Master<B>,
        options: &'a TuneOptions,
        motion: Motion,
        before: Found,
        began_ns: u64,
        user: &'a mut dyn TuneUser,
    ) -> Self {
        Self {
            master,
            options,
            motion,
            before,
            began_ns,
            recordings: Vec::new(),
            rounds: Vec::new(),
            learnt: None,
            control: None,
            study_set: None,
            best: None,
            tried: None,
            offer: None,
            trial: Vec::new(),
            courses: Default::default(),
            unlocked_ns: began_ns,
            guard_rad: 0.0,
            user,
        }
    }

    pub(super) fn elapsed_s(&mut self) -> f64 {
        let now_ns = self.master.client().bus().now_ns();
        now_ns.saturating_sub(self.began_ns) as f64 * 1e-9
    }

    pub(super) fn nm_per_a(&self) -> f64 {
        f64::from(self.before.set.friction.compensator.torque_constant_nm_per_a)
    }

    pub(super) fn means(&self) -> Means {
        let (motor, joint) = (&self.before.set.motor, &self.before.set.friction.compensator);
        Means {
            gear_ratio: f64::from(motor.gear_ratio),
            rated_a: f64::from(motor.current_limit_a.min(joint.current_limit_a)),
        }
    }

    pub(super) fn former(&self) -> TunedSet {
        TunedSet { set: self.before.set.clone(), position_gain: self.before.position_gain }
    }

    /// Searches the best new set; `None` if no set was better than the present one in its first block.
    pub(super) fn search(&mut self) -> Result<Option<TunedSet>, SessionError> {
        self.master.configure()?;
        self.begin_trial()?;
        self.user.progress("baseline: the motion of the trial with the present parameters");
        let motion = self.motion.clone();
        self.master.set_error_guard(self.study_guard_rad());
        let baseline = self.perform(&motion, "the present parameters")?;
        let former = score(&baseline, self.nm_per_a());
        self.courses[0] = course(&baseline, self.nm_per_a());
        self.guard_rad = (ERROR_GUARD * former.health.worst_error_rad).max(MIN_GUARD_RAD);
        self.master.set_error_guard(self.guard_rad);
        let designed = match self.design_loop()? {
            Some(gains) => self.usable_gains(gains, &former)?,
            None => None,
        };
        self.study()?;
        self.screen_laws(designed.as_ref(), &former)?;
        Ok(self.best.take().map(|best| best.tuned))
    }

    /// Tries the learnt models with the designed gains. The former gains are a fallback.
    fn screen_laws(
        &mut self,
        designed: Option<&LoopGains>,
        former: &Scored,
    ) -> Result<(), SessionError> {
        let Some(learnt) = &self.learnt else { return Ok(()) };
        let has_active = has_active(self.options, &self.before);
        let Laws { sets, offer } = Laws::of(&self.before.set, learnt, has_active);
        self.offer = offer;
        self.begin_trial()?;
        let gains_of_former = gains_of(&self.former());
        for gains in designed.into_iter().chain([&gains_of_former]) {
            for set in &sets {
                if self.best.is_some() && !self.has_time_for(1.0 + LEAST_BLOCKS) {
                    return Ok(());
                }
                let position_gain = self.before.position_gain;
                let tuned = with_gains(&TunedSet { set: set.clone(), position_gain }, gains);
                self.screen(&tuned, former)?;
            }
            if self.best.is_some() {
                break;
            }
        }
        Ok(())
    }

    /// Position error at which a motion of the study is ended, rad: it may be faster than that of the trial, and its errors
    /// larger.
    fn study_guard_rad(&self) -> f64 {
        (STUDY_GUARD * self.options.limits.range_rad).max(MIN_GUARD_RAD)
    }

    /// Returns the designed gains, or softer ones, with which the joint is better and does not oscillate; `None` without any.
    /// The response is that of small motions in a slide, so that a joint may ring with gains that fit it.
    fn usable_gains(
        &mut self,
        designed: LoopGains,
        former: &Scored,
    ) -> Result<Option<LoopGains>, SessionError> {
        let mut usable = None;
        self.begin_trial()?;
        for share in GAIN_SHARES {
            let gains = designed.softened(share);
            let stiffer = with_gains(&self.former(), &gains);
            self.screen(&stiffer, former)?;
            if self.best.is_some() {
                self.control = self
                    .slides()
                    .and_then(|recording| frequency::assess(recording, self.nm_per_a(), &gains));
                usable = Some(gains);
                break;
            }
        }
        // The better loop also gives the better recordings: it sticks less, and it does not ring.
        self.study_set = self.best.as_ref().map(|best| best.tuned.clone());
        self.end_trial()?;
        Ok(usable)
    }

    /// Returns true if there is time for this number of blocks.
    fn has_time_for(&mut self, blocks: f64) -> bool {
        let block_s = self.motion.seconds() + PAUSE_S;
        self.options.seconds - self.elapsed_s() > blocks * block_s
    }

    /// Returns the recording of the measurement of the mechanics.
    fn slides(&self) -> Option<&Recording> {
        let found =
            self.recordings.iter().rfind(|(recording, _)| recording.name == frequency::NAME);
        found.map(|(recording, _)| recording)
    }

    /// Measures the response of the mechanics and designs the loop gains; `None` if the response is not certain enough.
    fn design_loop(&mut self) -> Result<Option<LoopGains>, SessionError> {
        let limits = self.options.limits;
        let Some(motion) = frequency::motion(&limits) else { return Ok(None) };
        let why = "the response from current to velocity";
        self.round(&Experiment { motion, why })?;
        // Computing may take longer than the deadline of a trial.
        self.end_trial()?;
        let Some(recording) = self.slides() else { return Ok(None) };
        let former = gains_of(&self.former());
        let Some((gains, control)) = frequency::design(recording, self.nm_per_a(), &former) else {
            return Ok(None);
        };
        self.user.progress(&format!(
            "loop: crossover {:.1} Hz with margins of {:.0} degrees and {:.0} dB",
            control.crossover_hz, control.phase_margin_deg, control.gain_margin_db
        ));
        Ok(Some(gains))
    }

    /// Opens the service level of a locked joint again before it ends. The joint must be disarmed.
    fn stay_unlocked(&mut self) -> Result<(), SessionError> {
        let client = self.master.client();
        let now_ns = client.bus().now_ns();
        if now_ns > self.unlocked_ns + UNLOCK_NS {
            self.unlocked_ns = now_ns;
            let policy = Address::new(index::ACCESS, AccessObject::LOCKED_BY_DEFAULT);
            if client.read_number(policy).map_err(MasterError::from)? != 0 {
                client.unlock().map_err(MasterError::from)?;
            }
        }
        Ok(())
    }

    /// Disarms the joint and opens or renews a trial. Every motion is on trial, so that the drive itself restores its settings.
    fn begin_trial(&mut self) -> Result<(), SessionError> {
        self.master.disable_if_enabled()?;
        self.stay_unlocked()?;
        trial_set::open(&mut self.master)?;
        self.master.set_interpolation(TARGET_TIME)?;
        let error_micro_rad = (1e6 * self.guard_rad.max(self.study_guard_rad())) as u32;
        let former = self.before.following;
        let window = match former.error_micro_rad <= error_micro_rad {
            true => former,
            false => FollowingWindow { error_micro_rad, time_ms: FOLLOWING_MS },
        };
        Ok(self.master.set_following_window(window)?)
    }

    /// Disarms the joint and brings the stored set back.
    fn end_trial(&mut self) -> Result<(), SessionError> {
        self.master.disable_if_enabled()?;
        if self.master.has_trial() {
            trial_set::give_back(&mut self.master)?;
        }
        Ok(())
    }

    /// Enables the drive, moves to the origin and performs a motion.
    fn perform(&mut self, motion: &Motion, why: &str) -> Result<Recording, SessionError> {
        if !self.master.has_trial() {
            self.begin_trial()?;
        }
        self.master.enable()?;
        let origin = self.before.position_rad;
        self.master.approach(origin, 0.3 * self.options.limits.speed_rad_s)?;
        let recording = self.master.play(motion, origin)?;
        self.recordings.push((recording.clone(), why.to_owned()));
        Ok(recording)
    }

    /// Performs the motions of the survey and those chosen after it, until the doubt is small or the time is used.
    fn study(&mut self) -> Result<(), SessionError> {
        let limits = self.options.limits;
        self.begin_study()?;
        for experiment in survey(&limits) {
            self.round(&experiment)?;
        }
        self.diagnose()?;
        let mut left = library(&limits);
        for _ in 0..MAX_CHOSEN {
            let Some(next) = self.next_experiment(&mut left) else { break };
            self.begin_study()?;
            self.round(&next)?;
            self.diagnose()?;
        }
        Ok(())
    }

    /// Activates the set with which the joint is studied.
    fn begin_study(&mut self) -> Result<(), SessionError> {
        self.master.disable_if_enabled()?;
        check_heat(self.master.client())?;
        self.begin_trial()?;
        if let Some(tuned) = self.study_set.clone() {
            trial_set::apply(&mut self.master, &tuned)?;
        }
        Ok(())
    }

    fn round(&mut self, experiment: &Experiment) -> Result<(), SessionError> {
        let Experiment { motion, why } = experiment;
        self.user.progress(&format!("{}, {:.0} s: {why}", motion.name, motion.seconds()));
        self.master.set_error_guard(self.guard_rad.max(self.study_guard_rad()));
        let performed = self.perform(motion, why);
        self.master.set_error_guard(self.guard_rad);
        performed?;
        let round = TuneRound {
            motion: motion.name.clone(),
            seconds: motion.seconds(),
            why: (*why).to_owned(),
        };
        self.rounds.push(round);
        Ok(())
    }

    fn diagnose(&mut self) -> Result<(), SessionError> {
        self.end_trial()?;
        // The slides excite the mechanics beyond the frequencies at which a joint is a rigid body, and an oscillating
        // candidate does too.
        let is_quiet = |(recording, why): &&(Recording, String)| {
            recording.name != frequency::NAME && why != CANDIDATE
        };
        let quiet = self.recordings.iter().filter(is_quiet).map(|(recording, _)| recording.clone());
        let recordings: Vec<Recording> = quiet.collect();
        let learnt = learn(&recordings, self.options.seed)?;
        let (cause, probability) = learnt.cause();
        self.user.progress(&format!("diagnosis: {cause}, probability {probability:.2}"));
        self.learnt = Some(learnt);
        Ok(())
    }

    /// Returns the motion that separates the open hypotheses best, if there is time and doubt, and takes it from the list.
    fn next_experiment(&mut self, left: &mut Vec<Experiment>) -> Option<Experiment> {
        let trial_s = (TRIAL_BLOCKS as f64 + 2.0) * (self.motion.seconds() + PAUSE_S);
        let time_s = self.options.seconds - self.elapsed_s() - trial_s;
        let learnt = self.learnt.as_ref()?;
        if learnt.is_settled() {
            return None;
        }
        left.retain(|experiment| experiment.motion.seconds() + PAUSE_S < time_s);
        let [first, second] = learnt.open_hypotheses()?;
        let track = learnt.input.train.last()?;
        let at = track.samples.last()?;
        let at = compensator_core::Sample { position_rad: self.before.position_rad, ..*at };
        let noise = learnt.found.hand_over.held_out_of_driver.rmse;
        let seed = self.options.seed;
        let best = most_informative(left, [&first, &second], &at, noise, WORTHWHILE_NATS, seed);
        best.map(|place| left.remove(place))
    }

    /// Performs a block with a set. It becomes the best one if it does not oscillate, and is better than the former set and
    /// the best one so far.
    fn screen(&mut self, tuned: &TunedSet, former: &Scored) -> Result<(), SessionError> {
        let name = format!(
            "model {}, scale {}, velocity gain {:.2}",
            crate::names::model_name(&tuned.set.friction.model),
            tuned.set.friction.compensator.scale,
            tuned.set.motor.velocity_gain_a_s_per_rad,
        );
        let scored = match self.block(tuned, CANDIDATE) {
            Ok((_, scored)) => scored,
            // A set that makes the joint leave its demand is no candidate.
            Err(SessionError::Master(MasterError::ErrorGuard(error))) => {
                self.user
                    .progress(&format!("candidate: {name}: stopped at an error of {error:.3} rad"));
                return Ok(());
            }
            Err(other) => return Err(other),
        };
        let cost = proof::cost(former, &scored);
        let oscillation = proof::oscillates(former, &scored);
        self.user.progress(&format!(
            "candidate: {name}: error at reversals {:.2}, tracking {:.2} of before{}",
            scored.scores.reversal_error_rad / former.scores.reversal_error_rad,
            scored.scores.tracking_rms_rad / former.scores.tracking_rms_rad,
            oscillation.as_ref().map_or_else(String::new, |why| format!("; rejected: {why}"))
        ));
        let margin = if is_active(&tuned.set) { ACTIVE_COST } else { 0.0 };
        let is_better = cost + margin < self.best.as_ref().map_or(0.0, |best| best.cost);
        if oscillation.is_none() && is_better {
            self.best = Some(Candidate { cost, tuned: tuned.clone() });
        }
        Ok(())
    }

    /// Performs a block with a set.
    pub(super) fn block(
        &mut self,
        tuned: &TunedSet,
        why: &str,
    ) -> Result<(Recording, Scored), SessionError> {
        self.master.disable_if_enabled()?;
        check_heat(self.master.client())?;
        self.stay_unlocked()?;
        trial_set::apply(&mut self.master, tuned)?;
        self.tried = Some(tuned.clone());
        self.scored_block(why)
    }

    pub(super) fn scored_block(&mut self, why: &str) -> Result<(Recording, Scored), SessionError> {
        let motion = self.motion.clone();
        let recording = self.perform(&motion, why)?;
        let scored = score(&recording, self.nm_per_a());
        Ok((recording, scored))
    }
}

pub(super) fn course(recording: &Recording, nm_per_a: f64) -> TuneCourse {
    let rows = &recording.rows;
    let begin_s = rows.first().map_or(0.0, |row| row.time_s);
    TuneCourse {
        time_s: rows.iter().map(|row| row.time_s - begin_s).collect(),
        demand_rad: rows.iter().map(|row| row.demand_rad()).collect(),
        position_rad: rows.iter().map(|row| row.position_rad).collect(),
        current_a: rows.iter().map(|row| row.torque_nm / nm_per_a).collect(),
    }
}
