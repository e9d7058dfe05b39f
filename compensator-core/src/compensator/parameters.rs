//! The compensator's own parameters, built for a sample period.

use super::limit;
use crate::configuration::CompensatorParameters;
use crate::number::Real;
use crate::parameters::{Bound, Envelope, ParameterError};

/// Time in which the side load may go through the whole of its envelope, s: a few of its frames at 1 kHz.
const CROSSED_S: f32 = 5e-3;

/// The compensator's parameters, built for a sample period, with what the guards need of the envelope.
#[derive(Clone, Copy, Debug)]
pub(super) struct Built<T> {
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
    /// Age at which nothing is left, s. More than `hold_s` in every number: their ranges see to that.
    pub faded_s: T,
    /// No torque or current a driver can mean is larger.
    pub not_finite: T,
    pub velocity_limit: T,
    /// Half the largest side load: the middle of what is legal.
    pub radial_force_middle: T,
    /// Twice that. What lies between 0 and it is no farther from the middle than the middle is from 0, whatever is rounded.
    pub radial_force_max: T,
    /// How far the side load goes in a sample, N.
    pub radial_force_step: T,
    pub pressure_max_mpa: T,
}

impl<T: Real<Setting = f32>> Built<T> {
    pub(super) fn new(
        written: &CompensatorParameters,
        envelope: &Envelope,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let blend = written.blend_velocity_rad_s;
        let radial_force_middle = limit::<T>(0.5 * envelope.radial_force_max_n);
        let built = Self {
            scale: limit(written.scale),
            torque_limit: limit(written.torque_limit_nm),
            // A step too small for fixed point still moves: one unit of resolution per sample.
            slew_step: limit::<T>((written.slew_limit_nm_per_s * period_s).clamp(1e-6, 2000.0)),
            current_per_torque: limit(1.0 / written.torque_constant_nm_per_a),
            current_limit: limit(written.current_limit_a),
            blend_velocity: limit(blend),
            blend_per_velocity: limit(if blend > 0.0 { (1.0 / blend).min(1e6) } else { 1e6 }),
            period_s: limit(period_s),
            hold_s: limit(written.hold_s),
            fade_per_s: limit(1.0 / written.fade_s),
            faded_s: limit(written.hold_s + written.fade_s),
            not_finite: limit(2000.0),
            velocity_limit: limit(envelope.velocity_max_rad_s),
            radial_force_middle,
            radial_force_max: radial_force_middle + radial_force_middle,
            radial_force_step: limit(envelope.radial_force_max_n * (period_s / CROSSED_S).min(1.0)),
            pressure_max_mpa: limit(envelope.pressure_diff_max_pa * 1e-6),
        };
        for (field, value) in [
            ("scale", written.scale),
            ("torque_limit_nm", written.torque_limit_nm),
            ("current_limit_a", written.current_limit_a),
            ("1 / torque_constant_nm_per_a", 1.0 / written.torque_constant_nm_per_a),
            (
                "torque_limit_nm / torque_constant_nm_per_a",
                written.torque_limit_nm / written.torque_constant_nm_per_a,
            ),
            ("1 / fade_s", 1.0 / written.fade_s),
        ] {
            if !T::represents(value.into()) {
                let why = "the number type cannot hold this coefficient to 1e-3 of its value";
                return Err(ParameterError {
                    field,
                    value: value.into(),
                    bound: Bound::Finite,
                    why,
                });
            }
        }
        Ok(built)
    }
}
