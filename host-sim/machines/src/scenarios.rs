//! Test scenarios: simulated joints with no, one or two hidden physical effects.
//!
//! A diagnosis must be tested on joints it does not know. Each scenario is a campaign of runs on a random
//! seal, with its own sample rate, sensors, motions and covariates. The data have the form of a log, and
//! [`ScenarioTruth`] holds the hidden effects.
//!
//! ```text
//! kind ─► recipe ─► setting (seal, motions, covariates) ─► joint (physics) ─► torques ─► log
//!                        effect, drawn and scaled until visible ──┘                └─► truth
//! ```
//!
//! The module is independent of `compensator-core`. Its state is the bristle deflection in rad, and its
//! integrator (`dynamics`) uses the travel as the independent variable. Most logs also contain covariates
//! that vary without any effect.

mod arrange;
mod draw;
pub mod drawn_cause;
mod dynamics;
mod excite;
mod hidden_cause;
mod hide;
pub mod joint;
mod kind;
mod logger;
pub mod motion;
pub mod outside;
pub mod sampler;
mod sensors;
mod setting;
pub mod surroundings;
mod truth;

pub use hidden_cause::HiddenCause;
pub use hide::{Hide, kind};
pub use kind::{Kind, PAIRS, benchmark};
pub use setting::Options;
pub use truth::{Decoy, Hidden, ScenarioTruth};

use crate::log::Log;

/// A simulated log and its ground truth.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The log of the machine.
    pub log: Log,
    /// The ground truth of the log.
    pub truth: ScenarioTruth,
}

/// Draws a scenario of a kind. The same seed gives bit-identical results.
pub fn draw(kind: Kind, seed: u64) -> Scenario {
    draw_with(kind, &[], seed, &Options::default())
}

/// Draws a scenario with some quantities given.
///
/// `sizes` are the sizes of the kind's effects, in their order. A missing size is drawn so that the effect is
/// visible.
pub fn draw_with(kind: Kind, sizes: &[Option<f64>], seed: u64, options: &Options) -> Scenario {
    draw::draw(kind, sizes, seed, options)
}
