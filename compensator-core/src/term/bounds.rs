//! How far terms can take a law's quantities within an envelope.
//!
//! Validation needs the *least* level (it must stay positive, or the step divides by nothing) and a model
//! in fixed point the *largest* of everything (or a product leaves the number's range). Side load, pressure
//! and transmitted torque act linearly, so that their extremes lie at the corners of the envelope; ripple,
//! drift, direction and the like are factors on top, each with a range of its own. A term that is not in
//! the model counts for nothing, whatever its values.

use crate::envelope::Envelope;

/// Least share of a level that load, pressure or wear may leave: a positive rest that the rounding of
/// the step's number cannot make 0.
pub(crate) const LEAST_SHARE: f64 = 1e-3;

/// What the levels gain from one unit of something that acts linearly on them, Nm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Added {
    /// `F_C`.
    pub coulomb: f64,
    /// `F_S - F_C`.
    pub excess: f64,
}

impl Added {
    const NONE: Self = Self { coulomb: 0.0, excess: 0.0 };

    fn plus(self, other: Self, times: f64) -> Self {
        Self {
            coulomb: self.coulomb + other.coulomb * times,
            excess: self.excess + other.excess * times,
        }
    }
}

/// Number of corners: each of the three that act linearly is absent or at its largest.
pub(crate) const CORNERS: usize = 8;

/// How far the terms of a model can take a law's quantities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// What the levels gain from a side load of 1 N.
    pub per_newton: Added,
    /// What they gain from a pressure difference of 1 Pa.
    pub per_pascal: Added,
    /// What they gain from a transmitted torque of 1 Nm, in either direction.
    pub per_load_torque: Added,
    /// The most that is added to `F_S` besides, Nm; `F_S` is never taken from.
    pub static_level: f64,
    /// Least and largest factor on the level.
    pub level_factor: (f64, f64),
    /// Largest factor on the viscous coefficient.
    pub viscous_factor: f64,
    /// Largest magnitude of a torque outside the law, Nm.
    pub torque: f64,
    /// Bristle travel for a change of the side load, rad/N.
    pub travel_per_newton: f64,
    /// Whether speeds are scaled for the Stribeck curve before they are limited to its end.
    pub bends_stribeck_curve: bool,
}

impl Bounds {
    /// Where there are no terms.
    pub const NONE: Self = Self {
        per_newton: Added::NONE,
        per_pascal: Added::NONE,
        per_load_torque: Added::NONE,
        static_level: 0.0,
        level_factor: (1.0, 1.0),
        viscous_factor: 1.0,
        torque: 0.0,
        travel_per_newton: 0.0,
        bends_stribeck_curve: false,
    };

    /// Counts in a factor on the level, of which the least and the largest are known.
    pub fn scale_level(&mut self, least: f64, most: f64) {
        self.level_factor.0 *= least;
        self.level_factor.1 *= most;
    }

    /// Counts in a factor on the level that lies up to `share` to either side of 1.
    pub fn scale_level_by_share(&mut self, share: f64) {
        self.scale_level(1.0 - share, 1.0 + share);
    }

    /// What is added to the levels at each corner of an envelope, Nm.
    #[inline(never)]
    pub fn corners(&self, envelope: &Envelope) -> [Added; CORNERS] {
        core::array::from_fn(|corner| {
            let at = |bit: usize, size: f32| {
                if corner >> bit & 1 == 1 { f64::from(size) } else { 0.0 }
            };
            Added::NONE
                .plus(self.per_newton, at(0, envelope.radial_force_max_n))
                .plus(self.per_pascal, at(1, envelope.pressure_diff_max_pa))
                .plus(self.per_load_torque, at(2, envelope.load_torque_max_nm))
        })
    }
}
