//! The encoder at the joint's side of the gear: a frame of BiSS C in each millisecond, exchanged by SPI3 and DMA.
//!
//! ```text
//! the background sees a report of the current loop -> start -> 56 clocks without a gap -> read at the next tick
//! ```
//! The background starts a frame when a report has come, so that the positions of both sides are of the same time. DMA
//! clocks the four words without a gap: an interrupt between two words would end the encoder's frame.
//!
//! The pins are not connected before the parameters select such an encoder.

use super::pins;
use super::scales::ENCODER_CLOCK;
use core::sync::atomic::{AtomicU16, Ordering};
use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac;
use embassy_stm32::pac::bdma::vals as dma;
use embassy_stm32::pac::spi::vals as spi_values;
use embassy_stm32::peripherals::{DMA1_CH4, DMA1_CH5};
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{self, Spi};
use firmware::sensors::biss::WORDS;

const BUS: pac::spi::Spi = pac::SPI3;

/// Channels of DMA1, and their requests (RM0440, table of DMAMUX requests).
const COMMAND_CHANNEL: usize = 3;
const ANSWER_CHANNEL: usize = 4;
const SPI3_RX_REQUEST: u8 = 14;
const SPI3_TX_REQUEST: u8 = 15;

/// Words of the last frame. The command channel reads the first one: nothing but the clock leaves the bus.
static ANSWERS: [AtomicU16; WORDS] = [const { AtomicU16::new(NO_WORD) }; WORDS];
/// An open line, which is no frame.
const NO_WORD: u16 = u16::MAX;
/// Longest wait for a frame that was started at its reading, in looks; a frame takes 11 us.
const MAX_LOOKS: u32 = 1000;

/// The bus of the encoder.
pub struct JointEncoder {
    is_started: bool,
    _bus: Spi<'static, Blocking, Master>,
    _channels: (Peri<'static, DMA1_CH4>, Peri<'static, DMA1_CH5>),
}

impl JointEncoder {
    /// Connects the bus.
    pub fn connect(wired: pins::JointEncoder) -> Self {
        let mut config = spi::Config::default();
        // The clock is high at rest, and SLO is read at its rising edges.
        config.mode = spi::MODE_3;
        config.frequency = ENCODER_CLOCK;
        config.miso_pull = Pull::Up;
        let bus = Spi::new_blocking_rxonly(wired.spi, wired.clock, wired.back, config);
        set_up_channel(ANSWER_CHANNEL, SPI3_RX_REQUEST, dma::Dir::FROM_PERIPHERAL);
        set_up_channel(COMMAND_CHANNEL, SPI3_TX_REQUEST, dma::Dir::FROM_MEMORY);
        BUS.cr1().modify(|w| w.set_spe(false));
        BUS.cr2().modify(|w| {
            w.set_ds(spi_values::Ds::BITS14);
            w.set_frxth(spi_values::Frxth::HALF);
            w.set_rxdmaen(true);
            w.set_txdmaen(true);
        });
        BUS.cr1().modify(|w| w.set_spe(true));
        let channels = (wired.command, wired.answer);
        Self { is_started: false, _bus: bus, _channels: channels }
    }

    /// Starts a frame, unless one waits to be read. Returns true if it has started now.
    #[inline(never)]
    pub fn start(&mut self) -> bool {
        if self.is_started {
            return false;
        }
        self.is_started = true;
        // A word that an aborted frame has left.
        let _ = BUS.dr16().read();
        for channel in [ANSWER_CHANNEL, COMMAND_CHANNEL] {
            let channel = pac::DMA1.ch(channel);
            channel.cr().modify(|w| w.set_en(false));
            channel.ndtr().write(|w| w.set_ndt(WORDS as u16));
            channel.cr().modify(|w| w.set_en(true));
        }
        true
    }

    /// Returns the words of the frame since the last call; a frame that was not started is started now.
    #[inline(never)]
    pub fn read(&mut self) -> [u16; WORDS] {
        self.start();
        self.is_started = false;
        let is_complete = |_| pac::DMA1.ch(ANSWER_CHANNEL).ndtr().read().ndt() == 0;
        if (0..MAX_LOOKS).any(is_complete) {
            ANSWERS.each_ref().map(|word| word.load(Ordering::Relaxed))
        } else {
            [NO_WORD; WORDS]
        }
    }
}

fn set_up_channel(number: usize, request: u8, dir: dma::Dir) {
    pac::DMAMUX1.ccr(number).write(|w| w.set_dmareq_id(request));
    let channel = pac::DMA1.ch(number);
    channel.par().write_value(BUS.dr16().as_ptr() as u32);
    channel.mar().write_value(ANSWERS.as_ptr() as u32);
    channel.cr().write(|w| {
        w.set_dir(dir);
        w.set_minc(dir == dma::Dir::FROM_PERIPHERAL);
        w.set_msize(dma::Size::BITS16);
        w.set_psize(dma::Size::BITS16);
    });
}
