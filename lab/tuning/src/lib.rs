//! Grades `tune` on drawn joints: what it gains by the true position of the joint, whether it leaves a well tuned joint alone,
//! and whether a fault in the middle leaves the former set.
//!
//! The joints are those of [`simulated_machines::joint_plant`], which is not built from the friction law of the core. The
//! session sees their bus only. The grader also sees the plant: a gain counts by the true position of the output.
//!
//! The rival is a feed-forward by a table over speed, as open drives have it: a static law, fitted to the same recordings, with
//! the same loop gains, and scaled by the same choice.

mod error;
mod fault;
mod rival;
mod stand;
pub mod summary;

pub use error::GradeError;
pub use fault::{Fault, FaultGrade, grade_fault, grade_fault_on};
pub use stand::{LARGEST_DISTANCE_RAD, OrderFault, Stand, Truth};

use firmware::parameter_set::ParameterSet;
use friction_results::tune::{TuneArm, TuneGain, TuneOutcome, TuneQuantity};
use joint_rig::service;
use joint_tuning::recording::Recording;
use joint_tuning::{MotionLimits, Session, TuneOptions, TuneUser};
use rival::Rival;
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;

/// Bounds of the motions: the defaults of the command.
pub const LIMITS: MotionLimits =
    MotionLimits { range_rad: 0.4, speed_rad_s: 1.5, acceleration_rad_s2: 11.25 };

/// Time of a session, s: the default of the command.
pub const SECONDS: f64 = 300.0;

/// The effects that a joint's own motion can show.
pub const SHOWN_BY_MOTION: [&str; 11] = [
    "position-ripple",
    "gravity-imbalance",
    "direction-asymmetry",
    "torque-offset",
    "quadratic-drag",
    "dwell-time-static",
    "unmodelled-inertia",
    "backlash",
    "stribeck-shape",
    "torque-ripple",
    "warm-up",
];

/// How a joint was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// As commissioned: loops set by hand, friction not compensated.
    Commissioned,
    /// Tuned by a session before its hidden effect appeared, on other motions.
    TunedBefore,
}

/// A joint to grade.
#[derive(Clone, Debug)]
pub struct Case {
    /// Seed of the joint.
    pub seed: u64,
    /// Name of its hidden effect; `None` for a clean joint.
    pub hidden: Option<&'static str>,
    /// How it was found.
    pub start: Start,
}

/// A figure of both errors of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorFigures<T> {
    /// Of the error at reversals.
    pub reversal: T,
    /// Of the RMS tracking error.
    pub rms: T,
}

impl<T> ErrorFigures<T> {
    /// Returns both figures, that of the error at reversals first.
    pub fn both(self) -> [T; 2] {
        [self.reversal, self.rms]
    }
}

impl<T> From<[T; 2]> for ErrorFigures<T> {
    fn from([reversal, rms]: [T; 2]) -> Self {
        Self { reversal, rms }
    }
}

/// A gain with its 95 % interval, as shares of the former error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GainInterval {
    /// The gain.
    pub gain: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl From<&TuneGain> for GainInterval {
    fn from(found: &TuneGain) -> Self {
        let [low, high] = found.ci95;
        Self { gain: found.gain, low, high }
    }
}

/// Errors of the rival over those of the saved set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RivalRatio {
    /// By the true position of the output.
    pub by_truth: ErrorFigures<f64>,
    /// By the position of the encoder.
    pub by_encoder: ErrorFigures<f64>,
}

/// The grade of a session.
#[derive(Clone, Debug)]
pub struct Grade {
    /// The joint.
    pub case: Case,
    /// Family of its friction.
    pub family: &'static str,
    /// A new set was saved.
    pub is_saved: bool,
    /// Why not; empty if it was.
    pub why_not: String,
    /// Named cause.
    pub cause: String,
    /// Probability of the cause.
    pub probability: f64,
    /// Claimed gains; 0 if the session claims none.
    pub claimed: ErrorFigures<GainInterval>,
    /// Gains by the true position of the output, of the saved set over the former one; 0 if nothing was saved.
    pub true_gains: ErrorFigures<GainInterval>,
    /// Errors by the true position of the output with the former set, rad.
    pub former_errors_rad: ErrorFigures<f64>,
    /// The same with the saved set, rad, or with the former one if nothing was saved.
    pub final_errors_rad: ErrorFigures<f64>,
    /// The rival beside the saved set; `None` if nothing was saved.
    pub rival_ratio: Option<RivalRatio>,
    /// Time on the bus, s.
    pub seconds: f64,
}

impl Grade {
    /// Returns true if the saved set is worse than the former one by more than 1 %, by the true position and beyond its
    /// interval.
    pub fn is_worse(&self) -> bool {
        self.is_saved && self.true_gains.both().iter().any(|found| found.high < -0.01)
    }

    /// Returns true if the hidden effect is named first.
    pub fn is_named(&self) -> bool {
        self.case.hidden == Some(self.cause.as_str())
    }
}

/// A user who agrees and watches nothing.
struct Silent;

impl TuneUser for Silent {
    fn confirms(&mut self, _: &str) -> bool {
        true
    }

