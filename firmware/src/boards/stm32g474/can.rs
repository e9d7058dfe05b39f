//! FDCAN1 with classic frames.
//!
//! embassy sets the controller up: clock, pins, bit timing, filters. Frames are moved here, for embassy's own
//! queues take a critical section for each, which would hold up the current loop. The message memory's layout
//! is fixed (as the HAL of the chip has it): elements of 18 words, two of them header. Three received frames fit, so the
//! interrupt moves them on to a longer queue at once; three frames to send fit, in the order they came.
//!
//! Filters are masks and pairs (embassy 0.6 swaps the bounds of a range). A controller that has left the bus
//! (*bus-off*) is let back by clearing INIT, after which it waits for 128 x 11 quiet bits by itself.

use super::{pins, scales};
use compensator_core::can::{Frame, Node};
use core::num::{NonZeroU8, NonZeroU16};
use core::sync::atomic::{AtomicBool, Ordering};
use embassy_stm32::can::config::{
    FrameTransmissionConfig, GlobalFilter, NominalBitTiming, NonMatchingFilter, TxBufferMode,
};
use embassy_stm32::can::filter::{Action, FilterType, StandardFilter, StandardFilterSlot};
use embassy_stm32::can::{Can, CanConfigurator, IT0InterruptHandler, IT1InterruptHandler};
use embassy_stm32::interrupt::typelevel::{Binding, FDCAN1_IT0, FDCAN1_IT1};
use embassy_stm32::pac;
use embassy_stm32::peripherals::FDCAN1;
use firmware::node::bit_timing::BitTiming;
use firmware::supervisor::CanState;

const CONTROLLER: pac::can::Fdcan = pac::FDCAN1;
const MEMORY: pac::fdcanram::Fdcanram = pac::FDCANRAM1;

/// Words of an element, and of its header.
const ELEMENT: usize = 18;
const HEADER: usize = 2;

/// In the first word: 29-bit identifier, remote frame, where an 11-bit identifier begins.
const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;
const IDENTIFIER_AT: u32 = 18;
/// In the second: where the length begins, and a frame of the flexible kind.
const LENGTH_AT: u32 = 16;
const FLEXIBLE: u32 = 1 << 21;

/// Says that the interrupts are taken; they are, by the tasks of the board.
#[derive(Clone, Copy)]
struct Taken;
// SAFETY: embassy wants to know that its handlers run. They would serve its own queues, which are not used.
unsafe impl Binding<FDCAN1_IT0, IT0InterruptHandler<FDCAN1>> for Taken {}
unsafe impl Binding<FDCAN1_IT1, IT1InterruptHandler<FDCAN1>> for Taken {}

/// A frame found no place in the longer queue either.
static LOST: AtomicBool = AtomicBool::new(false);

/// In the interrupt: a frame found no place.
pub fn count_lost() {
    LOST.store(true, Ordering::Relaxed);
}

/// The controller, on its bus.
pub struct Controller {
    _can: Can<'static>,
}

impl Controller {
    /// Goes on the bus as this node.
    pub fn start(can: pins::Can, node: Node, bit_rate_kbit: u16) -> Self {
        let mut setup = CanConfigurator::new(can.controller, can.receive, can.transmit, Taken);
        let mut config = setup.config();
        // Every rate that settings may hold has a timing, as scales.rs makes sure of.
        if let Some(timing) = timing(bit_rate_kbit) {
            config.nbtr = timing;
        }
        config.frame_transmit = FrameTransmissionConfig::ClassicCanOnly;
        config.tx_buffer_mode = TxBufferMode::Fifo;
        // Recovery is asked for below, where it is also counted.
        config.automatic_bus_off_recovery = false;
        config.global_filter = GlobalFilter {
            handle_standard_frames: NonMatchingFilter::Reject,
            handle_extended_frames: NonMatchingFilter::Reject,
            reject_remote_standard_frames: true,
            reject_remote_extended_frames: true,
        };
        setup.set_config(config);
        let filters = [
            // All that carries this node's number: PDOs, SDO.
            FilterType::BitMask { filter: u16::from(node.number()), mask: 0x07F },
            // To all: network commands, SYNC, emergencies' base.
            FilterType::BitMask { filter: 0x000, mask: 0x77F },
            // Heartbeats, for whichever is awaited.
            FilterType::BitMask { filter: 0x700, mask: 0x780 },
        ];
        let slots = [StandardFilterSlot::_0, StandardFilterSlot::_1, StandardFilterSlot::_2];
        for (slot, filter) in slots.into_iter().zip(filters) {
            let filter = StandardFilter { filter, action: Action::StoreInFifo0 };
            setup.properties().set_standard_filter(slot, filter);
        }
        let can = setup.into_normal_mode();
        // Only what the interrupt clears: anything else would raise it for ever.
        CONTROLLER.ie().write(|w| w.set_rfne(0, true));
        Self { _can: can }
    }

