//! FDCAN1: registers, message RAM, filters, receive FIFO 0 and transmit FIFO (RM0440, 44). Its bus is in [`bus`].

mod bus;

pub use bus::BusFailure;
use bus::{Arriving, ErrorCounters, Outgoing, Sending};
use compensator_core::can::{FdTelemetry, Frame};
use std::collections::VecDeque;

const BASE: u32 = 0x4000_6400;
const RAM: u32 = 0x4000_A400;
const RAM_WORDS: usize = 0xC00 / 4;

const CREL: u32 = 0x00;
const ENDN: u32 = 0x04;
const DBTP: u32 = 0x0C;
const CCCR: u32 = 0x18;
const TDCR: u32 = 0x48;
const ECR: u32 = 0x40;
const PSR: u32 = 0x44;
const IR: u32 = 0x50;
const IE: u32 = 0x54;
const ILS: u32 = 0x58;
const ILE: u32 = 0x5C;
const RXGFC: u32 = 0x80;
const RXF0S: u32 = 0x90;
const RXF0A: u32 = 0x94;
const TXBC: u32 = 0xC0;
const TXFQS: u32 = 0xC4;
const TXBRP: u32 = 0xC8;
const TXBAR: u32 = 0xCC;
const TXBTO: u32 = 0xD4;

/// Transmit queue mode.
const QUEUE_MODE: u32 = 1 << 24;
const INIT: u32 = 1;
const FD_OPERATION: u32 = 1 << 8;
const RATE_SWITCHING: u32 = 1 << 9;
const NEW_MESSAGE: u32 = 1;
const FIFO_FULL: u32 = 1 << 1;
const MESSAGE_LOST: u32 = 1 << 2;
const TRANSMITTED: u32 = 1 << 7;
/// Remote frames with identifiers of eleven bits are rejected.
const REJECT_REMOTE: u32 = 1 << 1;
const BUS_OFF: u32 = 1 << 7;
/// Content of PSR without an error.
const NO_LAST_ERROR: u32 = 0x707;

/// Words of an element, and of its header; first words in the message RAM.
const ELEMENT_WORDS: usize = 18;
const FIFO_0: usize = 0xB0 / 4;
const TRANSMIT: usize = 0x278 / 4;
const ELEMENTS: usize = 3;

/// The controller and its bus.
#[derive(Clone, Debug)]
pub struct Fdcan {
    registers: [u32; 128],
    ram: Vec<u32>,
    /// Places of the receive FIFO: number of frames, and the oldest.
    filled: usize,
    oldest: usize,
    /// Transmit elements that wait, oldest first.
    waiting: VecDeque<usize>,
    on_bus: Option<Sending>,
    /// Frames that others send.
    arriving: VecDeque<Arriving>,
    /// End of the first of them, if it is on the bus, cycles.
    arrival: Option<u64>,
    /// Time from which the bus is free, cycles.
    bus_free: u64,
    errors: ErrorCounters,
    recovers_at: Option<u64>,
    /// Both pins have the controller's signals.
    is_connected: bool,
    /// Number of times that the node went bus-off.
    pub bus_offs: u32,
    /// Share of the frames that bit errors destroy, from 0 to 1.
    pub destroyed_share: f64,
    random: u64,
    /// Classic frames that the driver has sent, with their end, and those in its frames of CAN FD.
    pub sent: VecDeque<(u64, Frame)>,
    /// Frames of CAN FD that the driver has sent, with their end.
    pub sent_fd: VecDeque<(u64, FdTelemetry)>,
    /// End and identifier of the last frames that the driver may have received.
    pub arrived: VecDeque<(u64, u16)>,
}

impl Default for Fdcan {
    fn default() -> Self {
        let mut registers = [0; 128];
        registers[CREL as usize / 4] = 0x3214_1218;
        registers[ENDN as usize / 4] = 0x8765_4321;
        registers[CCCR as usize / 4] = INIT;
        registers[PSR as usize / 4] = NO_LAST_ERROR;
        Self {
            registers,
            ram: vec![0; RAM_WORDS],
            filled: 0,
            oldest: 0,
            waiting: VecDeque::new(),
            on_bus: None,
            arriving: VecDeque::new(),
            arrival: None,
            bus_free: 0,
            errors: ErrorCounters::default(),
            recovers_at: None,
            is_connected: false,
            bus_offs: 0,
            destroyed_share: 0.0,
            random: 1,
            sent: VecDeque::new(),
            sent_fd: VecDeque::new(),
            arrived: VecDeque::new(),
        }
    }
}

impl Fdcan {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    /// Connects the controller to its pins, or separates it from them.
    pub fn set_connected(&mut self, is_connected: bool) {
        self.is_connected = is_connected;
    }

    fn flag(&mut self, flags: u32) {
        self.registers[IR as usize / 4] |= flags;
    }

    fn is_running(&self) -> bool {
        let is_off = self.register(PSR) & BUS_OFF != 0;
        self.is_connected && self.register(CCCR) & INIT == 0 && !is_off
    }

