//! Cost of instructions in core cycles, as a lower and an upper estimate.
//!
//! Sources: the timing table of the Cortex-M4 (technical reference manual, 3.3 and 7.2.3), and RM0440, 3.3 for the
//! flash. Emulated time is the upper estimate. The assumptions, lower then upper:
//!
//! | what | lower | upper |
//! |---|---|---|
//! | refill of the pipeline after a branch that is taken, a call, a return | 1 | 3 |
//! | load | 1 (pipelined) | 2; 1 behind another load whose result is not its address |
//! | load of a floating-point register | 1 | 2 |
//! | store; with an index register | 1 | 1; 2 |
//! | load or store of n registers | n | 1 + n |
//! | integer division | 2 | 12 |
//! | floating point: add, multiply, convert, compare | 1 | 1; 2 if the next instruction uses the result |
//! | multiply and accumulate; division and square root | 3; 14 | 3; 14; one more if the next instruction uses it |
//! | fetch from flash | 0 | wait states of each 64-bit unit that is not cached |
//! | constant in flash | 0 | wait states if its line is not cached |
//! | peripheral register, added by [`crate::chip`] | 0 | 1 on AHB, 3 on APB |
//!
//! The caches are simulated as least recently used lines of 32 bytes: 32 for instructions, 8 for data. With prefetch,
//! the unit that follows in sequence costs one cycle in place of its wait states, because four halfwords execute while
//! it is read. Code in CCM or RAM has no wait states: CCM is on the instruction bus. Contention between the core and DMA is
//! not counted.

/// Instruction cache, lines.
const CODE_LINES: u8 = 32;
/// Data cache, lines.
const DATA_LINES: u8 = 8;
const LINE_BYTES: u32 = 32;
const UNIT_BYTES: u32 = 8;

/// Refill of the pipeline after a change of sequence: lower and upper.
pub const REFILL: Cost = Cost { lower: 1, upper: 3 };
/// Entry into an exception without floating-point state: TRM 3.9, and stacking into a busy memory.
pub const EXCEPTION_ENTRY: Cost = Cost { lower: 12, upper: 16 };
/// Return from an exception.
pub const EXCEPTION_RETURN: Cost = Cost { lower: 10, upper: 14 };
/// Stacking of the floating-point state, which is deferred to the first such instruction of the handler.
pub const LAZY_STACKING: Cost = Cost { lower: 17, upper: 19 };

/// A number of cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Lower estimate.
    pub lower: u32,
    /// Upper estimate.
    pub upper: u32,
}

impl Cost {
    const fn new(lower: u32, upper: u32) -> Self {
        Self { lower, upper }
    }

    /// Adds a number of cycles. A sum above the range stays at its end.
    pub(crate) fn add(&mut self, other: Self) {
        self.lower = self.lower.saturating_add(other.lower);
        self.upper = self.upper.saturating_add(other.upper);
    }
}

/// A basic block.
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// Address.
    pub address: u32,
    /// Length, bytes.
    pub bytes: u32,
    /// Number of instructions.
    pub instructions: u32,
    /// Cost without wait states.
    pub cost: Cost,
    /// It contains a floating-point instruction.
    pub uses_fpu: bool,
    /// It ends with WFI.
    pub waits: bool,
    /// Addresses of the constants that it loads.
    pub constants: Vec<u32>,
}

/// What the next instruction needs to know of the one before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Before {
    #[default]
    Other,
    /// A load of this core register.
    Load(u16),
    /// An operation with this floating-point register as result.
    Float(u16),
}

/// Registers in the fields of an instruction.
mod field {
    /// Floating-point result: its number is split over both halfwords.
    pub const fn float_result(first: u16, second: u16) -> u16 {
        (second >> 12) << 1 | first >> 6 & 1
    }
    /// First floating-point operand.
    pub const fn float_first(first: u16, second: u16) -> u16 {
        (first & 0xF) << 1 | second >> 7 & 1
    }
    /// Second floating-point operand.
    pub const fn float_second(second: u16) -> u16 {
        (second & 0xF) << 1 | second >> 5 & 1
    }
}

impl Block {
    /// Decodes a block at an address.
    pub fn decode(address: u32, code: &[u8]) -> Self {
        let mut block = Self { address, bytes: code.len() as u32, ..Self::default() };
        let halfword = |at: usize| {
            code.get(at..at + 2).map_or(0, |bytes| u16::from_le_bytes([bytes[0], bytes[1]]))
        };
        let (mut at, mut before) = (0, Before::Other);
        while at < code.len() {
            let first = halfword(at);
            let place = (address + at as u32 + 4) & !3;
            if first >> 11 >= 0b11101 {
                before = block.wide(first, halfword(at + 2), place, before);
                at += 4;
            } else {
                before = block.narrow(first, place, before);
                at += 2;
            }
            block.instructions += 1;
        }
        block
    }

