//! Releases an I2C bus whose data line a sensor holds low.
//!
//! If a transfer ends within a byte (a reset of the controller, a disturbed clock), the sensor keeps
//! driving the data line and waits for clocks. No controller sends them, because it starts only on a free
//! bus. At most nine manual clocks take the sensor to the end of its byte, where it releases the line. A
//! stop condition then ends the transfer (I2C-bus specification UM10204, 3.1.16). The board restarts the
//! controller itself around this.
//!
//! The recovery waits for nothing: each [`Recovery::step`] is half a clock period. Steps must be at least 5 us apart; the
//! bus has no lowest clock frequency.

/// Manual control of the two open-drain lines. A released line is high unless a device holds it low.
pub trait BusWires {
    /// Releases the clock, or pulls it low.
    fn clock(&mut self, released: bool);

    /// Releases the data line, or pulls it low.
    fn data(&mut self, released: bool);

    /// Returns true if the clock is high.
    fn clock_is_high(&mut self) -> bool;

    /// Returns true if the data line is high.
    fn data_is_high(&mut self) -> bool;
}

/// Maximum clocks to the end of a byte: eight bits and the acknowledge.
const MAX_CLOCKS: u32 = 9;

/// Result of a recovery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecoveryOutcome {
    /// The bus was free; a stop condition was sent.
    WasFree,
    /// The bus was held and is free after this number of clocks and a stop condition.
    AfterClocks(u32),
    /// The data line is still held: a short circuit, or a sensor without power.
    DataHeld,
    /// The clock line is held, so no clocks can be sent.
    ClockHeld,
}

/// Half of a clock period in progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Begin,
    /// Both lines are released, or a clock has ended.
    Check,
    /// The clock is low.
    Clock,
    /// Both lines are low, for the stop condition.
    StopClock,
    /// The clock is high and the data line low.
    StopData,
    /// Both lines are released.
    End,
}

/// A recovery in progress: at most nine clocks and a stop condition.
#[derive(Clone, Copy, Debug, Default)]
pub struct Recovery {
    phase: Phase,
    clocks: u32,
}

impl Recovery {
    /// Does half a clock period. Returns the outcome at the end, after at most 23 steps; both lines are released then.
    pub fn step(&mut self, wires: &mut impl BusWires) -> Option<RecoveryOutcome> {
        self.phase = match self.phase {
            Phase::Begin => {
                wires.data(true);
                wires.clock(true);
                Phase::Check
            }
            Phase::Check if self.clocks == 0 && !wires.clock_is_high() => {
                return Some(RecoveryOutcome::ClockHeld);
            }
            Phase::Check if wires.data_is_high() => {
                // A stop condition is a rising data line while the clock is high. The data line must fall while the
                // clock is low, because it would otherwise be a start condition.
                wires.clock(false);
                wires.data(false);
                Phase::StopClock
            }
            Phase::Check if self.clocks == MAX_CLOCKS => return Some(RecoveryOutcome::DataHeld),
            Phase::Check => {
                wires.clock(false);
                Phase::Clock
            }
            Phase::Clock => {
                wires.clock(true);
                self.clocks += 1;
                Phase::Check
            }
            Phase::StopClock => {
                wires.clock(true);
                Phase::StopData
            }
            Phase::StopData => {
                wires.data(true);
                Phase::End
            }
            Phase::End if self.clocks == 0 => return Some(RecoveryOutcome::WasFree),
            Phase::End => return Some(RecoveryOutcome::AfterClocks(self.clocks)),
        };
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines with a sensor that drives the last bits of a byte.
    #[derive(Default)]
    struct Lines {
        clock: bool,
        data: bool,
        /// Bits the sensor still drives low, one per falling clock edge.
        drives: u32,
        clock_shorted: bool,
        falls: u32,
        stops: u32,
        starts: u32,
    }

    impl Lines {
        fn driving(bits: u32) -> Self {
            Self { clock: true, data: true, drives: bits, ..Self::default() }
        }

        fn data_line(&self) -> bool {
            self.data && self.drives == 0
        }
    }

    impl BusWires for Lines {
        fn clock(&mut self, released: bool) {
            if self.clock && !released {
                self.falls += 1;
                self.drives = self.drives.saturating_sub(1);
            }
            self.clock = released;
        }

        fn data(&mut self, released: bool) {
            let before = self.data_line();
            self.data = released;
            let after = self.data_line();
            self.stops += u32::from(self.clock && !before && after);
            self.starts += u32::from(self.clock && before && !after);
        }

        fn clock_is_high(&mut self) -> bool {
            self.clock && !self.clock_shorted
        }

        fn data_is_high(&mut self) -> bool {
            self.data_line()
        }
    }

    /// Steps to the end.
    fn recover(lines: &mut Lines) -> RecoveryOutcome {
        let mut recovery = Recovery::default();
        (0..23).find_map(|_| recovery.step(lines)).expect("an end within 23 steps")
    }

    #[test]
    fn held_bus_is_released_at_every_bit_with_one_stop() {
        for bits in 1..=9 {
            let mut lines = Lines::driving(bits);
            assert_eq!(recover(&mut lines), RecoveryOutcome::AfterClocks(bits));
            assert_eq!((lines.falls, lines.stops, lines.starts), (bits + 1, 1, 0), "{bits} bits");
            assert!(lines.clock && lines.data);
        }
    }

    #[test]
    fn free_bus_gets_one_stop() {
        let mut lines = Lines::driving(0);
        assert_eq!(recover(&mut lines), RecoveryOutcome::WasFree);
        assert_eq!((lines.falls, lines.stops, lines.starts), (1, 1, 0));
    }

    #[test]
    fn permanently_held_line_is_reported_and_both_are_released() {
        let mut lines = Lines::driving(u32::MAX);
        assert_eq!(recover(&mut lines), RecoveryOutcome::DataHeld);
        assert_eq!((lines.falls, lines.stops), (9, 0));
        assert!(lines.clock && lines.data);
        let mut lines = Lines { clock_shorted: true, ..Lines::driving(3) };
        assert_eq!(recover(&mut lines), RecoveryOutcome::ClockHeld);
        assert_eq!(lines.falls, 0);
    }
}
