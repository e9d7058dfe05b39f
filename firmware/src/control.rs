//! The current loop of a permanent-magnet synchronous joint motor, without its board.
//!
//! A joint's torque is a current that turns with the rotor. Once a period the loop takes the phase
//! currents and the rotor's angle, looks at the currents from the rotor ([`transform`]), follows the
//! angle to a joint velocity ([`observer`]), lets the friction compensator add its current
//! ([`compensation`]), limits the *sum*, lets two PI controllers find the voltage ([`pi`]), and turns
//! that voltage into three duties ([`space_vector`]). [`current_loop`] is that order; [`parameters`] is
//! what it is built from; [`probe`] stands in for it while they are being found, and [`velocity_loop`] lies above it
//! where a velocity is asked for. Current is positive where it drives the *joint* towards positive position.
//!
//! The loop owns its state, reads no clock, and never logs, blocks, allocates or panics; whatever the
//! sample says, the duties are finite and within 0..=1, or the bridge is off. The same code runs in the
//! interrupt of the joint driver and in the closed-loop tests on a PC.

pub mod compensation;
pub mod current_loop;
pub mod flags;
pub mod observer;
pub mod parameters;
pub mod pi;
pub mod probe;
pub mod space_vector;
pub mod transform;
pub mod velocity_loop;

pub use compensation::{Compensate, JointCompensator, NoCompensation};
pub use current_loop::{Covariates, CurrentLoop, Cycle, Setpoint};
pub use flags::LoopFlags;
pub use parameters::{Motor, MotorParameters};

/// Period of the current loop, s: 20 kHz.
pub const PERIOD_S: f32 = 50e-6;

bitflags::bitflags! {
    /// What of a [`StageSample`] was measured and is believed by the board.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Valid: u8 {
        /// Current of phase a. A board with two shunts never sets the third's bit.
        const CURRENT_A = 1 << 0;
        /// Current of phase b.
        const CURRENT_B = 1 << 1;
        /// Current of phase c.
        const CURRENT_C = 1 << 2;
        /// Bus voltage.
        const BUS = 1 << 3;
        /// Encoder angle: read in time, and its own check (parity, CRC, magnet) passed.
        const ENCODER = 1 << 4;
    }
}

/// What a power stage measured in one period.
#[derive(Clone, Copy, Debug)]
pub struct StageSample {
    /// Phase currents a, b, c into the motor, A.
    pub currents_a: [f32; 3],
    /// Bus voltage, V.
    pub bus_v: f32,
    /// Encoder angle as a share of a turn of the motor, 2^32 for a whole one: see [`encoder_angle`].
    /// A binary angle wraps by itself, has no NaN, and 1.5e-9 rad is its resolution at any speed.
    pub encoder: u32,
    /// What of this is to be believed.
    pub valid: Valid,
}

/// An encoder's reading of so many bits (1..=32) as a [`StageSample::encoder`]; surplus high bits fall off.
#[inline(always)]
pub const fn encoder_angle(counts: u32, bits: u32) -> u32 {
    if bits == 0 || bits > 32 { 0 } else { counts.wrapping_shl(32 - bits) }
}

/// What is done with the bridge until the next cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// All six switches open.
    Off,
    /// Share of the period each high side conducts: phases a, b, c, 0..=1.
    Drive([f32; 3]),
}

/// For whom the hardware opened the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Broke {
    /// The gate driver.
    GateDriver,
    /// Comparators at the shunts.
    Overcurrent,
    /// The chip itself: its supply, clock, memory or processor.
    System,
}

/// A three-phase bridge with its sensors and the motor's encoder: what a board gives the current loop.
pub trait PowerStage {
    /// What was measured for this period.
    fn sample(&mut self) -> StageSample;

    /// Whether the hardware has opened the bridge by itself, or would, and for whom.
    fn broke(&mut self) -> Option<Broke>;

    /// Wakes the gate driver, or puts it to sleep: the second way to open all switches.
    fn wake(&mut self, awake: bool);

    /// Sets the duties of the next period, each 0..=1.
    fn drive(&mut self, duty: [f32; 3]);

    /// Opens all switches at once.
    fn off(&mut self);

    /// The processor's cycle counter, which wraps.
    fn cycles(&self) -> u32;

    /// Does with the bridge what a cycle says.
    #[inline(always)]
    fn apply(&mut self, bridge: Bridge) {
        match bridge {
            Bridge::Drive(duty) => self.drive(duty),
            Bridge::Off => self.off(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_fill_the_turn_from_the_top() {
        assert_eq!(encoder_angle(1, 1), 1 << 31);
        assert_eq!(encoder_angle(0x3FFF, 14), 0xFFFC_0000);
        assert_eq!(encoder_angle(0x4001, 14), 1 << 18);
        assert_eq!(encoder_angle(7, 32), 7);
        assert_eq!((encoder_angle(7, 0), encoder_angle(7, 33)), (0, 0));
    }
}
