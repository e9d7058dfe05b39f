//! TIM1: centre-aligned PWM with repetition counter, preload, main output and break (RM0440, 28).
//!
//! The count follows from the time. Events are the turning points and the edges of channel 4's reference, which is
//! the trigger output (TRGO2). With CMS = 0 the counter is edge-aligned: it rises to the top and starts again at 0.

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;
const CCR4: u32 = 0x40;
const BDTR: u32 = 0x44;

const ENABLED: u32 = 1;
const COUNTS_DOWN: u32 = 1 << 4;
/// Alignment in CR1: 0 for the edge.
const ALIGNMENT: u32 = 3 << 5;
const UPDATE_FLAG: u32 = 1;
const BREAK_FLAG: u32 = 1 << 7;
const SYSTEM_BREAK_FLAG: u32 = 1 << 13;
const BREAK_ENABLED: u32 = 1 << 12;
const MAIN_OUTPUT: u32 = 1 << 15;
/// Bits of BDTR that level 3 of the lock protects: all but MOE, and the lock itself.
const LOCK: u32 = 3 << 8;
/// Trigger output on channel 4's reference (CR2, MMS2).
const TRIGGER_ON_CHANNEL_4: u32 = 7;
/// Modes of a channel (OCxM): high below the compare value, and above it.
const PWM_MODE_1: u32 = 6;
const PWM_MODE_2: u32 = 7;
/// Bits of CCER for a channel whose output and complementary output are enabled and active high.
const BOTH_OUTPUTS: u32 = 0b0101;
/// The pin of the break is enabled, and inverted (AF1).
const AF1: u32 = 0x60;
const BREAK_PIN_ENABLED: u32 = 1;
const BREAK_PIN_INVERTED: u32 = 1 << 9;

/// An event of the timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimerEvent {
    /// The counter turns at the top or at the bottom.
    Turn,
    /// An edge of the trigger output.
    Trigger {
        /// The reference rises.
        is_rising: bool,
    },
}

/// The timer.
#[derive(Clone, Debug)]
pub struct Timer1 {
    registers: [u32; 32],
    /// Compare values in effect.
    active: [u32; 4],
    repetitions_left: u32,
    /// Time at which the count was 0 and rose; `None` before the start.
    started: Option<u64>,
    /// Time up to which events were taken.
    taken: u64,
    last_trigger: u64,
    next: u64,
    is_locked: bool,
}

impl Default for Timer1 {
    fn default() -> Self {
        Self {
            registers: [0; 32],
            active: [0; 4],
            repetitions_left: 0,
            started: None,
            taken: 0,
            last_trigger: 0,
            next: u64::MAX,
            is_locked: false,
        }
    }
}

/// Returns true if a write to this register may change the state of the bridge.
pub const fn changes_bridge(offset: u32) -> bool {
    matches!(offset, CR1 | EGR | BDTR | CCMR1 | CCMR2 | CCER)
}

impl Timer1 {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    fn top(&self) -> u64 {
        u64::from(self.register(ARR)).max(1)
    }

    fn is_centre_aligned(&self) -> bool {
        self.register(CR1) & ALIGNMENT != 0
    }

    /// Cycles from bottom to bottom.
    fn period(&self) -> u64 {
        if self.is_centre_aligned() { 2 * self.top() } else { self.top() + 1 }
    }

    /// Time in the period, cycles.
    fn phase(&self, now: u64) -> u64 {
        self.started.map_or(0, |started| (now - started) % self.period())
    }

    fn count(&self, now: u64) -> u64 {
        let (phase, top) = (self.phase(now), self.top());
        if phase <= top { phase } else { 2 * top - phase }
    }

    /// Mode of a channel, from 0.
    fn mode(&self, channel: usize) -> u32 {
        let word = self.register(if channel < 2 { CCMR1 } else { CCMR2 }) >> (8 * (channel % 2));
        word >> 4 & 7 | (word >> 16 & 1) << 3
    }

