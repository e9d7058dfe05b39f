//! What surrounds the chip: the motor stage, the encoder and the bus, as the peripherals see them.

use crate::chip::bme280::HousingAir;
use crate::chip::comparators::BreakLevels;
use crate::chip::ms5837::Water;
use crate::chip::timer20::Edges;
use crate::chip::wiring::{STANDARD, Wiring};

/// State of the bridge over a stretch of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// All switches are open.
    Open,
    /// The phases switch with these duties, from 0 to 1.
    Driven([f64; 3]),
}

/// Surroundings of the chip. All times are in seconds.
pub trait World {
    /// Returns the connections of the board.
    fn wiring(&self) -> &'static Wiring {
        &STANDARD
    }

    /// Simulates this time with the bridge in this state.
    fn advance(&mut self, seconds: f64, bridge: Bridge);

    /// Sets the level of the holding brake's output.
    fn set_brake_output(&mut self, _is_high: bool) {}

    /// Takes the analog values of this moment; [`World::analog`] then returns them. The currents are shown by the
    /// low-side shunts, so `is_low_side_on` states for phases a and b whether the low side conducts.
    fn sample(&mut self, is_low_side_on: [bool; 2]);

    /// Returns the counts of a converter, 1 to 5, for a channel.
    fn analog(&mut self, converter: usize, channel: u32) -> u16;

    /// Returns the counts of the signals that the comparators compare now.
    fn shunts(&mut self) -> [u16; 3] {
        [2048; 3]
    }

    /// Exchanges a word with the encoder, `seconds` after the last sample.
    fn encoder(&mut self, word: u16, seconds: f64) -> u16;

    /// Returns the edges of a quadrature encoder, `seconds` after the last sample.
    fn edges(&mut self, _seconds: f64) -> Edges {
        Edges::default()
    }

    /// Returns the levels of the motor's Hall sensors, `seconds` after the last sample; `None` if there are none.
    fn hall_levels(&mut self, _seconds: f64) -> Option<u8> {
        None
    }

    /// Returns the frame of an encoder with BiSS C that latches `seconds` after the last sample; `None` if an AS504x is
    /// connected.
    fn biss_frame(&mut self, _seconds: f64) -> Option<u64> {
        None
    }

    /// Returns the frame of an encoder with BiSS C at the joint's side of the gear that latches `seconds` after the last
    /// sample; `None` without one.
    fn joint_frame(&mut self, _seconds: f64) -> Option<u64> {
        None
    }

    /// Returns what the pressure sensor is in; `None` if there is no sensor.
    fn water(&self) -> Option<Water> {
        None
    }

    /// Returns what the sensor in the housing is in; `None` if there is no sensor.
    fn air(&self) -> Option<HousingAir> {
        None
    }

    /// Returns which channels of safe torque off allow torque.
    fn torque_allowed(&self) -> [bool; 2] {
        [true; 2]
    }

    /// Returns true if the touch probe's input is high.
    fn is_touched(&self) -> bool {
        false
    }

    /// Returns true if the gate driver reports a fault.
    fn has_gate_fault(&self) -> bool {
        false
    }

    /// Sets the levels at which the comparators see an overcurrent, from now on.
    fn set_break_levels(&mut self, _levels: BreakLevels) {}

    /// Returns true while the comparators see an overcurrent.
    fn is_overcurrent(&self) -> bool {
        false
    }

    /// The break flag was cleared by software.
    fn clear_break(&mut self) {}

    /// Returns by how many cycles the interrupt of the period that begins now is delayed, as by other work at the
    /// highest priority.
    fn interrupt_delay(&mut self) -> u32 {
        0
    }
}
