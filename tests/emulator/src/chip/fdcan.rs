//! FDCAN1: message RAM, filters, receive FIFO 0, transmit FIFO, and a bus of its own (RM0440, 44).
//!
//! A frame occupies the bus for its bits at 1 Mbit/s, with a stuff bit in ten, and those of CAN FD data at their own rate. Where
//! several wait, the lowest identifier wins. A share of the frames may be destroyed by bit errors: they are repeated, and the
//! error counters rise as ISO 11898-1 states, to error passive and bus-off. Frames of others are never lost.
//!
//! A sender compares the bits of its data with those on the bus, which show them after the way through the transceiver. If it
//! looks before, the frame is a bit error. It looks later by the measured delay if it compensates the delay (TDC).

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
const ERROR_PASSIVE: u32 = 1 << 5;

const DELAY_COMPENSATED: u32 = 1 << 23;
/// Way through the transceiver and back (ISO 11898-2: 255 ns at most), cycles.
const TRANSCEIVER_CYCLES: u64 = 43;
/// Largest prescaler with which the delay is measured (RM0440, 44.3.3).
const LAST_COMPENSATED_PRESCALER: u64 = 2;

/// Words of an element, and of its header; first words in the message RAM.
const ELEMENT_WORDS: usize = 18;
const FIFO_0: usize = 0xB0 / 4;
const TRANSMIT: usize = 0x278 / 4;
const ELEMENTS: usize = 3;

/// Bits of an error frame with the pause after it.
const ERROR_BITS: u64 = 23;
/// Error counters: a bad frame of the node's own, and the limits of error passive and bus-off.
const TRANSMIT_ERROR: u32 = 8;
const PASSIVE_ABOVE: u32 = 127;
const OFF_ABOVE: u32 = 255;
/// Bits of a recovery from bus-off.
const RECOVERY_BITS: u64 = 128 * 11;

/// Number of frames of others whose end is known.
const ARRIVED_FRAMES: usize = 32;

/// Core cycles of a bit at 1 Mbit/s.
const BIT_CYCLES: u64 = 170;

