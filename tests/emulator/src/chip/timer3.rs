//! TIM3: centre-aligned, started by TIM1, with chip select, a DMA request and a trigger output (RM0440, 29).
//!
//! Implemented are the modes that the image uses: both directions count as compare events (CMS = 11), channel 2 is the
//! OR of two compares, and the trigger output is the reference of channel 4.

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const EGR: u32 = 0x14;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;
const CCR3: u32 = 0x3C;
const CCR4: u32 = 0x40;

const ENABLED: u32 = 1;
const COUNTS_DOWN: u32 = 1 << 4;
const TRIGGER_MODE: u32 = 6;
const CHANNEL_1_DMA: u32 = 1 << 9;
const CHANNEL_3_DMA: u32 = 1 << 11;
const CHANNEL_2_ENABLED: u32 = 1 << 4;
/// Trigger output on channel 4's reference (CR2, MMS).
const TRIGGER_ON_CHANNEL_4: u32 = 7;

/// An event of the timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlaveEvent {
    /// Channel 1 matches: a DMA request.
    OuterRequest,
    /// Channel 3 matches: a DMA request. Chip select is released after this many cycles.
    Request {
        /// Cycles until chip select is released.
        release_in: u64,
    },
    /// An edge of the trigger output.
    Trigger {
        /// The reference rises.
        is_rising: bool,
    },
}

/// The timer.
#[derive(Clone, Debug)]
pub struct Timer3 {
    registers: [u32; 32],
    /// Time at which the count was 0 and rose, which may lie before the start; `None` before the start.
    origin: Option<i64>,
    taken: u64,
    next: u64,
}

impl Default for Timer3 {
    fn default() -> Self {
        Self { registers: [0; 32], origin: None, taken: 0, next: u64::MAX }
    }
}

impl Timer3 {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    fn top(&self) -> u64 {
        u64::from(self.register(ARR)).max(1)
    }

    fn phase(&self, now: u64) -> u64 {
        let period = 2 * self.top() as i64;
        self.origin.map_or(0, |origin| (now as i64 - origin).rem_euclid(period) as u64)
    }

    fn count(&self, now: u64) -> u64 {
        let (phase, top) = (self.phase(now), self.top());
        if phase < top { phase } else { 2 * top - phase }
    }

    /// The master has started: it starts too, if its slave mode is the trigger mode on ITR0.
    pub fn start_with_master(&mut self, now: u64) {
        let (mode, source) = (self.register(SMCR) & 0x1_0007, self.register(SMCR) >> 4 & 0x3_0007);
        if mode == TRIGGER_MODE && source == 0 && self.origin.is_none() {
            self.registers[CR1 as usize / 4] |= ENABLED;
            self.origin = Some(now as i64 - i64::from(self.register(CNT)));
            self.taken = now;
            self.schedule();
        }
    }

    /// Returns true if channel 2 selects the encoder at this time: it is low between both compare values.
    pub fn selects(&self, now: u64) -> bool {
        let count = self.count(now);
        let (above, below) = (u64::from(self.register(CCR1)), u64::from(self.register(CCR2)));
        self.register(CCER) & CHANNEL_2_ENABLED != 0
            && self.origin.is_some()
            && (below..above).contains(&count)
    }

    fn phases(&self) -> [(u64, SlaveEvent); 6] {
        let top = self.top();
        let compare = |offset: u32| u64::from(self.register(offset)).min(top);
        let (command, trigger) = (compare(CCR3), compare(CCR4));
        let outer = compare(CCR1);
        [
            (outer, SlaveEvent::OuterRequest),
            (2 * top - outer, SlaveEvent::OuterRequest),
            (command, SlaveEvent::Request { release_in: compare(CCR1).saturating_sub(command) }),
            (
                2 * top - command,
                SlaveEvent::Request { release_in: command.saturating_sub(compare(CCR2)) },
            ),
            // PWM mode 1: high below the compare value.
            (trigger, SlaveEvent::Trigger { is_rising: false }),
            (2 * top - trigger, SlaveEvent::Trigger { is_rising: true }),
        ]
    }

    fn upcoming(&self) -> Option<(u64, SlaveEvent)> {
        self.origin?;
        let period = 2 * self.top();
        let taken = self.phase(self.taken);
        let waits = self.phases().map(|(phase, event)| {
            let wait = (phase + period - taken) % period;
            (self.taken + if wait == 0 { period } else { wait }, event)
        });
        waits.into_iter().min_by_key(|(at, _)| *at)
    }

    fn schedule(&mut self) {
        self.next = self.upcoming().map_or(u64::MAX, |(at, _)| at);
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        self.next
    }

    /// Takes the next event that is due and enabled.
    pub fn take_event(&mut self, now: u64) -> Option<(u64, SlaveEvent)> {
        while self.next <= now
            && let Some((at, event)) = self.upcoming()
        {
            self.taken = at;
            let is_enabled = match event {
                SlaveEvent::OuterRequest => self.register(DIER) & CHANNEL_1_DMA != 0,
                SlaveEvent::Request { .. } => self.register(DIER) & CHANNEL_3_DMA != 0,
                SlaveEvent::Trigger { .. } => self.register(CR2) >> 4 & 7 == TRIGGER_ON_CHANNEL_4,
            };
            if is_enabled {
                self.schedule();
                return Some((at, event));
            }
            self.schedule();
        }
        None
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> u32 {
        match offset {
            CNT if self.origin.is_some() => self.count(now) as u32,
            CR1 => {
                let is_down = self.phase(now) >= self.top();
                self.register(CR1) & !COUNTS_DOWN | if is_down { COUNTS_DOWN } else { 0 }
            }
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32) {
        if offset != EGR
            && let Some(register) = self.registers.get_mut(offset as usize / 4)
        {
            *register = word;
        }
        self.schedule();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timer_started_by_master_requests_two_frames_around_its_top() {
        let mut timer = Timer3::default();
        for (offset, word) in [(ARR, 4250), (CCR1, 4210), (CCR2, 2970), (CCR3, 3590), (CCR4, 3000)]
        {
            timer.write(offset, word);
        }
        timer.write(CCER, CHANNEL_2_ENABLED);
        timer.write(DIER, CHANNEL_3_DMA);
        timer.write(SMCR, TRIGGER_MODE);
        timer.write(CNT, 1020);
        timer.start_with_master(10_000);
        let first = 10_000 + 3590 - 1020;
        assert_eq!(
            timer.take_event(20_000),
            Some((first, SlaveEvent::Request { release_in: 620 }))
        );
        assert!(timer.selects(first) && !timer.selects(first + 650));
        let second = first + 2 * (4250 - 3590);
        assert_eq!(
            timer.take_event(20_000),
            Some((second, SlaveEvent::Request { release_in: 620 }))
        );
        assert_eq!(timer.take_event(18_000), None);
        assert_eq!(timer.read(CNT, first), 3590);
    }
}
