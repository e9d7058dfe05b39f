//! The tests of `friction-fit` in one binary, because linking each takes longer than most of the tests.
//!
//! `cargo test -p friction-fit --test all X::` runs the tests of the file `X.rs`.

mod coverage;
mod measured_figures;
#[path = "../../../../tests/message.rs"]
mod message;
#[path = "../../../../tests/snapshot.rs"]
mod snapshot;
mod trace;
