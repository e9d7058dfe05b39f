//! Training the network of `lugre-lstm` ([`compensator_core::network`]) on measured runs.
//!
//! ```text
//! base law (fitted before, by crate) + inputs of a track        input
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

mod adjoint;
mod file;
mod input;
mod predict;
mod train;

pub use file::{BASE, CELLS, NetworkFile, WideNetwork, checksum};
pub use input::{NetworkInput, NetworkLaw, law_substeps};
pub use predict::{NetworkRun, predict};
pub use train::{TrainOptions, TrainedNetwork, TrainingProgress, train};
