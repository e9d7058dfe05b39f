//! The tests of the core in one program, because each program links the library again.
//!
//! `cargo test -p compensator-core --test all X::` runs the tests of the file `X.rs`.

// Its table has the factors of a network.
#[cfg(feature = "network")]
mod accuracy;
mod bounds;
mod compensator;
mod dbc;
mod fingerprint;
mod fixed;
mod refusals;
mod stability;
mod support;
mod terms;
