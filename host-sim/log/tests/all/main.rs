//! The tests of `joint-log` in one binary, because linking each takes longer than most of the tests.
//!
//! `cargo test -p joint-log --test all X::` runs the tests of the file `X.rs`.

#[cfg(feature = "arrow")]
mod data_arrow;
mod data_clock;
mod data_columns;
mod data_forms;
mod data_garbage;
mod data_join;
mod data_measured;
#[cfg(feature = "parquet")]
mod data_parquet;
mod data_proposals;
mod data_reading;
mod drive_trace;
mod filtered_velocity;
mod folder;
#[path = "../../../../tests/message.rs"]
mod message;
mod motion;
#[path = "../../../../tests/snapshot.rs"]
mod snapshot;
mod torque_against_motion;
