//! Parameters of the motor and the loop: written, validated, built for a period.
//!
//! [`MotorParameters`] is the written form, in a record or in the object dictionary: `f32` fields in SI units,
//! named in [`MotorParameters::NAMES`]. [`MotorParameters::validate`] names the first field refused, with its
//! bound and the reason. [`MotorParameters::build`] makes a [`Motor`] for a sample period. A [`Motor`] is
//! immutable and swapped whole between two cycles ([`super::CurrentLoop::swap`]).
//!
//! Electrical quantities are from one phase to the star point; currents are phase peaks.

use super::dead_time::{LONGEST_VECTOR, LossModel};
use super::pi::{
    BANDWIDTH_SHARE_ANY, BANDWIDTH_SHARE_MAX, Gains, bandwidth_share, one_minus_exp, reference_gain,
};
use super::space_vector::MAX_VECTOR_PER_BUS_V;
use super::transform::{UNITS_PER_RAD, binary_angle};
use crate::setting_error::check_either;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::{Bound, ParameterError, check_ranges, refuse};
use compensator_core::text;
use core::f32::consts::TAU;

/// Share of the written resistance that is assumed to burn power: the winding may be colder than at its measurement.
pub(super) const BURNING_SHARE: f32 = 0.9;

compensator_core::named_fields! {
    /// Parameters of the motor as they are written.
    pub struct MotorParameters {
        /// Pole pairs, a whole number.
        pole_pairs: f32 = 7.0, 1.0..=64.0, "a motor has at least one pair of poles";
        /// Motor turns per joint turn.
        gear_ratio: f32 = 51.0, 0.01..=1e4, "turns of the motor in one of the joint";
        /// 1, or -1 if a positive turn of the motor moves the joint towards negative position.
        joint_direction: f32 = 1.0, -1.0..=1.0, "1 or -1";
        /// Resistance of a phase, ohm.
        resistance_ohm: f32 = 0.12, 1e-4..=1e3, "a winding has resistance";
        /// Inductance along the magnet, H.
        inductance_d_h: f32 = 90e-6, 1e-7..=1.0, "a winding has inductance";
        /// Inductance across the magnet, H.
        inductance_q_h: f32 = 90e-6, 1e-7..=1.0, "a winding has inductance";
        /// Torque of the motor per q current, Nm/A, without gear.
        torque_constant_nm_per_a: f32 = 0.0196, 1e-6..=1e3, "a magnet makes torque";
        /// Bandwidth of the current controllers, Hz.
        current_bandwidth_hz: f32 = 800.0, 1.0..=50e3, "a bandwidth";
        /// Bandwidth of the observer (its triple pole), Hz.
        observer_bandwidth_hz: f32 = 100.0, 0.1..=10e3, "a bandwidth";
        /// Maximum current set-point, A.
        current_limit_a: f32 = 26.0, 0.0..=1e4, "a limit is not negative";
        /// Phase current at which the bridge opens, A.
        overcurrent_a: f32 = 40.0, 0.0..=2e4, "a limit is not negative";
        /// Bus voltage below which the bridge stays open, V.
        bus_voltage_min_v: f32 = 18.0, 1.0..=1e3, "duties are voltage over this";
        /// Bus voltage above which the bridge stays open, V.
        bus_voltage_max_v: f32 = 56.0, 1.0..=1e3, "a voltage";
        /// Share of the longest undistorted voltage vector in use; the rest leaves the shunts time to settle.
        modulation_max: f32 = 0.95, 0.05..=1.0, "beyond 1 the bridge distorts";
        /// Encoder angle at which the magnet lies along phase a, rad of the motor.
        encoder_offset_rad: f32 = 0.0, -6.3..=6.3, "within a turn";
        /// 1, or -1 if the encoder counts down in the phase sequence a, b, c.
        encoder_direction: f32 = 1.0, -1.0..=1.0, "1 or -1";
        /// Age of the encoder angle at the time the currents are sampled, s.
        encoder_delay_s: f32 = 0.0, 0.0..=1e-3, "a short time";
        /// Maximum time without an encoder sample before the rotor is lost, s.
        encoder_coast_s: f32 = 0.002, 0.0..=0.02, "a rotor is not known for longer";
        /// Maximum plausible joint velocity, rad/s.
        velocity_max_rad_s: f32 = 12.0, 1e-3..=1e4, "the joint must move";
        /// Age at which a set-point becomes stale, s.
        setpoint_timeout_s: f32 = 0.1, 1e-4..=0.1, "a joint must stop without new set-points";
        /// Inertia at the joint, rotor and gear included, kg m^2; 0 if unknown.
        inertia_kg_m2: f32 = 0.0, 0.0..=1e4, "an inertia";
        /// Proportional gain of the velocity loop, A s/rad.
        velocity_gain_a_s_per_rad: f32 = 3.0, 1e-3..=1e4, "a loop acts against its error";
        /// Integral time of the velocity loop, s.
        velocity_integral_s: f32 = 0.1, 1e-2..=1e3, "the loop has a delay of a millisecond";
        /// Maximum acceleration of the velocity loop's reference, rad/s^2.
        acceleration_max_rad_s2: f32 = 50.0, 1e-2..=1e5, "the joint must move";
        /// Reaction when the bridge stops while the motor turns: 0 coasts, 1 shorts the low sides.
        brake_at_stop: f32 = 0.0, 0.0..=1.0, "0 or 1";
        /// Time in each period in which a phase has the bus voltage against its current, s; 0 compensates nothing.
        dead_time_s: f32 = 0.0, 0.0..=2.5e-6, "at most a twentieth of the period, and so of the bus voltage";
        /// Phase current at which half of this voltage is lost, A.
        dead_time_current_a: f32 = 0.2, 0.02..=100.0, "a step at 0 A would chatter";
    }
    /// Defaults: a 48 V motor with seven pole pairs and a gear ratio of 51, 1 Nm/A at the joint.
}

