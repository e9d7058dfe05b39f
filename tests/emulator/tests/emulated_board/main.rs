//! The tests of the emulated board in one binary, because linking two takes longer than some of them.
#![cfg(feature = "unicorn")]

mod board;
mod common;
mod scenarios;
