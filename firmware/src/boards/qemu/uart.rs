//! The CMSDK UART of mps2-an386, byte by byte.
//!
//! It holds one byte each way. QEMU gives it the next byte when the last has been read, so none is ever lost;
//! it knows no baud rate, but sends and takes nothing without one. Both interrupts stay pending
//! in the NVIC until [`Uart::clear`]: they wake a core that waits with interrupts masked, and no handler runs.
#![allow(unsafe_code)] // Registers, and two lines of the NVIC.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

const UART0: usize = 0x4000_4000;
const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const INTERRUPTS: usize = 0x0C;
const DIVIDER: usize = 0x10;

const SENDING: u32 = 1 << 0;
const RECEIVED: u32 = 1 << 1;
const RECEIVED_TOO_LATE: u32 = 1 << 3;

const SEND: u32 = 1 << 0;
const RECEIVE: u32 = 1 << 1;
const TELL_SENT: u32 = 1 << 2;
const TELL_RECEIVED: u32 = 1 << 3;

const BOTH: u32 = 0b11;
/// The smallest the UART takes; 25 MHz / 16 = 1.56 Mbaud.
const FASTEST: u32 = 16;

#[derive(Clone, Copy)]
enum Line {
    Receive = 0,
    Transmit = 1,
}

// SAFETY: these are the numbers of UART0's lines on mps2-an386.
unsafe impl InterruptNumber for Line {
    fn number(self) -> u16 {
        self as u16
    }
}

/// UART0, on.
pub struct Uart {
    waits_to_send: bool,
}

impl Uart {
    /// Switches it on. To be called once.
    pub fn start() -> Self {
        write(DIVIDER, FASTEST);
        write(CONTROL, SEND | RECEIVE | TELL_RECEIVED);
        // SAFETY: no handler runs, interrupts are masked for good.
        unsafe {
            NVIC::unmask(Line::Receive);
            NVIC::unmask(Line::Transmit);
        }
        Self { waits_to_send: false }
    }

    /// Forgets the interrupts there were. To be called before the UART is looked at: what comes later
    /// is pending again, and a core that goes to sleep wakes at once.
    pub fn clear(&mut self) {
        NVIC::unpend(Line::Receive);
        NVIC::unpend(Line::Transmit);
        write(INTERRUPTS, BOTH);
    }

    /// The byte that came, if one did.
    pub fn receive(&mut self) -> Option<u8> {
        (read(STATE) & RECEIVED != 0).then(|| read(DATA) as u8)
    }

    /// Sends a byte; `false` where the last is still on its way.
    pub fn send(&mut self, byte: u8) -> bool {
        let free = read(STATE) & SENDING == 0;
        if free {
            write(DATA, u32::from(byte));
        }
        free
    }

    /// Whether to wake when a byte has been sent.
    pub fn wake_when_sent(&mut self, wake: bool) {
        if wake != self.waits_to_send {
            self.waits_to_send = wake;
            write(CONTROL, SEND | RECEIVE | TELL_RECEIVED | if wake { TELL_SENT } else { 0 });
        }
    }

    /// Whether a byte was lost since the last call.
    pub fn overrun(&mut self) -> bool {
        let lost = read(STATE) & RECEIVED_TOO_LATE != 0;
        if lost {
            write(STATE, RECEIVED_TOO_LATE);
        }
        lost
    }
}

fn read(register: usize) -> u32 {
    // SAFETY: a register of UART0; this module alone uses them.
    unsafe { ((UART0 + register) as *const u32).read_volatile() }
}

fn write(register: usize, value: u32) {
    // SAFETY: as above.
    unsafe { ((UART0 + register) as *mut u32).write_volatile(value) }
}
