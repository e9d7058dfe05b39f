//! DMA1 with its request multiplexer: transfers of halfwords between memory and a register (RM0440, 12 and 13).

use std::ops::RangeInclusive;

/// Registers of the controller, and of the multiplexer.
pub const REGISTERS: RangeInclusive<u32> = 0x4002_0000..=0x4002_03FF;
/// Registers of the multiplexer.
pub const MULTIPLEXER: RangeInclusive<u32> = 0x4002_0800..=0x4002_083F;

const CHANNELS: usize = 8;
const ENABLED: u32 = 1;
const FROM_MEMORY: u32 = 1 << 4;
const CIRCULAR: u32 = 1 << 5;
const INCREMENTS_MEMORY: u32 = 1 << 7;

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

/// Memory of the core.
pub trait Memory {
    /// Reads a halfword.
    fn read_half(&mut self, address: u32) -> u16;
    /// Writes a halfword.
    fn write_half(&mut self, address: u32, value: u16);
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
    /// Address in memory.
    pub memory: u32,
    /// Address of the register.
    pub peripheral: u32,
    /// From memory to the register.
    pub from_memory: bool,
}

/// The controller.
#[derive(Clone, Debug, Default)]
pub struct Dma {
    channels: [Channel; CHANNELS],
}

impl Dma {
    /// Returns the transfer of a request, if a channel serves it, and advances the channel.
    pub fn serve(&mut self, request: u32) -> Option<Transfer> {
        let channel = self.channels.iter_mut().find(|channel| {
            channel.request == request && channel.control & ENABLED != 0 && channel.left > 0
        })?;
        let done = channel.count - channel.left;
        let step = if channel.control & INCREMENTS_MEMORY != 0 { 2 * done } else { 0 };
        channel.left -= 1;
        if channel.left == 0 && channel.control & CIRCULAR != 0 {
            channel.left = channel.count;
        }
        Some(Transfer {
            memory: channel.memory + step,
            peripheral: channel.peripheral,
            from_memory: channel.control & FROM_MEMORY != 0,
        })
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
}