/// Range of the period, s.
const PERIOD_RANGE_S: (f32, f32) = (2e-6, 2e-3);

/// Maximum dead time, as a share of the period.
pub const DEAD_TIME_SHARE_MAX: f32 = 0.05;

/// Maximum electrical angle per period, rad. Beyond it, a voltage vector that is held for a period points too
/// far from its intended direction.
const TURN_MAX_RAD: f32 = 0.6;

/// Maximum error of an encoder angle, rad of the motor.
pub const ENCODER_ERROR_RAD: f32 = 0.02;

/// Ratio of the overcurrent to the current limit, minimum: the current overshoots, and sensors are noisy.
pub const OVERCURRENT_MARGIN: f32 = 1.1;

/// Largest current of a motor that is shorted while it turns, per steady one: the current before it adds to it.
const SHORT_OVERSHOOT: f32 = 1.6;

/// Settling time after a start, in time constants of the triple pole: 1 % is left.
const SETTLE_TIME_CONSTANTS: f32 = 12.0;

impl MotorParameters {
    /// Checks every field, and the fields that bound each other.
    ///
    /// # Errors
    /// Names the first field refused, its value, the bound it broke and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::TEXTS, &self.to_array(), &Self::RANGES)?;
        if self.pole_pairs != self.pole_pairs as u32 as f32 {
            refuse(
                text!("pole_pairs"),
                self.pole_pairs,
                Bound::Whole,
                text!("poles come in pairs"),
            )?;
        }
        for (field, sign) in [
            (text!("joint_direction"), self.joint_direction),
            (text!("encoder_direction"), self.encoder_direction),
        ] {
            check_either(field, sign, [-1.0, 1.0], text!("1 or -1"))?;
        }
        self.validate_brake()?;
        let least = self.current_limit_a * OVERCURRENT_MARGIN;
        if self.overcurrent_a < least {
            let why = text!("a tenth above the current limit, or the bridge opens in normal use");
            refuse(text!("overcurrent_a"), self.overcurrent_a, Bound::AtLeast(least), why)?;
        }
        if self.bus_voltage_max_v <= self.bus_voltage_min_v {
            let bound = Bound::MoreThan(self.bus_voltage_min_v);
            refuse(
                text!("bus_voltage_max_v"),
                self.bus_voltage_max_v,
                bound,
                text!("a range has a width"),
            )?;
        }
        Ok(())
    }

    /// Checks the reaction to a stop: the current of the shorted motor at its largest speed, with its overshoot, is
    /// below the overcurrent level, or the brake would be opened.
    fn validate_brake(&self) -> Result<(), ParameterError> {
        let (field, value) = (text!("brake_at_stop"), self.brake_at_stop);
        check_either(field, value, [0.0, 1.0], text!("0 or 1"))?;
        if value == 1.0 && !self.is_short_bounded() {
            let why = text!("the shorted motor would exceed overcurrent_a at velocity_max_rad_s");
            refuse(field, value, Bound::AtMost(0.0), why)?;
        }
        Ok(())
    }

    /// Returns true if the current of the shorted motor at its largest speed, with its overshoot, is below the overcurrent
    /// level.
    pub fn is_short_bounded(&self) -> bool {
        let electrical_rad_s = self.velocity_max_rad_s * self.gear_ratio * self.pole_pairs;
        let emf_v = electrical_rad_s * self.torque_constant_nm_per_a / (1.5 * self.pole_pairs);
        let reactance_ohm = electrical_rad_s * self.inductance_d_h.min(self.inductance_q_h);
        let squares = self.resistance_ohm * self.resistance_ohm + reactance_ohm * reactance_ohm;
        let most_a = self.overcurrent_a / SHORT_OVERSHOOT;
        emf_v * emf_v <= squares * most_a * most_a
    }

    /// Checks that motor, gear and compensator agree: the joint's torque constant is the motor's times the gear
    /// ratio, less the gear losses (at most 80 %), with a tolerance of 10 %.
    ///
    /// # Errors
    /// Names the compensator's torque constant and the bound it broke.
    pub fn validate_with(&self, joint: &CompensatorParameters) -> Result<(), ParameterError> {
        let (field, value) = (text!("torque_constant_nm_per_a"), joint.torque_constant_nm_per_a);
        let lossless = self.torque_constant_nm_per_a * self.gear_ratio;
        let why =
            text!("the joint's is the motor's times the gear ratio times the gear's efficiency");
        if value.is_nan() || value < 0.2 * lossless {
            refuse(field, value, Bound::AtLeast(0.2 * lossless), why)
        } else if value > 1.1 * lossless {
            refuse(field, value, Bound::AtMost(1.1 * lossless), why)
        } else {
            Ok(())
        }
    }

    /// Returns the highest bandwidth of the current controllers that this motor permits, Hz, for a period in s.
    pub fn current_bandwidth_max_hz(&self, period_s: f32) -> f32 {
        let inductances = [self.inductance_d_h, self.inductance_q_h];
        bandwidth_share(self.resistance_ohm, inductances, self.bus_voltage_min_v, period_s)
            / period_s
    }

    /// Checks the bandwidths against the period, the winding and the noise of the current sensors.
    fn check_bandwidths(&self, period_s: f32) -> Result<(), ParameterError> {
        let (observer, current) =
            (BANDWIDTH_SHARE_ANY / period_s, self.current_bandwidth_max_hz(period_s));
        if self.observer_bandwidth_hz > observer * 1.000_001 {
            let why = text!("a twentieth of the loop rate");
            let field = text!("observer_bandwidth_hz");
            refuse(field, self.observer_bandwidth_hz, Bound::AtMost(observer), why)?;
        }
        if self.current_bandwidth_hz > current * 1.000_001 {
            let why = if current < BANDWIDTH_SHARE_MAX / period_s * 0.999_999 {
                text!("a fast winding, or noise of the sensors times the gain, permits no more")
            } else {
                text!("a tenth of the loop rate: an inductance 30 % lower would leave no margin")
            };
            refuse(
                text!("current_bandwidth_hz"),
                self.current_bandwidth_hz,
                Bound::AtMost(current),
                why,
            )?;
        }
        Ok(())
    }

    /// Checks the period, and the dead time, bandwidths and speed that depend on it.
    fn check_timing(&self, period_s: f32) -> Result<(), ParameterError> {
        let (shortest, longest) = PERIOD_RANGE_S;
        let why = text!("range of a current loop's period");
        if !period_s.is_finite() || period_s < shortest {
            refuse(text!("period_s"), period_s, Bound::AtLeast(shortest), why)?;
        } else if period_s > longest {
            refuse(text!("period_s"), period_s, Bound::AtMost(longest), why)?;
        }
        let most = DEAD_TIME_SHARE_MAX * period_s;
        if self.dead_time_s > most * 1.000_001 {
            let why = text!("at most a twentieth of the period, and so of the bus voltage");
            refuse(text!("dead_time_s"), self.dead_time_s, Bound::AtMost(most), why)?;
        }
        let least = self.dead_time_per_bus(period_s) / (0.5 * MAX_VECTOR_PER_BUS_V);
        if self.modulation_max < least {
            let why = text!("half of the vector must be left beside the dead time");
            refuse(text!("modulation_max"), self.modulation_max, Bound::AtLeast(least), why)?;
        }
        self.check_bandwidths(period_s)?;
        let most = TURN_MAX_RAD / (period_s * self.gear_ratio * self.pole_pairs);
        if self.velocity_max_rad_s > most {
            let why = text!("the magnet may turn 0.6 rad (electrical) in a period");
            refuse(text!("velocity_max_rad_s"), self.velocity_max_rad_s, Bound::AtMost(most), why)?;
        }
        Ok(())
    }

    /// Returns the longest vector that compensates the dead time, per bus voltage.
    fn dead_time_per_bus(&self, period_s: f32) -> f32 {
        LONGEST_VECTOR * self.dead_time_s / period_s
    }

    /// Validates the parameters and builds the loop's coefficients for a period in s.
    ///
    /// # Errors
    /// As [`MotorParameters::validate`]; also if the period is not within 2 us..2 ms, or if dead time, bandwidths
    /// or speed do not fit it.
    pub fn build(&self, period_s: f32) -> Result<Motor, ParameterError> {
        self.validate()?;
        self.check_timing(period_s)?;
        let motor_velocity_max = self.velocity_max_rad_s * self.gear_ratio;
        let flux_vs = self.torque_constant_nm_per_a / (1.5 * self.pole_pairs);
        let (r, bandwidth) = (self.resistance_ohm, self.current_bandwidth_hz);
        Ok(Motor {
            period_s,
            pole_pairs: self.pole_pairs as u32,
            pole_pairs_f32: self.pole_pairs,
            joint_per_motor: self.joint_direction / self.gear_ratio,
            joint_direction: self.joint_direction,
            is_direct_drive: self.gear_ratio == 1.0,
            d: Gains::with_pole_cancellation(r, self.inductance_d_h, bandwidth, period_s),
            q: Gains::with_pole_cancellation(r, self.inductance_q_h, bandwidth, period_s),
            resistance_ohm: r,
            half_per_burning_ohm: 0.5 / (BURNING_SHARE * r),
            inductance_d_h: self.inductance_d_h,
            inductance_q_h: self.inductance_q_h,
            flux_vs,
            observer: ObserverGains::new(self, motor_velocity_max, period_s),
            current_limit_a: self.current_limit_a.abs(),
            overcurrent_a: self.overcurrent_a,
            bus_min_v: self.bus_voltage_min_v,
            bus_max_v: self.bus_voltage_max_v,
            braking_start_v: BRAKING_DERATE_START * self.bus_voltage_max_v,
            braking_end_v: BRAKING_DERATE_END * self.bus_voltage_max_v,
            braking_per_v: 1.0
                / ((BRAKING_DERATE_END - BRAKING_DERATE_START) * self.bus_voltage_max_v),
            // What the dead time may take is added to the vector, so it is not available for the currents.
            radius_per_bus: MAX_VECTOR_PER_BUS_V * self.modulation_max
                - self.dead_time_per_bus(period_s),
            dead_time: LossModel {
                share: self.dead_time_s / period_s,
                current_a: self.dead_time_current_a,
            },
            reference_gain: reference_gain(bandwidth, period_s),
            encoder_offset: binary_angle(self.encoder_offset_rad),
            encoder_reversed: self.encoder_direction < 0.0,
            park_units: self.encoder_delay_s * UNITS_PER_RAD,
            drive_units: (self.encoder_delay_s + DRIVE_DELAY_PERIODS * period_s) * UNITS_PER_RAD,
            velocity_max_rad_s: self.velocity_max_rad_s,
            overspeed_rad_s: f32::INFINITY,
            setpoint_timeout_s: self.setpoint_timeout_s,
            inertia_kg_m2: self.inertia_kg_m2,
        })
    }
}

