//! The motor's and loop's parameters: written, validated, built for a period.
//!
//! [`MotorParameters`] is what a person writes and a record or the object dictionary holds: plain `f32`
//! fields in SI units, named once in [`MotorParameters::NAMES`]. [`MotorParameters::validate`] names the
//! first field refused, with its bound and why. [`MotorParameters::build`] makes a [`Motor`] for a sample
//! period: immutable, swapped whole at a cycle boundary ([`super::CurrentLoop::swap`]).
//!
//! Electrical quantities are those of one phase to the star point, current is the peak of a phase.

use super::pi::{BANDWIDTH_SHARE_MAX, Gains, one_minus_exp};
use super::space_vector::CIRCLE;
use super::transform::{UNITS_PER_RAD, binary_angle};
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::{Bound, ParameterError, check_ranges};
use core::f32::consts::TAU;

compensator_core::named_fields! {
    /// What a person writes.
    pub struct MotorParameters {
        /// Pole pairs, a whole number.
        pole_pairs: f32 = 7.0, 1.0..=64.0, "a motor has at least one pair of poles";
        /// Turns of the motor in one of the joint.
        gear_ratio: f32 = 51.0, 0.01..=1e4, "turns of the motor in one of the joint";
        /// 1, or -1 where a positive turn of the motor moves the joint towards negative position.
        joint_direction: f32 = 1.0, -1.0..=1.0, "1 or -1";
        /// Resistance of a phase, ohm.
        resistance_ohm: f32 = 0.12, 1e-4..=1e3, "a winding has resistance";
        /// Inductance along the magnet, H.
        inductance_d_h: f32 = 90e-6, 1e-7..=1.0, "a winding has inductance";
        /// Inductance across the magnet, H.
        inductance_q_h: f32 = 90e-6, 1e-7..=1.0, "a winding has inductance";
        /// The motor's torque per q current, Nm/A, without gear.
        torque_constant_nm_per_a: f32 = 0.0196, 1e-6..=1e3, "a magnet makes torque";
        /// Bandwidth of the current controllers, Hz.
        current_bandwidth_hz: f32 = 800.0, 1.0..=50e3, "a bandwidth";
        /// Bandwidth of the observer (its triple pole), Hz.
        observer_bandwidth_hz: f32 = 100.0, 0.1..=10e3, "a bandwidth";
        /// Largest current asked for, A.
        current_limit_a: f32 = 26.0, 0.0..=1e4, "a limit is a size";
        /// Phase current at which the bridge opens, A.
        overcurrent_a: f32 = 40.0, 0.0..=2e4, "a limit is a size";
        /// Bus voltage below which the bridge stays open, V.
        bus_voltage_min_v: f32 = 18.0, 1.0..=1e3, "duties are voltage over this";
        /// Bus voltage above which the bridge stays open, V.
        bus_voltage_max_v: f32 = 56.0, 1.0..=1e3, "a voltage";
        /// Share of the longest undistorted voltage vector in use; the rest is time for the shunts to settle.
        modulation_max: f32 = 0.95, 0.05..=1.0, "beyond 1 the bridge distorts";
        /// Encoder angle at which the magnet lies along phase a, rad of the motor.
        encoder_offset_rad: f32 = 0.0, -6.3..=6.3, "within a turn";
        /// 1, or -1 where the encoder counts down when phases a, b, c follow each other.
        encoder_direction: f32 = 1.0, -1.0..=1.0, "1 or -1";
        /// How old the encoder's angle is when the currents are sampled, s.
        encoder_delay_s: f32 = 0.0, 0.0..=1e-3, "a short time";
        /// How long a missing encoder is coasted over, s.
        encoder_coast_s: f32 = 0.002, 0.0..=0.02, "a rotor is not known for longer";
        /// Largest speed of the joint that is believed, rad/s.
        velocity_max_rad_s: f32 = 12.0, 1e-3..=1e4, "the joint must move";
        /// Age at which a set-point no longer counts, s.
        setpoint_timeout_s: f32 = 0.1, 1e-4..=0.1, "a joint must not run on without being told";
        /// Inertia at the joint, rotor and gear included, kg m^2; 0 where it is not known.
        inertia_kg_m2: f32 = 0.0, 0.0..=1e4, "an inertia";
        /// Current of the velocity loop per velocity it is short of, A s/rad.
        velocity_gain_a_s_per_rad: f32 = 3.0, 1e-3..=1e4, "a loop acts against its error";
        /// Time the velocity loop's integral takes to come to as much, s.
        velocity_integral_s: f32 = 0.1, 1e-2..=1e3, "a loop a millisecond late is not faster";
        /// Largest acceleration of the velocity loop's reference, rad/s^2.
        acceleration_max_rad_s2: f32 = 50.0, 1e-2..=1e5, "the joint must move";
    }
    /// A 48 V motor of seven pole pairs behind a gear of 51, 1 Nm/A at the joint.
}

