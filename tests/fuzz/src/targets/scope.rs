//! Fuzzes the scope of a driver by its objects (2013h, 2014h) and by the rows of its current loop.
//!
//! The input is a list of steps: settings, orders, faults, and rows of the running capture, of an earlier one, or after a
//! gap. The target keeps its own list of rows. A complete capture must be a part of this list without a gap, and the row
//! of its trigger must meet the condition that was set. An upload by segments gives the same bytes whatever its length.

use crate::bytes::Bytes;
use compensator_core::can::{Frame, NodeId};
use firmware::driver::{Boot, Driver, Identity, LoopReport};
use firmware::joint_node::{Equipment, Joint as _};
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::scope::{MAX_SIGNALS, ScopeOrder, ScopeRow, ScopeState, Signal, TRIGGER_FAULT};
use firmware::store::memory::MemoryFlash;

/// Values of a capture. The driver takes its memory for ever, so this is what an execution leaks.
const MEMORY_VALUES: usize = 24;

/// Sub-indices of 2013h.
const ORDER: u8 = 1;
const STATE: u8 = 2;
const EVERY: u8 = 3;
const ROWS_BEFORE: u8 = 4;
const TRIGGER_SIGNAL: u8 = 5;
const TRIGGER_LEVEL: u8 = 6;
const IS_FALLING: u8 = 7;
const ROWS: u8 = 9;
const TRIGGER_ROW: u8 = 10;
const DATA: u8 = 11;

/// Settings as they were written.
#[derive(Clone, Copy)]
struct Settings {
    signals: [u8; MAX_SIGNALS],
    every: u16,
    rows_before: u16,
    trigger_signal: u8,
    trigger_level: f32,
    is_falling: bool,
}

impl Settings {
    /// Returns the number of signals if a capture with these settings can start.
    fn width(&self) -> Option<usize> {
        let width = self.signals.iter().position(|number| *number == 0).unwrap_or(MAX_SIGNALS);
        let (recorded, rest) = self.signals.split_at(width);
        let trigger = self.trigger_signal;
        let is_legal = width > 0
            && recorded.iter().all(|number| Signal::from_number(*number).is_some())
            && rest.iter().all(|number| *number == 0)
            && (trigger == 0 || trigger == TRIGGER_FAULT || recorded.contains(&trigger))
            && self.every > 0
            && usize::from(self.rows_before) < MEMORY_VALUES / width;
        is_legal.then_some(width)
    }
}

struct Bench {
    driver: Driver<MemoryFlash<4>>,
    now_us: u64,
    settings: Settings,
    /// Settings of the capture since the last start; `None` before it and after a stop.
    started: Option<Settings>,
    /// Rows of the running capture, and those at which it could be triggered: by an order or by a fault.
    rows: Vec<[f32; MAX_SIGNALS]>,
    requested_after: Option<usize>,
    has_fault: bool,
}

impl Bench {
    fn new() -> Self {
        let source = InputSource::Sensors;
        let settings = NodeSettings { node: NodeId::FIRST, source, ..NodeSettings::default() };
        let identity = Identity { hardware: "fuzz", serial: 1, stage: StageTraits::NONE };
        let mut driver = Driver::boot(settings, MemoryFlash::new(), identity, &Boot::default(), 0);
        let scope = Some(vec![0.0; MEMORY_VALUES].leak());
        driver.joint.equip(Equipment { scope, ..Equipment::default() });
        while driver.transmit().is_some() {}
        let settings = Settings {
            signals: [1, 9, 0, 0, 0, 0, 0, 0],
            every: 1,
            rows_before: 0,
            trigger_signal: 0,
            trigger_level: 0.0,
            is_falling: false,
        };
        let (rows, now_us) = (Vec::new(), 0);
        let (started, requested_after, has_fault) = (None, None, false);
        Self { driver, now_us, settings, started, rows, requested_after, has_fault }
    }

    /// Sends a request to the SDO server; returns its answer.
    fn exchange(&mut self, request: [u8; 8]) -> [u8; 8] {
        self.driver.receive(&Frame::new(0x601, &request).expect("legal"), self.now_us);
        let answer = std::iter::from_fn(|| self.driver.transmit())
            .filter(|frame| frame.identifier() == 0x581)
            .last()
            .expect("every request has an answer");
        answer.data().try_into().expect("eight bytes")
    }

