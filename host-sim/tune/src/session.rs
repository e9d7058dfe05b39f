//! A tuning session: baseline, learning, trial, and what remains in the joint.
//!
//! The joint is never left with an unproven set. New sets are in RAM only, on a trial that the drive itself ends when the host
//! does not renew it. Whatever ends a session early (a fault, a cable, an interrupt), the stored set is back afterwards.

use crate::experiment::{Experiment, library, most_informative, survey};
use crate::frequency::{self, LoopGains};
use crate::learn::{Learnt, learn};
use crate::master::{Master, MasterError};
use crate::motion::{Motion, MotionLimits, standard};
use crate::preflight::{Found, Purpose, Refusal, examine};
use crate::proof::{self, Verdict};
use crate::recording::{Recording, constant_covariates};
use crate::score::{Scored, score};
use crate::trial_set::{self, TrialError, TunedSet};
use compensator_core::can::NodeId;
use firmware::control::PERIOD_S;
use firmware::parameter_set::ParameterSet;
use friction_results::tune::{
    TuneBlock, TuneCourse, TuneLoop, TuneOutcome, TuneParameter, TuneReport, TuneRound, TuneTrial,
};
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;

/// Pairs of blocks of a trial, and the fewest if the minutes are short.
const PAIRS: usize = 6;
const MIN_PAIRS: usize = 3;
/// Time between two motions, s: changing the set, arming, and moving to the origin.
const PAUSE_S: f64 = 1.5;
/// Expected log likelihood ratio from which a further motion is worth its time.
const WORTHWHILE_NATS: f64 = 3.0;
/// Most motions that are chosen after the survey.
const MAX_CHOSEN: usize = 4;
/// Shares of the friction that are tried.
const SCALES: [f32; 2] = [0.9, 0.7];
/// Ratio of the position error to the worst one of the baseline at which a motion is ended.
const ERROR_GUARD: f64 = 2.5;
/// Least guard, rad.
const MIN_GUARD_RAD: f64 = 0.02;

/// What is asked of a session.
#[derive(Clone, Debug)]
pub struct TuneOptions {
    /// Node number of the joint.
    pub node: NodeId,
    /// Bounds of every motion.
    pub limits: MotionLimits,
    /// Time on the bus, s.
    pub seconds: f64,
    /// Motion of the trial; `None` for [`standard`].
    pub motion: Option<Motion>,
    /// Seed of what is drawn at random.
    pub seed: u64,
    /// Name of the joint for the report: bus and node.
    pub joint: String,
    /// The joint is simulated.
    pub is_simulated: bool,
    /// Unix time, s, for the record in the drive.
    pub now_s: u64,
}

/// Reason why nothing was tried; one line.
#[derive(Debug, thiserror::Error)]
pub enum TuneError {
    /// The joint is refused.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The motion of the trial is outside its bounds.
    #[error("{0}")]
    Motion(String),
    /// A move by hand ended early.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// The user declined.
    #[error("cancelled; nothing was changed")]
    Declined,
}

/// Everything that a session recorded and decided.
#[derive(Debug)]
pub struct Session {
    /// Values for `tune.json` and the page.
    pub report: TuneReport,
    /// All recordings, each with the reason for its motion.
    pub recordings: Vec<(Recording, String)>,
    /// The diagnosis of what was learnt from.
    pub learnt: Option<Learnt>,
    /// The joint as it was found.
    pub before: Found,
    /// The set that was tried last.
    pub tried: Option<ParameterSet>,
    /// The position gain that belongs to it (60FBh:1), 1e-3 1/s.
    pub position_gain: u32,
}

impl Session {
    /// Returns true if a gain was proven and the new set is saved.
    pub fn is_saved(&self) -> bool {
        self.report.outcome == TuneOutcome::Saved
    }
}

/// A front end of a session.
pub trait TuneUser {
    /// Asks whether the joint may move; `what` is a question.
    fn confirms(&mut self, what: &str) -> bool;
    /// Shows a line of progress.
    fn progress(&mut self, line: &str);
}

