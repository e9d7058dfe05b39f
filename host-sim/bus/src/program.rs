//! Programs of a joint: keys, signed packages, and their update over the bus (CiA 302-3).
//!
//! ```text
//! image (ELF or binary) + private key -> package -> update -> node: receive, restart, trial, confirmed
//! ```
//! [`key`] reads and writes the key files, [`package`] makes and reads packages, [`update`] transfers one. The format and
//! the state machine are `firmware::update`.

pub mod key;
pub mod package;
pub mod update;
