//! Hidden worlds: simulated joints in which one physical effect, or two, or none, is hidden.
//!
//! A diagnosis is worth what it says about joints it knows nothing of. Each world here is a campaign
//! of runs on a seal drawn at random, with its own rate, sensors, motions and covariates; the data
//! are as they would be read from a log, and [`WorldTruth`] holds what was hidden.
//!
//! ```text
//! kind ─► recipe ─► setting (seal, motions, covariates) ─► joint (physics) ─► torques ─► log
//!                        effect, drawn and sized until it shows ──┘                └─► truth
//! ```
//!
//! Nothing here knows `compensator-core`: the state is the bristles' deflection in rad, and the
//! integrator (`dynamics`) counts travel. A covariate that does nothing is in most logs, and moves.

mod arrange;
mod dice;
mod draw;
mod dynamics;
mod effect;
mod excite;
mod hidden;
mod joint;
mod kind;
mod motion;
mod outside;
mod sensors;
mod setting;
mod surroundings;
mod truth;

pub use effect::Effect;
pub use kind::{Kind, PAIRS, bank};
pub use setting::Options;
pub use truth::{Decoy, Hidden, WorldTruth};

use crate::log::Log;

/// A log and the truth behind it.
#[derive(Clone, Debug)]
pub struct World {
    /// What the machine logged.
    pub log: Log,
    /// What was hidden.
    pub truth: WorldTruth,
}

/// Draws a world of a kind; the same seed gives the same bits.
pub fn draw(kind: Kind, seed: u64) -> World {
    draw_with(kind, &[], seed, &Options::default())
}

/// Draws a world with some things given. `sizes` are those of the kind's effects in their order, as
/// far as they are given; without one a size is drawn so that the effect shows.
pub fn draw_with(kind: Kind, sizes: &[Option<f64>], seed: u64, options: &Options) -> World {
    draw::draw(kind, sizes, seed, options)
}
