//! The tests of the diagnosis on logs with a known truth, in one program.
//!
//! `cargo test -p friction-grading --test all X::` runs the tests of the file `X.rs`.

mod adverse_worlds;
mod calibrated_rule;
mod contest_table;
mod gear_play;
mod hidden_effects;
#[path = "../../../../tests/message.rs"]
mod message;
mod planted;
mod recovery;
mod scenarios;
#[path = "../../../../tests/snapshot.rs"]
mod snapshot;

/// Returns true if the tests run in their long form.
pub fn is_long() -> bool {
    std::env::var_os("LONG_TESTS").is_some()
}
