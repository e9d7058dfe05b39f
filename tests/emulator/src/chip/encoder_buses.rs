//! The buses of both encoders: words that DMA carries, and what the encoders answer.
//!
//! An encoder latches its angle at a time of its own, which may be ahead of the bus. So the world is asked for the angle at that
//! time, in seconds since the trigger of the converters, at which it was sampled last.

use super::dma::{Memory, NoMemory, Transfer, request};
use super::spi::BusFrame;
use super::{CORE_HZ, Chip, SPI1_DR, SPI3_DR};
use crate::world::World;

impl<W: World> Chip<W> {
    /// Serves a request to send a word of the encoder's bus.
    pub(super) fn send_word(
        &mut self,
        request: u32,
        at: u64,
        latched_at: u64,
        memory: &mut dyn Memory,
    ) {
        if let Some(transfer) = self.dma.serve(request)
            && transfer.is_to(SPI1_DR)
        {
            match memory.read_half(transfer.memory) {
                Ok(word) => self.exchange(word, at, latched_at),
                Err(NoMemory) => self.dma.fail(transfer),
            }
        }
    }

    /// Starts a frame of the encoder. The encoder latches its angle at this time, which may be ahead.
    pub(super) fn exchange(&mut self, word: u16, at: u64, latched_at: u64) {
        let by_timer = self.gpio.connects(self.wiring.encoder_select) && self.timer3.selects(at);
        let is_selected = self.gpio.connects(self.wiring.encoder_bus)
            && (by_timer || self.gpio.is_encoder_selected());
        let seconds = (latched_at as f64 - self.timer1.last_trigger() as f64) / CORE_HZ as f64;
        let world = &mut self.world;
        let trigger = self.timer1.last_trigger();
        let is_connected = self.gpio.connects(self.wiring.encoder_bus);
        let line = &mut self.biss;
        self.spi.write(SPI1_DR & 0x3FF, word.into(), at, &mut |frame| match frame {
            BusFrame::Word(word) if is_selected => world.encoder(word, seconds),
            BusFrame::Clocks { begin, bits, clocking } if is_connected => {
                let mut latch = |time: u64| {
                    let seconds = (time as f64 - trigger as f64) / CORE_HZ as f64;
                    world.biss_frame(seconds).unwrap_or(u64::MAX)
                };
                line.word(begin, bits, clocking, &mut latch)
            }
            _ => 0xFFFF,
        });
    }

    /// Sends the words of the joint's encoder that DMA has. Nothing but the clock leaves the bus, so they have no content.
    pub(super) fn feed_joint_bus(&mut self, at: u64) {
        while self.joint_bus.wants_word() {
            let Some(transfer) = self.dma.serve(request::SPI3_TX) else { break };
            if !transfer.is_to(SPI3_DR) {
                continue;
            }
            let is_connected = self.gpio.connects(self.wiring.joint_encoder);
            let (world, line, trigger) =
                (&mut self.world, &mut self.joint_line, self.timer1.last_trigger());
            self.joint_bus.write(SPI3_DR & 0x3FF, 0, at, &mut |frame| match frame {
                BusFrame::Clocks { begin, bits, clocking } if is_connected => {
                    let mut latch = |time: u64| {
                        let seconds = (time as f64 - trigger as f64) / CORE_HZ as f64;
                        world.joint_frame(seconds).unwrap_or(u64::MAX)
                    };
                    line.word(begin, bits, clocking, &mut latch)
                }
                _ => 0xFFFF,
            });
        }
    }

    /// Ends a word of the joint's encoder, and starts the next one.
    pub(super) fn finish_joint_word(&mut self, at: u64, memory: &mut dyn Memory) {
        if self.joint_bus.process(at)
            && let Some(transfer) = self.dma.serve(request::SPI3_RX)
            && transfer.is_from(SPI3_DR)
        {
            let answer = self.joint_bus.read(SPI3_DR & 0x3FF, at) as u16;
            self.store(transfer, answer, memory);
        }
        self.feed_joint_bus(at);
    }

    /// Ends a frame of the encoder: DMA stores its answer.
    pub(super) fn finish_frame(&mut self, at: u64, memory: &mut dyn Memory) {
        if self.spi.process(at)
            && let Some(transfer) = self.dma.serve(request::SPI1_RX)
            && transfer.is_from(SPI1_DR)
        {
            let answer = self.spi.read(SPI1_DR & 0x3FF, at) as u16;
            self.store(transfer, answer, memory);
        }
    }

    /// Writes an answer to the memory of its transfer.
    fn store(&mut self, transfer: Transfer, answer: u16, memory: &mut dyn Memory) {
        if let Err(NoMemory) = memory.write_half(transfer.memory, answer) {
            self.dma.fail(transfer);
        }
    }
}