    /// Duties in effect, from 0 to 1; `None` if the bridge is open.
    ///
    /// A half bridge follows its channel only if both outputs are enabled. With one of them its other switch never conducts
    /// (RM0440, 28.3.16). The joint then has no sound voltages, and the whole bridge counts as open.
    pub fn duties(&self) -> Option<[f64; 3]> {
        let outputs = self.register(CCER) & 0xFFF;
        if !self.is_main_output_enabled() || outputs != BOTH_OUTPUTS * 0x111 {
            return None;
        }
        let top = self.top() as f64;
        Some(std::array::from_fn(|channel| {
            let below = (f64::from(self.active[channel]) / top).min(1.0);
            match self.mode(channel) {
                PWM_MODE_1 => below,
                PWM_MODE_2 => 1.0 - below,
                _ => 0.0,
            }
        }))
    }

    /// Returns for phases a and b whether the low side conducts at this time.
    pub fn low_sides(&self, now: u64) -> [bool; 2] {
        let count = self.count(now);
        let is_open = self.duties().is_none();
        std::array::from_fn(|channel| {
            let is_above = count >= u64::from(self.active[channel]);
            is_open || is_above != (self.mode(channel) == PWM_MODE_2)
        })
    }

    /// Returns true if this level of the pin TIM1_BKIN activates the break, whose input is active high.
    pub fn breaks_at(&self, is_high: bool) -> bool {
        let word = self.register(AF1);
        word & BREAK_PIN_ENABLED != 0 && is_high != (word & BREAK_PIN_INVERTED != 0)
    }

    /// Returns true if the main output is enabled (MOE).
    pub fn is_main_output_enabled(&self) -> bool {
        self.register(BDTR) & MAIN_OUTPUT != 0
    }

    /// Time of the last trigger, cycles.
    pub fn last_trigger(&self) -> u64 {
        self.last_trigger
    }

    /// Returns true if the counter runs.
    pub fn is_running(&self) -> bool {
        self.started.is_some()
    }

    /// Returns true if its enable is the trigger output for other timers (CR2, MMS).
    pub fn signals_its_start(&self) -> bool {
        self.register(CR2) >> 4 & 7 == 1
    }

    /// Returns true if a break flag is set.
    pub fn has_break(&self) -> bool {
        self.register(SR) & (BREAK_FLAG | SYSTEM_BREAK_FLAG) != 0
    }

    /// Activates the break input, or the system's.
    pub fn set_break(&mut self, is_system: bool) {
        if is_system || self.register(BDTR) & BREAK_ENABLED != 0 {
            self.registers[SR as usize / 4] |=
                if is_system { SYSTEM_BREAK_FLAG } else { BREAK_FLAG };
            self.open();
        }
    }

    /// Disables the main output, as a reset does.
    pub fn open(&mut self) {
        self.registers[BDTR as usize / 4] &= !MAIN_OUTPUT;
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        self.next
    }

    /// Phases of the events: the edges of channel 4's reference, and the turning points.
    fn phases(&self) -> [(u64, TimerEvent); 4] {
        let (top, compare) = (self.top(), u64::from(self.active[3]));
        let is_high_above = self.mode(3) == PWM_MODE_2;
        if !self.is_centre_aligned() {
            let edge = |is_rising| TimerEvent::Trigger { is_rising };
            // The other edge is at the overflow; here one count before, as an event has a time of its own.
            let (first, second) = (edge(is_high_above), edge(!is_high_above));
            let turn = (top + 1, TimerEvent::Turn);
            return [(compare.min(top - 1), first), (top, second), turn, turn];
        }
        [
            (compare.min(top), TimerEvent::Trigger { is_rising: is_high_above }),
            (top, TimerEvent::Turn),
            (2 * top - compare.min(top), TimerEvent::Trigger { is_rising: !is_high_above }),
            (2 * top, TimerEvent::Turn),
        ]
    }