/// Reason why a session ends before its proof.
#[derive(Debug, thiserror::Error)]
enum Ended {
    #[error(transparent)]
    Master(#[from] MasterError),
    #[error(transparent)]
    Trial(#[from] TrialError),
    #[error("{0}")]
    Why(String),
}

/// Tunes a joint.
///
/// # Errors
/// Returns one line if the joint must not be moved or the user declines; then nothing was changed. A session that ends later
/// returns its result, with the former set.
pub fn tune<B: Bus>(
    mut client: Client<B>,
    options: &TuneOptions,
    is_interrupted: Box<dyn Fn() -> bool>,
    user: &mut dyn TuneUser,
) -> Result<Session, TuneError> {
    let limits = options.limits;
    let motion = options.motion.clone().unwrap_or_else(|| standard(&limits));
    motion.validate(&limits).map_err(TuneError::Motion)?;
    let before = examine(&mut client, options.node, &limits, Purpose::Tune)?;
    if !user.confirms(&question(options, &before)) {
        return Err(TuneError::Declined);
    }
    let began_ns = client.bus().now_ns();
    let master = Master::new(client, options.node, limits, is_interrupted);
    let mut work = Work::new(master, options, motion, before, began_ns);
    let ended = work.run(user);
    Ok(work.finish(ended, user))
}

fn question(options: &TuneOptions, found: &Found) -> String {
    let MotionLimits { range_rad, speed_rad_s, .. } = options.limits;
    let facts: Vec<String> =
        found.facts.iter().map(|(name, value)| format!("  {name}: {value}")).collect();
    format!(
        "{}\n{}\nThe joint will move by up to {range_rad} rad to either side of {:.3} rad, at up to {speed_rad_s} rad/s, for up \
         to {:.0} s. New parameters are tried in RAM; they are saved only after a proven gain. Keep the range clear and be \
         ready to switch off the supply. Continue?",
        options.joint,
        facts.join("\n"),
        found.position_rad,
        options.seconds
    )
}

/// The state of a session.
struct Work<'a, B> {
    master: Master<B>,
    options: &'a TuneOptions,
    motion: Motion,
    before: Found,
    began_ns: u64,
    recordings: Vec<(Recording, String)>,
    rounds: Vec<TuneRound>,
    learnt: Option<Learnt>,
    control: Option<TuneLoop>,
    baseline: Option<Scored>,
    tried: Option<TunedSet>,
    trial: Vec<(bool, Scored)>,
    courses: [TuneCourse; 2],
    is_enabled: bool,
    is_on_trial: bool,
}

impl<'a, B: Bus> Work<'a, B> {
    fn new(
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
            baseline: None,
            tried: None,
            trial: Vec::new(),
            courses: Default::default(),
            is_enabled: false,
            is_on_trial: false,
        }
    }

    fn elapsed_s(&mut self) -> f64 {
        let now_ns = self.master.client().bus().now_ns();
        now_ns.saturating_sub(self.began_ns) as f64 * 1e-9
    }

    fn nm_per_a(&self) -> f64 {
        f64::from(self.before.set.friction.compensator.torque_constant_nm_per_a)
    }

    fn former(&self) -> TunedSet {
        TunedSet { set: self.before.set.clone(), position_gain: self.before.position_gain }
    }

