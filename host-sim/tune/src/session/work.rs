//! The steps of a session up to its verdict.

use super::candidates::{candidates, gains_of, with_gains};
use super::{TuneOptions, TuneUser};
use crate::experiment::{Experiment, library, most_informative, survey};
use crate::frequency::{self, LoopGains};
use crate::learn::{Learnt, learn};
use crate::master::{Master, MasterError};
use crate::motion::{Motion, MotionLimits};
use crate::preflight::{Found, Refusal, check_heat};
use crate::proof::{self, Means, Verdict};
use crate::recording::Recording;
use crate::score::{Scored, score};
use crate::trial_set::{self, TrialError, TunedSet};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AccessObject;
use friction_results::tune::{TuneCourse, TuneLoop, TuneRound};
use joint_bus::bus::Bus;

/// Pairs of blocks of a trial, and the fewest if the minutes are short.
const PAIRS: usize = 6;
const MIN_PAIRS: usize = 3;
/// Time between two motions, s: changing the set, arming, and moving to the origin.
const PAUSE_S: f64 = 1.5;
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
/// Least guard of a motion of the study, as a share of the range.
const STUDY_GUARD: f64 = 0.5;

/// Time after which the service level of a locked joint is opened again, ns: it ends ten minutes after an unlock, and the
/// renewals of a trial need it.
const UNLOCK_NS: u64 = 300_000_000_000;
/// Reason of a block that is performed with a candidate.
const CANDIDATE: &str = "a candidate";

