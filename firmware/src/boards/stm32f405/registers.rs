//! The registers this board writes, by their addresses (RM0090): no crate of the chip is needed for so few.
#![allow(unsafe_code)] // Registers; this file alone knows how to reach one.

use cortex_m::interrupt::InterruptNumber;

pub const TIM1: usize = 0x4001_0000;
pub const TIM5: usize = 0x4000_0C00;
pub const USART1: usize = 0x4001_1000;
const RCC: usize = 0x4002_3800;

/// Offsets of a timer's registers.
pub mod timer {
    pub const CONTROL: usize = 0x00;
    pub const STATUS: usize = 0x10;
    pub const COUNTER: usize = 0x24;
    pub const RELOAD: usize = 0x2C;
    pub const COMPARE_1: usize = 0x34;
    pub const BREAK: usize = 0x44;
    pub const ENABLE: u32 = 1 << 0;
    /// The break input has opened the bridge.
    pub const BROKE: u32 = 1 << 7;
    pub const OUTPUTS_ON: u32 = 1 << 15;
}

/// A register of this board's.
pub fn read(register: usize) -> u32 {
    // SAFETY: a register of a peripheral that is always there; those that reading changes are one owner's.
    unsafe { (register as *const u32).read_volatile() }
}

/// As [`read`].
pub fn write(register: usize, value: u32) {
    // SAFETY: as above.
    unsafe { (register as *mut u32).write_volatile(value) }
}

/// Gives the peripherals of this board their clock.
pub fn start_clocks() {
    const ENABLE_APB1: usize = RCC + 0x40;
    const ENABLE_APB2: usize = RCC + 0x44;
    const ONLY_TIM5: u32 = 1 << 3;
    const TIM1_AND_USART1: u32 = 1 << 0 | 1 << 4;
    write(ENABLE_APB1, read(ENABLE_APB1) | ONLY_TIM5);
    write(ENABLE_APB2, read(ENABLE_APB2) | TIM1_AND_USART1);
}

/// The interrupts that are somebody's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    Serial = 37,
}

// SAFETY: the number of USART1 (RM0090, table 62; the same on the STM32F446).
unsafe impl InterruptNumber for Line {
    fn number(self) -> u16 {
        self as u16
    }
}
