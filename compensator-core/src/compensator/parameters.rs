//! The compensator's parameters, converted for a sample period.

use super::limit;
use crate::configuration::CompensatorParameters;
use crate::fits;
use crate::number::Real;
use crate::parameters::{Envelope, ParameterError};
use crate::text;

/// Minimum time in which the side load may cross its whole envelope, s: five frames at 1 kHz.
const MIN_CROSSING_TIME_S: f32 = 5e-3;

/// Largest plausible torque, Nm, or current, A: just below the range of the fixed point.
const LARGEST: f32 = 2000.0;
/// Smallest step of the slew limit, Nm: at least one unit of the fixed point.
const LEAST_STEP_NM: f32 = 1e-6;
/// Smallest blend velocity, rad/s: its reciprocal is finite.
const LEAST_BLEND_RAD_S: f32 = 1e-6;

/// The compensator's parameters for a sample period, and the limits that the guards take from the envelope.
#[derive(Clone, Copy, Debug)]
pub(super) struct BuiltParameters<T> {
    pub scale: T,
    pub torque_limit: T,
    pub slew_step: T,
    pub current_per_torque: T,
    pub current_limit: T,
    pub blend_velocity: T,
    pub blend_per_velocity: T,
    pub period_s: T,
    pub hold_s: T,
    pub fade_per_s: T,
    /// Age at which the weight reaches 0, s. The parameter ranges keep it above `hold_s` in every number type.
    pub faded_s: T,
    /// Bound for a plausible torque, Nm, or current, A. Larger values count as not finite.
    pub not_finite: T,
    pub velocity_limit: T,
    /// Half the largest side load, N: the middle of the valid range.
    pub radial_force_middle: T,
    /// Twice `radial_force_middle`, N. Every value from 0 to this limit is within `radial_force_middle` of the middle,
    /// whatever the rounding.
    pub radial_force_max: T,
    /// Largest change of the side load in a sample, N.
    pub radial_force_step: T,
    pub pressure_max_mpa: T,
}

impl<T: Real<Setting = f32>> BuiltParameters<T> {
    pub(super) fn new(
        parameters: &CompensatorParameters,
        envelope: &Envelope,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let blend = parameters.blend_velocity_rad_s;
        let radial_force_middle = limit::<T>(0.5 * envelope.radial_force_max_n);
        let built = Self {
            scale: limit(parameters.scale),
            torque_limit: limit(parameters.torque_limit_nm),
            slew_step: limit::<T>(
                (parameters.slew_limit_nm_per_s * period_s).clamp(LEAST_STEP_NM, LARGEST),
            ),
            current_per_torque: limit(1.0 / parameters.torque_constant_nm_per_a),
            current_limit: limit(parameters.current_limit_a),
            blend_velocity: limit(blend),
            blend_per_velocity: limit(1.0 / blend.max(LEAST_BLEND_RAD_S)),
            period_s: limit(period_s),
            hold_s: limit(parameters.hold_s),
            fade_per_s: limit(1.0 / parameters.fade_s),
            faded_s: limit(parameters.hold_s + parameters.fade_s),
            not_finite: limit(LARGEST),
            velocity_limit: limit(envelope.velocity_max_rad_s),
            radial_force_middle,
            radial_force_max: radial_force_middle + radial_force_middle,
            radial_force_step: limit(
                envelope.radial_force_max_n * (period_s / MIN_CROSSING_TIME_S).min(1.0),
            ),
            pressure_max_mpa: limit(envelope.pressure_diff_max_pa * 1e-6),
        };
        for (field, value) in [
            (text!("scale"), parameters.scale),
            (text!("torque_limit_nm"), parameters.torque_limit_nm),
            (text!("current_limit_a"), parameters.current_limit_a),
            (text!("1 / torque_constant_nm_per_a"), 1.0 / parameters.torque_constant_nm_per_a),
            (
                text!("torque_limit_nm / torque_constant_nm_per_a"),
                parameters.torque_limit_nm / parameters.torque_constant_nm_per_a,
            ),
            (text!("1 / fade_s"), 1.0 / parameters.fade_s),
        ] {
            fits::coefficient::<T>(field, value)?;
        }
        Ok(built)
    }
}
