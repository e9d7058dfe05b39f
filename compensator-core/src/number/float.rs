//! Implements [`Real`] for `f32` and `f64`.
//!
//! `f64` serves the host, where accuracy matters more than time. Its functions come from `libm`. `f32` serves
//! the current loop. Both use the Stribeck table of [`crate::curve`].
//!
//! The exponential, logarithm and arc tangent of `f32` also come from `libm`: the exponential of micromath is
//! slower and less accurate. The power of `f32` is computed from the two. The sine of `f32` comes from
//! micromath. Its error, about 1e-3 of the amplitude, is negligible, because ripple amplitudes are a few percent
//! of the friction.

use super::{Mask, Real};
use crate::curve;

macro_rules! common {
    ($type:ty, exp: $exp:path, ln: $ln:path, sin: $sin:path, atan: $atan:path) => {
        fn exp(self) -> Self {
            $exp(self)
        }
        fn ln(self) -> Self {
            $ln(self)
        }
        fn sin(self) -> Self {
            $sin(self)
        }
        fn atan(self) -> Self {
            $atan(self)
        }
        #[inline(always)]
        fn from_f64(value: f64) -> Self {
            value as $type
        }
        #[inline(always)]
        fn from_count(count: u8) -> Self {
            count.into()
        }
        #[inline(always)]
        fn value(self) -> f64 {
            f64::from(self)
        }
        fn represents(value: f32) -> bool {
            value.is_finite()
        }
        #[inline(always)]
        fn abs(self) -> Self {
            <$type>::abs(self)
        }
        #[inline(always)]
        fn copy_sign(self, sign: Self) -> Self {
            <$type>::copysign(self, sign)
        }
        #[inline(always)]
        fn sign(self) -> Self {
            if self > 0.0 {
                1.0
            } else if self < 0.0 {
                -1.0
            } else {
                0.0
            }
        }
        #[inline(always)]
        fn or_zero_if_nan(self) -> Self {
            if self.is_nan() { 0.0 } else { self }
        }
        #[inline(always)]
        fn ratio(self, divisor: Self) -> Self {
            self / divisor
        }
        #[inline(always)]
        fn up_to_curve_end(self, _: Self) -> Self {
            self
        }
    };
}

/// Mask of the bits of an `f32` without its sign.
///
/// These bits, read as an integer, have the order of the magnitudes, and every NaN is above infinity. Limits can
/// therefore be computed with integers, which avoids comparisons and FPU flag transfers on a Cortex-M4F.
const MAGNITUDE: u32 = 0x7FFF_FFFF;
/// Bits of infinity.
const INFINITE: u32 = f32::INFINITY.to_bits();

impl Real for f32 {
    type Setting = f32;

    common!(f32, exp: libm::expf, ln: libm::logf, sin: micromath::F32Ext::sin, atan: libm::atanf);

    #[inline(always)]
    fn lt_mask(self, other: Self) -> Mask {
        Mask::of_sign((self.to_bits() as i32).wrapping_sub(other.to_bits() as i32))
    }

    #[inline(always)]
    fn abs_gt_mask(self, bound: Self) -> Mask {
        bound.lt_mask(f32::from_bits(self.to_bits() & MAGNITUDE))
    }

    #[inline(always)]
    fn negative_or_nan_mask(self) -> Mask {
        Mask::of_sign(self.to_bits() as i32) | f32::INFINITY.lt_mask(self)
    }

    #[inline(always)]
    fn outside_mask(self, bound: Self) -> Mask {
        // The bits of a positive NaN are greater than those of every bound.
        Mask::of_sign(self.to_bits() as i32) | bound.lt_mask(self)
    }

    #[inline(always)]
    fn select(mask: Mask, if_set: Self, otherwise: Self) -> Self {
        let chosen = mask.bits();
        f32::from_bits(otherwise.to_bits() & !chosen | if_set.to_bits() & chosen)
    }

    #[inline(always)]
    fn cell_and_share(self, last: usize) -> (usize, Self) {
        // Avoids `f64`, which the processor must emulate.
        let cell = (self as usize).min(last);
        (cell, (self - cell as f32).at_most(1.0))
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        let bits = self.to_bits();
        f32::from_bits(bits & !((bits as i32 >> 31) as u32))
    }

    #[inline(always)]
    fn within_level(self, bound: Self) -> Self {
        // Subtract the excess of the magnitude bits over the bound; the sign is kept. This takes 4
        // instructions, where comparing and selecting floats takes 9.
        let bits = self.to_bits();
        let excess = ((bits & MAGNITUDE) as i32).wrapping_sub(bound.to_bits() as i32).max(0);
        f32::from_bits(bits.wrapping_sub(excess as u32))
    }

    #[inline(always)]
    fn limited_with_magnitude(self, bound: Self) -> (Self, Self) {
        let bits = self.to_bits();
        let magnitude = bits & MAGNITUDE;
        let excess = (magnitude as i32).wrapping_sub(bound.to_bits() as i32).max(0) as u32;
        // For NaN, the excess is the whole magnitude, so that the result is 0.
        let excess = if magnitude > INFINITE { magnitude } else { excess };
        let limited = |bits: u32| f32::from_bits(bits.wrapping_sub(excess));
        (limited(bits), limited(magnitude))
    }

    #[inline(always)]
    fn from_setting(setting: f32) -> Self {
        setting
    }

    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        // Adding 2^23 leaves the nearest integer in the low bits of the sum. This rounds exactly and
        // without branches; `as usize` compiles to comparisons and selects. Larger sums have larger
        // bits, so the clamp (one `usat`) limits the index for any speed.
        const ROUND: f32 = 8_388_608.0;
        let shifted = self + ROUND;
        let nearest = (shifted.to_bits() as i32).wrapping_sub(ROUND.to_bits() as i32);
        let cell = &curve::F32[nearest.clamp(0, curve::CELLS as i32 - 1) as usize];
        cell[0] + self * (cell[1] + self * cell[2])
    }

    #[inline(always)]
    fn is_neutral_exponent(self) -> bool {
        self == 1.0
    }
    fn pow(self, exponent: Self) -> Self {
        // Not `libm::powf`: it takes 1.4 KB of the memory that the current loop executes from. The error is that of the
        // logarithm times the exponent, below 1e-5 of the result over the Stribeck curve.
        libm::expf(exponent * libm::logf(self))
    }
}

impl Real for f64 {
    type Setting = f64;

    common!(f64, exp: libm::exp, ln: libm::log, sin: libm::sin, atan: libm::atan);

    #[inline(always)]
    fn from_setting(setting: f64) -> Self {
        setting
    }

    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        const ROUND: f64 = 4_503_599_627_370_496.0; // 2^52
        let shifted = self + ROUND;
        let nearest = (shifted.to_bits() as i64).wrapping_sub(ROUND.to_bits() as i64);
        let cell = &curve::F64[nearest.clamp(0, curve::CELLS as i64 - 1) as usize];
        let offset = self + (ROUND - shifted);
        cell[0] + offset * (cell[1] + offset * cell[2])
    }

    fn pow(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }
}
