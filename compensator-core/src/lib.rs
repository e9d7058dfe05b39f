//! Friction laws, extension terms and the friction compensator of an underwater joint driver.
//!
//! The seal of an underwater joint rubs; how hard depends on speed, on the side load on the shaft
//! and on the water pressure. This crate computes that friction inside a current loop and on a PC,
//! with the same code: `no_std`, no allocation, no `unsafe`, no panics, generic over the number.
//!
//! Reading order: [`law`] (what rubs), [`effect`] and [`term`] (what changes how hard),
//! [`parameters`] (written, validated, built), [`model`] (one sample in, one torque out),
//! [`compensator`] (the model made safe for a current loop), [`network`] (parameters a network supplies), [`record`] (parameters in flash), [`can`]
//! (samples and answers on the bus). [`quantity`] is the table of what a joint measures.
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
pub mod configuration;
pub mod curve;
pub mod effect;
mod envelope;
mod fits;
mod flags;
mod joint_kind;
pub mod law;
pub mod model;
pub mod network;
pub mod number;
pub mod parameter;
pub mod parameters;
pub mod quantity;
pub mod record;
mod refusal;
pub mod seal;
pub mod term;

pub use compensator::{Compensator, Output};
pub use envelope::Envelope;
pub use flags::Flags;
pub use joint_kind::JointKind;
pub use model::{Model, State};
pub use number::{Fixed, Real};
pub use parameters::{LawKind, ParameterError, ParameterId, Parameters};
pub use quantity::{Inputs, Quantity, Reading, Sample};
pub use term::TermKind;

/// What the README shows compiles as it stands.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