    /// A load of a core register, with the registers of its address.
    fn load(&mut self, result: u16, address: [Option<u16>; 2], before: Before) -> Before {
        let is_pipelined = match before {
            Before::Load(loaded) => !address.contains(&Some(loaded)),
            _ => false,
        };
        self.cost.add(Cost::new(1, if is_pipelined { 1 } else { 2 }));
        Before::Load(result)
    }

    fn several(&mut self, registers: u32) {
        self.cost.add(Cost::new(registers.max(1), 1 + registers));
    }

    fn narrow(&mut self, code: u16, place: u32, before: Before) -> Before {
        let (low, base, upper) = (code & 7, code >> 3 & 7, code >> 8 & 7);
        match code >> 8 {
            0x48..=0x4F => {
                self.constants.push(place + 4 * u32::from(code & 0xFF));
                return self.load(upper, [None, None], before);
            }
            // With an index register: stores, then loads.
            0x50..=0x55 => self.cost.add(Cost::new(1, 2)),
            0x56..=0x5F => return self.load(low, [Some(base), Some(code >> 6 & 7)], before),
            // With a constant offset: bit 11 marks a load.
            0x60..=0x8F if code & 0x800 != 0 => return self.load(low, [Some(base), None], before),
            0x98..=0x9F => return self.load(upper, [None, None], before),
            0xB4 | 0xB5 | 0xBC | 0xBD => self.several((code & 0x1FF).count_ones()),
            0xB6 => self.cost.add(Cost::new(1, 2)),
            0xBF => {
                self.waits |= code == 0xBF30;
                self.cost.add(Cost::new(u32::from(code & 0xF == 0), 1));
            }
            0xC0..=0xCF => self.several((code & 0xFF).count_ones()),
            _ => self.cost.add(Cost::new(1, 1)),
        }
        Before::Other
    }

    fn wide(&mut self, first: u16, second: u16, place: u32, before: Before) -> Before {
        match first >> 9 & 0x3F {
            // Multiple, double, exclusive, and table branches.
            0b11_0100 if first & 0x40 == 0 => self.several(u32::from(second).count_ones()),
            0b11_0100 if first & 0xFFF0 == 0xE8D0 && second & 0xFFE0 == 0xF000 => {
                self.cost.add(Cost::new(2, 4));
            }
            0b11_0100 => self.several(2),
            // Loads and stores.
            0b11_1100 => return self.wide_access(first, second, place, before),
            0b11_1101 => match first & 0xFFF0 {
                0xFB90 | 0xFBB0 => self.cost.add(Cost::new(2, 12)),
                0xFB00 if second >> 12 != 0xF => self.cost.add(Cost::new(1, 2)),
                _ => self.cost.add(Cost::new(1, 1)),
            },
            0b11_0110 | 0b11_0111 | 0b11_1110 | 0b11_1111 => {
                return self.coprocessor(first, second, place, before);
            }
            // System registers and barriers.
            _ if first & 0xF800 == 0xF000
                && second & 0xD000 == 0x8000
                && first & 0xFE0 >= 0x380 =>
            {
                self.cost.add(Cost::new(1, 4));
            }
            _ => self.cost.add(Cost::new(1, 1)),
        }
        Before::Other
    }

    fn wide_access(&mut self, first: u16, second: u16, place: u32, before: Before) -> Before {
        let (base, is_load) = (first & 0xF, first & 0x10 != 0);
        let is_indexed = first & 0x80 == 0 && second & 0xFC0 == 0;
        if !is_load {
            self.cost.add(Cost::new(1, if is_indexed { 2 } else { 1 }));
            return Before::Other;
        }
        if base == 0xF {
            let offset = u32::from(second & 0xFFF);
            let at = if first & 0x80 != 0 { place + offset } else { place.wrapping_sub(offset) };
            self.constants.push(at);
        }
        let index = is_indexed.then_some(second & 0xF);
        self.load(second >> 12, [Some(base), index], before)
    }

