//! Friction laws, extension terms and the friction compensator of an underwater joint driver.
//!
//! The shaft seal of an underwater joint causes friction. The friction depends on speed, on the side load on
//! the shaft and on the water pressure. This crate computes it with the same code in a current loop and on a PC.
//! The code is `no_std`, generic over the number type, and free of allocation, `unsafe` and panics.
//!
//! Read the modules in this order:
//!
//! * [`quantity`]: the measured quantities of a joint, and their units.
//! * [`law`]: the friction laws.
//! * [`effect`] and [`term`]: influences on a law, such as pressure and temperature.
//! * [`parameters`]: parameters, their validation, and building a model from them.
//! * [`model`]: a law with its terms. Each sample gives one friction torque.
//! * [`compensator`]: the model with input guards and output limits for a current loop.
//! * [`adaptation`]: gains on the sizes of a model that follow the joint.
//! * [`network`]: factors of a law that a neural network supplies.
//! * [`record`]: parameters in flash memory.
//! * [`can`]: samples and results on the CAN bus.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)
)]

#[cfg(test)]
extern crate std;

#[macro_use]
mod fields;

pub mod adaptation;
pub mod can;
pub mod compensator;
pub mod configuration;
pub mod crc32;
pub mod curve;
pub mod effect;
mod envelope;
mod fits;
mod flags;
mod joint_kind;
pub mod law;
pub mod model;
pub mod network;
#[cfg(test)]
extern crate self as compensator_core;
pub mod number;
pub mod parameter;
pub mod parameters;
pub mod quantity;
pub mod record;
mod refusal;
pub mod term;

pub use compensator::{Compensator, CompensatorOutput};
pub use envelope::Envelope;
pub use flags::Flags;
pub use joint_kind::JointKind;
pub use model::{FrictionModel, ModelState};
pub use number::{Fixed, Real};
pub use parameters::{LawKind, ParameterError, ParameterId, Parameters};
pub use quantity::{Inputs, Quantity, Reading, Sample};
pub use term::TermKind;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Compiles the example of the embedding guide.
#[cfg(doctest)]
#[doc = include_str!("../../docs/src/how-to/embed-the-compensator.md")]
struct EmbeddingGuide;
