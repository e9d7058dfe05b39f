//! A joint driver on a CAN bus, seen from a PC.
//!
//! ```text
//! bus (a hub in virtual time, SocketCAN, slcan; a recorder and a fault injector around any of them)
//!  ├─ canopen   reads and writes a joint's objects
//!  ├─ parameters  reads and writes a joint's whole set
//!  ├─ joint     is a joint: the firmware's own driver on a bus
//!  ├─ replay    plays a trace to a joint and holds every answer against the core, bit for bit
//!  └─ monitor   shows a joint to a person
//! ```
//!
//! Time is the bus's: a hub's is virtual, so that a minute of traffic takes milliseconds.

pub mod bus;
pub mod canopen;
pub mod joint;
#[cfg(feature = "monitor")]
pub mod monitor;
pub mod parameters;
pub mod replay;
