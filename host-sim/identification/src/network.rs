//! Training the network of `lugre-lstm` ([`compensator_core::network`]) on measured runs.
//!
//! ```text
//! base law (fitted before, by crate::fit) + inputs of a track        input
//!   -> forwards: the core's network, the core's LuGre step           adjoint, predict
//!   -> backwards: exact gradient by every weight                     adjoint
//!   -> Adam, run by run, stopped by runs held out                     train
//!   -> network.json, for driver and people                            file
//! ```
//!
//! Gradients go through time and through the LuGre equations, as the paper has it for `sigma0`; here for all three
//! factors at once, because levels and stiffness stand in for each other in presliding. Each LuGre step is
//! the core's own in dual numbers, which gives its derivatives by held torque and factors to rounding; they are chained
//! backwards by hand, and so is the recurrent layer. A library for tensors (candle, burn) would want the law written
//! again as a graph; neither was timed.

#[cfg(feature = "fit")]
mod adjoint;
mod file;
#[cfg(feature = "fit")]
mod input;
#[cfg(feature = "fit")]
mod predict;
#[cfg(feature = "fit")]
mod train;

pub use file::{BASE, CELLS, NetworkFile, Widened, checksum};
#[cfg(feature = "fit")]
pub use input::{Input, Supplied};
#[cfg(feature = "fit")]
pub use predict::{Run, predict};
#[cfg(feature = "fit")]
pub use train::{Progress, TrainOptions, Trained, train};