/// The controller and its bus.
#[derive(Clone, Debug)]
pub struct Fdcan {
    registers: [u32; 128],
    ram: Vec<u32>,
    /// Places of the receive FIFO: number of frames, and the oldest.
    filled: usize,
    oldest: usize,
    /// Transmit elements that wait, oldest first, and the one on the bus with its end.
    waiting: VecDeque<usize>,
    on_bus: Option<(u64, usize)>,
    /// Frames that others send.
    arriving: VecDeque<Arriving>,
    arrival: Option<u64>,
    bus_free: u64,
    /// Error counters: transmit, receive.
    errors: [u32; 2],
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

/// A frame that others send.
#[derive(Clone, Debug)]
struct Arriving {
    /// Its earliest start, cycles.
    from: u64,
    frame: Frame,
    is_remote: bool,
}

/// A frame in a transmit element.
enum Outgoing {
    Classic(Frame),
    Fd(FdTelemetry),
}

impl Outgoing {
    fn identifier(&self) -> u16 {
        match self {
            Self::Classic(frame) => frame.identifier(),
            Self::Fd(frame) => frame.identifier(),
        }
    }
}

impl Default for Fdcan {
    fn default() -> Self {
        let mut registers = [0; 128];
        registers[CREL as usize / 4] = 0x3214_1218;
        registers[ENDN as usize / 4] = 0x8765_4321;
        registers[CCCR as usize / 4] = INIT;
        registers[PSR as usize / 4] = 0x707;
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
            errors: [0; 2],
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

fn frame_cycles(frame: &Frame) -> u64 {
    let bits = 47 + 8 * frame.data().len() as u64;
    (bits + bits / 10) * BIT_CYCLES
}

impl Fdcan {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    /// Connects the controller to its pins, or separates it from them.
    pub fn set_connected(&mut self, is_connected: bool) {
        self.is_connected = is_connected;
    }

    /// Prescaler of CAN FD data, and cycles of a bit up to its sample point and in all.
    fn data_timing(&self) -> (u64, u64, u64) {
        let timing = u64::from(self.register(DBTP));
        let prescaler = 1 + (timing >> 16 & 0x1F);
        let before = 2 + (timing >> 8 & 0x1F);
        (prescaler, prescaler * before, prescaler * (before + 1 + (timing >> 4 & 0xF)))
    }

    /// Returns the bit rate of the data of CAN FD frames that the controller can follow, bit/s; `None` if it would
    /// destroy them.
    pub fn data_bit_rate(&self) -> Option<u64> {
        let (_, _, cycles) = self.data_timing();
        (self.register(CCCR) & FD_OPERATION != 0).then(|| BIT_CYCLES * 1_000_000 / cycles)
    }

    /// Returns true if the controller finds the bits of its own CAN FD data on the bus.
    fn finds_own_data(&self) -> bool {
        let (prescaler, sample, bit) = self.data_timing();
        if self.register(DBTP) & DELAY_COMPENSATED == 0 {
            return sample > TRANSCEIVER_CYCLES;
        }
        // The second sample point is behind the measured delay by its offset, and must be in the same bit.
        let offset = u64::from(self.register(TDCR) >> 8 & 0x7F);
        prescaler <= LAST_COMPENSATED_PRESCALER && (1..bit).contains(&offset)
    }

    fn flag(&mut self, flags: u32) {
        self.registers[IR as usize / 4] |= flags;
    }

    fn is_running(&self) -> bool {
        let is_off = self.register(PSR) & BUS_OFF != 0;
        self.is_connected && self.register(CCCR) & INIT == 0 && !is_off
    }

    /// Sends a frame to the node, from this time on.
    pub fn deliver(&mut self, frame: Frame, now: u64) {
        self.arriving.push_back(Arriving { from: now, frame, is_remote: false });
        self.begin_next(now);
    }

    /// Sends a remote frame, which requests that of an identifier.
    pub fn deliver_remote(&mut self, frame: Frame, now: u64) {
        self.arriving.push_back(Arriving { from: now, frame, is_remote: true });
        self.begin_next(now);
    }

    /// Returns the number of frames of others on the bus and waiting for it.
    pub fn waiting_frames(&self) -> usize {
        self.arriving.len()
    }

    /// Makes the controller leave the bus, or become passive, by its count of errors: frames of others do not end it.
    pub fn count_errors(&mut self, is_off: bool) {
        /// More than the frames of a millisecond take off.
        const MORE: u32 = 100;
        self.errors[0] = if is_off { OFF_ABOVE } else { PASSIVE_ABOVE } + MORE;
        self.show_errors();
    }

    /// Sets the error state: bus-off, or passive.
    pub fn set_errors(&mut self, is_off: bool, is_passive: bool) {
        let place = PSR as usize / 4;
        let was_off = self.registers[place] & BUS_OFF != 0;
        self.registers[place] =
            0x707 | if is_off { BUS_OFF } else { 0 } | if is_passive { ERROR_PASSIVE } else { 0 };
        if is_off && !was_off {
            self.bus_offs += 1;
            self.registers[CCCR as usize / 4] |= INIT;
        }
        self.registers[ECR as usize / 4] = if is_off { 248 } else { 0 };
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        let sending = self.on_bus.map_or(u64::MAX, |(end, _)| end);
        let recovery = self.recovers_at.unwrap_or(u64::MAX);
        sending.min(self.arrival.unwrap_or(u64::MAX)).min(recovery)
    }

    /// Transmit element that is next: the oldest, or in queue mode that of the lowest identifier, and of equal ones the
    /// first.
    fn next_element(&self) -> Option<usize> {
        if self.register(TXBC) & QUEUE_MODE == 0 {
            return self.waiting.front().copied();
        }
        let identifier =
            |element: usize| self.ram[TRANSMIT + ELEMENT_WORDS * element] >> 18 & 0x7FF;
        self.waiting.iter().copied().min_by_key(|element| (identifier(*element), *element))
    }

    /// Starts what is next on the bus, if it is free: of those that wait, the lowest identifier.
    fn begin_next(&mut self, now: u64) {
        if self.on_bus.is_some() || self.arrival.is_some() {
            return;
        }
        let waiting = self.next_element().filter(|_| self.is_running());
        let waiting = waiting.and_then(|element| Some((element, self.outgoing(element)?)));
        let start = now.max(self.bus_free);
        self.sort_arriving(start);
        let arrives = self.arriving.front();
        let others_win = match (&waiting, arrives) {
            (_, None) => false,
            (None, Some(_)) => true,
            (Some((_, waiting)), Some(other)) => {
                other.from <= start && other.frame.identifier() < waiting.identifier()
            }
        };
        if others_win && let Some(Arriving { from, frame, .. }) = arrives {
            self.arrival = Some(start.max(*from) + frame_cycles(frame));
        } else if let Some((element, frame)) = waiting {
            let cycles = match &frame {
                Outgoing::Classic(frame) => frame_cycles(frame),
                Outgoing::Fd(_) => self.fd_cycles(),
            };
            self.on_bus = Some((start + cycles, element));
        }
    }

    /// Puts the frame of the others that is next on the bus first: the lowest identifier of those that wait.
    fn sort_arriving(&mut self, start: u64) {
        let waits = self.arriving.iter().enumerate().filter(|(_, other)| other.from <= start);
        let lowest = waits.min_by_key(|(at, other)| (other.frame.identifier(), *at));
        let lowest = lowest.map(|(at, _)| at);
        if let Some(frame) = lowest.and_then(|at| self.arriving.remove(at)) {
            self.arriving.push_front(frame);
        }
    }

    /// Ends the frames that are due.
    pub fn process(&mut self, now: u64) {
        if self.recovers_at.is_some_and(|at| at <= now) {
            self.recovers_at = None;
            self.errors = [0; 2];
            self.show_errors();
        }
        while self.on_bus.is_some_and(|(end, _)| end <= now)
            || self.arrival.is_some_and(|end| end <= now)
        {
            let is_destroyed = self.is_destroyed();
            if let Some((end, element)) = self.on_bus.take() {
                let is_fd = matches!(self.outgoing(element), Some(Outgoing::Fd(_)));
                let is_lost = is_fd && !self.finds_own_data();
                self.finish_transmission(end, element, is_destroyed || is_lost);
            } else if let Some(end) = self.arrival.take() {
                self.finish_other(end, is_destroyed);
            }
            self.begin_next(self.bus_free);
        }
        self.begin_next(now);
    }

    fn is_destroyed(&mut self) -> bool {
        // A linear congruential generator (Knuth): its upper bits are random enough.
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.random >> 33) as f64) < self.destroyed_share * f64::from(1u32 << 31)
    }