    /// Runs the session up to its verdict.
    fn run(&mut self, user: &mut dyn TuneUser) -> Result<Verdict, Ended> {
        self.master.configure()?;
        user.progress("baseline: the motion of the trial with the present parameters");
        let motion = self.motion.clone();
        let baseline = self.perform(&motion, "the present parameters")?;
        let scored = score(&baseline, self.nm_per_a());
        self.baseline = Some(scored);
        self.courses[0] = course(&baseline);
        self.master
            .set_error_guard((ERROR_GUARD * scored.health.worst_error_rad).max(MIN_GUARD_RAD));
        self.study(user)?;
        let candidates = self.candidates();
        self.disable()?;
        self.master.restore_interpolation(self.before.interpolation)?;
        trial_set::open(&mut self.master)?;
        self.is_on_trial = true;
        self.master.set_interpolation()?;
        let chosen = self.screen(candidates, &scored, user)?;
        let Some(chosen) = chosen else {
            return Ok(Verdict::returned(
                "no new set was better than the present one in its first block",
            ));
        };
        self.compare(chosen, user)
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

    fn disable(&mut self) -> Result<(), Ended> {
        if self.is_enabled {
            self.is_enabled = false;
            self.master.disable()?;
        }
        Ok(())
    }

    /// Performs the motions of the survey and those chosen after it, until the doubt is small or the time is used.
    fn study(&mut self, user: &mut dyn TuneUser) -> Result<(), Ended> {
        let limits = self.options.limits;
        for experiment in survey(&limits) {
            self.round(&experiment, user)?;
        }
        if let Some(motion) = frequency::motion(&limits) {
            let why = "the response from current to velocity, and the inertia";
            self.round(&Experiment { motion, why }, user)?;
        }
        self.disable()?;
        self.diagnose(user)?;
        let mut left = library(&limits);
        for _ in 0..MAX_CHOSEN {
            let Some(next) = self.next_experiment(&mut left) else { break };
            self.round(&next, user)?;
            self.disable()?;
            self.diagnose(user)?;
        }
        Ok(())
    }

    fn round(&mut self, experiment: &Experiment, user: &mut dyn TuneUser) -> Result<(), Ended> {
        let Experiment { motion, why } = experiment;
        user.progress(&format!("{}, {:.0} s: {why}", motion.name, motion.seconds()));
        self.perform(motion, why)?;
        let round = TuneRound {
            motion: motion.name.clone(),
            seconds: motion.seconds(),
            why: (*why).to_owned(),
        };
        self.rounds.push(round);
        Ok(())
    }

    fn diagnose(&mut self, user: &mut dyn TuneUser) -> Result<(), Ended> {
        let recordings: Vec<Recording> =
            self.recordings.iter().map(|(own, _)| own.clone()).collect();
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
        let noise = learnt.found.after.metrics.rmse;
        let seed = self.options.seed;
        let best = most_informative(left, [&first, &second], &at, noise, WORTHWHILE_NATS, seed);
        best.map(|(place, _)| left.remove(place))
    }

    /// Returns the sets to try, the most complete first.
    fn candidates(&mut self) -> Vec<TunedSet> {
        let former = self.former();
        let Some(learnt) = &self.learnt else { return Vec::new() };
        let gains = LoopGains {
            velocity_gain: f64::from(former.set.motor.velocity_gain_a_s_per_rad),
            integral_s: f64::from(former.set.motor.velocity_integral_s),
            position_gain: 1e-3 * f64::from(former.position_gain),
        };
        let inertia = learnt.inertia_kg_m2();
        let slides = self.recordings.iter().find(|(own, _)| own.name.starts_with("slides"));
        let designed = slides.zip(inertia).and_then(|((recording, _), inertia)| {
            frequency::design(recording, self.nm_per_a(), inertia, &gains)
        });
        let stiffer = designed.map(|(gains, control)| {
            self.control = Some(control);
            gains
        });
        let with_gains = |set: ParameterSet, gains: Option<LoopGains>| {
            let mut tuned = TunedSet { set, position_gain: former.position_gain };
            if let Some(gains) = gains {
                tuned.set.motor.velocity_gain_a_s_per_rad = gains.velocity_gain as f32;
                tuned.set.motor.velocity_integral_s = gains.integral_s as f32;
                tuned.position_gain = (1e3 * gains.position_gain) as u32;
            }
            tuned
        };
        let mut all = Vec::new();
        for gains in [stiffer, None] {
            for scale in SCALES {
                let set = learnt.set(&former.set, scale);
                if set.validate().is_ok() && set.check_buildable().is_ok() {
                    all.push(with_gains(set, gains));
                }
            }
            if stiffer.is_none() {
                break;
            }
        }
        if stiffer.is_some() {
            all.push(with_gains(former.set.clone(), stiffer));
        }
        all
    }

    /// Performs a block with each candidate, and returns the best one that does not oscillate and is better than the
    /// former set.
    fn screen(
        &mut self,
        candidates: Vec<TunedSet>,
        former: &Scored,
        user: &mut dyn TuneUser,
    ) -> Result<Option<TunedSet>, Ended> {
        let mut best: Option<(f64, TunedSet)> = None;
        for tuned in candidates {
            let block_s = self.motion.seconds() + PAUSE_S;
            let needed_s = 2.0 * MIN_PAIRS as f64 * block_s;
            if best.is_some() && self.options.seconds - self.elapsed_s() - block_s < needed_s {
                break;
            }
            let scored = match self.block(&tuned, "a candidate") {
                Ok((_, scored)) => scored,
                // The set is refused or makes the joint leave its demand: it is not a candidate.
                Err(Ended::Master(MasterError::ErrorGuard(error))) => {
                    user.progress(&format!(
                        "a candidate was stopped at a position error of {error:.3} rad"
                    ));
                    self.is_enabled = false;
                    continue;
                }
                Err(other) => return Err(other),
            };
            let cost = proof::cost(former, &scored);
            user.progress(&format!(
                "candidate: model {}, scale {}, velocity gain {:.2}: error at reversals {:.2}, tracking {:.2} of before",
                crate::names::model_name(&tuned.set.friction.model),
                tuned.set.friction.compensator.scale,
                tuned.set.motor.velocity_gain_a_s_per_rad,
                scored.scores[0] / former.scores[0],
                scored.scores[1] / former.scores[1],
            ));
            if proof::oscillates(former, &scored).is_none()
                && cost < 0.0
                && best.as_ref().is_none_or(|(least, _)| cost < *least)
            {
                best = Some((cost, tuned));
            }
        }
        Ok(best.map(|(_, tuned)| tuned))
    }

    /// Performs a block with a set.
    fn block(&mut self, tuned: &TunedSet, why: &str) -> Result<(Recording, Scored), Ended> {
        self.disable()?;
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
            self.courses[usize::from(is_new)] = course(&recording);
            self.trial.push((is_new, scored));
            if is_new && let Some(why) = proof::oscillates(&self.trial[0].1, &scored) {
                return Ok(Verdict::returned(&why));
            }
        }
        self.tried = Some(chosen);
        Ok(proof::verdict(&self.pairs(), self.options.seed))
    }