    fn coprocessor(&mut self, first: u16, second: u16, place: u32, before: Before) -> Before {
        self.uses_fpu = true;
        let result = field::float_result(first, second);
        let operands = [result, field::float_first(first, second), field::float_second(second)];
        // The fields of a transfer or an access hold other things, too: then the estimate may be too high.
        if matches!(before, Before::Float(ready) if operands.contains(&ready)) {
            self.cost.add(Cost::new(0, 1));
        }
        let cost = if first & 0xFE00 == 0xEC00 {
            let words = u32::from(second & 0xFF);
            if first & 0x0120 != 0x0100 {
                self.several(words);
                return Before::Other;
            }
            if first & 0x1F == 0x1F {
                let offset = 4 * words;
                let at =
                    if first & 0x80 != 0 { place + offset } else { place.wrapping_sub(offset) };
                self.constants.push(at);
            }
            Cost::new(1, 2)
        } else if second & 0x10 != 0 {
            Cost::new(1, 1)
        } else {
            match first & 0xFFB0 {
                0xEE00 | 0xEE10 | 0xEE90 | 0xEEA0 => Cost::new(3, 3),
                0xEE80 => Cost::new(14, 14),
                0xEEB0 if first & 0xF == 1 && second & 0xC0 == 0xC0 => Cost::new(14, 14),
                _ => Cost::new(1, 1),
            }
        };
        self.cost.add(cost);
        Before::Float(result)
    }
}

/// Access settings of the flash: FLASH_ACR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FlashAccess {
    /// Wait states of a 64-bit unit.
    pub wait_states: u32,
    /// Prefetch is on.
    pub prefetch: bool,
    /// The instruction cache is on.
    pub code_cache: bool,
    /// The data cache is on.
    pub data_cache: bool,
}

impl FlashAccess {
    /// Reads the settings from the register.
    pub const fn from_register(acr: u32) -> Self {
        Self {
            wait_states: acr & 0xF,
            prefetch: acr >> 8 & 1 == 1,
            code_cache: acr >> 9 & 1 == 1,
            data_cache: acr >> 10 & 1 == 1,
        }
    }
}

/// Lines of the flash.
const FLASH_LINES: usize = (512 << 10) / LINE_BYTES as usize;

/// Lines of a cache, which replaces the least recently used one. They form a ring from the latest to the least recently
/// used, so that an access takes the same short time for a hit and a miss.
#[derive(Clone, Debug)]
struct Lines {
    /// Place in the ring of each line of the flash, plus one; 0 if it is not cached.
    places: Vec<u8>,
    ring: Vec<RingLine>,
    latest: usize,
}

#[derive(Clone, Copy, Debug)]
struct RingLine {
    /// Line of the flash; `None` if it is empty.
    line: Option<u16>,
    /// Places of the lines that were used before it and after it.
    before: u8,
    after: u8,
}

impl Lines {
    fn new(capacity: u8) -> Self {
        let ring = (0..capacity).map(|at| RingLine {
            line: None,
            before: (at + 1) % capacity,
            after: (at + capacity - 1) % capacity,
        });
        Self { places: vec![0; FLASH_LINES], ring: ring.collect(), latest: 0 }
    }

    fn touch(&mut self, address: u32) -> bool {
        let line = (address / LINE_BYTES) as usize % FLASH_LINES;
        let known = usize::from(self.places[line]);
        if known == self.latest + 1 {
            return true;
        }
        // In a ring, the least recently used line is behind the latest one.
        let oldest = usize::from(self.ring[self.latest].after);
        let place = if known > 0 { known - 1 } else { oldest };
        if known == 0 {
            if let Some(replaced) = self.ring[place].line.replace(line as u16) {
                self.places[usize::from(replaced)] = 0;
            }
            self.places[line] = place as u8 + 1;
        }
        self.make_latest(place, oldest);
        known > 0
    }

    /// Moves a line between the latest and the oldest one.
    fn make_latest(&mut self, place: usize, oldest: usize) {
        if place != oldest {
            let RingLine { before, after, .. } = self.ring[place];
            self.ring[usize::from(before)].after = after;
            self.ring[usize::from(after)].before = before;
            let latest = self.latest;
            (self.ring[place].before, self.ring[place].after) = (latest as u8, oldest as u8);
            self.ring[latest].after = place as u8;
            self.ring[oldest].before = place as u8;
        }
        self.latest = place;
    }
}

/// The caches in front of the flash.
#[derive(Clone, Debug)]
pub struct FlashCaches {
    code: Lines,
    data: Lines,
}

impl Default for FlashCaches {
    fn default() -> Self {
        Self { code: Lines::new(CODE_LINES), data: Lines::new(DATA_LINES) }
    }
}

