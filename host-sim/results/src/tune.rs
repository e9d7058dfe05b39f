//! Result files of `tune`: what was tried on a joint, what it gained, and what was not learnt.
//!
//! [`TuneReport`] has the plain values of a session. [`TuneReport::document`] is `tune.json`; the page `tune.html` and the table
//! of the recorded rows have the same values.
//!
//! A *block* is one performance of the same motion with one of the sets of [`TuneArm`]. The orders of the blocks are balanced, so
//! that a steady drift of the joint favours no set.

#[cfg(feature = "pages")]
mod charts;
#[cfg(all(feature = "pages", feature = "rows"))]
mod files;
#[cfg(feature = "pages")]
mod page;
#[cfg(feature = "pages")]
mod words;

#[cfg(all(feature = "pages", feature = "rows"))]
pub use files::{TuneRun, table};

use serde::Serialize;
use serde_json::{Value, json};

/// What the session did with the joint.
#[derive(Clone, Debug, PartialEq)]
pub enum TuneOutcome {
    /// A gain was proven, and the new set is saved.
    Saved,
    /// The former set is back; the reason, as a sentence.
    Returned(String),
}

/// A quantity of a block: smaller is better for all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TuneQuantity {
    /// Largest position error after a reversal, mean over the reversals, rad.
    ReversalError,
    /// Root mean square of the position error, rad.
    TrackingRms,
    /// Root mean square of the current, A.
    CurrentRms,
    /// Time at rest where motion was demanded, s.
    StuckTime,
}

impl TuneQuantity {
    /// All quantities.
    pub const ALL: [Self; 4] =
        [Self::ReversalError, Self::TrackingRms, Self::CurrentRms, Self::StuckTime];

    /// Returns the unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::ReversalError | Self::TrackingRms => "rad",
            Self::CurrentRms => "A",
            Self::StuckTime => "s",
        }
    }

    /// Returns the name in words.
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::ReversalError => "error at reversals",
            Self::TrackingRms => "tracking error",
            Self::CurrentRms => "current",
            Self::StuckTime => "time stuck",
        }
    }
}

/// The gain of a quantity from one set to another: `1 - after / before`, paired over the rounds of the trial.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TuneGain {
    /// The quantity.
    pub quantity: TuneQuantity,
    /// Its unit.
    pub unit: &'static str,
    /// Geometric mean of the blocks with the first set.
    pub before: f64,
    /// Geometric mean of the blocks with the second set.
    pub after: f64,
    /// The gain; negative if it is worse.
    pub gain: f64,
    /// 95 % confidence interval of the gain.
    pub ci95: [f64; 2],
}

impl TuneGain {
    /// Returns the change with its interval.
    fn in_words(&self) -> String {
        let Self { quantity, unit, before, after, .. } = self;
        let [low, high] = self.ci95.map(|share| 100.0 * share);
        format!(
            "{}: {before:.4} {unit} -> {after:.4} {unit} ({:+.0} %, 95 % interval {:+.0} to {:+.0} %)",
            quantity.in_words(),
            -100.0 * self.gain,
            -high,
            -low
        )
    }
}

/// A motion that was performed to learn from it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TuneRound {
    /// Name of the motion.
    pub motion: String,
    /// Duration, s.
    pub seconds: f64,
    /// Why it was chosen, as a sentence.
    pub why: String,
}

/// A set of the trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum TuneArm {
    /// The set as the joint had it.
    #[serde(rename = "A")]
    Former,
    /// The new friction model and, if they were found, the new loop gains.
    #[serde(rename = "B")]
    New,
    /// The former friction model with the new loop gains.
    #[serde(rename = "C")]
    NewLoop,
}

impl TuneArm {
    /// All sets, in the order of performance of a first round.
    pub const ALL: [Self; 3] = [Self::Former, Self::NewLoop, Self::New];

    /// Returns the letter.
    pub const fn letter(self) -> &'static str {
        match self {
            Self::Former => "A",
            Self::New => "B",
            Self::NewLoop => "C",
        }
    }

    /// Returns what the set has beside the former one.
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::Former => "the former set",
            Self::New => "the new one",
            Self::NewLoop => "the former friction model with the new loop gains",
        }
    }
}

/// A block of the trial.
#[derive(Clone, Debug, PartialEq)]
pub struct TuneBlock {
    /// Its set.
    pub arm: TuneArm,
    /// Values in the order of [`TuneQuantity::ALL`].
    pub values: [f64; 4],
}

/// The comparison of the sets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TuneTrial {
    /// The blocks in the order of performance.
    pub blocks: Vec<TuneBlock>,
}

/// What each part of a new set takes of the errors, in the order of [`TuneQuantity::ALL`]; empty if it was not compared.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TuneParts {
    /// From the former set to the new loop gains with the former friction model.
    pub loop_gains: Vec<TuneGain>,
    /// From there, or without new loop gains from the former set, to the new friction model.
    pub friction_model: Vec<TuneGain>,
}

impl TuneTrial {
    /// Returns the order of the blocks, such as `ABBA`.
    pub fn order(&self) -> String {
        self.blocks.iter().map(|block| block.arm.letter()).collect()
    }

    /// Returns the sets that were compared.
    pub fn arms(&self) -> Vec<TuneArm> {
        let is_performed = |arm: &TuneArm| self.blocks.iter().any(|block| block.arm == *arm);
        [TuneArm::Former, TuneArm::New, TuneArm::NewLoop].into_iter().filter(is_performed).collect()
    }
}

/// Demand and position over time of one performance of the motion of the trial.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TuneCourse {
    /// Time from the start of the motion, s.
    pub time_s: Vec<f64>,
    /// Demanded position, rad.
    pub demand_rad: Vec<f64>,
    /// Measured position, rad.
    pub position_rad: Vec<f64>,
    /// Measured current, A.
    pub current_a: Vec<f64>,
}

