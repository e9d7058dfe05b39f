//! The bus of the controller: arbitration, the time of each frame, bit errors and their counters.
//!
//! A frame occupies the bus for its bits at 1 Mbit/s, with a stuff bit in ten, and those of CAN FD data at their own rate. Where
//! several wait, the lowest identifier wins. A share of the frames may be destroyed by bit errors: they are repeated, and the
//! error counters rise as ISO 11898-1 states, to error passive and bus-off. Frames of others are never lost.
//!
//! A sender compares the bits of its data with those on the bus, which show them after the way through the transceiver. If it
//! looks before, the frame is a bit error. It looks later by the measured delay if it compensates the delay (TDC).

use super::{
    BASE, BUS_OFF, CCCR, DBTP, ECR, ELEMENT_WORDS, FD_OPERATION, Fdcan, INIT, NO_LAST_ERROR, PSR,
    QUEUE_MODE, TDCR, TRANSMIT, TRANSMITTED, TXBAR, TXBC, TXBRP, TXBTO,
};
use compensator_core::can::{FdTelemetry, Frame};

const ERROR_PASSIVE: u32 = 1 << 5;

pub(super) const DELAY_COMPENSATED: u32 = 1 << 23;
/// Way through the transceiver and back (ISO 11898-2: 255 ns at most), cycles.
const TRANSCEIVER_CYCLES: u64 = 43;
/// Largest prescaler with which the delay is measured (RM0440, 44.3.3).
const LAST_COMPENSATED_PRESCALER: u64 = 2;

/// Bits of an error frame with the pause after it.
const ERROR_BITS: u64 = 23;
/// Error counters: a bad frame of the node's own, and the limits of error passive and bus-off.
const TRANSMIT_ERROR: u32 = 8;
const PASSIVE_ABOVE: u32 = 127;
const OFF_ABOVE: u32 = 255;
/// Time of a recovery from bus-off, cycles: 128 times 11 bits.
const RECOVERY_CYCLES: u64 = 128 * 11 * BIT_CYCLES;

/// Number of frames of others whose end is known.
const ARRIVED_FRAMES: usize = 32;

/// Core cycles of a bit at 1 Mbit/s.
const BIT_CYCLES: u64 = 170;

/// What many bad frames make of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusFailure {
    /// The node may not signal errors to others.
    Passive,
    /// The node has left the bus.
    Off,
}

/// A frame of the driver on the bus: its end, and the transmit element that holds it.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    end: u64,
    element: usize,
}

/// Error counters of the controller.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ErrorCounters {
    transmit: u32,
    receive: u32,
}

/// Timing of CAN FD data.
struct DataTiming {
    /// Core cycles of a time quantum.
    prescaler: u64,
    /// Core cycles of a bit up to its sample point.
    sample_cycles: u64,
    /// Core cycles of a bit.
    bit_cycles: u64,
}

/// A frame that others send.
#[derive(Clone, Debug)]
pub(super) struct Arriving {
    /// Its earliest start, cycles.
    from: u64,
    frame: Frame,
    is_remote: bool,
}

/// A frame in a transmit element.
pub(super) enum Outgoing {
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

fn frame_cycles(frame: &Frame) -> u64 {
    let bits = 47 + 8 * frame.data().len() as u64;
    (bits + bits / 10) * BIT_CYCLES
}

impl Fdcan {
    /// Timing of CAN FD data.
    fn data_timing(&self) -> DataTiming {
        let timing = u64::from(self.register(DBTP));
        let prescaler = 1 + (timing >> 16 & 0x1F);
        let before = 2 + (timing >> 8 & 0x1F);
        DataTiming {
            prescaler,
            sample_cycles: prescaler * before,
            bit_cycles: prescaler * (before + 1 + (timing >> 4 & 0xF)),
        }
    }

    /// Returns the bit rate of the data of CAN FD frames that the controller can follow, bit/s; `None` if it would
    /// destroy them.
    pub fn data_bit_rate(&self) -> Option<u64> {
        let cycles = self.data_timing().bit_cycles;
        (self.register(CCCR) & FD_OPERATION != 0).then(|| BIT_CYCLES * 1_000_000 / cycles)
    }

