//! TIM20 or TIM4 as a counter of a quadrature encoder: encoder mode 3, and the index captured by channel 3 (RM0440, 28).
//!
//! The edges come from the surroundings. Mode 3 counts those of both lines; modes 1 and 2 count the edges of one line, so
//! that two edges are one count. Without the pins' alternate functions no edge arrives.

const CR1: u32 = 0x00;
const SMCR: u32 = 0x08;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const CCR3: u32 = 0x3C;

const ENABLED: u32 = 1;
const MODES: u32 = 0x1_0007;
/// Input selection of channels 1 and 2, or of channel 3, on their own pins.
const BOTH_INPUTS: u32 = 0x0101;
const BOTH_SELECTIONS: u32 = 0x0303;
const CAPTURES: u32 = 1 << 8;
const CAPTURES_FALLING: u32 = 1 << 9;
const CAPTURED: u32 = 1 << 3;
const CAPTURED_AGAIN: u32 = 1 << 11;
const DOUBLE_EDGE: u32 = 1 << 23;

/// What a quadrature encoder has shown since its power-up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Number of the edges of both lines, signed.
    pub count: i64,
    /// This number at the last rise of the index since the last call.
    pub index: Option<i64>,
    /// Both lines have changed at once.
    pub has_double_edge: bool,
}

/// The timer.
#[derive(Clone, Debug)]
pub struct Timer20 {
    registers: [u32; 32],
    /// Edges at the last call; `None` before the first.
    last: Option<i64>,
    /// Edges that are no whole count yet.
    rest: i64,
}

impl Default for Timer20 {
    fn default() -> Self {
        let mut registers = [0; 32];
        registers[0x2C / 4] = 0xFFFF;
        Self { registers, last: None, rest: 0 }
    }
}

impl Timer20 {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    /// Edges that make one count: 1 in mode 3, 2 in modes 1 and 2; `None` if the timer does not count edges.
    fn edges_per_count(&self) -> Option<i64> {
        let has_inputs = self.register(CCMR1) & BOTH_SELECTIONS == BOTH_INPUTS;
        let is_counting = self.register(CR1) & ENABLED != 0 && has_inputs;
        match self.register(SMCR) & MODES {
            3 if is_counting => Some(1),
            1 | 2 if is_counting => Some(2),
            _ => None,
        }
    }

    /// Counts the edges up to now; none arrive if the pins are not connected.
    pub fn follow(&mut self, edges: Edges, are_connected: bool) {
        let before = self.last.replace(edges.count).unwrap_or(edges.count);
        let Some(per_count) = self.edges_per_count().filter(|_| are_connected) else { return };
        let at = |count: u32, edges: i64| (i64::from(count) + edges.div_euclid(per_count)) as u32;
        let moved = edges.count - before + self.rest;
        if let Some(index) = edges.index {
            self.capture(at(self.register(CNT), index - before + self.rest));
        }
        self.registers[CNT as usize / 4] = at(self.register(CNT), moved) & 0xFFFF;
        self.rest = moved.rem_euclid(per_count);
        if edges.has_double_edge {
            self.registers[SR as usize / 4] |= DOUBLE_EDGE;
        }
    }

    fn capture(&mut self, count: u32) {
        let is_input = self.register(CCMR2) & 3 == 1;
        let captures = self.register(CCER) & (CAPTURES | CAPTURES_FALLING) == CAPTURES;
        if is_input && captures {
            let again = if self.register(SR) & CAPTURED != 0 { CAPTURED_AGAIN } else { 0 };
            self.registers[SR as usize / 4] |= CAPTURED | again;
            self.registers[CCR3 as usize / 4] = count & 0xFFFF;
        }
    }

    /// Reads a register. Reading a capture clears its flag.
    pub fn read(&mut self, offset: u32) -> u32 {
        if offset == CCR3 {
            self.registers[SR as usize / 4] &= !CAPTURED;
        }
        self.registers.get(offset as usize / 4).copied().unwrap_or(0)
    }

    /// Writes a register. Flags are cleared by 0.
    pub fn write(&mut self, offset: u32, word: u32) {
        match offset {
            SR => self.registers[SR as usize / 4] &= word,
            _ => {
                if let Some(register) = self.registers.get_mut(offset as usize / 4) {
                    *register = word;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timer(mode: u32) -> Timer20 {
        let mut timer = Timer20::default();
        for (offset, word) in
            [(CCMR1, 0x3131), (CCMR2, 0x31), (CCER, CAPTURES), (SMCR, mode), (CR1, ENABLED)]
        {
            timer.write(offset, word);
        }
        timer.follow(Edges { count: 1000, ..Edges::default() }, true);
        timer
    }

    #[test]
    fn counter_follows_edges_of_both_lines_and_captures_the_index() {
        let mut timer = timer(3);
        timer.follow(Edges { count: 990, index: Some(995), has_double_edge: false }, true);
        assert_eq!(timer.read(CNT), 0xFFFF - 9);
        assert_eq!(timer.read(SR), CAPTURED);
        assert_eq!((timer.read(CCR3), timer.read(SR)), (0xFFFF - 4, 0));
        timer.follow(Edges { count: 1010, index: None, has_double_edge: true }, true);
        assert_eq!((timer.read(CNT), timer.read(SR)), (10, DOUBLE_EDGE));
        timer.write(SR, !DOUBLE_EDGE);
        assert_eq!(timer.read(SR), 0);
    }

    #[test]
    fn counter_in_other_mode_or_without_pins_counts_less() {
        let mut timer = timer(1);
        timer.follow(Edges { count: 1007, ..Edges::default() }, true);
        assert_eq!(timer.read(CNT), 3);
        timer.follow(Edges { count: 1020, ..Edges::default() }, false);
        assert_eq!(timer.read(CNT), 3);
    }
}
