//! The compensator's own parameters, written and built.

use super::limit;
use crate::number::Real;
use crate::parameters::{Bound, Envelope, ParameterError, check_ranges};

/// How the model is used in the current loop, as a person writes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensatorParameters {
    /// Share of the friction to cancel, 0..=1. Industry uses 0.7-0.9; above 1 joints oscillate.
    pub scale: f32,
    /// Largest compensation torque, Nm.
    pub torque_limit_nm: f32,
    /// Fastest change of the compensation torque, Nm/s.
    pub slew_limit_nm_per_s: f32,
    /// Joint torque per motor current, Nm/A, gear included.
    pub torque_constant_nm_per_a: f32,
    /// Largest current after the last addition, A.
    pub current_limit_a: f32,
    /// Below this speed the reference velocity takes over gradually, rad/s; 0 for never.
    pub blend_velocity_rad_s: f32,
    /// A reading is good for this long, s.
    pub hold_s: f32,
    /// After that it fades to neutral over this long, s.
    pub fade_s: f32,
}

impl Default for CompensatorParameters {
    /// For the joint of paper 0 (26 Nm; friction 2-3.5 Nm) with a 1 Nm/A drive.
    fn default() -> Self {
        Self {
            scale: 0.9,
            torque_limit_nm: 6.0,
            slew_limit_nm_per_s: 2000.0,
            torque_constant_nm_per_a: 1.0,
            current_limit_a: 26.0,
            blend_velocity_rad_s: 0.05,
            hold_s: 0.1,
            fade_s: 0.4,
        }
    }
}

impl CompensatorParameters {
    /// How many fields there are.
    pub const FIELDS: usize = 8;

    /// Names of the fields, in their order.
    pub const NAMES: [&'static str; Self::FIELDS] = [
        "scale",
        "torque_limit_nm",
        "slew_limit_nm_per_s",
        "torque_constant_nm_per_a",
        "current_limit_a",
        "blend_velocity_rad_s",
        "hold_s",
        "fade_s",
    ];

    /// The fields, in their order.
    pub const fn to_array(self) -> [f32; Self::FIELDS] {
        [
            self.scale,
            self.torque_limit_nm,
            self.slew_limit_nm_per_s,
            self.torque_constant_nm_per_a,
            self.current_limit_a,
            self.blend_velocity_rad_s,
            self.hold_s,
            self.fade_s,
        ]
    }

    /// The parameters with these fields, in their order.
    pub const fn from_array(fields: [f32; Self::FIELDS]) -> Self {
        let [scale, torque, slew, constant, current, blend, hold, fade] = fields;
        Self {
            scale,
            torque_limit_nm: torque,
            slew_limit_nm_per_s: slew,
            torque_constant_nm_per_a: constant,
            current_limit_a: current,
            blend_velocity_rad_s: blend,
            hold_s: hold,
            fade_s: fade,
        }
    }

    /// Smallest and largest legal value of each field, in their order, and why.
    const RANGES: [(f32, f32, &'static str); Self::FIELDS] = [
        (0.0, 1.0, "over-compensation makes the joint oscillate"),
        (0.0, 1000.0, "a torque limit is a size"),
        (1e-3, 1e9, "at no slew nothing would ever be compensated"),
        (1e-6, 1e6, "current is torque over this"),
        (0.0, 1000.0, "a current limit is a size"),
        (0.0, 1e3, "a speed"),
        (0.0, 1000.0, "a time"),
        (1e-4, 1000.0, "a reading fades, it does not jump"),
    ];

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field out of its range, its value, its bound and why.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::NAMES, &self.to_array(), &Self::RANGES)
    }
}

/// The same, built for a sample period, with what the guards need of the envelope.
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
    /// Age at which nothing is left, s.
    pub faded_s: T,
    /// No torque or current a driver can mean is larger.
    pub not_finite: T,
    pub velocity_limit: T,
    /// Half the largest side load: the middle of what is legal.
    pub radial_force_middle: T,
    pub pressure_max_mpa: T,
    #[cfg(feature = "terms")]
    pub position_max: T,
    #[cfg(feature = "terms")]
    pub acceleration_max: T,
    #[cfg(feature = "terms")]
    pub load_torque_max: T,
    #[cfg(feature = "terms")]
    pub campaign_max_h: T,
    #[cfg(feature = "terms")]
    pub temperature_reference: T,
}

impl<T: Real<Setting = f32>> Built<T> {
    pub(super) fn new(
        written: &CompensatorParameters,
        envelope: &Envelope,
        temperature_reference: f32,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let blend = written.blend_velocity_rad_s;
        let _ = temperature_reference;
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
            radial_force_middle: limit(0.5 * envelope.radial_force_max_n),
            pressure_max_mpa: limit(envelope.pressure_diff_max_pa * 1e-6),
            #[cfg(feature = "terms")]
            position_max: limit(envelope.position_max_rad),
            #[cfg(feature = "terms")]
            acceleration_max: limit(envelope.acceleration_max_rad_s2),
            #[cfg(feature = "terms")]
            load_torque_max: limit(envelope.load_torque_max_nm),
            #[cfg(feature = "terms")]
            campaign_max_h: limit(envelope.campaign_max_h),
            #[cfg(feature = "terms")]
            temperature_reference: T::from_f64(f64::from(temperature_reference)),
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
