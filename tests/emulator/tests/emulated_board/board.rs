//! The image on the emulated board: its start, a course in closed loop, and what its interrupts cost.
//!
//! `FIRMWARE_IMAGE` names another image, as for the mutations of `tests/emulator/run`.

mod access;
mod board_bus;
mod bus;
mod compact;
mod compact_cost;
mod cost;
mod course;
mod drift;
mod dry_side;
mod flood;
mod interruptions;
mod pdo_timing;
mod peripherals;
mod power_cut;
mod pressure;
mod resets;
mod scope;
mod second_wiring;
mod slots;
mod start;
mod tuning;
mod update;
