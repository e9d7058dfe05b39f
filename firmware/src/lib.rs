//! The joint driver's firmware, as far as it can be tested on a PC.
//!
//! What is here so far is what measuring the core on its processor needs: the joint the figures are
//! taken for ([`joint`]), the runs whose output bits must agree between PC and microcontroller
//! ([`fingerprint`]), and what a panic does on each board. The binary `cost` counts instructions in
//! QEMU; the binary `firmware` starts on the STM32G474 and keeps a compensator ready, nothing more.
#![cfg_attr(not(test), no_std)]

pub mod fingerprint;
pub mod joint;

#[cfg(target_os = "none")]
mod panic;
