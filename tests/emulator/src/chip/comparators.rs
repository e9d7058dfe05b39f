//! Overcurrent comparators: the levels that the image sets in the DACs (RM0440, 22 and 24).
//!
//! The registers are plain memory. This finds the level of each comparator in the break, in counts of 12 bits.

use std::collections::HashMap;

/// Base addresses of the DACs, by number.
const DAC: [u32; 4] = [0x5000_0800, 0x5000_0C00, 0x5000_1000, 0x5000_1400];
const DHR12R: [u32; 2] = [0x08, 0x14];

/// Levels of the DACs.
#[derive(Clone, Debug, Default)]
pub struct Comparators {
    levels: HashMap<(usize, usize), u32>,
}

impl Comparators {
    /// Observes a write to a plain register.
    pub fn observe(&mut self, address: u32, word: u32) {
        for (number, base) in DAC.into_iter().enumerate() {
            for (channel, offset) in DHR12R.into_iter().enumerate() {
                if address == base + offset {
                    self.levels.insert((number + 1, channel + 1), word & 0xFFF);
                }
            }
        }
    }

    /// Upper level of the phase amplifiers, counts: DAC3, channel 1 (see the board's overcurrent.rs).
    pub fn upper_level(&self) -> Option<u32> {
        self.levels.get(&(3, 1)).copied()
    }
}
