//! The background's side of a scope: settings, ring of rows, trigger.

use super::{MAX_SIGNALS, ScopeOrder, ScopeRow, Signal};
use compensator_core::parameters::Text;
use compensator_core::text;

/// Number of [`ScopeSettings::trigger_signal`] for a fault of the supervisor.
pub const TRIGGER_FAULT: u8 = 0xFF;

/// What triggers a capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trigger {
    /// The first row.
    Now,
    /// A signal crosses a level upwards, or downwards.
    Level {
        /// Place of the signal in a row.
        place: usize,
        /// Level, in the unit of the signal.
        level: f32,
        /// True for a signal that falls.
        is_falling: bool,
    },
    /// A fault of the supervisor.
    Fault,
}

/// Settings of a capture, as objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScopeSettings {
    /// Numbers of the signals, 0 for none.
    pub signals: [u8; MAX_SIGNALS],
    /// Periods from one row to the next, at least 1.
    pub every: u16,
    /// Rows to keep before the trigger.
    pub rows_before: u16,
    /// Number of the signal that triggers; 0 for none, [`TRIGGER_FAULT`] for a fault.
    pub trigger_signal: u8,
    /// Level of the trigger, in the unit of the signal.
    pub trigger_level: f32,
    /// True for a signal that falls.
    pub is_falling: bool,
}

impl ScopeSettings {
    /// Current and velocity in every period, from now on.
    pub const DEFAULT: Self = Self {
        signals: [1, 9, 0, 0, 0, 0, 0, 0],
        every: 1,
        rows_before: 0,
        trigger_signal: 0,
        trigger_level: 0.0,
        is_falling: false,
    };
}

/// State of a capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum ScopeState {
    /// No capture.
    #[default]
    Idle = 0,
    /// The rows before the trigger are recorded.
    Filling = 1,
    /// The trigger is awaited.
    Waiting = 2,
    /// The rows after the trigger are recorded.
    Recording = 3,
    /// The rows can be read.
    Complete = 4,
    /// Rows were lost; start again.
    Failed = 5,
}

/// A scope. Without memory it refuses to start.
#[derive(Debug)]
pub struct Scope {
    /// Settings of the next capture.
    pub settings: ScopeSettings,
    memory: &'static mut [f32],
    state: ScopeState,
    signals: [u8; MAX_SIGNALS],
    /// Signals in a row, and rows of a whole capture.
    width: usize,
    capacity: usize,
    trigger: Trigger,
    every: u16,
    rows_before: usize,
    capture: u8,
    /// Row that is written next, rows that are written, and rows until the capture is complete.
    next: usize,
    rows: usize,
    remaining: usize,
    last: Option<f32>,
    is_requested: bool,
}

impl Default for Scope {
    fn default() -> Self {
        Self::new(&mut [])
    }
}

impl Scope {
    /// Creates a scope with this memory, whose length is the number of values of a capture.
    pub const fn new(memory: &'static mut [f32]) -> Self {
        Self {
            settings: ScopeSettings::DEFAULT,
            memory,
            state: ScopeState::Idle,
            signals: [0; MAX_SIGNALS],
            width: 1,
            capacity: 0,
            trigger: Trigger::Now,
            every: 1,
            rows_before: 0,
            capture: 0,
            next: 0,
            rows: 0,
            remaining: 0,
            last: None,
            is_requested: false,
        }
    }

    /// Returns the state.
    pub const fn state(&self) -> ScopeState {
        self.state
    }

    /// Returns the number of values of a capture.
    pub const fn memory_values(&self) -> usize {
        self.memory.len()
    }

    /// Returns the number of rows that can be read; 0 before the capture is complete.
    pub fn readable_rows(&self) -> usize {
        if self.state == ScopeState::Complete { self.rows } else { 0 }
    }

    /// Returns the row of the trigger, of those that can be read.
    pub fn trigger_row(&self) -> usize {
        if self.state == ScopeState::Complete { self.rows_before } else { 0 }
    }

    /// Returns the length of the rows that can be read, bytes.
    pub fn readable_bytes(&self) -> usize {
        4 * self.width * self.readable_rows()
    }

    /// Starts a capture with the settings.
    ///
    /// # Errors
    /// Returns why it is refused.
    pub fn start(&mut self) -> Result<(), Text> {
        let settings = self.settings;
        let width = settings.signals.iter().take_while(|number| **number != 0).count();
        let has_unknown = settings
            .signals
            .iter()
            .any(|number| *number != 0 && Signal::from_number(*number).is_none());
        if width == 0
            || has_unknown
            || settings.signals.iter().skip(width).any(|number| *number != 0)
        {
            return Err(text!(
                "the signals of the scope (2014h) must be known numbers, followed by zeros"
            ));
        }
        let trigger = match settings.trigger_signal {
            0 => Trigger::Now,
            TRIGGER_FAULT => Trigger::Fault,
            number => match settings.signals.iter().position(|recorded| *recorded == number) {
                Some(place) => {
                    let (level, is_falling) = (settings.trigger_level, settings.is_falling);
                    Trigger::Level { place, level, is_falling }
                }
                None => {
                    return Err(text!(
                        "the signal of the trigger must be one of the recorded ones"
                    ));
                }
            },
        };
        let capacity = self.memory.len() / width;
        if settings.every == 0 || usize::from(settings.rows_before) >= capacity {
            return Err(text!(
                "a capture needs a row at least every period, and one after the trigger"
            ));
        }
        self.signals = settings.signals;
        (self.width, self.capacity, self.trigger) = (width, capacity, trigger);
        (self.every, self.rows_before) = (settings.every, settings.rows_before.into());
        self.capture = self.capture.wrapping_add(1);
        (self.next, self.rows, self.remaining) = (0, 0, 0);
        (self.last, self.is_requested) = (None, false);
        self.state = ScopeState::Filling;
        Ok(())
    }

