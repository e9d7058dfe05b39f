//! The image on the emulated board: its start, a course in closed loop, and what its interrupts cost.
//!
//! `FIRMWARE_IMAGE` names another image, as for the mutations of `tests/emulator/run`.

mod access;
mod bits;
mod board_bus;
mod bus;
mod compact;
mod compact_cost;
mod core_bits;
mod core_cost;
mod cost;
mod course;
mod drift;
mod dry_side;
mod flood;
mod hil_course;
mod interruptions;
mod log;
mod parameters;
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
