//! Test scenarios: simulated joints with no, one or two hidden physical effects.
//!
//! A diagnosis must be tested on joints it does not know. Each scenario is a campaign of runs on a random
//! seal, with its own sample rate, sensors, motions and covariates. The data have the form of a log, and
//! [`ScenarioTruth`] holds the hidden effects.
//!
//! ```text
//! plan ─► setting (seal, motions, covariates) ─► joint (physics) ─► torques ─► log
//!             effect, drawn and scaled until visible ──┘                └─► truth
//! ```
//!
//! The module is independent of `compensator-core`. Its state is the bristle deflection in rad, and its
//! integrator ([`crate::imposed`]) uses the travel as the independent variable. Most logs also contain covariates
//! that vary without any effect.

mod draw;
pub mod drawn_cause;
mod excite;
mod hidden_cause;
mod hide;
mod sensors;
pub mod setting;
mod truth;

pub use draw::{ColumnRelation, Plan, draw_planned};
pub use hidden_cause::HiddenCause;
pub use hide::{Hide, HideError};
pub use setting::Options;
pub use truth::{Decoy, Hidden, ScenarioTruth};

use crate::log::Log;
use crate::sampler::Sampler;

/// A simulated log and its ground truth.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The log of the machine.
    pub log: Log,
    /// The ground truth of the log.
    pub truth: ScenarioTruth,
}

/// Draws a scenario with these hidden effects. The same seed gives bit-identical results.
pub fn draw(effects: &[HiddenCause], seed: u64) -> Scenario {
    let plan = |_: &mut Sampler| Plan { effects: effects.to_vec(), relation: None };
    draw_planned(&plan, &[], seed, &Options::default())
}

/// Draws a scenario with hidden effects whose sizes may be given, and with some quantities given.
///
/// A missing size is drawn so that the effect is visible.
pub fn draw_with(hide: &[Hide], seed: u64, options: &Options) -> Scenario {
    let (effects, sizes): (Vec<HiddenCause>, Vec<Option<f64>>) =
        hide.iter().filter_map(|hide| Some((hide.effect?, hide.size))).unzip();
    let plan = |_: &mut Sampler| Plan { effects: effects.clone(), relation: None };
    draw_planned(&plan, &sizes, seed, options)
}
