//! The joint driver's firmware, as far as it can be tested on a PC.
#![cfg_attr(not(test), no_std)]

pub mod control;
pub mod fingerprint;
pub mod joint;
pub mod store;
pub mod supervisor;
pub mod watch;

#[cfg(target_os = "none")]
pub mod panic;
