//! Bounds of a law's quantities under the terms of a model, within an envelope.
//!
//! Validation needs the smallest level: it must be positive, because the step divides by it. A fixed-point model
//! needs the largest value of every quantity, so that no product overflows. Side load, pressure and transmitted
//! torque act linearly, so their extremes are at the corners of the envelope. Ripple, drift, direction and
//! similar terms are factors with their own ranges. Terms that are not in the model do not count.

use crate::envelope::Envelope;

/// Returns the length of `(a, b)` to 1e-14 of it, between 1e-19 and 1e19. A longer one is infinite, so that a bound is
/// refused; one below 1e-22 is 0. The function of `libm` would add 1 KB to the image of a driver.
pub(super) fn length(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        return a.abs() + b.abs();
    }
    let square = a * a + b * b;
    let near = f64::from(libm::sqrtf(square as f32));
    // One step of Newton.
    if near > 0.0 { 0.5 * (near + square / near) } else { near }
}

/// Returns `e^x` to 1e-13 of it, for `x` limited to -700..=700. The function of `libm` would add 1 KB to the image of a
/// driver.
pub(super) fn exponential(x: f64) -> f64 {
    use core::f64::consts::LN_2;
    let x = x.clamp(-700.0, 700.0);
    let doublings = (x / LN_2 + 0.5_f64.copysign(x)) as i32;
    let rest = x - f64::from(doublings) * LN_2;
    // The rest is at most `ln 2 / 2`: the first term left out is below 1e-17.
    let series = (1..=13).rev().fold(1.0, |sum, term| 1.0 + sum * rest / f64::from(term));
    // A power of two: the exponent of a double is stored plus 1023.
    series * f64::from_bits(((1023 + doublings) as u64) << 52)
}

/// Returns the logarithm of a number from 1 on, to 1e-14. The function of `libm` would add 700 bytes to the image of a
/// driver.
pub(super) fn logarithm(x: f64) -> f64 {
    let near = f64::from(libm::logf(x as f32));
    // One step of Newton.
    near + (x * exponential(-near) - 1.0)
}

/// Minimum share of a level that must remain under load, pressure or wear. It is large enough that rounding in
/// the number type of the step cannot make the level 0.
pub(crate) const LEAST_SHARE: f64 = 1e-3;

/// Increase of the levels by a linear effect, Nm, or Nm per unit of its input.
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
    pub static_level: f64,
    /// Smallest and largest factor of the level.
    pub level_factor: (f64, f64),
    /// Largest factor of the viscous coefficient.
    pub viscous_factor: f64,
    /// Largest magnitude of a torque outside the law, Nm.
    pub torque: f64,
    /// Bristle travel per change of the side load, rad/N.
    pub travel_per_newton: f64,
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
        level_factor: (1.0, 1.0),
        viscous_factor: 1.0,
        torque: 0.0,
        travel_per_newton: 0.0,
        bends_stribeck_curve: false,
    };

    /// Includes a factor of the level, given its smallest and largest value.
    pub fn scale_level(&mut self, least: f64, most: f64) {
        self.level_factor.0 *= least;
        self.level_factor.1 *= most;
    }

    /// Includes a factor of the level in `1 - share..=1 + share`.
    pub fn scale_level_by_share(&mut self, share: f64) {
        self.scale_level(1.0 - share, 1.0 + share);
    }

    /// Returns the increase of the levels at each corner of an envelope, Nm.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn length_logarithm_and_exponential_agree_with_libm() {
        let numbers = [1e-12, 3e-7, 0.1, 0.7, 0.99, 1.0, 2.5, 123.456, 7.7e8, 1e15];
        for a in numbers {
            assert_eq!((length(a, 0.0), length(0.0, -a)), (a, a));
            for b in numbers {
                let expected = libm::hypot(a, b);
                assert!((length(-a, b) - expected).abs() <= 1e-14 * expected, "{a} {b}");
            }
            for x in [a, -a] {
                let expected = libm::exp(x.clamp(-700.0, 700.0));
                assert!((exponential(x) - expected).abs() <= 1e-13 * expected, "{x}");
            }
            let expected = libm::log(1.0 + a);
            let difference = logarithm(1.0 + a) - expected;
            assert!(difference.abs() <= 1e-13 * expected.max(1.0), "{a}: {difference}");
        }
    }
}