    fn upcoming(&self) -> Option<(u64, TimerEvent)> {
        let started = self.started?;
        let period = self.period();
        let passed = self.taken - started;
        let base = started + passed / period * period;
        let phases = self.phases();
        let all = phases.iter().chain(&phases).enumerate().map(|(at, (phase, event))| {
            (base + phase + if at >= phases.len() { period } else { 0 }, *event)
        });
        all.filter(|(at, _)| *at > self.taken)
            .min_by_key(|(at, event)| (*at, matches!(event, TimerEvent::Turn)))
    }

    fn schedule(&mut self) {
        self.next = self.upcoming().map_or(u64::MAX, |(at, _)| at);
    }

    /// Takes the next event that is due. A trigger counts only if it is selected as output.
    pub fn take_event(&mut self, now: u64) -> Option<(u64, TimerEvent)> {
        if self.next > now {
            return None;
        }
        let (at, event) = self.upcoming()?;
        self.taken = at;
        self.schedule();
        let is_selected = self.register(CR2) >> 20 & 0xF == TRIGGER_ON_CHANNEL_4;
        match event {
            TimerEvent::Trigger { .. } if !is_selected => self.take_event(now),
            TimerEvent::Trigger { is_rising } => {
                if is_rising {
                    self.last_trigger = at;
                }
                Some((at, event))
            }
            TimerEvent::Turn => Some((at, event)),
        }
    }

    /// Returns true if the next turn of the counter is an update.
    pub fn is_update_due(&self) -> bool {
        self.repetitions_left == 0
    }

    /// Turns the counter: every (RCR + 1)-th time is an update.
    pub fn turn(&mut self) {
        if self.repetitions_left == 0 {
            self.update();
        } else {
            self.repetitions_left -= 1;
        }
    }

