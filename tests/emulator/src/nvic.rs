//! Interrupt controller: pending exceptions, priorities, and the stack of active ones.
//!
//! Priorities have four bits, in the upper half of their byte (RM0440, 14.1). A lower number is more urgent. The
//! reset value of PRIGROUP makes all four bits preempt.

/// Number of exceptions: 16 of the core and 102 of the chip.
const EXCEPTIONS: usize = 16 + 102;

/// Non-maskable interrupt.
pub const NMI: usize = 2;
/// Hard fault.
pub const HARD_FAULT: usize = 3;
/// Exception number of the chip's first interrupt.
pub const FIRST_INTERRUPT: usize = 16;

/// Priority of thread mode: below every exception.
const THREAD_PRIORITY: i32 = 256;

/// State of the interrupt controller.
#[derive(Clone, Debug)]
pub struct Nvic {
    /// A bit for each exception.
    enabled: u128,
    pending: u128,
    /// Priority bytes as written.
    priority: [u8; EXCEPTIONS],
    /// Exceptions that run, the innermost last.
    active: Vec<usize>,
}

impl Default for Nvic {
    fn default() -> Self {
        Self {
            enabled: (1 << FIRST_INTERRUPT) - 1,
            pending: 0,
            priority: [0; EXCEPTIONS],
            active: Vec::new(),
        }
    }
}

impl Nvic {
    /// Returns the priority of an exception; a lower one is more urgent.
    pub fn priority_of(&self, exception: usize) -> i32 {
        match exception {
            NMI => -2,
            HARD_FAULT => -1,
            _ => i32::from(self.priority[exception] & 0xF0),
        }
    }

    /// Returns the exception that runs; 0 in thread mode.
    pub fn current(&self) -> usize {
        self.active.last().copied().unwrap_or(0)
    }

    /// Returns the number of exceptions that run.
    pub fn depth(&self) -> usize {
        self.active.len()
    }

    /// Returns true if this exception runs, or is preempted.
    pub fn is_active(&self, exception: usize) -> bool {
        self.active.contains(&exception)
    }

    /// Marks an exception as pending.
    pub fn pend(&mut self, exception: usize) {
        self.pending |= 1 << exception;
    }

    /// Sets the line of a level-sensitive interrupt. The pending state is kept until the interrupt is taken.
    pub fn set_line(&mut self, interrupt: usize, is_high: bool) {
        let exception = FIRST_INTERRUPT + interrupt;
        if is_high && !self.is_active(exception) {
            self.pending |= 1 << exception;
        }
    }

    /// Returns the pending exception that would preempt what runs, without regard to masks.
    pub fn candidate(&self) -> Option<usize> {
        // Exception 0 is thread mode.
        let mut waiting = self.pending & self.enabled & !1;
        let mut best: Option<(i32, usize)> = None;
        while waiting != 0 {
            let exception = waiting.trailing_zeros() as usize;
            waiting &= waiting - 1;
            let candidate = (self.priority_of(exception), exception);
            best = Some(best.map_or(candidate, |best| best.min(candidate)));
        }
        let (priority, exception) = best?;
        let active = self.active.iter().map(|&active| self.priority_of(active));
        (priority < active.min().unwrap_or(THREAD_PRIORITY)).then_some(exception)
    }

    /// Returns true if these masks allow the exception.
    pub fn is_allowed(&self, exception: usize, primask: u32, basepri: u32) -> bool {
        let priority = self.priority_of(exception);
        priority < 0 || primask & 1 == 0 && (basepri == 0 || priority < basepri as i32)
    }

    /// Returns true if any enabled exception is pending: WFI then returns.
    pub fn wakes(&self) -> bool {
        self.pending & self.enabled & !1 != 0
    }

    /// Begins an exception.
    pub fn enter(&mut self, exception: usize) {
        self.pending &= !(1 << exception);
        self.active.push(exception);
    }

    /// Ends the innermost exception.
    pub fn leave(&mut self) {
        self.active.pop();
    }

    /// Reads a register of the NVIC, at this offset from 0xE000_E000.
    pub fn read(&self, offset: u32) -> u32 {
        let bits = |from: u32, of: u128| {
            let base = FIRST_INTERRUPT + (offset - from) as usize / 4 * 32;
            of.checked_shr(base as u32).unwrap_or(0) as u32
        };
        match offset {
            0x100..=0x11F => bits(0x100, self.enabled),
            0x180..=0x19F => bits(0x180, self.enabled),
            0x200..=0x21F => bits(0x200, self.pending),
            0x280..=0x29F => bits(0x280, self.pending),
            0x400..=0x4EF => self.priority_word(FIRST_INTERRUPT + (offset - 0x400) as usize),
            0xD18..=0xD23 => self.priority_word(4 + (offset - 0xD18) as usize),
            _ => 0,
        }
    }

    fn priority_word(&self, first: usize) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|at| {
            self.priority.get((first & !3) + at).copied().unwrap_or(0)
        }))
    }

    /// Writes a register of the NVIC; `size` bytes.
    pub fn write(&mut self, offset: u32, size: usize, value: u32) {
        let word = |from: u32| FIRST_INTERRUPT + (offset - from) as usize / 4 * 32;
        let (of, base, to): (&mut u128, usize, bool) = match offset {
            0x100..=0x11F => (&mut self.enabled, word(0x100), true),
            0x180..=0x19F => (&mut self.enabled, word(0x180), false),
            0x200..=0x21F => (&mut self.pending, word(0x200), true),
            0x280..=0x29F => (&mut self.pending, word(0x280), false),
            0x400..=0x4EF => {
                return self.write_priorities(
                    FIRST_INTERRUPT + (offset - 0x400) as usize,
                    size,
                    value,
                );
            }
            0xD18..=0xD23 => {
                return self.write_priorities(4 + (offset - 0xD18) as usize, size, value);
            }
            _ => return,
        };
        let bits = u128::from(value).checked_shl(base as u32).unwrap_or(0);
        *of = if to { *of | bits } else { *of & !bits };
    }

    fn write_priorities(&mut self, first: usize, size: usize, value: u32) {
        for (at, byte) in value.to_le_bytes().into_iter().take(size).enumerate() {
            if let Some(priority) = self.priority.get_mut(first + at) {
                *priority = byte & 0xF0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidate_with_lower_priority_than_active_is_none() {
        let mut nvic = Nvic::default();
        nvic.write(0x100, 4, 1 << 18 | 1 << 21);
        nvic.write(0x400 + 18, 1, 0x10);
        nvic.write(0x400 + 21, 1, 0x80);
        nvic.pend(16 + 18);
        assert_eq!(nvic.candidate(), Some(34));
        nvic.enter(34);
        nvic.pend(16 + 21);
        assert_eq!(nvic.candidate(), None);
        nvic.leave();
        assert_eq!(nvic.candidate(), Some(37));
        assert!(!nvic.is_allowed(37, 0, 0x80));
        assert!(!nvic.is_allowed(37, 1, 0));
        assert!(nvic.is_allowed(NMI, 1, 0));
    }
}