    /// Writes a value; returns true if it is accepted.
    fn write(&mut self, at: u16, sub_index: u8, value: &[u8]) -> bool {
        let [low, high] = at.to_le_bytes();
        let mut request = [0x23 | (4 - value.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
        request[4..4 + value.len()].copy_from_slice(value);
        self.exchange(request)[0] == 0x60
    }

    fn number(&mut self, sub_index: u8) -> usize {
        let [low, high] = index::SCOPE.to_le_bytes();
        let [command, _, _, _, a, b, ..] = self.exchange([0x40, low, high, sub_index, 0, 0, 0, 0]);
        assert_eq!(command & 0xE3, 0x43, "a number");
        usize::from(a) | usize::from(b) << 8
    }

    /// Reads the rows in segments; `None` if they are refused.
    fn data(&mut self) -> Option<Vec<u8>> {
        let [low, high] = index::SCOPE.to_le_bytes();
        let [command, _, _, _, data @ ..] = self.exchange([0x40, low, high, DATA, 0, 0, 0, 0]);
        match command {
            0x80 => return None,
            0x41 => {}
            _ => return Some(data[..4 - usize::from(command >> 2 & 3)].to_vec()),
        }
        let (mut value, mut toggle) = (Vec::new(), 0);
        loop {
            let [command, data @ ..] = self.exchange([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(command & 0xF0, toggle, "a segment");
            value.extend_from_slice(&data[..7 - usize::from(command >> 1 & 7)]);
            if command & 1 != 0 {
                return Some(value);
            }
            toggle ^= 0x10;
        }
    }

    fn state(&mut self) -> ScopeState {
        use ScopeState as State;
        let known = [
            State::Idle,
            State::Filling,
            State::Waiting,
            State::Recording,
            State::Complete,
            State::Failed,
        ];
        known[self.number(STATE)]
    }

    fn order(&mut self) -> ScopeOrder {
        self.driver.joint.loop_commands(self.now_us).scope
    }

    fn start(&mut self) {
        let capture = self.order().capture;
        let is_accepted = self.write(index::SCOPE, ORDER, &[1]);
        assert_eq!(is_accepted, self.settings.width().is_some(), "start");
        if is_accepted {
            self.started = Some(self.settings);
            (self.requested_after, self.has_fault) = (None, false);
            self.rows.clear();
            let order = self.order();
            assert_eq!((order.signals, order.every), (self.settings.signals, self.settings.every));
            assert!(capture == 0 || order.capture != capture, "captures have different numbers");
        }
    }

    /// Passes a row of the running capture to the driver.
    fn take(&mut self, values: [f32; MAX_SIGNALS], is_after_gap: bool) {
        let order = self.order();
        if order == ScopeOrder::OFF {
            return;
        }
        if self.is_faulty() {
            self.has_fault = true;
        }
        self.rows.push(values);
        self.driver.joint.take_scope_row(&ScopeRow {
            values,
            capture: order.capture,
            is_after_gap,
        });
        if is_after_gap {
            assert_eq!(self.state(), ScopeState::Failed);
        }
    }

    fn is_faulty(&self) -> bool {
        self.driver.joint.supervisor().faults().iter().next().is_some()
    }

    /// Returns true if this row of the capture may have triggered it.
    fn can_trigger(&self, settings: &Settings, at: usize) -> bool {
        let is_requested = self.requested_after.is_some_and(|first| at >= first);
        let place = settings.signals.iter().position(|number| *number == settings.trigger_signal);
        let is_met = match (settings.trigger_signal, place) {
            (0, _) => true,
            (TRIGGER_FAULT, _) => self.has_fault,
            (_, Some(place)) if at > 0 => {
                let (before, value) = (self.rows[at - 1][place], self.rows[at][place]);
                let level = settings.trigger_level;
                match settings.is_falling {
                    false => before <= level && value > level,
                    true => before >= level && value < level,
                }
            }
            _ => false,
        };
        is_requested || is_met
    }

    /// Checks the objects of the scope against the list of rows.
    fn check(&mut self) {
        let state = self.state();
        let (rows, trigger_row) = (self.number(ROWS), self.number(TRIGGER_ROW));
        let runs =
            matches!(state, ScopeState::Filling | ScopeState::Waiting | ScopeState::Recording);
        assert_eq!(self.order() != ScopeOrder::OFF, runs, "{state:?}");
        let data = self.data();
        assert_eq!(data.is_some(), state == ScopeState::Complete, "{state:?}");
        let Some(data) = data else {
            return assert_eq!((rows, trigger_row), (0, 0));
        };
        let settings = self.started.expect("a capture was started");
        let width = settings.width().expect("which was possible");
        assert_eq!(rows, MEMORY_VALUES / width);
        assert_eq!((data.len(), trigger_row), (4 * rows * width, settings.rows_before.into()));
        let taken = self.rows.len();
        assert!(taken >= rows);
        let expected: Vec<u8> = self.rows[taken - rows..]
            .iter()
            .flat_map(|row| row[..width].iter().flat_map(|value| value.to_le_bytes()))
            .collect();
        assert_eq!(data, expected, "the last {rows} rows of {taken}");
        assert!(self.can_trigger(&settings, taken - rows + trigger_row), "the trigger");
    }
}

impl Bytes<'_> {
    /// Returns a small number, which crosses small levels, or NaN.
    fn value(&mut self) -> f32 {
        match self.byte() {
            255 => f32::NAN,
            byte => (f32::from(byte) - 127.0) * 0.25,
        }
    }
}

/// Writes one setting.
fn set(bench: &mut Bench, bytes: &mut Bytes) {
    let byte = bytes.byte();
    let is_accepted = match byte % 6 {
        0 => {
            let place = usize::from(bytes.byte()) % MAX_SIGNALS;
            // One more than there are, which is no signal.
            let number = bytes.byte() % (Signal::ALL.len() as u8 + 2);
            bench.settings.signals[place] = number;
            bench.write(index::SCOPE_SIGNALS, place as u8 + 1, &[number])
        }
        1 => {
            bench.settings.every = u16::from(bytes.byte() % 4);
            let every = bench.settings.every.to_le_bytes();
            bench.write(index::SCOPE, EVERY, &every)
        }
        2 => {
            bench.settings.rows_before = u16::from(bytes.byte() % 26);
            let rows = bench.settings.rows_before.to_le_bytes();
            bench.write(index::SCOPE, ROWS_BEFORE, &rows)
        }
        3 => {
            let number = bytes.byte();
            let number = if number < 200 { number % 16 } else { TRIGGER_FAULT };
            bench.settings.trigger_signal = number;
            bench.write(index::SCOPE, TRIGGER_SIGNAL, &[number])
        }
        4 => {
            bench.settings.trigger_level = bytes.value();
            let level = bench.settings.trigger_level.to_le_bytes();
            bench.write(index::SCOPE, TRIGGER_LEVEL, &level)
        }
        _ => {
            bench.settings.is_falling = bytes.byte() % 2 == 1;
            let is_falling = bench.settings.is_falling.into();
            bench.write(index::SCOPE, IS_FALLING, &[is_falling])
        }
    };
    assert!(is_accepted, "every setting is accepted; a start checks them");
}

fn step(bench: &mut Bench, selector: u8, bytes: &mut Bytes) {
    match selector % 12 {
        0..=3 => set(bench, bytes),
        4 => bench.start(),
        5 => {
            let was_running = bench.order() != ScopeOrder::OFF;
            bench.write(index::SCOPE, ORDER, &[2]);
            if was_running && bench.requested_after.is_none() {
                bench.requested_after = Some(bench.rows.len());
            }
        }
        6 if bytes.byte() == 0 => {
            bench.write(index::SCOPE, ORDER, &[0]);
            assert_eq!(bench.state(), ScopeState::Idle);
        }
        // A row of an earlier capture changes nothing.
        7 => {
            let capture = bench.order().capture.wrapping_sub(1);
            let values = [bytes.value(); MAX_SIGNALS];
            bench.driver.joint.take_scope_row(&ScopeRow { values, capture, is_after_gap: true });
        }
        8 if bytes.byte() < 32 => bench.take([0.0; MAX_SIGNALS], true),
        9 => {
            bench.now_us += 1000 * u64::from(bytes.byte());
            let is_faulty = bytes.byte() < 64;
            bench.driver.joint.report(&LoopReport {
                stack_intact: true,
                gate_driver_fault: is_faulty,
                ..LoopReport::default()
            });
            bench.driver.tick(bench.now_us);
            while bench.driver.transmit().is_some() {}
            bench.has_fault |= bench.is_faulty();
        }
        _ => {
            for _ in 0..=bytes.byte() % 32 {
                let values = [bytes.value(), bytes.value(), 0.5, 1.5, 2.5, 3.5, 4.5, 5.5];
                bench.take(values, false);
            }
        }
    }
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let (mut bench, mut bytes) = (Bench::new(), Bytes(data));
    while let Some(selector) = bytes.next() {
        step(&mut bench, selector, &mut bytes);
        bench.check();
    }
}
