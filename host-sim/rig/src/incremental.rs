//! A quadrature encoder and Hall sensors at the motor of the rig, with their faults.

use firmware::sensors::quadrature::Quadrature;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::{HallSensors, LineEncoder};

/// A fault of a quadrature encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LineFault {
    /// No fault.
    #[default]
    None,
    /// The plug is off: no edges, no index.
    Missing,
    /// Line A is stuck: the edges of B count up and down.
    StuckLine,
    /// Share of the edges that are lost or counted twice.
    Noisy(f64),
    /// Lines A and B are swapped.
    Reversed,
    /// The count jumps once by this number.
    Jump(i64),
    /// The index is missing.
    NoIndex,
    /// Counts are lost once, fewer than the observer can see.
    Lost(i64),
}

/// A fault of the Hall sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum HallFault {
    /// No fault.
    #[default]
    None,
    /// The plug is off: all levels are high.
    Missing,
    /// The first sensor is stuck at high.
    StuckSensor,
    /// All levels are stuck.
    Frozen,
    /// Share of the readings in which one level is wrong.
    Noisy(f64),
    /// Two sensors are swapped, which reverses the order.
    Reversed,
    /// The levels jump by half an electrical turn, as where the magnet has slipped.
    Jump,
}

/// Edges that a quadrature encoder has shown since the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineEdges {
    /// All of them.
    pub shown: i64,
    /// Those at the last rise of the index since the last query; `None` if it has not risen.
    pub at_index: Option<i64>,
}

/// Edges and levels at the motor's shaft.
#[derive(Clone, Debug)]
pub struct Incremental {
    lines: LineEncoder,
    hall: HallSensors,
    line_fault: LineFault,
    hall_fault: HallFault,
    frozen_levels: Option<u8>,
    /// Last true edge, and the edges that the encoder has shown.
    edge: Option<i64>,
    shown: i64,
    /// Shown edges at the last rise of the index that was not read.
    index: Option<i64>,
    random: Pcg64,
}

impl Incremental {
    /// Sensors of a motor with these pole pairs.
    pub fn new(pole_pairs: f64, seed: u64) -> Self {
        Self {
            lines: LineEncoder::default(),
            hall: HallSensors::new(pole_pairs),
            line_fault: LineFault::None,
            hall_fault: HallFault::None,
            frozen_levels: None,
            edge: None,
            shown: 0,
            index: None,
            random: Pcg64::seed_from_u64(seed ^ 0x11ae),
        }
    }

    /// Sets the fault of the lines from now on.
    pub fn set_line_fault(&mut self, fault: LineFault) {
        self.line_fault = fault;
        if let LineFault::Jump(counts) | LineFault::Lost(counts) = fault {
            self.shown += counts;
        }
    }

    /// Sets the fault of the Hall sensors from now on.
    pub fn set_hall_fault(&mut self, fault: HallFault) {
        (self.hall_fault, self.frozen_levels) = (fault, None);
    }

    /// Turns the shaft to this angle, turns.
    pub fn turn_to(&mut self, turns: f64) {
        let now = self.lines.edges(turns);
        let before = self.edge.replace(now).unwrap_or(now);
        let moved = now - before;
        let rise = self.lines.index_rise(before, now);
        let start = self.shown;
        self.shown += match self.line_fault {
            LineFault::Missing => 0,
            // B changes at every second edge.
            LineFault::StuckLine => (now >> 1 & 1) - (before >> 1 & 1),
            LineFault::Reversed => -moved,
            LineFault::Noisy(share) => {
                let mut sum = 0;
                for _ in 0..moved.abs() {
                    if self.random.random_bool(share) {
                        sum += if self.random.random_bool(0.5) { 1 } else { -1 };
                    }
                }
                moved + sum
            }
            _ => moved,
        };
        let has_index = !matches!(
            self.line_fault,
            LineFault::Missing | LineFault::NoIndex | LineFault::StuckLine
        );
        if let Some(rise) = rise.filter(|_| has_index) {
            let sign = if self.line_fault == LineFault::Reversed { -1 } else { 1 };
            self.index = Some(start + sign * (rise - before));
        }
    }

    /// Returns the edges that the encoder has shown.
    pub fn take_edges(&mut self) -> LineEdges {
        LineEdges { shown: self.shown, at_index: self.index.take() }
    }

    /// Returns what a counter of the edges shows.
    pub fn read(&mut self) -> Quadrature {
        let LineEdges { shown, at_index } = self.take_edges();
        let count = |edges: i64| edges as u16;
        Quadrature { count: count(shown), index: at_index.map(count), has_double_edge: false }
    }

    /// Returns the levels of the Hall sensors at this angle, turns.
    pub fn levels(&mut self, turns: f64) -> u8 {
        let half =
            if self.hall_fault == HallFault::Jump { 0.5 / self.hall.pole_pairs } else { 0.0 };
        let levels = self.hall.levels(turns + half);
        match self.hall_fault {
            HallFault::None | HallFault::Jump => levels,
            HallFault::Missing => 0b111,
            HallFault::StuckSensor => levels | 1,
            HallFault::Frozen => *self.frozen_levels.get_or_insert(levels),
            HallFault::Noisy(share) if self.random.random_bool(share) => {
                levels ^ 1 << self.random.random_range(0..3)
            }
            HallFault::Noisy(_) => levels,
            HallFault::Reversed => levels & 0b001 | levels >> 1 & 0b010 | levels << 1 & 0b100,
        }
    }
}