/// Shortest and longest period, s.
const PERIOD_RANGE_S: (f32, f32) = (2e-6, 2e-3);

/// Farthest the magnet may turn in a period, rad: beyond, a voltage vector held for a period is no longer
/// near where it was meant to be.
const TURN_MAX_RAD: f32 = 0.6;

/// How far an encoder's angle may lie from the shaft's, rad of the motor.
const ENCODER_ERROR_RAD: f32 = 0.02;

/// Overcurrent must lie above the limit by this: the current overshoots, and sensors are noisy.
const OVERCURRENT_MARGIN: f32 = 1.1;

/// Time constants of the triple pole until a start has settled to 1 %.
const SETTLE_TIME_CONSTANTS: f32 = 12.0;

fn refuse(
    field: &'static str,
    value: f32,
    bound: Bound,
    why: &'static str,
) -> Result<(), ParameterError> {
    Err(ParameterError { field, value: value.into(), bound, why })
}

impl MotorParameters {
    /// Checks every field, and those that bound each other.
    ///
    /// # Errors
    /// Names the first field refused, its value, the bound it broke and why the bound is there.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::NAMES, &self.to_array(), &Self::RANGES)?;
        if self.pole_pairs != self.pole_pairs as u32 as f32 {
            refuse("pole_pairs", self.pole_pairs, Bound::Whole, "poles come in pairs")?;
        }
        for (field, sign) in [
            ("joint_direction", self.joint_direction),
            ("encoder_direction", self.encoder_direction),
        ] {
            if sign.abs() != 1.0 {
                let bound = if sign < 0.0 { Bound::AtMost(-1.0) } else { Bound::AtLeast(1.0) };
                refuse(field, sign, bound, "1 or -1")?;
            }
        }
        let least = self.current_limit_a * OVERCURRENT_MARGIN;
        if self.overcurrent_a < least {
            let why = "a tenth above the current limit, or the bridge opens in normal use";
            refuse("overcurrent_a", self.overcurrent_a, Bound::AtLeast(least.into()), why)?;
        }
        if self.bus_voltage_max_v <= self.bus_voltage_min_v {
            let bound = Bound::MoreThan(self.bus_voltage_min_v.into());
            refuse("bus_voltage_max_v", self.bus_voltage_max_v, bound, "a range has a width")?;
        }
        Ok(())
    }

    /// Checks that motor, gear and compensator tell the same story: the joint's torque constant is the
    /// motor's times the gear ratio, less what the gear loses (at most 80 %) and with 10 % for tolerances.
    ///
    /// # Errors
    /// Names the compensator's torque constant and the bound it broke.
    pub fn validate_with(&self, joint: &CompensatorParameters) -> Result<(), ParameterError> {
        let (field, value) = ("torque_constant_nm_per_a", joint.torque_constant_nm_per_a);
        let lossless = self.torque_constant_nm_per_a * self.gear_ratio;
        let why = "the joint's is the motor's times the gear ratio times the gear's efficiency";
        if value.is_nan() || value < 0.2 * lossless {
            refuse(field, value, Bound::AtLeast((0.2 * lossless).into()), why)
        } else if value > 1.1 * lossless {
            refuse(field, value, Bound::AtMost((1.1 * lossless).into()), why)
        } else {
            Ok(())
        }
    }

    /// Validates the parameters and builds the loop's coefficients for a period in s.
    ///
    /// # Errors
    /// As [`MotorParameters::validate`]; also if the period is not within 2 us..2 ms, or a bandwidth
    /// or speed is too high for it.
    pub fn build(&self, period_s: f32) -> Result<Motor, ParameterError> {
        self.validate()?;
        let (shortest, longest) = PERIOD_RANGE_S;
        let why = "range of a current loop's period";
        if !period_s.is_finite() || period_s < shortest {
            refuse("period_s", period_s, Bound::AtLeast(shortest.into()), why)?;
        } else if period_s > longest {
            refuse("period_s", period_s, Bound::AtMost(longest.into()), why)?;
        }
        let fastest = BANDWIDTH_SHARE_MAX / period_s;
        for (field, value) in [
            ("current_bandwidth_hz", self.current_bandwidth_hz),
            ("observer_bandwidth_hz", self.observer_bandwidth_hz),
        ] {
            if value > fastest * 1.000_001 {
                let why = "a twentieth of the loop rate: beyond it the PWM's delay makes overshoot";
                refuse(field, value, Bound::AtMost(fastest.into()), why)?;
            }
        }
        let motor_velocity_max = self.velocity_max_rad_s * self.gear_ratio;
        let most = TURN_MAX_RAD / (period_s * self.gear_ratio * self.pole_pairs);
        if self.velocity_max_rad_s > most {
            let why = "the magnet may turn 0.6 rad (electrical) in a period";
            refuse("velocity_max_rad_s", self.velocity_max_rad_s, Bound::AtMost(most.into()), why)?;
        }
        let flux_vs = self.torque_constant_nm_per_a / (1.5 * self.pole_pairs);
        let (r, bandwidth) = (self.resistance_ohm, self.current_bandwidth_hz);
        Ok(Motor {
            period_s,
            pole_pairs: self.pole_pairs as u32,
            pole_pairs_f32: self.pole_pairs,
            joint_per_motor: self.joint_direction / self.gear_ratio,
            joint_direction: self.joint_direction,
            turns_do_not_matter: self.gear_ratio == 1.0,
            d: Gains::cancelling(r, self.inductance_d_h, bandwidth, period_s),
            q: Gains::cancelling(r, self.inductance_q_h, bandwidth, period_s),
            inductance_d_h: self.inductance_d_h,
            inductance_q_h: self.inductance_q_h,
            flux_vs,
            observer: ObserverGains::new(self, motor_velocity_max, period_s),
            current_limit_a: self.current_limit_a.abs(),
            overcurrent_a: self.overcurrent_a,
            bus_min_v: self.bus_voltage_min_v,
            bus_max_v: self.bus_voltage_max_v,
            bus_brakes_to_v: BRAKES_TO * self.bus_voltage_max_v,
            braking_per_v: 1.0 / ((BRAKES_TO - BRAKES_FROM) * self.bus_voltage_max_v),
            radius_per_bus: CIRCLE * self.modulation_max,
            encoder_offset: binary_angle(self.encoder_offset_rad),
            encoder_reversed: self.encoder_direction < 0.0,
            park_units: self.encoder_delay_s * UNITS_PER_RAD,
            drive_units: (self.encoder_delay_s + DRIVE_DELAY_PERIODS * period_s) * UNITS_PER_RAD,
            velocity_max_rad_s: self.velocity_max_rad_s,
            setpoint_timeout_s: self.setpoint_timeout_s,
            inertia_kg_m2: self.inertia_kg_m2,
        })
    }
}