/// Shares of the maximum bus voltage between which braking is reduced to zero, because braking charges the bus.
const BRAKING_DERATE_START: f32 = 0.94;
const BRAKING_DERATE_END: f32 = 0.99;

/// Delay from the sample to the middle of the period in which the duties act, in periods.
const DRIVE_DELAY_PERIODS: f32 = 1.5;

/// Parameters of the motor built for a period; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    pub(super) period_s: f32,
    pub(super) pole_pairs: u32,
    pub(super) pole_pairs_f32: f32,
    /// Includes the sign of the direction.
    pub(super) joint_per_motor: f32,
    pub(super) joint_direction: f32,
    /// Direct drive: one motor turn is one joint turn.
    pub(super) is_direct_drive: bool,
    pub(super) d: Gains,
    pub(super) q: Gains,
    pub(super) resistance_ohm: f32,
    /// Half of one over the resistance that is assumed to burn braking power, 1/ohm.
    pub(super) half_per_burning_ohm: f32,
    pub(super) inductance_d_h: f32,
    pub(super) inductance_q_h: f32,
    /// Flux of the magnet through a phase, Vs.
    pub(super) flux_vs: f32,
    pub(super) observer: ObserverGains,
    pub(super) current_limit_a: f32,
    pub(super) overcurrent_a: f32,
    pub(super) bus_min_v: f32,
    pub(super) bus_max_v: f32,
    /// Bus voltages from which braking is reduced and at which it is zero, V, and the share of the braking regained per volt below
    /// it.
    pub(super) braking_start_v: f32,
    pub(super) braking_end_v: f32,
    pub(super) braking_per_v: f32,
    /// Length of the longest voltage vector in use, per bus voltage.
    pub(super) radius_per_bus: f32,
    /// Voltage that the dead time takes.
    pub(super) dead_time: LossModel,
    /// Share of the difference by which the reference of the q current moves per period.
    pub(super) reference_gain: f32,
    pub(super) encoder_offset: u32,
    pub(super) encoder_reversed: bool,
    /// Binary angle of the motor per rad/s, from the encoder sample to the current sample.
    pub(super) park_units: f32,
    /// Binary angle of the motor per rad/s, from the encoder sample to the middle of the period in which the
    /// duties act.
    pub(super) drive_units: f32,
    pub(super) velocity_max_rad_s: f32,
    /// Joint speed at which the bridge opens, rad/s.
    pub(super) overspeed_rad_s: f32,
    pub(super) setpoint_timeout_s: f32,
    pub(super) inertia_kg_m2: f32,
}

