//! The tests of the firmware in one binary, because linking six takes longer than the tests of some of them.
//!
//! `cargo test -p firmware --test all X::` runs the tests of the file `X.rs` and of its folder.

mod closed_loop;
mod compact;
mod driver;
#[path = "../../../tests/message.rs"]
mod message;
#[path = "../../../tests/reference_network.rs"]
mod reference_network;
mod refusals;
#[path = "../../../tests/snapshot.rs"]
mod snapshot;
mod store;
mod supervisor;
mod update;
mod watch;