/// The loop gains and the margins for which they were chosen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TuneLoop {
    /// Inertia at the joint, kg m^2.
    pub inertia_kg_m2: f64,
    /// Delay from a measured velocity to the torque that answers it, observer included, s.
    pub delay_s: f64,
    /// First resonance of the mechanics, Hz; `None` if there is none below the measured frequencies.
    pub resonance_hz: Option<f64>,
    /// Standard deviation of the measured velocity at rest, rad/s.
    pub velocity_noise_rad_s: f64,
    /// Crossover of the velocity loop, Hz.
    pub crossover_hz: f64,
    /// Phase margin of the velocity loop, degrees.
    pub phase_margin_deg: f64,
    /// Gain margin of the velocity loop, dB.
    pub gain_margin_db: f64,
    /// Measured frequency response from current to velocity: frequency Hz, magnitude rad/s per A, phase degrees.
    pub response: Vec<[f64; 3]>,
}

/// A parameter that the session changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TuneParameter {
    /// Name, as `params get` prints it.
    pub name: String,
    /// Former value, as text.
    pub before: String,
    /// New value, as text.
    pub after: String,
}

/// The values of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct TuneReport {
    /// The joint: bus and node.
    pub joint: String,
    /// True for a simulated joint.
    pub is_simulated: bool,
    /// Facts of the joint before the session: name and value.
    pub identity: Vec<(String, String)>,
    /// What happened to the parameters.
    pub outcome: TuneOutcome,
    /// Name of the first cause; `none` without one.
    pub cause: String,
    /// Its probability.
    pub probability: f64,
    /// The set that was saved; if none was, the one that was tried last.
    pub arm: TuneArm,
    /// Gains of this set over the former one, in the order of [`TuneQuantity::ALL`]; empty if nothing was tried.
    pub gains: Vec<TuneGain>,
    /// What loop gains and friction model contribute.
    pub parts: TuneParts,
    /// The motions that were learnt from, in order.
    pub rounds: Vec<TuneRound>,
    /// What this joint and this session could not show, a sentence each.
    pub not_learnt: Vec<String>,
    /// The comparison of the sets.
    pub trial: TuneTrial,
    /// A performance with the former set, and one with the new set.
    pub courses: [TuneCourse; 2],
    /// The loop gains; `None` if they were not measured.
    pub control: Option<TuneLoop>,
    /// Changed parameters.
    pub parameters: Vec<TuneParameter>,
    /// Bound of the compensation torque, Nm, and of the bristle torque, Nm, of the tried set.
    pub bounds_nm: [f64; 2],
    /// Warnings, a sentence each.
    pub warnings: Vec<String>,
    /// Duration of the session on the bus, s.
    pub seconds: f64,
}

impl TuneReport {
    /// Returns the name of what was handed over.
    const fn handed_over(&self) -> &'static str {
        match (&self.outcome, self.arm) {
            (TuneOutcome::Returned(_), _) | (_, TuneArm::Former) => "none",
            (_, TuneArm::NewLoop) => "loop-gains",
            (_, TuneArm::New) if self.parts.loop_gains.is_empty() => "friction-model",
            (_, TuneArm::New) => "both",
        }
    }

    /// Returns the session as the document `tune.json`, version 1. A value that is not finite is null.
    pub fn document(&self) -> Value {
        let block = |block: &TuneBlock| {
            let is_new = block.arm == TuneArm::New;
            json!({ "set": block.arm, "is_new": is_new, "values": block.values })
        };
        let mut document = json!({
            "schema": 1,
            "joint": self.joint,
            "simulated": self.is_simulated,
            "saved": self.outcome == TuneOutcome::Saved,
            "cause": self.cause,
            "probability": self.probability,
            "handed_over": self.handed_over(),
            "gains": self.gains,
            "parts": self.parts,
            "rounds": self.rounds,
            "not_learnt": self.not_learnt,
            "trial": {
                "blocks": self.trial.blocks.len(),
                "order": self.trial.order(),
                "values": self.trial.blocks.iter().map(block).collect::<Vec<_>>(),
            },
            "control": self.control,
            "parameters": self.parameters,
            "torque_bound_nm": self.bounds_nm[0],
            "state_bound_nm": self.bounds_nm[1],
            "warnings": self.warnings,
            "seconds": self.seconds,
        });
        if let TuneOutcome::Returned(why) = &self.outcome {
            document["why_not"] = json!(why);
        }
        document
    }
    /// Returns the result as lines for a terminal.
    pub fn text(&self) -> String {
        let mut text = match &self.outcome {
            TuneOutcome::Saved => {
                "The joint moves better, and the new parameters are saved.\n".to_owned()
            }
            TuneOutcome::Returned(why) => format!("The former parameters are active: {why}.\n"),
        };
        self.gains.iter().for_each(|gain| text += &format!("  {}\n", gain.in_words()));
        let TuneParts { loop_gains, friction_model } = &self.parts;
        if !loop_gains.is_empty() && !friction_model.is_empty() {
            for (name, gains) in
                [("by the loop gains", loop_gains), ("then by the friction model", friction_model)]
            {
                text += &format!("  {name}:\n");
                // The current follows from both, and the time stuck from the errors.
                let errors = gains.iter().take(2);
                errors.for_each(|gain| text += &format!("    {}\n", gain.in_words()));
            }
        }
        text += &format!("  cause: {}, probability {:.2}\n", self.cause, self.probability);
        for (name, lines) in [("warning", &self.warnings), ("not learnt", &self.not_learnt)] {
            lines.iter().for_each(|line| text += &format!("  {name}: {line}\n"));
        }
        text
    }
}