    /// Ends a capture without result.
    pub const fn stop(&mut self) {
        self.state = ScopeState::Idle;
    }

    /// Triggers at the next row.
    pub const fn request_trigger(&mut self) {
        self.is_requested = true;
    }

    /// Reports a fault of the supervisor.
    pub fn record_fault(&mut self) {
        if self.trigger == Trigger::Fault {
            self.is_requested = true;
        }
    }

    /// Returns what the interrupt records.
    pub const fn order(&self) -> ScopeOrder {
        match self.state {
            ScopeState::Filling | ScopeState::Waiting | ScopeState::Recording => {
                ScopeOrder { signals: self.signals, every: self.every, capture: self.capture }
            }
            ScopeState::Idle | ScopeState::Complete | ScopeState::Failed => ScopeOrder::OFF,
        }
    }

    /// Takes a row of the interrupt.
    // Not inlined: from its own part, it reaches the fields by short offsets.
    #[inline(never)]
    pub fn take(&mut self, row: &ScopeRow) {
        if self.order() == ScopeOrder::OFF || row.capture != self.capture {
            return;
        }
        if row.is_after_gap {
            self.state = ScopeState::Failed;
            return;
        }
        self.store(row);
        if self.state == ScopeState::Filling && self.rows > self.rows_before {
            self.state = ScopeState::Waiting;
        }
        // A level is compared with the row before it in every state, so that a capture that begins above its level
        // waits for a crossing.
        let is_triggered = self.is_triggered(row);
        if self.state == ScopeState::Waiting && is_triggered {
            self.state = ScopeState::Recording;
            self.remaining = self.capacity - self.rows_before;
        }
        if self.state == ScopeState::Recording {
            self.remaining -= 1;
            if self.remaining == 0 {
                self.state = ScopeState::Complete;
            }
        }
    }

    fn store(&mut self, row: &ScopeRow) {
        let begin = self.next * self.width;
        if let Some(place) = self.memory.get_mut(begin..begin + self.width) {
            for (place, value) in place.iter_mut().zip(row.values) {
                *place = value;
            }
        }
        self.next = (self.next + 1) % self.capacity;
        self.rows = (self.rows + 1).min(self.capacity);
    }

    fn is_triggered(&mut self, row: &ScopeRow) -> bool {
        if self.is_requested {
            return true;
        }
        match self.trigger {
            Trigger::Now => true,
            Trigger::Fault => false,
            Trigger::Level { place, level, is_falling } => {
                let value = row.values.get(place).copied().unwrap_or(f32::NAN);
                let before = self.last.replace(value);
                before.is_some_and(|before| {
                    if is_falling {
                        before >= level && value < level
                    } else {
                        before <= level && value > level
                    }
                })
            }
        }
    }