impl FlashCaches {
    /// Returns the wait states of a block in flash, and changes the caches.
    pub fn fetch(&mut self, access: FlashAccess, address: u32, bytes: u32) -> u32 {
        let (mut cycles, mut line, mut is_cached) = (0, u32::MAX, false);
        let mut unit = address / UNIT_BYTES;
        let end = (address + bytes.max(1) - 1) / UNIT_BYTES;
        let mut is_first = true;
        while unit <= end {
            if access.code_cache && line != unit * UNIT_BYTES / LINE_BYTES {
                line = unit * UNIT_BYTES / LINE_BYTES;
                is_cached = self.code.touch(unit * UNIT_BYTES);
            }
            if !is_cached {
                cycles += if access.prefetch && !is_first { 1 } else { access.wait_states };
            }
            is_first = false;
            unit += 1;
        }
        cycles
    }

    /// Returns the wait states of a constant in flash, and changes the caches.
    pub fn load(&mut self, access: FlashAccess, address: u32) -> u32 {
        if access.data_cache && self.data.touch(address) { 0 } else { access.wait_states }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(code: &[u16]) -> Cost {
        let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        Block::decode(0x0800_0000, &bytes).cost
    }

    #[test]
    fn cost_of_known_instructions_matches_manual() {
        // adds r0, r0, #1
        assert_eq!(cost(&[0x3001]), Cost::new(1, 1));
        // ldr r0, [r1]; and another that does not need r0, or does
        assert_eq!(cost(&[0x6808]), Cost::new(1, 2));
        assert_eq!(cost(&[0x6808, 0x685A]), Cost::new(2, 3));
        assert_eq!(cost(&[0x6808, 0x6842]), Cost::new(2, 4));
        // str r0, [r1]; str r0, [r1, r2]
        assert_eq!(cost(&[0x6008]), Cost::new(1, 1));
        assert_eq!(cost(&[0x5088]), Cost::new(1, 2));
        // push {r4-r7, lr}
        assert_eq!(cost(&[0xB5F0]), Cost::new(5, 6));
        // sdiv r0, r0, r1
        assert_eq!(cost(&[0xFB90, 0xF0F1]), Cost::new(2, 12));
        // vadd.f32 s0, s0, s1; alone, and before vmul.f32 s2, s0, s3 or vmul.f32 s2, s4, s3
        assert_eq!(cost(&[0xEE30, 0x0A20]), Cost::new(1, 1));
        assert_eq!(cost(&[0xEE30, 0x0A20, 0xEE20, 0x1A21]), Cost::new(2, 3));
        assert_eq!(cost(&[0xEE30, 0x0A20, 0xEE22, 0x1A21]), Cost::new(2, 2));
        // vdiv.f32 s0, s0, s1; vfma.f32 s0, s1, s2; vsqrt.f32 s0, s1
        assert_eq!(cost(&[0xEE80, 0x0A20]), Cost::new(14, 14));
        assert_eq!(cost(&[0xEEA0, 0x0A81]), Cost::new(3, 3));
        assert_eq!(cost(&[0xEEB1, 0x0AE0]), Cost::new(14, 14));
        // vpush {s16-s19}
        assert_eq!(cost(&[0xED2D, 0x8A04]), Cost::new(4, 5));
    }

    #[test]
    fn block_with_literal_load_names_its_address() {
        // ldr r0, [pc, #8]
        let block = Block::decode(0x0800_0002, &0x4802u16.to_le_bytes());
        assert_eq!(block.constants, [0x0800_000C]);
    }

    #[test]
    fn caches_with_repeated_block_cost_nothing_the_second_time() {
        let access =
            FlashAccess { wait_states: 4, prefetch: false, code_cache: true, data_cache: true };
        let mut caches = FlashCaches::default();
        assert_eq!(caches.fetch(access, 0x0800_0000, 32), 16);
        assert_eq!(caches.fetch(access, 0x0800_0000, 32), 0);
        let prefetching = FlashAccess { prefetch: true, ..access };
        assert_eq!(caches.fetch(prefetching, 0x0800_1000, 32), 4 + 3);
        for line in 0..32 {
            caches.fetch(access, 0x0801_0000 + 32 * line, 4);
        }
        assert!(caches.fetch(access, 0x0800_0000, 4) > 0, "33 lines do not fit");
        // It replaced line 0, and line 1 is used again before line 2 is replaced.
        assert_eq!(caches.fetch(access, 0x0801_0020, 4), 0);
        assert!(caches.fetch(access, 0x0801_0000, 4) > 0);
        assert_eq!(caches.fetch(access, 0x0801_0020, 4), 0);
        assert!(caches.fetch(access, 0x0801_0040, 4) > 0);
    }
}