    /// Returns the scores of the trial as pairs: former, new.
    fn pairs(&self) -> Vec<[Scored; 2]> {
        let pair = |blocks: &[(bool, Scored)]| match *blocks {
            [(false, former), (true, new)] | [(true, new), (false, former)] => Some([former, new]),
            _ => None,
        };
        self.trial.chunks_exact(2).filter_map(pair).collect()
    }

    /// Saves the new set or brings the former one back, and returns the result.
    fn finish(mut self, ended: Result<Verdict, Ended>, user: &mut dyn TuneUser) -> Session {
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
        if self.is_on_trial
            && let Err(error) = trial_set::give_back(&mut self.master)
        {
            warnings.push(format!(
                "the return of the former set was not confirmed ({error}); the drive returns by itself {} s after the last \
                 renewal, and at every reset",
                f64::from(crate::master::TRIAL_DEADLINE_MS) * 1e-3
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
        self.is_on_trial = false;
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

/// Performs a motion around a position, rad, with a set in RAM, and records it. The joint is disarmed before and after.
///
/// # Errors
/// Returns one line if the set is refused or the joint stops.
pub fn performed<B: Bus>(
    client: Client<B>,
    options: &TuneOptions,
    origin_rad: f64,
    tuned: &TunedSet,
    motion: &Motion,
) -> Result<Recording, String> {
    let mut master = Master::new(client, options.node, options.limits, Box::new(|| false));
    let mut perform = || -> Result<Recording, Ended> {
        master.configure()?;
        trial_set::write(&mut master, tuned)?;
        master.enable()?;
        master.approach(origin_rad, 0.3 * options.limits.speed_rad_s)?;
        let recording = master.play(motion, origin_rad)?;
        master.disable()?;
        master.leave()?;
        Ok(recording)
    };
    perform().map_err(|error| error.to_string())
}

/// Returns the bounds of the compensation torque and of the bristle torque of a set, Nm, for every input.
fn bounds_nm(set: &ParameterSet) -> [f64; 2] {
    let compensator = &set.friction.compensator;
    let Ok([state, friction]) = set.friction.model.largest_torques_nm(PERIOD_S) else {
        return [f64::from(compensator.torque_limit_nm), f64::NAN];
    };
    [f64::from(compensator.torque_limit_nm.min(compensator.scale * friction)), f64::from(state)]
}

fn course(recording: &Recording) -> TuneCourse {
    let rows = &recording.rows;
    let begin_s = rows.first().map_or(0.0, |row| row.time_s);
    TuneCourse {
        time_s: rows.iter().map(|row| row.time_s - begin_s).collect(),
        demand_rad: rows.iter().map(|row| row.demand_rad()).collect(),
        position_rad: rows.iter().map(|row| row.position_rad).collect(),
        current_a: rows.iter().map(|row| row.torque_nm).collect(),
    }
}