    /// Returns true if the controller finds the bits of its own CAN FD data on the bus.
    pub(super) fn finds_own_data(&self) -> bool {
        let DataTiming { prescaler, sample_cycles, bit_cycles } = self.data_timing();
        if self.register(DBTP) & DELAY_COMPENSATED == 0 {
            return sample_cycles > TRANSCEIVER_CYCLES;
        }
        // The second sample point is behind the measured delay by its offset, and must be in the same bit.
        let offset = u64::from(self.register(TDCR) >> 8 & 0x7F);
        prescaler <= LAST_COMPENSATED_PRESCALER && (1..bit_cycles).contains(&offset)
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

    /// Counts errors as after many of the node's own bad frames: the controller is passive, or off the bus. Frames of others
    /// do not end it.
    pub fn count_errors(&mut self, failure: BusFailure) {
        /// More than the frames of a millisecond take off.
        const MORE: u32 = 100;
        self.errors.transmit = MORE
            + match failure {
                BusFailure::Passive => PASSIVE_ABOVE,
                BusFailure::Off => OFF_ABOVE,
            };
        self.show_errors();
    }

    /// Writes a register or the message RAM, by address.
    pub fn write(&mut self, address: u32, word: u32, now: u64) {
        self.store(address, word);
        let is_control = address == BASE + CCCR;
        let is_off = self.register(PSR) & BUS_OFF != 0;
        if is_control && is_off && word & INIT == 0 && self.recovers_at.is_none() {
            self.recovers_at = Some(now + RECOVERY_CYCLES);
        }
        if is_control || address == BASE + TXBAR {
            self.begin_next(now);
        }
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        let sending = self.on_bus.as_ref().map_or(u64::MAX, |sending| sending.end);
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
            self.on_bus = Some(Sending { end: start + cycles, element });
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
            self.errors = ErrorCounters::default();
            self.show_errors();
        }
        while self.on_bus.as_ref().is_some_and(|sending| sending.end <= now)
            || self.arrival.is_some_and(|end| end <= now)
        {
            let is_destroyed = self.is_destroyed();
            if let Some(Sending { end, element }) = self.on_bus.take() {
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
            self.errors.transmit += TRANSMIT_ERROR;
            self.bus_free = end + ERROR_BITS * BIT_CYCLES;
            return self.show_errors();
        }
        self.errors.transmit = self.errors.transmit.saturating_sub(1);
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
            self.errors.receive += 1;
            self.bus_free = end + ERROR_BITS * BIT_CYCLES;
            return self.show_errors();
        }
        self.errors.receive = self.errors.receive.saturating_sub(1);
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
        let was_off = self.register(PSR) & BUS_OFF != 0;
        let is_off = self.errors.transmit > OFF_ABOVE;
        let is_passive = self.errors.transmit.max(self.errors.receive) > PASSIVE_ABOVE;
        self.registers[PSR as usize / 4] = NO_LAST_ERROR
            | if is_off { BUS_OFF } else { 0 }
            | if is_passive { ERROR_PASSIVE } else { 0 };
        if is_off && !was_off {
            self.bus_offs += 1;
            self.registers[CCCR as usize / 4] |= INIT;
        }
        self.registers[ECR as usize / 4] = if is_off { 248 } else { 0 };
    }

    /// Returns the duration of a frame of CAN FD with 64 bytes: bits of the arbitration and the end at 1 Mbit/s; the others,
    /// with a stuff bit in ten, at their own rate.
    fn fd_cycles(&self) -> u64 {
        let data_rate = self.data_bit_rate().unwrap_or(1_000_000);
        let bits = 5 + 8 * 64;
        let data_bits = bits + bits / 10 + 4 + 21 + 7;
        30 * BIT_CYCLES + data_bits * BIT_CYCLES * 1_000_000 / data_rate
    }
}
