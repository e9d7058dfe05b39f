//! What the test boards share: runs whose output bits must agree with a PC's, and CAN over a serial line.
//!
//! The boards test the firmware's library where no STM32G474 is needed. `qemu-board` is the driver in the emulator, compared
//! with a PC bit by bit. `stm32f405-board` is a skeleton for another chip. `cost` counts instructions, and the images of
//! `footprint` differ by the core alone. None of them ships.
#![cfg_attr(not(test), no_std)]

pub mod fingerprint;
pub mod serial_bus;
