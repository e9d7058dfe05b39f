//! Friction laws, extension terms and the friction compensator of an underwater joint driver.
//!
//! The seal of an underwater joint rubs; how hard depends on speed, on the side load on the shaft
//! and on the water pressure. This crate computes that friction inside a current loop and on a PC,
//! with the same code: `no_std`, no allocation, no `unsafe`, no panics, generic over the number.
//!
//! Reading order: [`law`] (what rubs), [`effect`] and [`term`] (what changes how hard),
//! [`parameters`] (written, validated, built), [`model`] (one sample in, one torque out),
//! [`compensator`] (the model made safe for a current loop), [`record`] (parameters in flash), [`can`]
//! (samples and answers on the bus).
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

pub mod can;
pub mod compensator;
pub mod curve;
pub mod effect;
pub mod law;
pub mod model;
pub mod number;
pub mod parameters;
pub mod record;
pub mod seal;
pub mod term;

pub use compensator::{Compensator, Flags, Inputs, Output};
pub use model::{Model, Sample, State};
pub use number::{Fixed, Real};
pub use parameters::{LawKind, ParameterError, ParameterId, Parameters};
pub use term::TermKind;
