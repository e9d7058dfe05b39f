//! A small network that supplies parameters to LuGre while it runs: the law `lugre-lstm`.
//!
//! In the damper paper, an LSTM computes `F_C`, `F_S` and `sigma0`. Here it computes *factors* ([`Factors`]) on the
//! parameters of a fitted law. The bristle step applies them as any other [`crate::effect`], so both laws share one
//! implementation. Call `Network::evaluate` outside the current loop, at its own rate. The loop reads only the
//! last three factors.
//!
//! The network needs the feature `network`. Without it, the factors, the empty [`record`] and types without values remain, so
//! that a driver compiles without conditions and holds no code of a network.

mod factors;
pub mod record;

#[cfg(feature = "network")]
mod lstm_network;
#[cfg(feature = "network")]
pub use lstm_network::*;

#[cfg(not(feature = "network"))]
mod absent;
#[cfg(not(feature = "network"))]
pub use absent::{FactorSupplier, JointNetwork, NetworkState};

pub use factors::{FACTOR_COUNT, Factors};

/// Maximum number of inputs of a driver's network.
pub const MAX_INPUTS: usize = 4;

/// Number of cells of a driver's network.
pub const CELLS: usize = 8;