impl Motor {
    /// Returns the motor with a joint speed at which the bridge opens, rad/s; without it, there is none.
    #[must_use]
    pub const fn with_overspeed(self, overspeed_rad_s: f32) -> Self {
        Self { overspeed_rad_s, ..self }
    }

    /// Returns the period for which the loop was built, s.
    pub fn period_s(&self) -> f32 {
        self.period_s
    }

    /// Returns the rotor's mechanical angle from the electrical zero, for an encoder angle.
    #[inline(always)]
    pub fn rotor_angle(&self, encoder: u32) -> u32 {
        let angle = encoder.wrapping_sub(self.encoder_offset);
        if self.encoder_reversed { angle.wrapping_neg() } else { angle }
    }

    /// Returns true if an observer that ran with `other` stays valid: the angle has the same meaning.
    pub(super) fn has_same_shaft(&self, other: &Self) -> bool {
        self.encoder_offset == other.encoder_offset
            && self.encoder_reversed == other.encoder_reversed
            && self.joint_per_motor == other.joint_per_motor
    }
}

/// Coefficients of the observer, see [`super::observer`].
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
    /// Maximum binary angle per second of the motor, and the maximum encoder error.
    pub(super) units_per_s: f32,
    pub(super) jump_units: f32,
    /// Cycles until a start has settled.
    pub(super) settle_cycles: u32,
}

impl ObserverGains {
    fn new(written: &MotorParameters, motor_velocity_max: f32, period_s: f32) -> Self {
        let rate = TAU * written.observer_bandwidth_hz;
        // 1 - z, computed without cancellation.
        let y = one_minus_exp(rate * period_s);
        let z = 1.0 - y;
        let settle = SETTLE_TIME_CONSTANTS / (rate * period_s);
        Self {
            period_s,
            angle: y * (1.0 + z + z * z),
            velocity_per_s: 1.5 * y * y * (1.0 + z) / period_s,
            acceleration_per_s2: y * y * y / (period_s * period_s),
            // Half a period is added so that rounding does not remove the last cycle.
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
