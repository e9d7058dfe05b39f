//! FDCAN1 with classic frames.
//!
//! embassy sets up the controller: clock, pins, bit timing, filters. This module moves the frames, because
//! embassy's queues take a critical section per frame, which would delay the current loop. The layout of
//! the message memory is fixed (as in the HAL of the chip): elements of 18 words with a header of two
//! words. Its receive FIFO holds three frames, so the interrupt moves them to a longer queue at once.
//!
//! Of its three transmit elements, the one with the lowest identifier is sent first. In a FIFO, a heartbeat that waits for
//! a loaded bus would keep back all process data. The order of equal identifiers would be that of the elements, so no
//! two of them are in the controller. Services leave one element to process data.
//!
//! The controller understands CAN FD: otherwise it would destroy each such frame by an error frame. It needs the bit rate
//! of their data for it (2001h:8). Received ones are discarded. A board may send one ([`compensator_core::can::FdTelemetry`], 2001h:9).
//!
//! A sender compares its bits with those on the bus. At 5 Mbit/s a bit is shorter than the way through the transceiver
//! and back. The controller then measures that delay (RM0440, 44.3.3). It can do so with a prescaler of at most 2, which
//! the lower bit rates exceed and do not need: they sample 400 ns after the begin of a bit, and a transceiver takes at most
//! 255 ns (ISO 11898-2).
//!
//! Filters are masks and pairs (embassy 0.6 swaps the bounds of a range). A controller that is *bus-off*
//! recovers when INIT is cleared: it then waits for 128 x 11 recessive bits.

use super::{pins, scales};
use compensator_core::can::{Frame, NodeId};
use core::num::{NonZeroU8, NonZeroU16};
use core::sync::atomic::{AtomicBool, Ordering};
use embassy_stm32::can::config::{
    DataBitTiming, FrameTransmissionConfig, GlobalFilter, NominalBitTiming, NonMatchingFilter,
    TxBufferMode,
};
use embassy_stm32::can::filter::{Action, FilterType, StandardFilter, StandardFilterSlot};
use embassy_stm32::can::{Can, CanConfigurator, IT0InterruptHandler, IT1InterruptHandler};
use embassy_stm32::interrupt::typelevel::{Binding, FDCAN1_IT0, FDCAN1_IT1};
use embassy_stm32::pac;
use embassy_stm32::peripherals::FDCAN1;
use firmware::node::bit_timing::BitTiming;
use firmware::node::lss::LSS_REQUEST;
use firmware::supervisor::CanState;

const CONTROLLER: pac::can::Fdcan = pac::FDCAN1;
const MESSAGE_MEMORY: pac::fdcanram::Fdcanram = pac::FDCANRAM1;

/// Words of an element, and of its header.
const ELEMENT_WORDS: usize = 18;
const HEADER_WORDS: usize = 2;

/// First word: 29-bit identifier, remote frame, position of an 11-bit identifier.
const EXTENDED_ID: u32 = 1 << 30;
const REMOTE_FRAME: u32 = 1 << 29;
const IDENTIFIER_SHIFT: u32 = 18;
/// Second word: position of the length, and the flag of a CAN FD frame.
pub const LENGTH_SHIFT: u32 = 16;
pub const FD_FRAME: u32 = 1 << 21;

/// Largest prescaler with which the controller measures the delay of the transceiver.
const LAST_COMPENSATED_PRESCALER: u16 = 2;

/// Declares to embassy that the interrupts are handled; tasks of the board do so.
#[derive(Clone, Copy)]
struct HandledInterrupts;
// SAFETY: embassy requires that its handlers run. They would serve its own queues, which are not used.
unsafe impl Binding<FDCAN1_IT0, IT0InterruptHandler<FDCAN1>> for HandledInterrupts {}
unsafe impl Binding<FDCAN1_IT1, IT1InterruptHandler<FDCAN1>> for HandledInterrupts {}

/// Set when a frame did not fit into the longer queue.
static FRAME_LOST: AtomicBool = AtomicBool::new(false);

/// Records that a frame was lost. The interrupt calls it.
pub fn record_lost() {
    FRAME_LOST.store(true, Ordering::Relaxed);
}

/// The running controller.
pub struct Controller {
    can: Can<'static>,
    /// Identifiers accepted besides those of the start; 0 for none.
    accepted: [u16; 7],
    /// Identifiers of the transmit elements.
    transmitted: [u16; TRANSMIT_ELEMENTS],
}

/// Transmit elements.
const TRANSMIT_ELEMENTS: usize = 3;
/// Lowest identifier of the services: answers to SDO requests, heartbeats, LSS.
const SERVICES: u16 = 0x580;

/// Filter slots of single identifiers. The slots before are those of the node number and the broadcasts.
const RECEIVE_SLOTS: [StandardFilterSlot; 7] = [
    StandardFilterSlot::_4,
    StandardFilterSlot::_5,
    StandardFilterSlot::_6,
    StandardFilterSlot::_7,
    StandardFilterSlot::_8,
    StandardFilterSlot::_9,
    StandardFilterSlot::_10,
];

