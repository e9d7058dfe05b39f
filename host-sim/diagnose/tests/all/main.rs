//! The tests of `friction-diagnose` in one binary, because linking each takes longer than most of the tests.
//!
//! `cargo test -p friction-diagnose --test all X::` runs the tests of the file `X.rs`.

mod awkward_machines;
mod cancellation;
mod log_check;
mod measured_diagnosis;
mod tables;
