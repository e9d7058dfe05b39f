//! The joint driver's firmware, as far as it can be tested on a PC.
//!
//! From the outside in: [`background`] is a board's slow loop, over one trait of wires. [`driver`] is a joint on
//! its bus (frames in, frames out, a tick a millisecond), with its objects ([`node`]), parameters
//! ([`parameter_set`], [`node_settings`], [`store`]), [`supervisor`] and [`watch`]. [`loop_task`] is what the fast
//! interrupt does: the current loop ([`control`]) under its own time guard ([`deadline`]); between the two are
//! the queues of [`loop_link`]. [`sensors`] are drivers without a board. The boards themselves are in the
//! binary `firmware`, and only there are registers. Time is passed in everywhere, so a PC runs all of this
//! in virtual time.
//!
//! For measuring the core on its processor: [`reference_joint`] (the network is `compensator_core::network::reference`), which all figures are taken for, and
//! [`fingerprint`], the runs whose output bits must agree between PC and microcontroller; the binary `cost`
//! counts instructions.
#![cfg_attr(not(test), no_std)]

pub mod background;
pub mod bridge_guard;
pub mod control;
pub mod deadline;
pub mod driver;
pub mod fingerprint;
pub mod hil;
mod log;
pub mod loop_link;
pub mod loop_parts;
pub mod loop_task;
pub mod node;
pub mod node_settings;
pub mod panic_note;
pub mod parameter_set;
pub mod reference_joint;
pub mod sensors;
pub mod store;
pub mod supervisor;
pub mod watch;

#[cfg(target_os = "none")]
pub mod panic;
#[cfg(target_os = "none")]
pub mod stack_guard;
