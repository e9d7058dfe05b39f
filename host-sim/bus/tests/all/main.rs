//! The tests of the buses and of the client in one program, because each program links the libraries again.
//!
//! `cargo test -p joint-bus --test all X::` runs the tests of the file `X.rs`.

mod access;
mod bus;
mod bus_slcan;
mod bus_socketcan;
#[path = "../../../../tests/message.rs"]
mod message;
mod program_update;
#[path = "../../../../tests/reference_network.rs"]
mod reference_network;
mod sdo_blocks;
#[path = "../../../../tests/snapshot.rs"]
mod snapshot;