    /// Copies bytes of the rows, oldest row first, values as little-endian `f32`, from this offset.
    pub fn read(&self, offset: usize, part: &mut [u8]) {
        let oldest = if self.rows < self.capacity { 0 } else { self.next };
        for (place, byte) in part.iter_mut().enumerate() {
            let at = offset + place;
            let (value, in_value) = (at / 4, at % 4);
            let row = (oldest + value / self.width) % self.capacity.max(1);
            let number = self.memory.get(row * self.width + value % self.width).copied();
            let bytes = number.unwrap_or(f32::NAN).to_le_bytes();
            *byte = bytes.get(in_value).copied().unwrap_or(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scope(values: usize, settings: ScopeSettings) -> Scope {
        let mut scope = Scope::new(Box::leak(vec![0.0; values].into_boxed_slice()));
        scope.settings = settings;
        scope.start().expect("valid settings");
        scope
    }

    /// Passes rows whose first value is their number, until the capture ends.
    fn run(scope: &mut Scope, rows: std::ops::Range<usize>) -> Option<usize> {
        for number in rows {
            let mut values = [0.5; MAX_SIGNALS];
            values[0] = number as f32;
            scope.take(&ScopeRow { values, capture: scope.capture, is_after_gap: false });
            if scope.state() == ScopeState::Complete {
                return Some(number);
            }
        }
        None
    }

    fn read(scope: &Scope) -> Vec<f32> {
        let mut bytes = vec![0; scope.readable_bytes()];
        // In parts of seven bytes, as segments are.
        for (index, part) in bytes.chunks_mut(7).enumerate() {
            scope.read(7 * index, part);
        }
        bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect()
    }

    const ONE: ScopeSettings =
        ScopeSettings { signals: [1, 0, 0, 0, 0, 0, 0, 0], ..ScopeSettings::DEFAULT };

    #[test]
    fn capture_without_trigger_holds_the_first_rows() {
        let mut scope = scope(10, ONE);
        assert_eq!(run(&mut scope, 0..100), Some(9));
        assert_eq!(read(&scope), (0..10).map(|row| row as f32).collect::<Vec<_>>());
        assert_eq!((scope.trigger_row(), scope.order()), (0, ScopeOrder::OFF));
    }

    #[test]
    fn level_trigger_keeps_the_rows_before_it() {
        for (rows_before, level) in [(0, 50.5), (3, 50.5), (9, 50.5)] {
            let settings =
                ScopeSettings { rows_before, trigger_signal: 1, trigger_level: level, ..ONE };
            let mut scope = scope(10, settings);
            run(&mut scope, 0..200);
            let found = read(&scope);
            let trigger = scope.trigger_row();
            assert_eq!((found.len(), trigger), (10, usize::from(rows_before)), "{settings:?}");
            assert!(found.windows(2).all(|pair| pair[1] == pair[0] + 1.0), "{found:?}");
            assert_eq!(found[trigger], 51.0, "the first row above the level");
        }
    }

    #[test]
    fn level_that_is_passed_while_filling_is_no_trigger() {
        let settings =
            ScopeSettings { rows_before: 5, trigger_signal: 1, trigger_level: 2.5, ..ONE };
        let mut scope = scope(10, settings);
        assert_eq!(run(&mut scope, 0..100), None);
        assert_eq!(scope.state(), ScopeState::Waiting);
        scope.request_trigger();
        assert_eq!(run(&mut scope, 100..200), Some(104));
    }

    #[test]
    fn fault_triggers_only_a_capture_that_waits_for_it() {
        let mut waits =
            scope(4, ScopeSettings { trigger_signal: TRIGGER_FAULT, rows_before: 2, ..ONE });
        assert_eq!(run(&mut waits, 0..20), None);
        waits.record_fault();
        assert_eq!(run(&mut waits, 20..30), Some(21));
        assert_eq!(read(&waits), [18.0, 19.0, 20.0, 21.0]);
        let mut other = scope(4, ScopeSettings { trigger_signal: 1, trigger_level: 1e9, ..ONE });
        other.record_fault();
        assert_eq!(run(&mut other, 0..20), None);
    }

    #[test]
    fn falling_signal_triggers_when_it_falls() {
        let settings =
            ScopeSettings { trigger_signal: 1, trigger_level: 0.0, is_falling: true, ..ONE };
        let mut scope = scope(1, settings);
        for value in [-1.0, 1.0, 0.0] {
            scope.take(&ScopeRow { values: [value; 8], capture: 1, is_after_gap: false });
            assert_eq!(scope.state(), ScopeState::Waiting, "{value}");
        }
        scope.take(&ScopeRow { values: [-0.5; 8], capture: 1, is_after_gap: false });
        assert_eq!(read(&scope), [-0.5]);
    }

    #[test]
    fn gap_fails_the_capture_and_rows_of_an_earlier_one_are_ignored() {
        let mut scope = scope(10, ONE);
        scope.take(&ScopeRow { values: [7.0; 8], capture: 0, is_after_gap: true });
        assert_eq!(run(&mut scope, 0..3), None);
        scope.take(&ScopeRow { values: [7.0; 8], capture: 1, is_after_gap: true });
        assert_eq!((scope.state(), scope.readable_rows()), (ScopeState::Failed, 0));
        scope.start().expect("again");
        assert_eq!(scope.order().capture, 2);
    }

    #[test]
    fn settings_that_record_nothing_are_refused() {
        let mut scope = Scope::new(Box::leak(vec![0.0; 16].into_boxed_slice()));
        for settings in [
            ScopeSettings { signals: [0; 8], ..ONE },
            ScopeSettings { signals: [1, 0, 9, 0, 0, 0, 0, 0], ..ONE },
            ScopeSettings { signals: [99, 0, 0, 0, 0, 0, 0, 0], ..ONE },
            ScopeSettings { every: 0, ..ONE },
            ScopeSettings { rows_before: 16, ..ONE },
            ScopeSettings { trigger_signal: 9, ..ONE },
        ] {
            scope.settings = settings;
            assert!(scope.start().is_err(), "{settings:?}");
            assert_eq!(scope.state(), ScopeState::Idle);
        }
        assert!(Scope::default().start().is_err(), "no memory");
    }

    #[test]
    fn signals_have_names_and_numbers() {
        for (number, name) in Signal::ALL {
            let signal = Signal::from_name(name).expect("known");
            assert_eq!((signal.number(), signal.name()), (*number, *name));
            assert_eq!(Signal::from_number(*number), Some(signal));
        }
        assert_eq!((Signal::from_number(0), Signal::from_name("speed")), (None, None));
    }
}
