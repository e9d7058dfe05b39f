//! The CMSDK UART of mps2-an386, byte by byte.
//!
//! It holds one byte in each direction. QEMU delivers the next byte when the last one was read, so none is
//! lost. It has no real baud rate, but needs one set to transfer. Both interrupts stay pending in the NVIC
//! until [`Uart::clear`]: they wake a core that waits with masked interrupts, and no handler runs.
#![allow(unsafe_code)] // Accesses registers and two lines of the NVIC.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

const UART0: usize = 0x4000_4000;
const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const INTERRUPT_STATUS: usize = 0x0C;
const DIVIDER: usize = 0x10;

const TRANSMITTER_FULL: u32 = 1 << 0;
const RECEIVER_FULL: u32 = 1 << 1;
const OVERRUN: u32 = 1 << 3;

const ENABLE_TRANSMITTER: u32 = 1 << 0;
const ENABLE_RECEIVER: u32 = 1 << 1;
const SENT_INTERRUPT: u32 = 1 << 2;
const RECEIVED_INTERRUPT: u32 = 1 << 3;

const BOTH_INTERRUPTS: u32 = 0b11;
/// Minimum divider of the UART: 25 MHz / 16 = 1.56 Mbaud.
const MIN_DIVIDER: u32 = 16;

#[derive(Clone, Copy)]
enum Line {
    Receive = 0,
    Transmit = 1,
}

// SAFETY: the interrupt numbers of UART0 on mps2-an386.
unsafe impl InterruptNumber for Line {
    fn number(self) -> u16 {
        self as u16
    }
}

/// UART0, enabled.
pub struct Uart {
    waits_to_send: bool,
}

impl Uart {
    /// Enables the UART. Call it once.
    pub fn start() -> Self {
        write(DIVIDER, MIN_DIVIDER);
        write(CONTROL, ENABLE_TRANSMITTER | ENABLE_RECEIVER | RECEIVED_INTERRUPT);
        // SAFETY: no handler runs, because interrupts stay masked.
        unsafe {
            NVIC::unmask(Line::Receive);
            NVIC::unmask(Line::Transmit);
        }
        Self { waits_to_send: false }
    }

    /// Clears pending interrupts. Call it before the UART is read: later events are pending again and wake
    /// a sleeping core at once.
    pub fn clear(&mut self) {
        NVIC::unpend(Line::Receive);
        NVIC::unpend(Line::Transmit);
        write(INTERRUPT_STATUS, BOTH_INTERRUPTS);
    }

    /// Returns the received byte, if there is one.
    pub fn receive(&mut self) -> Option<u8> {
        (read(STATE) & RECEIVER_FULL != 0).then(|| read(DATA) as u8)
    }

    /// Sends a byte; returns false if the previous one is still being sent.
    pub fn send(&mut self, byte: u8) -> bool {
        let free = read(STATE) & TRANSMITTER_FULL == 0;
        if free {
            write(DATA, u32::from(byte));
        }
        free
    }

    /// Sets whether a sent byte wakes the core.
    pub fn wake_when_sent(&mut self, wake: bool) {
        if wake != self.waits_to_send {
            self.waits_to_send = wake;
            write(
                CONTROL,
                ENABLE_TRANSMITTER
                    | ENABLE_RECEIVER
                    | RECEIVED_INTERRUPT
                    | if wake { SENT_INTERRUPT } else { 0 },
            );
        }
    }

    /// Returns true if a byte was lost since the last call.
    pub fn overrun(&mut self) -> bool {
        let lost = read(STATE) & OVERRUN != 0;
        if lost {
            write(STATE, OVERRUN);
        }
        lost
    }
}

fn read(register: usize) -> u32 {
    // SAFETY: a register of UART0; only this module uses them.
    unsafe { ((UART0 + register) as *const u32).read_volatile() }
}

fn write(register: usize, value: u32) {
    // SAFETY: as above.
    unsafe { ((UART0 + register) as *mut u32).write_volatile(value) }
}