    fn progress(&mut self, line: &str) {
        if std::env::var_os("TUNE_PROGRESS").is_some() {
            eprintln!("{line}");
        }
    }
}

/// Returns the options of a session.
pub fn options(seed: u64, limits: MotionLimits) -> TuneOptions {
    TuneOptions {
        node: compensator_core::can::NodeId::FIRST,
        limits,
        seconds: SECONDS,
        motion: None,
        allow_active: false,
        seed,
        joint: format!("joint {seed}"),
        is_simulated: true,
        now_s: 0,
    }
}

/// Returns the joint of a case.
///
/// # Errors
/// Returns an error if the plant does not have the effect.
pub fn joint(seed: u64, hidden: Option<&str>) -> Result<DrawnJoint, GradeError> {
    let hide: Vec<Hide> = hidden.map(Hide::parse).transpose()?.into_iter().collect();
    Ok(DrawnJoint::draw(seed, &hide, None)?)
}

/// Returns the stand with the joint of a case as it is found.
fn stand_of(case: &Case, joint: &DrawnJoint, start: StartStand) -> Result<Stand, GradeError> {
    let clean = self::joint(case.seed, None)?;
    let set = service::starting_set(&clean);
    if case.start == Start::Commissioned {
        return start(joint, &set);
    }
    let other = MotionLimits { range_rad: 0.3, speed_rad_s: 1.1, acceleration_rad_s2: 8.0 };
    let session = Stand::new(&clean, &set)?.tune(&options(case.seed ^ 0x5eed, other))?;
    let Some(tuned) = session.tried.as_ref().filter(|_| session.is_saved()) else {
        return Err(GradeError::NothingSaved);
    };
    let stand = start(joint, tuned)?;
    stand.set_position_gain(session.position_gain)?;
    Ok(stand)
}

/// Tunes the joint of a case, and grades the result by its true position, beside the rival.
///
/// # Errors
/// Returns an error if the joint does not start or the session is refused.
pub fn grade(case: &Case) -> Result<Grade, GradeError> {
    let (mut grade, stand, session) = graded(case, Stand::new)?;
    if session.learnt.is_some() && session.is_saved() {
        grade.rival_ratio = Some(Rival::new(&session)?.ratio(&stand, &session)?);
    }
    Ok(grade)
}

/// Tunes the joint of a case on the stand that `start` makes for a joint with its set, and grades the result by its true
/// position, without the rival.
///
/// # Errors
/// As [`grade`].
pub fn grade_on(case: &Case, start: StartStand) -> Result<Grade, GradeError> {
    graded(case, start).map(|(grade, ..)| grade)
}

/// Starts a stand for a joint with this set.
pub type StartStand = fn(&DrawnJoint, &ParameterSet) -> Result<Stand, GradeError>;

fn graded(case: &Case, start: StartStand) -> Result<(Grade, Stand, Session), GradeError> {
    let joint = joint(case.seed, case.hidden)?;
    let stand = stand_of(case, &joint, start)?;
    let session = stand.tune(&options(case.seed, LIMITS))?;
    let claim = |quantity: TuneQuantity| {
        let found = session.report.gains.iter().find(|gain| gain.quantity == quantity);
        found.map_or(GainInterval::default(), GainInterval::from)
    };
    let truth = stand.truth();
    let (true_gains, former_errors_rad, final_errors_rad) = if session.is_saved() {
        let gains = truth.gains(&trial_rounds(&session), [TuneArm::Former, session.report.arm]);
        let [before, after] = [|gain: &TuneGain| gain.before, |gain: &TuneGain| gain.after];
        let gains = gains.each_ref();
        (gains.map(GainInterval::from).into(), gains.map(before).into(), gains.map(after).into())
    } else {
        let (baseline, _) = session.recordings.first().ok_or(GradeError::NoRecording)?;
        let scores = truth.scored(baseline).scores;
        let errors =
            ErrorFigures { reversal: scores.reversal_error_rad, rms: scores.tracking_rms_rad };
        ([GainInterval::default(); 2].into(), errors, errors)
    };
    let grade = Grade {
        case: case.clone(),
        family: joint.family.name(),
        is_saved: session.is_saved(),
        why_not: match &session.report.outcome {
            TuneOutcome::Saved => String::new(),
            TuneOutcome::Returned(why) => why.clone(),
        },
        cause: session.report.cause.clone(),
        probability: session.report.probability,
        claimed: [claim(TuneQuantity::ReversalError), claim(TuneQuantity::TrackingRms)].into(),
        true_gains,
        former_errors_rad,
        final_errors_rad,
        rival_ratio: None,
        seconds: session.report.seconds,
    };
    Ok((grade, stand, session))
}

/// Returns the recordings of the trial, each with its set, by rounds.
fn trial_rounds(session: &Session) -> Vec<Vec<(TuneArm, &Recording)>> {
    let performed = session.recordings.iter().filter(|(_, why)| why == "trial");
    let trial = &session.report.trial;
    let arms = trial.blocks.iter().map(|block| block.arm);
    let blocks: Vec<_> = arms.zip(performed.map(|(recording, _)| recording)).collect();
    blocks.chunks(trial.arms().len().max(1)).map(<[_]>::to_vec).collect()
}