/// Shares of the largest bus voltage between which braking is taken back to nothing: what brakes feeds the bus.
const BRAKES_FROM: f32 = 0.94;
const BRAKES_TO: f32 = 0.99;

/// The duties found now act through the next period; their middle is this many periods away.
const DRIVE_DELAY_PERIODS: f32 = 1.5;

/// The parameters built for a period; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    pub(super) period_s: f32,
    pub(super) pole_pairs: u32,
    pub(super) pole_pairs_f32: f32,
    /// Signed: the direction is in it.
    pub(super) joint_per_motor: f32,
    pub(super) joint_direction: f32,
    /// Direct drive: a whole turn of the motor is one of the joint.
    pub(super) turns_do_not_matter: bool,
    pub(super) d: Gains,
    pub(super) q: Gains,
    pub(super) inductance_d_h: f32,
    pub(super) inductance_q_h: f32,
    /// Flux of the magnet through a phase, Vs.
    pub(super) flux_vs: f32,
    pub(super) observer: ObserverGains,
    pub(super) current_limit_a: f32,
    pub(super) overcurrent_a: f32,
    pub(super) bus_min_v: f32,
    pub(super) bus_max_v: f32,
    /// Bus voltage at which nothing brakes any more, V, and share of the braking that a volt below it leaves.
    pub(super) bus_brakes_to_v: f32,
    pub(super) braking_per_v: f32,
    /// Longest voltage vector in use, per bus voltage.
    pub(super) radius_per_bus: f32,
    pub(super) encoder_offset: u32,
    pub(super) encoder_reversed: bool,
    /// Binary angle of the motor per rad/s, from the encoder's sample to that of the currents...
    pub(super) park_units: f32,
    /// ... and to the middle of the period the duties act in.
    pub(super) drive_units: f32,
    pub(super) velocity_max_rad_s: f32,
    pub(super) setpoint_timeout_s: f32,
    pub(super) inertia_kg_m2: f32,
}