impl Controller {
    /// Starts the controller as this node.
    pub fn start(
        can: pins::Can,
        node: NodeId,
        bit_rate_kbit: u16,
        data_bit_rate_kbit: u16,
    ) -> Self {
        let mut setup =
            CanConfigurator::new(can.controller, can.receive, can.transmit, HandledInterrupts);
        let mut config = setup.config();
        // Every legal bit rate has a timing, which rates.rs checks.
        if let Some(timing) = timing(bit_rate_kbit) {
            config.nbtr = timing;
        }
        if let Some(timing) = data_timing(data_bit_rate_kbit) {
            config.dbtr = timing;
        }
        // FDOE: frames in the FD format are followed to their end. BRSE permits a switched bit rate. The format of a sent
        // frame is in its header.
        config.frame_transmit = FrameTransmissionConfig::AllowFdCanAndBRS;
        config.tx_buffer_mode = TxBufferMode::Priority;
        // `state` requests the recovery, so that it is also reported.
        config.automatic_bus_off_recovery = false;
        config.global_filter = GlobalFilter {
            handle_standard_frames: NonMatchingFilter::Reject,
            handle_extended_frames: NonMatchingFilter::Reject,
            reject_remote_standard_frames: true,
            reject_remote_extended_frames: true,
        };
        setup.set_config(config);
        let filters = [
            // All identifiers with this node number: PDOs, SDO.
            FilterType::BitMask { filter: u16::from(node.number()), mask: 0x07F },
            // Broadcasts: network commands, SYNC, base of the emergencies.
            FilterType::BitMask { filter: 0x000, mask: 0x77F },
            // Heartbeats of all nodes, of which one is monitored.
            FilterType::BitMask { filter: 0x700, mask: 0x780 },
            // The LSS master.
            FilterType::BitMask { filter: LSS_REQUEST, mask: 0x7FF },
        ];
        let slots = [
            StandardFilterSlot::_0,
            StandardFilterSlot::_1,
            StandardFilterSlot::_2,
            StandardFilterSlot::_3,
        ];
        for (slot, filter) in slots.into_iter().zip(filters) {
            let filter = StandardFilter { filter, action: Action::StoreInFifo0 };
            setup.properties().set_standard_filter(slot, filter);
        }
        let can = setup.into_normal_mode();
        compensate_delay(data_bit_rate_kbit);
        // Enable only the source that the interrupt clears; any other would raise it for ever.
        CONTROLLER.ie().write(|w| w.set_rfne(0, true));
        Self { can, accepted: [0; 7], transmitted: [0; TRANSMIT_ELEMENTS] }
    }

    /// Accepts these identifiers besides those of the start, because a master may move a receive PDO to the
    /// identifier of another node, or change the node number. The message memory may be written while the controller runs.
    pub fn accept(&mut self, identifiers: &[u16; 7]) {
        if *identifiers == self.accepted {
            return;
        }
        self.accepted = *identifiers;
        for (slot, identifier) in RECEIVE_SLOTS.into_iter().zip(identifiers) {
            let filter = FilterType::BitMask { filter: *identifier, mask: 0x7FF };
            let action = if *identifier == 0 { Action::Disable } else { Action::StoreInFifo0 };
            self.can.properties().set_standard_filter(slot, StandardFilter { filter, action });
        }
    }

    /// Returns true if a frame was lost since the last call, in the controller or in the queue.
    pub fn take_overrun(&mut self) -> bool {
        // Writing 1 clears this flag only.
        let lost = CONTROLLER.ir().read().rfl(0);
        if lost {
            CONTROLLER.ir().write(|w| w.set_rfl(0, true));
        }
        FRAME_LOST.swap(false, Ordering::Relaxed) || lost
    }

    /// Returns the error state. In bus-off it starts the recovery.
    pub fn state(&mut self) -> CanState {
        let status = CONTROLLER.psr().read();
        if status.bo() {
            if CONTROLLER.cccr().read().init() {
                CONTROLLER.cccr().modify(|w| w.set_init(false));
            }
            CanState::Off
        } else if status.ep() {
            CanState::Passive
        } else {
            CanState::Active
        }
    }

    /// Returns true if a frame with this identifier can be sent: see the module's header.
    pub fn has_room_for(&self, identifier: u16) -> bool {
        let pending = CONTROLLER.txbrp().read().0;
        let mut free = 0;
        for (element, transmitted) in self.transmitted.iter().enumerate() {
            if pending >> element & 1 == 0 {
                free += 1;
            } else if *transmitted == identifier {
                return false;
            }
        }
        free > u32::from(identifier >= SERVICES)
    }

    /// Returns true if all frames have been sent.
    pub fn is_idle(&self) -> bool {
        CONTROLLER.txbrp().read().0 == 0
    }

    /// Sends a frame. Check [`Controller::has_room_for`] first.
    pub fn send(&mut self, frame: &Frame) {
        let mut bytes = [0; 8];
        for (place, byte) in bytes.iter_mut().zip(frame.data()) {
            *place = *byte;
        }
        self.transmit(frame.identifier(), frame.data().len() as u32, &bytes);
    }

