//! A tuning session: baseline, learning, trial, and what remains in the joint.
//!
//! The joint is never left with an unproven set. New sets are in RAM only, on a trial that the drive itself ends when the host
//! does not renew it. Whatever ends a session early (a fault, a cable, an interrupt), the stored set is back afterwards.
//!
//! `work` has the steps up to the trial, `candidates` the sets to try, `compare` the trial, and `finish` what remains in the
//! joint.

mod candidates;
mod compare;
mod finish;
mod work;

use crate::learn::Learnt;
use crate::master::{Master, MasterError};
use crate::motion::{Motion, MotionError, MotionLimits, standard};
use crate::preflight::{Found, Purpose, Refusal, examine};
use crate::recording::Recording;
use crate::trial_set::{self, TrialError};
use compensator_core::can::NodeId;
use firmware::parameter_set::ParameterSet;
use friction_diagnose::prepare;
use friction_results::tune::{TuneOutcome, TuneReport};
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;
use work::{Work, least_seconds};

/// What is asked of a session.
#[derive(Clone, Debug)]
pub struct TuneOptions {
    /// Node number of the joint.
    pub node: NodeId,
    /// Bounds of every motion.
    pub limits: MotionLimits,
    /// Time on the bus, s. Baseline, survey and the fewest blocks are performed even if they take longer.
    pub seconds: f64,
    /// Motion of the trial; `None` for [`standard`].
    pub motion: Option<Motion>,
    /// Also tries laws that can give out energy, and so keep a joint moving.
    pub allow_active: bool,
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
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// A move by hand ended early.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// The drive opens no trial.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// The user declined.
    #[error("cancelled; nothing was changed")]
    Declined,
}

/// Reason why a session ends before its proof; one line.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// A motion ended early.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// A set is not on trial.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// The joint must not be moved.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// Nothing was learnt from the recordings.
    #[error(transparent)]
    Learning(#[from] prepare::Error),
    /// There is no set to save.
    #[error("no set was tried")]
    NothingTried,
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
    motion.validate(&limits)?;
    let before = examine(&mut client, options.node, &limits, Purpose::Tune)?;
    if !user.confirms(&question(options, &motion, &before)) {
        return Err(TuneError::Declined);
    }
    let began_ns = client.bus().now_ns();
    let master = Master::new(client, options.node, limits, is_interrupted);
    let mut work = Work::new(master, options, motion, before, began_ns, user);
    // The drive refuses it unless its active parameters are the stored ones. Nothing has moved.
    trial_set::open(&mut work.master)?;
    let ended = work.run();
    Ok(work.finish(ended))
}

/// Returns true if laws that can give out energy are tried: the user or the stored set permits them.
fn has_active(options: &TuneOptions, found: &Found) -> bool {
    options.allow_active || found.set.friction.model.choices.allow_active
}

fn question(options: &TuneOptions, motion: &Motion, found: &Found) -> String {
    let MotionLimits { range_rad, speed_rad_s, .. } = options.limits;
    let facts: Vec<String> =
        found.facts.iter().map(|(name, value)| format!("  {name}: {value}")).collect();
    let active = match has_active(options, found) {
        true => {
            "Laws that can supply energy, and so keep the joint moving, are tried too (allow_active).\n"
        }
        false => "",
    };
    format!(
        "{}\n{}\n{active}The joint will move by up to {range_rad} rad to either side of {:.3} rad, at up to {speed_rad_s} rad/s, for up \
         to {:.0} s. New parameters are tried in RAM; they are saved only after a proven gain. Keep the range clear and be \
         ready to switch off the supply. Continue?",
        options.joint,
        facts.join("\n"),
        found.position_rad,
        options.seconds.max(least_seconds(motion, &options.limits))
    )
}
