//! DMA1 with its request multiplexer: transfers of halfwords between memory and a register (RM0440, 12 and 13).
//!
//! A transfer to an address without memory is an error: it disables its channel, whose flag of an error is set.

use std::ops::RangeInclusive;

/// Registers of the multiplexer.
pub const MULTIPLEXER: RangeInclusive<u32> = 0x4002_0800..=0x4002_083F;

const CHANNELS: usize = 8;
const ENABLED: u32 = 1;
const FROM_MEMORY: u32 = 1 << 4;
const CIRCULAR: u32 = 1 << 5;
const INCREMENTS_MEMORY: u32 = 1 << 7;

/// Offsets of the interrupt flags, and of the register that clears them; flags of channel 1: any, and error.
const ISR: u32 = 0x00;
const IFCR: u32 = 0x04;
const ANY_FLAG: u32 = 1;
const ERROR_FLAG: u32 = 1 << 3;
const FLAG_BITS: usize = 4;

/// Requests (RM0440, table 91).
pub mod request {
    /// SPI1 has received.
    pub const SPI1_RX: u32 = 10;
    /// SPI3 has received, and has room for a word to send.
    pub const SPI3_RX: u32 = 14;
    /// See [`SPI3_RX`].
    pub const SPI3_TX: u32 = 15;
    /// Channel 1 of TIM3.
    pub const TIM3_CH1: u32 = 61;
    /// Channel 3 of TIM3.
    pub const TIM3_CH3: u32 = 63;
}

/// The chip has no memory at an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoMemory;

/// Memory of the core.
pub trait Memory {
    /// Reads a halfword.
    ///
    /// # Errors
    /// Returns an error if the chip has no memory there.
    fn read_half(&mut self, address: u32) -> Result<u16, NoMemory>;

    /// Writes a halfword.
    ///
    /// # Errors
    /// Returns an error if the chip has no memory there.
    fn write_half(&mut self, address: u32, value: u16) -> Result<(), NoMemory>;
}

#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    control: u32,
    count: u32,
    peripheral: u32,
    memory: u32,
    request: u32,
    /// Transfers left, of `count` at the enabling.
    left: u32,
}

/// A transfer that a request causes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    channel: usize,
    /// Address in memory.
    pub memory: u32,
    peripheral: u32,
    is_from_memory: bool,
}

impl Transfer {
    /// Returns true if the transfer goes from memory to this register.
    pub fn is_to(&self, register: u32) -> bool {
        self.is_from_memory && self.peripheral == register
    }

    /// Returns true if the transfer goes from this register to memory.
    pub fn is_from(&self, register: u32) -> bool {
        !self.is_from_memory && self.peripheral == register
    }
}

/// The controller.
#[derive(Clone, Debug, Default)]
pub struct Dma {
    channels: [Channel; CHANNELS],
    flags: u32,
}

impl Dma {
    /// Returns the transfer of a request, if a channel serves it, and advances the channel.
    pub fn serve(&mut self, request: u32) -> Option<Transfer> {
        let (number, channel) = self.channels.iter_mut().enumerate().find(|(_, channel)| {
            channel.request == request && channel.control & ENABLED != 0 && channel.left > 0
        })?;
        let done = channel.count - channel.left;
        let step = if channel.control & INCREMENTS_MEMORY != 0 { 2 * done } else { 0 };
        channel.left -= 1;
        if channel.left == 0 && channel.control & CIRCULAR != 0 {
            channel.left = channel.count;
        }
        Some(Transfer {
            channel: number,
            memory: channel.memory + step,
            peripheral: channel.peripheral,
            is_from_memory: channel.control & FROM_MEMORY != 0,
        })
    }

    /// Ends a transfer that found no memory.
    pub fn fail(&mut self, transfer: Transfer) {
        self.channels[transfer.channel].control &= !ENABLED;
        self.flags |= (ANY_FLAG | ERROR_FLAG) << (FLAG_BITS * transfer.channel);
    }

    fn channel(&mut self, address: u32) -> Option<(&mut Channel, u32)> {
        if MULTIPLEXER.contains(&address) {
            let number = (address - MULTIPLEXER.start()) as usize / 4;
            return self.channels.get_mut(number).map(|channel| (channel, 0x20));
        }
        let offset = (address & 0x3FF).checked_sub(8)?;
        self.channels.get_mut(offset as usize / 0x14).map(|channel| (channel, offset % 0x14))
    }

    /// Reads a register by its address.
    pub fn read(&mut self, address: u32) -> u32 {
        match self.channel(address) {
            Some((channel, 0x00)) => channel.control,
            Some((channel, 0x04)) => channel.left,
            Some((channel, 0x08)) => channel.peripheral,
            Some((channel, 0x0C)) => channel.memory,
            Some((channel, 0x20)) => channel.request,
            None if address & 0x3FF == ISR => self.flags,
            _ => 0,
        }
    }

    /// Writes a register by its address.
    pub fn write(&mut self, address: u32, word: u32) {
        match self.channel(address) {
            Some((channel, 0x00)) => {
                if word & ENABLED != 0 && channel.control & ENABLED == 0 {
                    channel.left = channel.count;
                }
                channel.control = word;
            }
            Some((channel, 0x04)) => (channel.count, channel.left) = (word & 0xFFFF, word & 0xFFFF),
            Some((channel, 0x08)) => channel.peripheral = word,
            Some((channel, 0x0C)) => channel.memory = word,
            Some((channel, 0x20)) => channel.request = word & 0x7F,
            None if address & 0x3FF == IFCR => self.flags &= !word,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circular_channel_serves_its_words_in_turn() {
        let mut dma = Dma::default();
        dma.write(0x4002_0800, request::TIM3_CH3);
        dma.write(0x4002_0014, 0x2000_0100);
        dma.write(0x4002_0010, 0x4001_300C);
        dma.write(0x4002_000C, 2);
        assert_eq!(dma.serve(request::TIM3_CH3), None, "not enabled");
        dma.write(0x4002_0008, ENABLED | FROM_MEMORY | CIRCULAR | INCREMENTS_MEMORY);
        let places: Vec<_> = (0..3)
            .filter_map(|_| dma.serve(request::TIM3_CH3))
            .map(|transfer| transfer.memory)
            .collect();
        assert_eq!(places, [0x2000_0100, 0x2000_0102, 0x2000_0100]);
        assert_eq!(dma.read(0x4002_000C), 1);
    }

    #[test]
    fn failed_transfer_disables_its_channel_and_sets_its_flag() {
        let mut dma = Dma::default();
        // Channel 2.
        dma.write(0x4002_0804, request::SPI1_RX);
        dma.write(0x4002_0020, 4);
        dma.write(0x4002_0024, 0x4001_300C);
        dma.write(0x4002_001C, ENABLED | CIRCULAR);
        let transfer = dma.serve(request::SPI1_RX).expect("a transfer");
        assert!(transfer.is_from(0x4001_300C) && !transfer.is_to(0x4001_300C));
        dma.fail(transfer);
        assert_eq!(dma.serve(request::SPI1_RX), None);
        assert_eq!((dma.read(0x4002_001C), dma.read(0x4002_0000)), (CIRCULAR, 0x90));
        dma.write(0x4002_0004, 0x80);
        assert_eq!(dma.read(0x4002_0000), 0x10);
    }
}