    /// Writes the next transmit element and requests its transmission. `format` is the upper half of its second word.
    #[inline(never)]
    pub fn transmit(&mut self, identifier: u16, format: u32, data: &[u8]) {
        let place = usize::from(CONTROLLER.txfqs().read().tfqpi()).min(TRANSMIT_ELEMENTS - 1);
        if let Some(transmitted) = self.transmitted.get_mut(place) {
            *transmitted = identifier;
        }
        let word = |at: usize| MESSAGE_MEMORY.txbuf(ELEMENT_WORDS * place + at);
        word(0).write_value(u32::from(identifier) << IDENTIFIER_SHIFT);
        word(1).write_value(format << LENGTH_SHIFT);
        for (at, bytes) in data.as_chunks::<4>().0.iter().enumerate() {
            word(HEADER_WORDS + at).write_value(u32::from_le_bytes(*bytes));
        }
        // The frame must be in memory before the controller reads it.
        cortex_m::asm::dmb();
        CONTROLLER.txbar().write(|w| w.set_ar(place, true));
    }
}

/// Lets the controller measure the delay of the transceiver, at data bit rates that need it. embassy does not offer it.
fn compensate_delay(data_bit_rate_kbit: u16) {
    let timing = BitTiming::for_rate(scales::CAN_HZ, u32::from(data_bit_rate_kbit) * 1000);
    let Some(timing) = timing.filter(|timing| timing.prescaler <= LAST_COMPENSATED_PRESCALER)
    else {
        return;
    };
    // The registers can be written only while the controller is off the bus, where it just came from.
    CONTROLLER.cccr().modify(|w| w.set_init(true));
    while !CONTROLLER.cccr().read().init() {}
    CONTROLLER.cccr().modify(|w| w.set_cce(true));
    // The second sample point is as far behind the measured delay as the first is in a bit.
    let offset = timing.prescaler as u8 * (1 + timing.seg1);
    CONTROLLER.tdcr().write(|w| w.set_tdco(offset));
    CONTROLLER.dbtp().modify(|w| w.set_tdc(true));
    // Clearing INIT clears CCE.
    CONTROLLER.cccr().modify(|w| w.set_init(false));
}

/// Converts a bit rate to the timing of the controller.
fn timing(bit_rate_kbit: u16) -> Option<NominalBitTiming> {
    let timing = BitTiming::for_rate(scales::CAN_HZ, u32::from(bit_rate_kbit) * 1000)?;
    Some(NominalBitTiming {
        prescaler: NonZeroU16::new(timing.prescaler)?,
        seg1: NonZeroU8::new(timing.seg1)?,
        seg2: NonZeroU8::new(timing.seg2)?,
        sync_jump_width: NonZeroU8::new(timing.seg2)?,
    })
}

/// Converts a bit rate of CAN FD data to the timing of the controller. embassy ignores the field of the delay.
fn data_timing(bit_rate_kbit: u16) -> Option<DataBitTiming> {
    let timing = BitTiming::for_rate(scales::CAN_HZ, u32::from(bit_rate_kbit) * 1000)?;
    Some(DataBitTiming {
        transceiver_delay_compensation: false,
        prescaler: NonZeroU16::new(timing.prescaler)?,
        seg1: NonZeroU8::new(timing.seg1)?,
        seg2: NonZeroU8::new(timing.seg2)?,
        sync_jump_width: NonZeroU8::new(timing.seg2)?,
    })
}

/// Passes every received frame to `take`. The interrupt calls it.
pub fn receive(mut take: impl FnMut(Frame)) {
    // Cleared before the FIFO is emptied, so that a later frame raises the interrupt again.
    CONTROLLER.ir().write(|w| w.set_rfn(0, true));
    loop {
        let queue = CONTROLLER.rxfs(0).read();
        if queue.ffl() == 0 {
            return;
        }
        let place = usize::from(queue.fgi()).min(2);
        let word = |at: usize| MESSAGE_MEMORY.rxfifo0(ELEMENT_WORDS * place + at).read();
        let (first, second) = (word(0), word(1));
        let [low, high] = [word(HEADER_WORDS).to_le_bytes(), word(HEADER_WORDS + 1).to_le_bytes()];
        CONTROLLER.rxfa(0).write(|w| w.set_fai(queue.fgi()));
        if first & (EXTENDED_ID | REMOTE_FRAME) != 0 || second & FD_FRAME != 0 {
            continue;
        }
        let [a, b, c, d] = low;
        let [e, f, g, h] = high;
        let bytes = [a, b, c, d, e, f, g, h];
        // A length code above 8 means 8 in a classic frame.
        let length = ((second >> LENGTH_SHIFT) as usize & 0xF).min(8);
        let identifier = (first >> IDENTIFIER_SHIFT) as u16 & 0x7FF;
        if let Some(frame) = Frame::new(identifier, bytes.get(..length).unwrap_or_default()) {
            take(frame);
        }
    }
}
