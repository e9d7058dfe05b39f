//! The current loop of a permanent-magnet synchronous joint motor, without its board.
//!
//! A motor's torque comes from a current vector that turns with the rotor. In every period the loop does these
//! steps: it transforms the phase currents to the rotor's frame ([`transform`]) and observes the joint's motion
//! ([`observer`]). It adds the compensation current ([`compensation`]) to the set-point and limits the *sum*.
//! Two PI controllers find the voltage ([`pi`]), and [`space_vector`] turns the voltage into three duties.
//!
//! [`current_loop`] is that sequence, and [`parameters`] holds what it is built from. [`probe`] replaces it
//! while the parameters are measured. [`velocity_loop`] commands it in velocity mode. Current is positive if it
//! drives the *joint* towards positive position.
//!
//! The loop owns its state, reads no clock, and never logs, blocks, allocates or panics. For every sample the
//! duties are finite and within 0..=1, or the bridge is off. The interrupt of the joint driver and the
//! closed-loop tests on a PC run the same code.

pub mod compensation;
pub mod covariates;
mod current_limits;
pub mod current_loop;
mod cycle;
pub mod dead_time;
pub mod flags;
pub mod observer;
pub mod parameters;
pub mod pi;
pub mod probe;
pub mod space_vector;
pub mod transform;
pub mod velocity_loop;

pub use compensation::{Compensate, JointCompensator};
pub use covariates::Covariates;
pub use current_loop::CurrentLoop;
pub use cycle::{CycleResult, Setpoint};
pub use flags::LoopFlags;
pub use parameters::{ENCODER_ERROR_RAD, Motor, MotorParameters};

/// Period of the current loop, s: 20 kHz.
pub const PERIOD_S: f32 = 50e-6;

bitflags::bitflags! {
    /// Measurements of a [`StageSample`] that are present and passed the board's checks.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct ValidChannels: u8 {
        /// Current of phase a.
        const CURRENT_A = 1 << 0;
        /// Current of phase b.
        const CURRENT_B = 1 << 1;
        /// Current of phase c. A board with two shunts never sets this bit.
        const CURRENT_C = 1 << 2;
        /// Bus voltage.
        const BUS = 1 << 3;
        /// Encoder angle: read in time, and its own check (parity, CRC, magnet) passed.
        const ENCODER = 1 << 4;
    }
}

/// Measurements of a power stage in one period.
#[derive(Clone, Copy, Debug)]
pub struct StageSample {
    /// Phase currents a, b, c into the motor, A.
    pub currents_a: [f32; 3],
    /// Bus voltage, V.
    pub bus_v: f32,
    /// Encoder angle as a fraction of a motor turn; 2^32 is a whole turn. See [`encoder_angle`]. A binary angle
    /// wraps without extra code and has no NaN. Its resolution is 1.5e-9 rad at any speed.
    pub encoder: u32,
    /// Which of these values are valid.
    pub valid: ValidChannels,
}

/// Converts an encoder count of `bits` bits (1..=32) to a [`StageSample::encoder`]. Excess high bits are
/// dropped.
#[inline(always)]
pub const fn encoder_angle(counts: u32, bits: u32) -> u32 {
    if bits == 0 || bits > 32 { 0 } else { counts.wrapping_shl(32 - bits) }
}

/// State of the bridge until the next cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Bridge {
    /// All six switches open.
    #[default]
    Off,
    /// Duties of the high sides of phases a, b, c, 0..=1.
    Drive([f32; 3]),
    /// All low sides closed: the motor brakes itself.
    Shorted,
}

/// Source of a hardware signal that opened the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BridgeFault {
    /// The gate driver.
    GateDriver,
    /// Overcurrent comparators at the shunts.
    Overcurrent,
    /// The chip: its supply, clock, memory or processor.
    System,
}

/// A three-phase bridge with its sensors and the motor's encoder: the interface of a board to the current loop.
pub trait PowerStage {
    /// Returns the measurements of this period.
    fn sample(&mut self) -> StageSample;

    /// Returns the source of a hardware fault that opened the bridge, or holds it open.
    fn bridge_fault(&mut self) -> Option<BridgeFault>;

    /// Returns true if the encoder reports a fault of its magnet; its angle is still valid. It is called once per
    /// report.
    fn has_magnet_fault(&self) -> bool {
        false
    }

    /// Returns the level of the touch probe's input, read at the begin of the period. A stage without it is never touched.
    fn is_touched(&self) -> bool {
        false
    }

    /// Wakes the gate driver, or puts it to sleep. Sleep is a second way to open all switches.
    fn set_awake(&mut self, awake: bool);

    /// Sets the duties of the next period, each 0..=1.
    fn drive(&mut self, duty: [f32; 3]);

    /// Opens all switches immediately.
    fn off(&mut self);

    /// Closes all low sides and opens all high sides, so that the motor brakes itself ([`crate::stop_brake`]). It is
    /// called in every period of the brake, and only while the gate driver is awake and reports no fault. A stage
    /// that cannot do it opens all switches: the joint coasts.
    fn brake(&mut self) {
        self.off();
    }

    /// Returns the processor's cycle counter, which wraps.
    fn cycles(&self) -> u32;

    /// Applies the bridge state that a cycle returned.
    #[inline(always)]
    fn apply(&mut self, bridge: Bridge) {
        match bridge {
            Bridge::Drive(duty) => self.drive(duty),
            Bridge::Off => self.off(),
            Bridge::Shorted => self.brake(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoder_angle_of_any_width_aligns_to_the_high_bits() {
        assert_eq!(encoder_angle(1, 1), 1 << 31);
        assert_eq!(encoder_angle(0x3FFF, 14), 0xFFFC_0000);
        assert_eq!(encoder_angle(0x4001, 14), 1 << 18);
        assert_eq!(encoder_angle(7, 32), 7);
        assert_eq!((encoder_angle(7, 0), encoder_angle(7, 33)), (0, 0));
    }
}
