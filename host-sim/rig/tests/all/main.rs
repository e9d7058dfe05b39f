//! The tests of the rig in one program, because each program links the libraries again.
//!
//! `cargo test -p joint-rig --test all X::` runs the tests of `X`.

mod armed_joint;
#[path = "../closed_loop/main.rs"]
mod closed_loop;
mod compact;
mod drawn_joint;
mod fd_telemetry;
mod start_values;