    /// Returns the frame of a transmit element; `None` if it is neither a classic frame of eleven bits nor telemetry of
    /// CAN FD with switched bit rate, or if the controller may not send that.
    fn outgoing(&self, element: usize) -> Option<Outgoing> {
        let words = &self.ram[TRANSMIT + ELEMENT_WORDS * element..];
        let (head, second) = (words[0], words[1]);
        if head >> 30 & 1 == 1 {
            return None;
        }
        let is_fd = second >> 21 & 1 == 1;
        if is_fd {
            let needed = FD_OPERATION | RATE_SWITCHING;
            let bytes: Vec<u8> =
                words[2..ELEMENT_WORDS].iter().flat_map(|word| word.to_le_bytes()).collect();
            let is_whole = second >> 16 & 0x1F == 0x1F;
            let frame = FdTelemetry::parse((head >> 18) as u16 & 0x7FF, &bytes);
            return frame
                .filter(|_| is_whole && self.register(CCCR) & needed == needed)
                .map(Outgoing::Fd);
        }
        let length = (second >> 16 & 0xF).min(8) as usize;
        let bytes: Vec<u8> = words[2..4].iter().flat_map(|word| word.to_le_bytes()).collect();
        Frame::new((head >> 18) as u16 & 0x7FF, &bytes[..length]).map(Outgoing::Classic)
    }

    /// Returns true if a filter accepts the identifier into FIFO 0.
    fn accepts(&self, identifier: u32) -> bool {
        let settings = self.register(RXGFC);
        let count = (settings >> 16 & 0x1F) as usize;
        for word in &self.ram[..count] {
            let (first, second) = (word >> 16 & 0x7FF, word & 0x7FF);
            let action = word >> 27 & 7;
            if action == 0 {
                continue;
            }
            let matches = match word >> 30 {
                0 => (first..=second).contains(&identifier),
                1 => identifier == first || identifier == second,
                2 => identifier & second == first & second,
                _ => false,
            };
            if matches {
                return action == 1;
            }
        }
        settings >> 4 & 3 == 0
    }

    fn receive(&mut self, frame: &Frame, is_remote: bool) {
        let is_rejected = is_remote && self.register(RXGFC) & REJECT_REMOTE != 0;
        if is_rejected || !self.accepts(u32::from(frame.identifier())) {
            return;
        }
        if self.filled == ELEMENTS {
            return self.flag(MESSAGE_LOST);
        }
        let place = (self.oldest + self.filled) % ELEMENTS;
        let words = &mut self.ram[FIFO_0 + ELEMENT_WORDS * place..];
        let mut bytes = [0; 8];
        bytes[..frame.data().len()].copy_from_slice(frame.data());
        words[0] = u32::from(frame.identifier()) << 18 | u32::from(is_remote) << 29;
        words[1] = (frame.data().len() as u32) << 16;
        words[2] = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        words[3] = u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]);
        self.filled += 1;
        self.flag(NEW_MESSAGE | if self.filled == ELEMENTS { FIFO_FULL } else { 0 });
    }

    /// Returns true if this interrupt line is high. The groups of ILS: bit 0 covers FIFO 0, bit 3 transmission.
    pub fn line(&self, number: u32) -> bool {
        const GROUPS: [u32; 7] = [0x7, 0x38, 0x1C0, 0x1E00, 0x1E000, 0x60000, 0xF80000];
        let active = self.register(IR) & self.register(IE);
        let select = self.register(ILS);
        let on_line = GROUPS
            .iter()
            .enumerate()
            .any(|(group, flags)| select >> group & 1 == number && active & flags != 0);
        on_line && self.register(ILE) >> number & 1 == 1
    }

    /// Reads a register or the message RAM, by address.
    pub fn read(&self, address: u32) -> u32 {
        if address >= RAM {
            return self.ram.get((address - RAM) as usize / 4).copied().unwrap_or(0);
        }
        let offset = address - BASE;
        match offset {
            RXF0S => {
                let put = (self.oldest + self.filled) % ELEMENTS;
                let full = u32::from(self.filled == ELEMENTS);
                self.filled as u32 | (self.oldest as u32) << 8 | (put as u32) << 16 | full << 24
            }
            TXFQS => {
                let free = ELEMENTS - self.waiting.len();
                let put = (0..ELEMENTS).find(|place| !self.waiting.contains(place));
                free as u32 | (put.unwrap_or(0) as u32) << 16 | u32::from(free == 0) << 21
            }
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Stores a word in a register or in the message RAM, by address.
    fn store(&mut self, address: u32, word: u32) {
        if address >= RAM {
            if let Some(place) = self.ram.get_mut((address - RAM) as usize / 4) {
                *place = word;
            }
            return;
        }
        let offset = address - BASE;
        let place = offset as usize / 4;
        match offset {
            CREL | ENDN | RXF0S | TXFQS | TXBRP | PSR => {}
            IR => self.registers[place] &= !word,
            RXF0A => {
                if self.filled > 0 {
                    self.filled -= 1;
                    self.oldest = (self.oldest + 1) % ELEMENTS;
                }
            }
            TXBAR => {
                for element in (0..ELEMENTS).filter(|element| word >> element & 1 == 1) {
                    if !self.waiting.contains(&element) {
                        self.waiting.push_back(element);
                        self.registers[TXBRP as usize / 4] |= 1 << element;
                        self.registers[TXBTO as usize / 4] &= !(1 << element);
                    }
                }
            }
            _ => {
                if let Some(register) = self.registers.get_mut(place) {
                    *register = word;
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "fdcan_tests.rs"]
mod tests;
