//! Training the network of `lugre-lstm` ([`compensator_core::network`]) on measured runs.
//!
//! ```text
//! base law (fitted before) + inputs of a track                     input
//!   -> forward pass: the core's network, the core's LuGre step       adjoint, predict
//!   -> backward pass: exact gradient by every weight                 adjoint
//!   -> Adam, run by run, stopped by the error of held-out runs        train
//!   -> network.json, for the driver and for people                    file
//!   -> rows of a log predicted, as a driver does                      predict, prediction
//! ```
//! [`identify()`] does all of this for a log, and returns the result files.
//!
//! Gradients propagate through time and through the LuGre equations. The paper does this for `sigma0`; here it is done for
//! all three factors together, because levels and stiffness are confounded in presliding. Each LuGre step is the core's
//! own in dual numbers, which gives the derivatives by held torque and factors, exact to rounding. The chain rule of
//! the backward pass and of the recurrent layer is written by hand. A tensor library (candle, burn) would require a second
//! implementation of the law as a graph.

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/reference_network.rs"]
mod reference_network;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

mod adjoint;
mod error;
mod export;
mod file;
mod identify;
mod input;
mod predict;
mod prediction;
mod result_files;
mod train;

pub use error::NetworkError;
pub use export::export;
pub use file::{BASE, CELLS, MODEL, NetworkFile, WideNetwork};
pub use identify::{IdentifiedNetwork, IdentifyOptions, identify};
pub use input::{NetworkInput, NetworkLaw, law_substeps};
pub use predict::{NetworkRun, predict};
pub use prediction::predict_tracks;
pub use train::{TrainOptions, TrainedNetwork, TrainingProgress, train};