    fn finish_transmission(&mut self, end: u64, element: usize, is_destroyed: bool) {
        if is_destroyed {
            self.errors[0] += TRANSMIT_ERROR;
            self.bus_free = end + ERROR_BITS * BIT_CYCLES;
            return self.show_errors();
        }
        self.errors[0] = self.errors[0].saturating_sub(1);
        self.bus_free = end;
        self.waiting.retain(|waiting| *waiting != element);
        match self.outgoing(element) {
            Some(Outgoing::Classic(frame)) => self.sent.push_back((end, frame)),
            Some(Outgoing::Fd(frame)) => {
                self.sent.extend(frame.frames().map(|classic| (end, classic)));
                self.sent_fd.push_back((end, frame));
            }
            None => {}
        }
        self.registers[TXBRP as usize / 4] &= !(1 << element);
        self.registers[TXBTO as usize / 4] |= 1 << element;
        self.flag(TRANSMITTED);
        self.show_errors();
    }

    fn finish_other(&mut self, end: u64, is_destroyed: bool) {
        if is_destroyed {
            self.errors[1] += 1;
            self.bus_free = end + ERROR_BITS * BIT_CYCLES;
            return self.show_errors();
        }
        self.errors[1] = self.errors[1].saturating_sub(1);
        self.bus_free = end;
        if let Some(Arriving { frame, is_remote, .. }) = self.arriving.pop_front()
            && self.is_running()
        {
            self.arrived.truncate(ARRIVED_FRAMES - 1);
            self.arrived.push_front((end, frame.identifier()));
            self.receive(&frame, is_remote);
        }
        self.show_errors();
    }

    /// Shows the error counters in the registers. Bus-off stops the node.
    fn show_errors(&mut self) {
        let is_off = self.errors[0] > OFF_ABOVE;
        self.set_errors(is_off, self.errors.iter().any(|&count| count > PASSIVE_ABOVE));
    }

    /// Returns the duration of a frame of CAN FD with 64 bytes: bits of the arbitration and the end at 1 Mbit/s; the others,
    /// with a stuff bit in ten, at their own rate.
    fn fd_cycles(&self) -> u64 {
        let data_rate = self.data_bit_rate().unwrap_or(1_000_000);
        let bits = 5 + 8 * 64;
        let data_bits = bits + bits / 10 + 4 + 21 + 7;
        30 * BIT_CYCLES + data_bits * BIT_CYCLES * 1_000_000 / data_rate
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

    /// Writes a register or the message RAM, by address.
    pub fn write(&mut self, address: u32, word: u32, now: u64) {
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
                self.begin_next(now);
            }
            _ => {
                if let Some(register) = self.registers.get_mut(place) {
                    *register = word;
                }
            }
        }
        if offset == CCCR {
            let is_off = self.register(PSR) & BUS_OFF != 0;
            if is_off && word & INIT == 0 && self.recovers_at.is_none() {
                self.recovers_at = Some(now + RECOVERY_BITS * BIT_CYCLES);
            }
            self.begin_next(now);
        }
    }
}

#[cfg(test)]
#[path = "fdcan_tests.rs"]
mod tests;