impl Motor {
    /// The period the loop was built for, s.
    pub fn period_s(&self) -> f32 {
        self.period_s
    }

    /// The rotor's mechanical angle from the electrical zero, for an encoder's angle.
    #[inline(always)]
    pub fn rotor_angle(&self, encoder: u32) -> u32 {
        let angle = encoder.wrapping_sub(self.encoder_offset);
        if self.encoder_reversed { angle.wrapping_neg() } else { angle }
    }

    /// Whether an observer that ran with `other` may go on with this: the angle means the same.
    pub(super) fn same_shaft(&self, other: &Self) -> bool {
        self.encoder_offset == other.encoder_offset
            && self.encoder_reversed == other.encoder_reversed
            && self.joint_per_motor == other.joint_per_motor
    }
}

/// The observer's coefficients, see [`super::observer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverGains {
    pub(super) period_s: f32,
    /// `g`.
    pub(super) angle: f32,
    /// `h / T`.
    pub(super) velocity_per_s: f32,
    /// `2 k / T^2`.
    pub(super) acceleration_per_s2: f32,
    pub(super) coast_s: f32,
    /// Binary angle the motor can turn in a second, and what an encoder may err by.
    pub(super) units_per_s: f32,
    pub(super) jump_units: f32,
    /// Cycles until a start has settled.
    pub(super) settle_cycles: u32,
}

impl ObserverGains {
    fn new(written: &MotorParameters, motor_velocity_max: f32, period_s: f32) -> Self {
        let rate = TAU * written.observer_bandwidth_hz;
        // 1 - z, without the cancellation.
        let y = one_minus_exp(rate * period_s);
        let z = 1.0 - y;
        let settle = SETTLE_TIME_CONSTANTS / (rate * period_s);
        Self {
            period_s,
            angle: y * (1.0 + z + z * z),
            velocity_per_s: 1.5 * y * y * (1.0 + z) / period_s,
            acceleration_per_s2: y * y * y / (period_s * period_s),
            // Half a period more, so that rounding does not take one from the last cycle.
            coast_s: written.encoder_coast_s + 0.5 * period_s,
            units_per_s: 1.25 * motor_velocity_max * UNITS_PER_RAD,
            jump_units: ENCODER_ERROR_RAD * UNITS_PER_RAD,
            settle_cycles: settle as u32 + 1,
        }
    }
}

#[cfg(test)]
#[path = "parameters_tests.rs"]
mod tests;
