//! Training the network of `lugre-lstm` ([`compensator_core::network`]) on measured runs.
//!
//! ```text
//! base law (fitted before, by crate::fit) + inputs of a track        input
//!   -> forward pass: the core's network, the core's LuGre step       adjoint, predict
//!   -> backward pass: exact gradient by every weight                 adjoint
//!   -> Adam, run by run, stopped by the error of held-out runs        train
//!   -> network.json, for the driver and for people                    file
//! ```
//!
//! Gradients propagate through time and through the LuGre equations. The paper does this for `sigma0`; here it is done for
//! all three factors together, because levels and stiffness are confounded in presliding. Each LuGre step is the core's
//! own in dual numbers, which gives the derivatives by held torque and factors, exact to rounding. The chain rule of
//! the backward pass and of the recurrent layer is written by hand. A tensor library (candle, burn) would require a second
//! implementation of the law as a graph.

#[cfg(feature = "fit")]
mod adjoint;
mod file;
#[cfg(feature = "fit")]
mod input;
#[cfg(feature = "fit")]
mod predict;
#[cfg(feature = "fit")]
mod train;

pub use file::{BASE, CELLS, NetworkFile, WideNetwork, checksum};
#[cfg(feature = "fit")]
pub use input::{NetworkInput, NetworkLaw, law_substeps};
#[cfg(feature = "fit")]
pub use predict::{NetworkRun, predict};
#[cfg(feature = "fit")]
pub use train::{TrainOptions, TrainedNetwork, TrainingProgress, train};
