//! Frees an I2C bus whose data line a sensor holds low.
//!
//! A transfer that ends in the middle of a byte (a reset of the controller, a disturbed clock) leaves a sensor in it: it
//! drives the data line, and waits for clocks that nobody sends, because no controller starts on a bus that is not free.
//! Clocks by hand bring it to the end of its byte, nine at most, where it lets go; a stop then ends what it took for a
//! transfer (I2C-bus specification UM10204, 3.1.16). The controller itself is restarted by its board around this.

/// The two lines of a bus by hand, open drain: a line that is released is high unless somebody holds it low.
pub trait BusWires {
    /// Releases the clock, or pulls it low.
    fn clock(&mut self, released: bool);

    /// Releases the data line, or pulls it low.
    fn data(&mut self, released: bool);

    /// Whether the clock is high.
    fn clock_is_high(&mut self) -> bool;

    /// Whether the data line is high.
    fn data_is_high(&mut self) -> bool;

    /// Lets half a clock pass: 5 us and more.
    fn wait(&mut self);
}

/// Clocks until a sensor is at the end of its byte: eight bits and the acknowledge.
const CLOCKS: u32 = 9;

/// How a bus was found and left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recovered {
    /// Nobody held it; it was given a stop.
    WasFree,
    /// It was held, and is free after so many clocks and a stop.
    After(u32),
    /// The data line is held still: a short, or a sensor without power.
    DataHeld,
    /// The clock is held: no clocks can be sent.
    ClockHeld,
}

/// Frees the bus: at most nine clocks and a stop, 22 waits in all. The lines are released when it returns.
pub fn recover(wires: &mut impl BusWires) -> Recovered {
    wires.data(true);
    wires.clock(true);
    wires.wait();
    if !wires.clock_is_high() {
        return Recovered::ClockHeld;
    }
    let mut clocks = 0;
    while !wires.data_is_high() {
        if clocks == CLOCKS {
            return Recovered::DataHeld;
        }
        wires.clock(false);
        wires.wait();
        wires.clock(true);
        wires.wait();
        clocks += 1;
    }
    // A stop is the data line that rises while the clock is high: with the clock low it may fall without being a start.
    wires.clock(false);
    wires.data(false);
    wires.wait();
    wires.clock(true);
    wires.wait();
    wires.data(true);
    wires.wait();
    if clocks == 0 { Recovered::WasFree } else { Recovered::After(clocks) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor that drives a byte's last bits, on its lines.
    #[derive(Default)]
    struct Lines {
        clock: bool,
        data: bool,
        /// Bits it still drives low, one a falling edge of the clock.
        drives: u32,
        clock_shorted: bool,
        falls: u32,
        waits: u32,
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

        fn wait(&mut self) {
            self.waits += 1;
        }
    }

    #[test]
    fn whatever_bit_a_sensor_stopped_at_it_lets_go_and_gets_one_stop() {
        for bits in 1..=9 {
            let mut lines = Lines::driving(bits);
            assert_eq!(recover(&mut lines), Recovered::After(bits));
            assert_eq!((lines.falls, lines.stops, lines.starts), (bits + 1, 1, 0), "{bits} bits");
            assert!(lines.clock && lines.data && lines.waits <= 22, "{} waits", lines.waits);
        }
    }

    #[test]
    fn a_free_bus_gets_a_stop_and_no_more() {
        let mut lines = Lines::driving(0);
        assert_eq!(recover(&mut lines), Recovered::WasFree);
        assert_eq!((lines.falls, lines.stops, lines.starts), (1, 1, 0));
    }

    #[test]
    fn a_line_that_is_held_for_good_is_told_and_the_bus_left_released() {
        let mut lines = Lines::driving(u32::MAX);
        assert_eq!(recover(&mut lines), Recovered::DataHeld);
        assert_eq!((lines.falls, lines.stops), (9, 0));
        assert!(lines.clock && lines.data);
        let mut lines = Lines { clock_shorted: true, ..Lines::driving(3) };
        assert_eq!(recover(&mut lines), Recovered::ClockHeld);
        assert_eq!(lines.falls, 0);
    }
}
