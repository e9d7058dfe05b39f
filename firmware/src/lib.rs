//! The joint driver's firmware: everything that can be tested on a PC.
//!
//! From the outside in: [`background`] is the slow loop of a board, above one trait for its hardware. [`driver`]
//! is a joint on its bus, with its objects ([`node`]), parameters ([`parameter_set`], [`node_settings`],
//! [`store`]), [`supervisor`] and [`watch`]. It processes frames, and a tick every millisecond. [`loop_task`] is
//! the work of the fast interrupt: the current loop ([`control`]) with its time guard ([`deadline`]). The queues
//! of [`loop_link`] connect the two. [`sensors`] are sensor drivers without a board. Boards are in
//! binaries, and only they and the modules for `target_os = "none"` access registers. Time is passed in everywhere, so a PC
//! runs all else in virtual time.
//!
//! Measurements of the core on its processor, which `tests/emulator` has, use [`reference_joint`] (its network is
//! `tests/reference_network.rs`).
#![cfg_attr(not(test), no_std)]

#[cfg(test)]
#[path = "../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../tests/reference_network.rs"]
mod reference_network;
#[cfg(test)]
#[path = "../../tests/snapshot.rs"]
mod snapshot;

#[macro_use]
mod with_defaults;

pub mod access;
pub mod background;
pub mod bridge_guard;
pub mod compact;
pub mod control;
pub mod deadline;
pub mod drive_settings;
pub mod driver;
pub mod hil;
pub mod joint_node;
pub mod level_learner;
mod log;
pub mod loop_link;
pub mod loop_parts;
pub mod loop_task;
pub mod node;
pub mod node_settings;
pub mod panic_note;
pub mod parameter_set;
pub mod reference_joint;
pub mod refusal;
pub mod scope;
pub mod sensors;
pub mod setting_error;
pub mod start_values;
pub mod stop_brake;
pub mod store;
pub mod supervisor;
pub mod update;
pub mod watch;

#[cfg(target_os = "none")]
pub mod heat_memory;
#[cfg(target_os = "none")]
pub mod home_memory;
#[cfg(target_os = "none")]
pub mod panic;
#[cfg(target_os = "none")]
pub mod stack_guard;
