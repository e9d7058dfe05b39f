//! Bounds of a law's quantities under the terms of a model, within an envelope.
//!
//! Validation needs the smallest level: it must be positive, because the step divides by it. A fixed-point model
//! needs the largest value of every quantity, so that no product overflows. Side load, pressure and transmitted
//! torque act linearly, so their extremes are at the corners of the envelope. Ripple, drift, direction and
//! similar terms are factors with their own ranges. Terms that are not in the model do not count.

use crate::envelope::Envelope;
use crate::quantity::TEMPERATURE_RANGE_C;

/// Minimum share of a level that must remain under each term that reduces it, so that the smallest level stays positive.
pub(crate) const LEAST_SHARE: f32 = 1e-3;

/// Least and largest temperature at which a law is used, deg C.
pub(crate) const TEMPERATURES_C: [f32; 2] =
    [TEMPERATURE_RANGE_C[0] as f32, TEMPERATURE_RANGE_C[1] as f32];

/// Returns the amplitude of a wave of this sine and cosine. Their ranges do not let the squares overflow, so this needs no
/// `hypotf`, which computes in double precision.
pub(crate) fn amplitude(sine: f32, cosine: f32) -> f32 {
    libm::sqrtf(sine * sine + cosine * cosine)
}

/// Increase of the levels by a linear effect, Nm, or Nm per unit of its input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Added {
    /// `F_C`.
    pub coulomb: f32,
    /// `F_S - F_C`.
    pub excess: f32,
}

impl Added {
    const NONE: Self = Self { coulomb: 0.0, excess: 0.0 };

    fn plus(self, other: Self, times: f32) -> Self {
        Self {
            coulomb: self.coulomb + other.coulomb * times,
            excess: self.excess + other.excess * times,
        }
    }
}

/// Number of corners: each of the three linear inputs is either 0 or at its maximum.
pub(crate) const CORNERS: usize = 8;

/// Bounds of the effects of a model's terms on the law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Increase of the levels per side load, Nm/N.
    pub per_newton: Added,
    /// Increase of the levels per pressure difference, Nm/Pa.
    pub per_pascal: Added,
    /// Increase of the levels per magnitude of the transmitted torque, Nm/Nm.
    pub per_load_torque: Added,
    /// Largest further increase of `F_S`, Nm. No term decreases `F_S` in this way.
    pub static_level: f32,
    /// Smallest factor of the level.
    pub least_level_factor: f32,
    /// Largest factor of the level.
    pub largest_level_factor: f32,
    /// Largest factor of the viscous coefficient.
    pub viscous_factor: f32,
    /// Largest magnitude of a torque outside the law, Nm.
    pub torque: f32,
    /// Bristle travel per change of the side load, rad/N.
    pub travel_per_newton: f32,
    /// True if speeds are scaled for the Stribeck curve before they are limited to its end.
    pub bends_stribeck_curve: bool,
}

impl Bounds {
    /// Bounds of a model without terms.
    pub const NONE: Self = Self {
        per_newton: Added::NONE,
        per_pascal: Added::NONE,
        per_load_torque: Added::NONE,
        static_level: 0.0,
        least_level_factor: 1.0,
        largest_level_factor: 1.0,
        viscous_factor: 1.0,
        torque: 0.0,
        travel_per_newton: 0.0,
        bends_stribeck_curve: false,
    };

    /// Includes a factor of the level, given its smallest and largest value. The validation of a term keeps both positive.
    pub fn scale_level(&mut self, least: f32, most: f32) {
        self.least_level_factor *= least;
        self.largest_level_factor *= most;
    }

    /// Includes a factor of the level in `1 - share..=1 + share`.
    pub fn scale_level_by_share(&mut self, share: f32) {
        self.scale_level(1.0 - share, 1.0 + share);
    }

    /// Returns the increase of the levels at each corner of an envelope, Nm.
    #[inline(never)]
    pub fn corners(&self, envelope: &Envelope) -> [Added; CORNERS] {
        core::array::from_fn(|corner| {
            let at = |bit: usize, size: f32| {
                if corner >> bit & 1 == 1 { size } else { 0.0 }
            };
            Added::NONE
                .plus(self.per_newton, at(0, envelope.radial_force_max_n))
                .plus(self.per_pascal, at(1, envelope.pressure_diff_max_pa))
                .plus(self.per_load_torque, at(2, envelope.load_torque_max_nm))
        })
    }
}
