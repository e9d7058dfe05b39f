//! An emulated STM32G474, or STM32G431 with the board B-G431B-ESC1, that executes the image of a joint driver.
//!
//! ```text
//!               Machine: instructions (Unicorn), exceptions, time in core cycles
//!                  |  reads and writes of registers
//!               Chip: TIM1, ADC, SPI, DMA, FDCAN, flash, watchdog, ...    one file each in chip/
//!                  |  counts, encoder words, duties, frames
//!               World: the joint (JointWorld), or constants in a test
//! ```
//! Unicorn executes the instructions. It has no exceptions, no time and no peripherals of this chip; they are here.
//! Time is counted in core cycles by `cycles`, whose assumptions are listed there. It advances by whole basic
//! blocks, so a register access may be off by the length of a block, and an interrupt is taken between two blocks.
//!
//! The registers follow the reference manual RM0440. A register that no peripheral here implements is plain memory.
//! What this cannot show, only a board can: see docs/src/how-to/bring-up.md.

#![cfg(feature = "unicorn")]

mod board_driver;
pub mod calls;
pub mod chip;
pub mod costs;
pub mod cycles;
mod error;
mod execution;
pub mod image;
mod joint_world;
pub mod machine;
pub mod nvic;
pub mod world;

pub use board_driver::{BoardDriver, HEAT_MEMORY, kept_heat, largest_stack_bytes, store_content};
pub use error::EmulatorError;
pub use image::Image;
pub use joint_world::JointWorld;
pub use machine::{Machine, StopReason};
