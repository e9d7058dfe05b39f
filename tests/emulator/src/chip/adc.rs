//! Converters: calibration, single regular conversions by software, injected sequences by TIM1 or TIM3 (RM0440, 21).

const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const SMPR1: u32 = 0x14;
const SMPR2: u32 = 0x18;
const SQR1: u32 = 0x30;
const DR: u32 = 0x40;
const JSQR: u32 = 0x4C;
const JDR1: u32 = 0x80;

const READY: u32 = 1;
const REGULAR_DONE: u32 = 1 << 2 | 1 << 3;
const INJECTED_DONE: u32 = 1 << 5 | 1 << 6;
const ENABLE: u32 = 1;
const DISABLE: u32 = 1 << 1;
const START: u32 = 1 << 2;
const INJECTED_START: u32 = 1 << 3;
const CALIBRATE: u32 = 1 << 31;

/// Signals that start injected sequences, by their numbers in JEXTSEL (RM0440, tables 163 and 165).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// TIM1_TRGO2.
    Timer1 = 8,
    /// TIM3_TRGO.
    Timer3 = 12,
}

/// Cycles of the converter beside its sampling time, times two.
const CONVERSION_HALF_CYCLES: u64 = 25;
/// Sampling times, times two.
const SAMPLING_HALF_CYCLES: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];

/// One converter.
#[derive(Clone, Debug)]
pub struct Adc {
    number: usize,
    /// Core cycles of a converter cycle.
    pub divider: u64,
    registers: [u32; 64],
    regular: Option<(u64, u16)>,
    injected: Option<(u64, [u16; 4])>,
}

/// Returns the index of the converter with this register, and the register's offset.
pub const fn place(address: u32) -> Option<(usize, u32)> {
    let number = match address & 0x700 {
        0x000 => 0,
        0x100 => 1,
        0x400 => 2,
        0x500 => 3,
        0x600 => 4,
        _ => return None,
    };
    Some((number, address & 0xFF))
}

/// Returns the converters and the divider that a write to a common register (CCR, PRESC) sets.
pub fn clock_divider(address: u32, word: u32) -> Option<(std::ops::Range<usize>, u64)> {
    const DIVIDERS: [u64; 16] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256, 256, 256, 256, 256];
    let divider = DIVIDERS[(word >> 18 & 0xF) as usize];
    match address {
        0x5000_0308 => Some((0..2, divider)),
        0x5000_0708 => Some((2..5, divider)),
        _ => None,
    }
}

impl Adc {
    /// Returns a converter with this number, from 1.
    pub fn new(number: usize) -> Self {
        Self { number, divider: 4, registers: [0; 64], regular: None, injected: None }
    }

    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    fn set_flags(&mut self, flags: u32) {
        self.registers[ISR as usize / 4] |= flags;
    }

    /// Duration of a conversion of this channel, core cycles.
    fn duration(&self, channel: u32) -> u64 {
        let code = if channel < 10 {
            self.register(SMPR1) >> (3 * channel)
        } else {
            self.register(SMPR2) >> (3 * (channel - 10))
        };
        (SAMPLING_HALF_CYCLES[(code & 7) as usize] + CONVERSION_HALF_CYCLES) * self.divider / 2
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        let regular = self.regular.map_or(u64::MAX, |(at, _)| at);
        regular.min(self.injected.map_or(u64::MAX, |(at, _)| at))
    }

    /// Ends the conversions that are due.
    pub fn process(&mut self, now: u64) {
        if let Some((at, value)) = self.regular
            && at <= now
        {
            self.regular = None;
            self.registers[DR as usize / 4] = value.into();
            self.registers[CR as usize / 4] &= !START;
            self.set_flags(REGULAR_DONE);
        }
        if let Some((at, values)) = self.injected
            && at <= now
        {
            self.injected = None;
            for (rank, value) in values.into_iter().enumerate() {
                self.registers[JDR1 as usize / 4 + rank] = value.into();
            }
            self.set_flags(INJECTED_DONE);
        }
    }

    /// Returns true if an enabled flag is set.
    pub fn line(&self) -> bool {
        self.register(ISR) & self.register(IER) & 0x7FF != 0
    }

    /// Returns true if this edge of a signal starts the injected sequence.
    pub fn is_triggered_by(&self, signal: Signal, is_rising: bool) -> bool {
        let (jsqr, edge) = (self.register(JSQR), if is_rising { 1 } else { 2 });
        self.register(CR) & (ENABLE | INJECTED_START) == ENABLE | INJECTED_START
            && jsqr >> 2 & 0x1F == signal as u32
            && jsqr >> 7 & edge != 0
    }

    /// Starts the injected sequence if this trigger is selected.
    pub fn trigger(
        &mut self,
        at: u64,
        signal: Signal,
        is_rising: bool,
        analog: &mut dyn FnMut(usize, u32) -> u16,
    ) {
        if !self.is_triggered_by(signal, is_rising) {
            return;
        }
        let jsqr = self.register(JSQR);
        let (mut values, mut until) = ([0; 4], at);
        for (rank, value) in values.iter_mut().enumerate().take((jsqr & 3) as usize + 1) {
            let channel = jsqr >> (9 + 6 * rank) & 0x1F;
            until += self.duration(channel);
            *value = analog(self.number, channel);
        }
        self.injected = Some((until, values));
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> u32 {
        self.register(offset & 0xFC)
    }

    /// Writes a register.
    pub fn write(
        &mut self,
        offset: u32,
        word: u32,
        now: u64,
        analog: &mut dyn FnMut(usize, u32) -> u16,
    ) {
        let place = offset as usize / 4;
        match offset {
            // Flags are cleared by ones.
            ISR => self.registers[place] &= !word,
            CR => self.control(word, now, analog),
            _ => self.registers[place] = word,
        }
    }

    fn control(&mut self, word: u32, now: u64, analog: &mut dyn FnMut(usize, u32) -> u16) {
        // Calibration and stop requests end at once.
        let mut control = word & !(CALIBRATE | DISABLE | 1 << 4 | 1 << 5);
        if word & 1 << 4 != 0 {
            control &= !START;
        }
        if word & 1 << 5 != 0 {
            control &= !INJECTED_START;
        }
        if word & DISABLE != 0 {
            control &= !ENABLE;
        } else if word & ENABLE != 0 {
            self.set_flags(READY);
        }
        let was_started = self.register(CR) & START != 0;
        self.registers[CR as usize / 4] = control;
        if control & START != 0 && !was_started {
            let channel = self.register(SQR1) >> 6 & 0x1F;
            self.regular = Some((now + self.duration(channel), analog(self.number, channel)));
        }
    }
}
