//! TIM5 or TIM2: an upward counter with update and two compare interrupts (RM0440, 29).

const CR1: u32 = 0x00;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;

const ENABLED: u32 = 1;
const UPDATES_ONLY_BY_COUNTER: u32 = 1 << 2;

/// The timer.
#[derive(Clone, Debug)]
pub struct Timer5 {
    registers: [u32; 32],
    prescaler: u64,
    /// Time and count at the last change.
    since: (u64, u64),
    processed: u64,
    next: u64,
}

impl Default for Timer5 {
    fn default() -> Self {
        let mut registers = [0; 32];
        registers[ARR as usize / 4] = u32::MAX;
        Self { registers, prescaler: 1, since: (0, 0), processed: 0, next: u64::MAX }
    }
}

impl Timer5 {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    fn is_running(&self) -> bool {
        self.register(CR1) & ENABLED != 0
    }

    fn period(&self) -> u64 {
        u64::from(self.register(ARR)) + 1
    }

    /// Ticks since the count was 0, without the overflow.
    fn ticks(&self, now: u64) -> u64 {
        let (at, count) = self.since;
        if self.is_running() { count + (now - at) / self.prescaler } else { count }
    }

    /// Time at which the count reaches this number of ticks.
    fn time_of(&self, ticks: u64) -> u64 {
        let (at, count) = self.since;
        at + (ticks - count) * self.prescaler
    }

    fn schedule(&mut self) {
        self.next = u64::MAX;
        if self.is_running() {
            for value in [0, u64::from(self.register(CCR1)), u64::from(self.register(CCR2))] {
                let turn = self.processed / self.period() * self.period();
                let ticks = if turn + value > self.processed {
                    turn + value
                } else {
                    turn + value + self.period()
                };
                self.next = self.next.min(self.time_of(ticks));
            }
        }
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        self.next
    }

    /// Sets the flags of the counts that were passed.
    pub fn process(&mut self, now: u64) {
        if now < self.next {
            return;
        }
        let ticks = self.ticks(now);
        for (flag, value) in
            [(1, 0), (2, u64::from(self.register(CCR1))), (4, u64::from(self.register(CCR2)))]
        {
            let passes = |until: u64| (until + self.period() - value) / self.period();
            if passes(ticks) > passes(self.processed) {
                self.registers[SR as usize / 4] |= flag;
            }
        }
        self.processed = ticks;
        self.schedule();
    }

    /// Returns true if an enabled flag is set.
    pub fn line(&self) -> bool {
        self.register(SR) & self.register(DIER) & 0x1F != 0
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> u32 {
        match offset {
            CNT => (self.ticks(now) % self.period()) as u32,
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32, now: u64) {
        self.process(now);
        let place = offset as usize / 4;
        match offset {
            SR => self.registers[place] &= word,
            EGR if word & 1 != 0 => {
                self.prescaler = u64::from(self.register(PSC)) + 1;
                self.restart(now, 0);
                if self.register(CR1) & UPDATES_ONLY_BY_COUNTER == 0 {
                    self.registers[SR as usize / 4] |= 1;
                }
            }
            CNT => self.restart(now, u64::from(word)),
            CR1 => {
                let count = self.ticks(now) % self.period();
                self.registers[place] = word;
                self.restart(now, count);
            }
            _ => {
                if let Some(register) = self.registers.get_mut(place) {
                    *register = word;
                }
            }
        }
        self.schedule();
    }

    fn restart(&mut self, now: u64, count: u64) {
        self.since = (now, count);
        self.processed = count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_with_sixteen_bit_period_follow_count() {
        let mut timer = Timer5::default();
        timer.write(PSC, 169, 0);
        timer.write(ARR, 0xFFFF, 0);
        timer.write(CCR1, 0x8000, 0);
        timer.write(CCR2, 0xFFF0, 0);
        timer.write(CR1, UPDATES_ONLY_BY_COUNTER, 0);
        timer.write(EGR, 1, 0);
        timer.write(DIER, 3, 0);
        timer.write(CR1, ENABLED, 1000);
        assert_eq!(timer.read(CNT, 1000 + 170 * 10), 10);
        assert_eq!(timer.next_event(), 1000 + 170 * 0x8000);
        timer.process(1000 + 170 * 0x8000);
        assert_eq!(timer.read(SR, 0), 2);
        timer.write(SR, !2, 1000 + 170 * 0x8001);
        timer.process(1000 + 170 * 0x10000);
        assert_eq!(timer.read(SR, 0), 5, "update, and compare 2 on the way");
        assert!(timer.line());
    }
}
