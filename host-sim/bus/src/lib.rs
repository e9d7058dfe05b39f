//! The PC side of a joint driver on a CAN bus.
//!
//! ```text
//! bus (a hub in virtual time, SocketCAN, slcan; each with an optional recorder and fault injector)
//!  ├─ canopen     reads and writes the objects of a joint
//!  ├─ codes       names the faults and limits of a joint
//!  ├─ parameters  reads and writes the complete parameter set of a joint
//!  ├─ program     signs programs and updates a joint with them
//!  ├─ joint       runs a joint: the firmware's driver on a bus
//!  ├─ replay      sends a trace to a joint and compares every answer with the core, bit for bit
//!  ├─ scope       records the current loop of a joint at 20 kHz
//!  └─ monitor     shows the state of a joint
//! ```
//!
//! The bus defines the time. The time of a hub is virtual, so a minute of traffic takes milliseconds.

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

pub mod bus;
pub mod canopen;
pub mod codes;
pub mod joint;
pub mod monitor;
pub mod parameters;
#[cfg(feature = "update")]
pub mod program;
pub mod replay;
pub mod scope;