    /// Whether a frame was lost since the last time asked: here, or before the interrupt got to it.
    pub fn take_overrun(&mut self) -> bool {
        // Cleared by a one; the others are left.
        let lost = CONTROLLER.ir().read().rfl(0);
        if lost {
            CONTROLLER.ir().write(|w| w.set_rfl(0, true));
        }
        LOST.swap(false, Ordering::Relaxed) || lost
    }

    /// How it stands to its bus; off the bus, it is sent back.
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

    /// Whether a frame to send finds a place.
    pub fn has_room(&self) -> bool {
        !CONTROLLER.txfqs().read().tfqf()
    }

    /// Whether all that was to be sent is.
    pub fn is_idle(&self) -> bool {
        CONTROLLER.txbrp().read().0 == 0
    }

    /// Sends a frame. Ask [`Controller::has_room`] first.
    pub fn send(&mut self, frame: &Frame) {
        let place = usize::from(CONTROLLER.txfqs().read().tfqpi()).min(2);
        let word = |at: usize| MEMORY.txbuf(ELEMENT * place + at);
        word(0).write_value(u32::from(frame.identifier()) << IDENTIFIER_AT);
        word(1).write_value((frame.data().len() as u32) << LENGTH_AT);
        let mut bytes = [0; 8];
        for (place, byte) in bytes.iter_mut().zip(frame.data()) {
            *place = *byte;
        }
        for (at, bytes) in bytes.as_chunks::<4>().0.iter().enumerate() {
            word(HEADER + at).write_value(u32::from_le_bytes(*bytes));
        }
        // What is written here must be in memory before the controller looks.
        cortex_m::asm::dmb();
        CONTROLLER.txbar().write(|w| w.set_ar(place, true));
    }
}

/// A bit rate as the controller wants it.
fn timing(bit_rate_kbit: u16) -> Option<NominalBitTiming> {
    let timing = BitTiming::of(scales::CAN_HZ, u32::from(bit_rate_kbit) * 1000)?;
    Some(NominalBitTiming {
        prescaler: NonZeroU16::new(timing.prescaler)?,
        seg1: NonZeroU8::new(timing.seg1)?,
        seg2: NonZeroU8::new(timing.seg2)?,
        sync_jump_width: NonZeroU8::new(timing.seg2)?,
    })
}

/// In the interrupt: gives every frame received to `take`.
pub fn receive(mut take: impl FnMut(Frame)) {
    // Before the queue is emptied: what comes meanwhile raises it anew.
    CONTROLLER.ir().write(|w| w.set_rfn(0, true));
    loop {
        let queue = CONTROLLER.rxfs(0).read();
        if queue.ffl() == 0 {
            return;
        }
        let place = usize::from(queue.fgi()).min(2);
        let word = |at: usize| MEMORY.rxfifo0(ELEMENT * place + at).read();
        let (first, second) = (word(0), word(1));
        let [low, high] = [word(HEADER).to_le_bytes(), word(HEADER + 1).to_le_bytes()];
        CONTROLLER.rxfa(0).write(|w| w.set_fai(queue.fgi()));
        if first & (EXTENDED | REMOTE) != 0 || second & FLEXIBLE != 0 {
            continue;
        }
        let [a, b, c, d] = low;
        let [e, f, g, h] = high;
        let bytes = [a, b, c, d, e, f, g, h];
        // A length code above 8 means 8 in a classic frame.
        let length = ((second >> LENGTH_AT) as usize & 0xF).min(8);
        let identifier = (first >> IDENTIFIER_AT) as u16 & 0x7FF;
        if let Some(frame) = Frame::new(identifier, bytes.get(..length).unwrap_or_default()) {
            take(frame);
        }
    }
}