    fn update(&mut self) {
        self.repetitions_left = self.register(RCR) & 0xFF;
        for channel in 0..4 {
            self.active[channel] = self.register(compare(channel));
        }
        self.registers[SR as usize / 4] |= UPDATE_FLAG;
        self.schedule();
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> u32 {
        match offset {
            CNT => self.count(now) as u32,
            CR1 => {
                let is_down = self.is_centre_aligned() && self.phase(now) >= self.top();
                self.register(CR1) & !COUNTS_DOWN | if is_down { COUNTS_DOWN } else { 0 }
            }
            _ => self.registers.get(offset as usize / 4).copied().unwrap_or(0),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32, now: u64) {
        let place = offset as usize / 4;
        if place >= self.registers.len() {
            return;
        }
        match offset {
            // Flags are cleared by zeros.
            SR => self.registers[place] &= word,
            EGR => {
                if word & 1 != 0 {
                    self.update();
                    if self.started.is_some() {
                        (self.started, self.taken) = (Some(now), now);
                    }
                }
            }
            BDTR => self.write_break(word),
            CR1 => {
                self.registers[place] = word;
                if word & ENABLED != 0 && self.started.is_none() {
                    (self.started, self.taken) = (Some(now), now);
                }
            }
            _ => self.registers[place] = word,
        }
        self.schedule();
    }

    fn write_break(&mut self, word: u32) {
        let place = BDTR as usize / 4;
        let may_close = word & MAIN_OUTPUT != 0 && !self.has_break();
        let output = if may_close { MAIN_OUTPUT } else { 0 };
        // Once locked, only MOE can be written.
        let kept = if self.is_locked { self.registers[place] } else { word };
        self.registers[place] = kept & !MAIN_OUTPUT | output;
        self.is_locked |= word & LOCK != 0;
    }
}

const fn compare(channel: usize) -> u32 {
    if channel == 3 { CCR4 } else { CCR1 + 4 * channel as u32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn running() -> Timer1 {
        let mut timer = Timer1::default();
        timer.write(ARR, 4250, 0);
        timer.write(CCR4, 4249, 0);
        timer.write(CCMR1, PWM_MODE_1 << 4 | PWM_MODE_1 << 12, 0);
        timer.write(CCMR2, PWM_MODE_1 << 4 | PWM_MODE_2 << 12, 0);
        timer.write(CCER, 0x1555, 0);
        timer.write(CR2, TRIGGER_ON_CHANNEL_4 << 20, 0);
        timer.write(RCR, 1, 0);
        timer.write(EGR, 1, 0);
        timer.write(CR1, ENABLED | ALIGNMENT, 100);
        timer
    }

    fn driven() -> Timer1 {
        let mut timer = running();
        timer.write(BDTR, MAIN_OUTPUT, 200);
        timer.write(CCR1, 1000, 200);
        (0..2).for_each(|_| timer.turn());
        timer
    }

    fn duty(timer: &Timer1) -> Option<f64> {
        timer.duties().map(|[first, ..]| first)
    }

    #[test]
    fn trigger_with_compare_below_top_rises_one_count_before_top() {
        let mut timer = running();
        assert_eq!(timer.next_event(), 100 + 4249);
        assert_eq!(timer.take_event(5000), Some((4349, TimerEvent::Trigger { is_rising: true })));
        assert_eq!(timer.take_event(5000), Some((4350, TimerEvent::Turn)));
        assert_eq!(timer.read(CNT, 4350 + 250), 4000);
        assert_ne!(timer.read(CR1, 4350 + 250) & COUNTS_DOWN, 0);
    }

    #[test]
    fn duty_with_preload_takes_effect_at_second_turn() {
        let mut timer = driven();
        timer.write(CCR1, 2000, 200);
        timer.turn();
        assert_eq!(duty(&timer), Some(1000.0 / 4250.0));
        timer.turn();
        assert_eq!(duty(&timer), Some(2000.0 / 4250.0));
    }

    #[test]
    fn duties_need_all_outputs_and_follow_mode() {
        let mut timer = driven();
        timer.write(CCMR1, PWM_MODE_2 << 4 | PWM_MODE_1 << 12, 0);
        assert_eq!(duty(&timer), Some(1.0 - 1000.0 / 4250.0));
        assert_eq!(timer.low_sides(100 + 1500), [false, true]);
        for missing in [0x1155, 0x1551, 0x155D] {
            timer.write(CCER, missing, 0);
            assert_eq!(duty(&timer), None, "{missing:x}");
        }
    }

    #[test]
    fn edge_aligned_counter_starts_again_after_top() {
        let mut timer = running();
        timer.write(CR1, ENABLED, 200);
        assert_eq!(timer.read(CNT, 100 + 4251 + 10), 10);
        assert_eq!(timer.read(CR1, 100 + 4250) & COUNTS_DOWN, 0);
        assert_eq!(timer.take_event(9000), Some((4349, TimerEvent::Trigger { is_rising: true })));
        assert_eq!(timer.take_event(9000), Some((4350, TimerEvent::Trigger { is_rising: false })));
        assert_eq!(timer.take_event(9000), Some((4351, TimerEvent::Turn)));
    }

    #[test]
    fn break_with_active_flag_keeps_bridge_open() {
        let mut timer = running();
        timer.write(BDTR, BREAK_ENABLED | LOCK, 0);
        timer.write(BDTR, MAIN_OUTPUT, 0);
        assert!(timer.is_main_output_enabled(), "MOE is not locked");
        timer.set_break(false);
        assert!(!timer.is_main_output_enabled());
        timer.write(BDTR, MAIN_OUTPUT, 0);
        assert!(!timer.is_main_output_enabled());
        timer.write(SR, !BREAK_FLAG, 0);
        timer.write(BDTR, MAIN_OUTPUT, 0);
        assert!(timer.is_main_output_enabled());
        assert_ne!(timer.read(BDTR, 0) & BREAK_ENABLED, 0, "the lock keeps the break enabled");
    }
}
