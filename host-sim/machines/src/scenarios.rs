//! Scenarios with something hidden: simulated joints in which one physical effect, or two, or none, is hidden.
//!
//! A diagnosis is worth what it says about joints it knows nothing of. Each scenario here is a campaign
//! of runs on a seal drawn at random, with its own rate, sensors, motions and covariates; the data
//! are as they would be read from a log, and [`ScenarioTruth`] holds what was hidden.
//!
//! ```text
//! kind ─► recipe ─► setting (seal, motions, covariates) ─► joint (physics) ─► torques ─► log
//!                        effect, drawn and sized until it shows ──┘                └─► truth
//! ```
//!
//! Nothing here knows `compensator-core`: the state is the bristles' deflection in rad, and the
//! integrator (`dynamics`) counts travel. A covariate that does nothing is in most logs, and moves.

mod arrange;
mod draw;
mod drawn_cause;
mod dynamics;
mod excite;
mod hidden_cause;
mod hide;
mod joint;
mod kind;
mod logger;
mod motion;
mod outside;
mod sampler;
mod sensors;
mod setting;
mod surroundings;
mod truth;
pub mod unkind;

pub use hidden_cause::HiddenCause;
pub use hide::{Hide, kind};
pub use kind::{Kind, PAIRS, benchmark};
pub use setting::Options;
pub use truth::{Decoy, Hidden, ScenarioTruth};

use crate::log::Log;

/// A log and the truth behind it.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What the machine logged.
    pub log: Log,
    /// What was hidden.
    pub truth: ScenarioTruth,
}

/// Draws a scenario of a kind; the same seed gives the same bits.
pub fn draw(kind: Kind, seed: u64) -> Scenario {
    draw_with(kind, &[], seed, &Options::default())
}

/// Draws a scenario with some things given. `sizes` are those of the kind's effects in their order, as
/// far as they are given; without one a size is drawn so that the effect shows.
pub fn draw_with(kind: Kind, sizes: &[Option<f64>], seed: u64, options: &Options) -> Scenario {
    draw::draw(kind, sizes, seed, options)
}