/// Reason why a session ends before its proof.
#[derive(Debug, thiserror::Error)]
pub(super) enum Ended {
    #[error(transparent)]
    Master(#[from] MasterError),
    #[error(transparent)]
    Trial(#[from] TrialError),
    #[error(transparent)]
    Refused(#[from] Refusal),
    #[error("{0}")]
    Why(String),
}

/// The state of a session.
pub(super) struct Work<'a, B> {
    pub(super) master: Master<B>,
    pub(super) options: &'a TuneOptions,
    motion: Motion,
    pub(super) before: Found,
    began_ns: u64,
    pub(super) recordings: Vec<(Recording, String)>,
    pub(super) rounds: Vec<TuneRound>,
    pub(super) learnt: Option<Learnt>,
    pub(super) control: Option<TuneLoop>,
    /// Set with which the joint is studied; `None` for the stored one.
    study_set: Option<TunedSet>,
    pub(super) tried: Option<TunedSet>,
    pub(super) trial: Vec<(bool, Scored)>,
    pub(super) courses: [TuneCourse; 2],
    /// Bus time of the last unlock, ns.
    unlocked_ns: u64,
    /// Position error at which a block of the trial is ended, rad.
    guard_rad: f64,
    pub(super) is_enabled: bool,
    pub(super) is_on_trial: bool,
    /// The new set was kept: it is active in RAM, without a trial.
    pub(super) is_kept: bool,
}

/// Returns the time that the shortest session takes on the bus, s: baseline, survey, a candidate, and the fewest blocks.
pub(super) fn least_seconds(motion: &Motion, limits: &MotionLimits) -> f64 {
    let blocks = 3.0 + 2.0 * MIN_PAIRS as f64;
    let studied = survey(limits).into_iter().map(|own| own.motion).chain(frequency::motion(limits));
    let studied: f64 = studied.map(|own| own.seconds() + PAUSE_S).sum();
    studied + blocks * (motion.seconds() + PAUSE_S)
}

impl<'a, B: Bus> Work<'a, B> {
    pub(super) fn new(
        master: Master<B>,
        options: &'a TuneOptions,
        motion: Motion,
        before: Found,
        began_ns: u64,
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
            tried: None,
            trial: Vec::new(),
            courses: Default::default(),
            unlocked_ns: began_ns,
            guard_rad: f64::INFINITY,
            is_enabled: false,
            is_on_trial: false,
            is_kept: false,
        }
    }

    pub(super) fn elapsed_s(&mut self) -> f64 {
        let now_ns = self.master.client().bus().now_ns();
        now_ns.saturating_sub(self.began_ns) as f64 * 1e-9
    }

    pub(super) fn nm_per_a(&self) -> f64 {
        f64::from(self.before.set.friction.compensator.torque_constant_nm_per_a)
    }

    fn means(&self) -> Means {
        let (motor, joint) = (&self.before.set.motor, &self.before.set.friction.compensator);
        Means {
            gear_ratio: f64::from(motor.gear_ratio),
            rated_a: f64::from(motor.current_limit_a.min(joint.current_limit_a)),
        }
    }

    pub(super) fn former(&self) -> TunedSet {
        TunedSet { set: self.before.set.clone(), position_gain: self.before.position_gain }
    }

    /// Runs the session up to its verdict.
    pub(super) fn run(&mut self, user: &mut dyn TuneUser) -> Result<Verdict, Ended> {
        self.master.configure()?;
        user.progress("baseline: the motion of the trial with the present parameters");
        let motion = self.motion.clone();
        let baseline = self.perform(&motion, "the present parameters")?;
        let former = score(&baseline, self.nm_per_a());
        self.courses[0] = course(&baseline, self.nm_per_a());
        self.guard_rad = (ERROR_GUARD * former.health.worst_error_rad).max(MIN_GUARD_RAD);
        self.master.set_error_guard(self.guard_rad);
        let mut best = None;
        let designed = match self.design_loop(user)? {
            Some(gains) => self.usable_gains(gains, &former, &mut best, user)?,
            None => None,
        };
        self.study(user)?;
        let Some(learnt) = &self.learnt else {
            return Ok(Verdict::returned("nothing was learnt"));
        };
        let gains_of_former = gains_of(&self.former());
        let stiffer = designed.as_ref().map(|gains| candidates(&self.former(), learnt, gains));
        let others = candidates(&self.former(), learnt, &gains_of_former);
        self.begin_trial()?;
        for tuned in stiffer.into_iter().flatten() {
            if best.is_some() && !self.has_time_for(1.0 + 2.0 * MIN_PAIRS as f64) {
                break;
            }
            self.screen(&tuned, &former, &mut best, user)?;
        }
        // The former gains are a fallback.
        for tuned in others {
            if best.is_some() || !self.has_time_for(1.0 + 2.0 * MIN_PAIRS as f64) {
                break;
            }
            self.screen(&tuned, &former, &mut best, user)?;
        }
        match best {
            Some((_, chosen)) => self.compare(chosen, user),
            None => {
                let why = "no new set was better than the present one in its first block";
                Ok(Verdict::returned(why))
            }
        }
    }

    /// Returns the designed gains, or softer ones, with which the joint is better and does not oscillate; `None` without any.
    /// The response is that of small motions in a slide, so that a joint may ring with gains that fit it.
    fn usable_gains(
        &mut self,
        designed: LoopGains,
        former: &Scored,
        best: &mut Option<(f64, TunedSet)>,
        user: &mut dyn TuneUser,
    ) -> Result<Option<LoopGains>, Ended> {
        let mut usable = None;
        self.begin_trial()?;
        for share in GAIN_SHARES {
            let gains = designed.softened(share);
            let stiffer = with_gains(&self.former(), &gains);
            self.screen(&stiffer, former, best, user)?;
            if best.is_some() {
                self.control =
                    self.slides().and_then(|own| frequency::assess(own, self.nm_per_a(), &gains));
                usable = Some(gains);
                break;
            }
        }
        // The better loop also gives the better recordings: it sticks less, and it does not ring.
        self.study_set = best.as_ref().map(|(_, tuned)| tuned.clone());
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
        let found = self.recordings.iter().rfind(|(own, _)| own.name == frequency::NAME);
        found.map(|(recording, _)| recording)
    }

    /// Measures the response of the mechanics and designs the loop gains; `None` if the response is not certain enough.
    fn design_loop(&mut self, user: &mut dyn TuneUser) -> Result<Option<LoopGains>, Ended> {
        let limits = self.options.limits;
        let Some(motion) = frequency::motion(&limits) else { return Ok(None) };
        let why = "the response from current to velocity";
        self.round(&Experiment { motion, why }, user)?;
        let Some(recording) = self.slides() else { return Ok(None) };
        let former = gains_of(&self.former());
        let Some((gains, control)) = frequency::design(recording, self.nm_per_a(), &former) else {
            return Ok(None);
        };
        user.progress(&format!(
            "loop: crossover {:.1} Hz with margins of {:.0} degrees and {:.0} dB",
            control.crossover_hz, control.phase_margin_deg, control.gain_margin_db
        ));
        Ok(Some(gains))
    }

    /// Opens the service level of a locked joint again before it ends. The joint must be disarmed.
    fn stay_unlocked(&mut self) -> Result<(), Ended> {
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

    /// Disarms the joint and opens a trial.
    fn begin_trial(&mut self) -> Result<(), Ended> {
        self.disable()?;
        self.master.restore_interpolation(self.before.interpolation)?;
        trial_set::open(&mut self.master)?;
        self.is_on_trial = true;
        Ok(self.master.set_interpolation()?)
    }

    /// Disarms the joint and brings the stored set back.
    fn end_trial(&mut self) -> Result<(), Ended> {
        self.disable()?;
        if self.is_on_trial {
            trial_set::give_back(&mut self.master)?;
            self.is_on_trial = false;
            self.master.set_interpolation()?;
        }
        Ok(())
    }

    /// Enables the drive if it is not, moves to the origin and performs a motion.
    fn perform(&mut self, motion: &Motion, why: &str) -> Result<Recording, Ended> {
        if !self.is_enabled {
            self.master.enable()?;
            self.is_enabled = true;
        }
        let origin = self.before.position_rad;
        self.master.approach(origin, 0.3 * self.options.limits.speed_rad_s)?;
        let recording = self.master.play(motion, origin)?;
        self.recordings.push((recording.clone(), why.to_owned()));
        Ok(recording)
    }

    pub(super) fn disable(&mut self) -> Result<(), Ended> {
        if self.is_enabled {
            self.is_enabled = false;
            self.master.disable()?;
        }
        Ok(())
    }

    /// Performs the motions of the survey and those chosen after it, until the doubt is small or the time is used.
    fn study(&mut self, user: &mut dyn TuneUser) -> Result<(), Ended> {
        let limits = self.options.limits;
        self.begin_study()?;
        for experiment in survey(&limits) {
            self.round(&experiment, user)?;
        }
        self.diagnose(user)?;
        let mut left = library(&limits);
        for _ in 0..MAX_CHOSEN {
            let Some(next) = self.next_experiment(&mut left) else { break };
            self.begin_study()?;
            self.round(&next, user)?;
            self.diagnose(user)?;
        }
        Ok(())
    }

    /// Activates the set with which the joint is studied.
    fn begin_study(&mut self) -> Result<(), Ended> {
        self.disable()?;
        check_heat(self.master.client())?;
        if let Some(tuned) = self.study_set.clone() {
            self.stay_unlocked()?;
            self.begin_trial()?;
            trial_set::apply(&mut self.master, &tuned)?;
        }
        Ok(())
    }

    fn round(&mut self, experiment: &Experiment, user: &mut dyn TuneUser) -> Result<(), Ended> {
        let Experiment { motion, why } = experiment;
        user.progress(&format!("{}, {:.0} s: {why}", motion.name, motion.seconds()));
        // A motion of the study may be faster than that of the trial, and its errors larger.
        let guard_rad = self.guard_rad.max(STUDY_GUARD * self.options.limits.range_rad);
        self.master.set_error_guard(guard_rad);
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

    fn diagnose(&mut self, user: &mut dyn TuneUser) -> Result<(), Ended> {
        // Computing takes longer than the deadline of a trial.
        self.end_trial()?;
        // The slides excite the mechanics beyond the frequencies at which a joint is a rigid body, and an oscillating
        // candidate does too.
        let is_quiet =
            |(own, why): &&(Recording, String)| own.name != frequency::NAME && why != CANDIDATE;
        let quiet = self.recordings.iter().filter(is_quiet).map(|(own, _)| own.clone());
        let recordings: Vec<Recording> = quiet.collect();
        let learnt =
            learn(&recordings, self.options.seed).map_err(|error| Ended::Why(error.to_string()))?;
        let (cause, probability) = learnt.cause();
        user.progress(&format!("diagnosis: {cause}, probability {probability:.2}"));
        self.learnt = Some(learnt);
        Ok(())
    }

    /// Returns the motion that separates the open hypotheses best, if there is time and doubt, and takes it from the list.
    fn next_experiment(&mut self, left: &mut Vec<Experiment>) -> Option<Experiment> {
        let trial_s = 2.0 * (PAIRS as f64 + 1.0) * (self.motion.seconds() + PAUSE_S);
        let time_s = self.options.seconds - self.elapsed_s() - trial_s;
        let learnt = self.learnt.as_ref()?;
        if learnt.is_settled() {
            return None;
        }
        left.retain(|own| own.motion.seconds() + PAUSE_S < time_s);
        let [first, second] = learnt.open_hypotheses()?;
        let track = learnt.input.train.last()?;
        let at = track.samples.last()?;
        let at = compensator_core::Sample { position_rad: self.before.position_rad, ..*at };
        let noise = learnt.found.hand_over.held_out_of_driver.rmse;
        let seed = self.options.seed;
        let best = most_informative(left, [&first, &second], &at, noise, WORTHWHILE_NATS, seed);
        best.map(|(place, _)| left.remove(place))
    }

    /// Performs a block with a set. It becomes the best one if it does not oscillate, and is better than the former set and
    /// the best one so far.
    fn screen(
        &mut self,
        tuned: &TunedSet,
        former: &Scored,
        best: &mut Option<(f64, TunedSet)>,
        user: &mut dyn TuneUser,
    ) -> Result<(), Ended> {
        let name = format!(
            "model {}, scale {}, velocity gain {:.2}",
            crate::names::model_name(&tuned.set.friction.model),
            tuned.set.friction.compensator.scale,
            tuned.set.motor.velocity_gain_a_s_per_rad,
        );
        let scored = match self.block(tuned, CANDIDATE) {
            Ok((_, scored)) => scored,
            // A set that makes the joint leave its demand is no candidate.
            Err(Ended::Master(MasterError::ErrorGuard(error))) => {
                self.is_enabled = false;
                user.progress(&format!("candidate: {name}: stopped at an error of {error:.3} rad"));
                return Ok(());
            }
            Err(other) => return Err(other),
        };
        let cost = proof::cost(former, &scored);
        let oscillation = proof::oscillates(former, &scored);
        user.progress(&format!(
            "candidate: {name}: error at reversals {:.2}, tracking {:.2} of before{}",
            scored.scores[0] / former.scores[0],
            scored.scores[1] / former.scores[1],
            oscillation.as_ref().map_or_else(String::new, |why| format!("; rejected: {why}"))
        ));
        let is_better = cost < best.as_ref().map_or(0.0, |(least, _)| *least);
        if oscillation.is_none() && is_better {
            *best = Some((cost, tuned.clone()));
        }
        Ok(())
    }

    /// Performs a block with a set.
    fn block(&mut self, tuned: &TunedSet, why: &str) -> Result<(Recording, Scored), Ended> {
        self.disable()?;
        check_heat(self.master.client())?;
        self.stay_unlocked()?;
        trial_set::apply(&mut self.master, tuned)?;
        self.tried = Some(tuned.clone());
        self.scored_block(why)
    }

    fn scored_block(&mut self, why: &str) -> Result<(Recording, Scored), Ended> {
        let motion = self.motion.clone();
        let recording = self.perform(&motion, why)?;
        let scored = score(&recording, self.nm_per_a());
        Ok((recording, scored))
    }

    /// Compares the former set (A) and a new one (B) in blocks A B B A.
    fn compare(&mut self, chosen: TunedSet, user: &mut dyn TuneUser) -> Result<Verdict, Ended> {
        let left_s = self.options.seconds - self.elapsed_s();
        let possible = (left_s / (2.0 * (self.motion.seconds() + PAUSE_S))) as usize;
        let pairs = possible.clamp(MIN_PAIRS, PAIRS);
        user.progress(&format!("trial: {} blocks with the former and the new set", 2 * pairs));
        let former = self.former();
        let order =
            (0..pairs).flat_map(|pair| if pair % 2 == 0 { [false, true] } else { [true, false] });
        let mut last = None;
        for is_new in order {
            let tuned = if is_new { &chosen } else { &former };
            let (recording, scored) = if last == Some(is_new) {
                self.scored_block("trial")?
            } else {
                self.block(tuned, "trial")?
            };
            last = Some(is_new);
            self.courses[usize::from(is_new)] = course(&recording, self.nm_per_a());
            self.trial.push((is_new, scored));
            if is_new && let Some(why) = proof::oscillates(&self.trial[0].1, &scored) {
                return Ok(Verdict::returned(&why));
            }
        }
        self.tried = Some(chosen);
        Ok(proof::verdict(&self.pairs(), &self.means(), self.options.seed))
    }

    /// Returns the scores of the trial as pairs: former, new.
    pub(super) fn pairs(&self) -> Vec<[Scored; 2]> {
        let pair = |blocks: &[(bool, Scored)]| match *blocks {
            [(false, former), (true, new)] | [(true, new), (false, former)] => Some([former, new]),
            _ => None,
        };
        self.trial.chunks_exact(2).filter_map(pair).collect()
    }
}

fn course(recording: &Recording, nm_per_a: f64) -> TuneCourse {
    let rows = &recording.rows;
    let begin_s = rows.first().map_or(0.0, |row| row.time_s);
    TuneCourse {
        time_s: rows.iter().map(|row| row.time_s - begin_s).collect(),
        demand_rad: rows.iter().map(|row| row.demand_rad()).collect(),
        position_rad: rows.iter().map(|row| row.position_rad).collect(),
        current_a: rows.iter().map(|row| row.torque_nm / nm_per_a).collect(),
    }
}
