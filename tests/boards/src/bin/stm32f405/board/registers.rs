//! Addresses of the registers that this board uses (RM0090). So few need no crate for the chip.
#![allow(unsafe_code)] // Only this file accesses registers.

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
    /// Set when the break input has opened the bridge.
    pub const BREAK_FLAG: u32 = 1 << 7;
    pub const MAIN_OUTPUT_ENABLE: u32 = 1 << 15;
}

/// Reads a register.
pub fn read(register: usize) -> u32 {
    // SAFETY: a register that always exists. Registers with read side effects have one owner.
    unsafe { (register as *const u32).read_volatile() }
}

/// Writes a register.
pub fn write(register: usize, value: u32) {
    // SAFETY: see `read`.
    unsafe { (register as *mut u32).write_volatile(value) }
}

/// Enables the clocks of the peripherals that this board uses.
pub fn start_clocks() {
    const ENABLE_APB1: usize = RCC + 0x40;
    const ENABLE_APB2: usize = RCC + 0x44;
    const TIM5_ENABLE: u32 = 1 << 3;
    const TIM1_AND_USART1_ENABLE: u32 = 1 << 0 | 1 << 4;
    write(ENABLE_APB1, read(ENABLE_APB1) | TIM5_ENABLE);
    write(ENABLE_APB2, read(ENABLE_APB2) | TIM1_AND_USART1_ENABLE);
}

/// The interrupts that this board uses.
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
