//! A 32-bit fixed-point number for processors without an FPU.
//!
//! [`Fixed`] has 20 fractional bits: its range is -2048..2048 and its resolution is 9.5e-7. In the units of the
//! step (Nm, rad/s, N, MPa, h), this is sufficient for a joint of up to a few hundred Nm.
//!
//! Sums saturate (one `qadd` instruction). Products and [`Real::plus_product`] do not check for overflow,
//! because a check would double the cost of a step. No product of a step can overflow:
//! [`crate::parameters::Parameters::build`] returns an error if one could within the declared envelope.
//! `tests/emulator/core-cost.tsv` bounds the instructions on a Cortex-M4.
//!
//! `exp`, `ln`, `sin`, `atan` and `pow` convert to `f32`, which is emulated on these processors. Only the
//! extension terms and the atan law use them.

use super::{Mask, Real, Share};
use crate::curve;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Signed fixed-point number with 12 integer bits (with the sign) and 20 fractional bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixed(i32);

/// Fractional bits of a [`Fixed`].
const FRACTION: u32 = 20;
/// Fractional bits of a [`Share`], equal to those of the curve's table.
const SHARE_FRACTION: u32 = 31;
/// Value of 1 in units of the resolution.
const SCALE: f64 = (1u32 << FRACTION) as f64;

impl Fixed {
    /// Creates a number from its bits.
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// Returns the bits: the value times 2^20.
    pub const fn to_bits(self) -> i32 {
        self.0
    }
}

impl Add for Fixed {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Fixed {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Neg for Fixed {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(0i32.saturating_sub(self.0))
    }
}

impl Mul for Fixed {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(((i64::from(self.0) * i64::from(other.0)) >> FRACTION) as i32)
    }
}

impl Div for Fixed {
    type Output = Self;
    /// Divides with full precision and saturates. The divisor 0 gives the largest magnitude.
    ///
    /// The 64-bit division is a library call on a Cortex-M. The plain step uses [`Real::ratio`] instead.
    fn div(self, divisor: Self) -> Self {
        if divisor.0 == 0 {
            return Self(i32::MAX).copy_sign(self);
        }
        let wide = (i64::from(self.0) << FRACTION) / i64::from(divisor.0);
        Self(wide.clamp(-i64::from(i32::MAX), i64::from(i32::MAX)) as i32)
    }
}

impl Real for Fixed {
    type Setting = f32;

    #[inline(always)]
    fn from_setting(setting: f32) -> Self {
        Self::from_f64(f64::from(setting))
    }

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        // `as` saturates and converts NaN to 0. Adding the half rounds to nearest.
        let half = if value < 0.0 { -0.5 } else { 0.5 };
        Self((value * SCALE + half) as i32)
    }

    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self.0) / SCALE
    }

    fn represents(value: f32) -> bool {
        let value = f64::from(value);
        let held = Self::from_f64(value).value();
        // The range needs its own test: a saturated value is close to a value just out of range.
        let in_range = value.abs() * SCALE <= f64::from(i32::MAX);
        in_range && (held - value).abs() <= 1e-3 * value.abs()
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.saturating_abs())
    }

    #[inline(always)]
    fn copy_sign(self, sign: Self) -> Self {
        // Without a branch: xor and subtract the sign mask. A negative `self` is made positive first.
        let mask = sign.0 >> 31;
        Self((self.0.saturating_abs() ^ mask) - mask)
    }

    #[inline(always)]
    fn sign(self) -> Self {
        Self(self.0.signum() << FRACTION)
    }

    #[inline(always)]
    fn or_zero_if_nan(self) -> Self {
        self
    }

    #[inline(always)]
    fn within(self, bound: Self) -> Self {
        Self(self.0.min(bound.0).max(bound.0.wrapping_neg()))
    }

    #[inline(always)]
    fn lt_mask(self, other: Self) -> Mask {
        Mask::of_sign(self.0.wrapping_sub(other.0))
    }

    #[inline(always)]
    fn abs_gt_mask(self, bound: Self) -> Mask {
        Mask::of_sign(bound.0.wrapping_sub(self.0.saturating_abs()))
    }

    #[inline(always)]
    fn negative_or_nan_mask(self) -> Mask {
        Mask::of_sign(self.0)
    }

    #[inline(always)]
    fn select(mask: Mask, if_set: Self, otherwise: Self) -> Self {
        let chosen = mask.bits() as i32;
        Self(otherwise.0 & !chosen | if_set.0 & chosen)
    }

    #[inline(always)]
    fn cell_and_share(self, last: usize) -> (usize, Self) {
        let cell = ((self.0 >> FRACTION) as usize).min(last);
        (cell, Self((self.0 - ((cell as i32) << FRACTION)).min(1 << FRACTION)))
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        Self(self.0.max(0))
    }

    #[inline(always)]
    fn within_level(self, bound: Self) -> Self {
        // Two saturating additions limit the value: 5 instructions, where comparisons need 7. The
        // result is in -bound..=bound - 1, in units of the resolution.
        let to_end = bound.0.wrapping_add(i32::MIN);
        let from_above = self.0.saturating_sub(to_end).wrapping_add(to_end);
        Self(from_above.saturating_add(to_end).wrapping_sub(to_end))
    }

    #[inline(always)]
    fn past_level_mask(self, bound: Self) -> Mask {
        // `within_level` also reduces +bound, by one unit.
        !self.abs().lt_mask(bound)
    }

    #[inline(always)]
    fn limited_with_magnitude(self, bound: Self) -> (Self, Self) {
        let negative = self.0 >> 31;
        let magnitude = self.0.unsigned_abs().min(bound.0 as u32) as i32;
        // Restore the sign: negate if negative (complement and add 1).
        (Self((magnitude ^ negative) - negative), Self(magnitude))
    }

    #[inline(always)]
    fn ratio(self, divisor: Self) -> Self {
        // One 32-bit division computes 1/d: shift d to 2^31..2^32, and divide 2^32-1 by its upper 16
        // bits. The quotient is 2^48/d_shifted in 16 to 17 bits. Setting a bit in d (1.5e-5) keeps the
        // shift below 28, and can only reduce the ratio. The shift sets the top bit. Setting it again
        // with `0x8000` shows the compiler that the divisor is not 0.
        let unsigned = divisor.0 as u32 | 16;
        let shift = unsigned.leading_zeros();
        let reciprocal = u32::MAX / ((unsigned << shift) >> 16 | 0x8000);
        // self * 2^20 / d = self * reciprocal * 2^(20 + shift - 48)
        //                 = self * 8 reciprocal / 2^(31 - shift)
        let wide = i64::from(self.0) * i64::from((reciprocal << 3) as i32);
        let (low, high) = (wide as u32, (wide >> 32) as u32);
        Self(((low >> (shift ^ 31)) | (high << 1 << shift)) as i32)
    }

    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        Self(curve_q31(i64::from(self.0) << (32 - FRACTION)) >> (SHARE_FRACTION - FRACTION))
    }

    #[inline(always)]
    fn into_share(self) -> Share<Self> {
        // 1 does not fit into 31 fractional bits, so it is reduced by one unit.
        Share(Self(self.0.min((1 << FRACTION) - 1) << (SHARE_FRACTION - FRACTION)))
    }

    #[inline(always)]
    fn stribeck_share(self, cells_per_velocity: Self, _: Self) -> Share<Self> {
        // 20 and 12 fractional bits give 32: the integer and the fractional part are one word each.
        // The 64-bit product can represent any speed, so `end` is not needed.
        Share(Self(curve_q31(i64::from(self.0) * i64::from(cells_per_velocity.0 >> 8))))
    }

    #[inline(always)]
    fn plus_share(self, part: Self, share: Share<Self>) -> Self {
        // Rounding costs no more than truncation: one instruction, `smmulr`.
        let product = i64::from(part.0) * i64::from(share.0.0);
        let upper_half = ((product + (1 << 31)) >> 32) as i32;
        Self(self.0.wrapping_add(upper_half << (32 - SHARE_FRACTION)))
    }

    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        // The two halves of the shifted product have no common bits. Adding each of them to the sum
        // is cheaper than combining them first.
        let wide = i64::from(a.0) * i64::from(b.0);
        let (low, high) = (wide as u32, (wide >> 32) as u32);
        let sum = (self.0 as u32).wrapping_add(low >> FRACTION);
        Self(sum.wrapping_add(high << (32 - FRACTION)) as i32)
    }

    #[inline(always)]
    fn plus_products(self, a: Self, b: Self, c: Self, d: Self) -> Self {
        // Each product is in range, and so is half of their sum. `qdadd` doubles and adds with saturation.
        let wide = i64::from(a.0) * i64::from(b.0) + i64::from(c.0) * i64::from(d.0);
        let half = (wide >> (FRACTION + 1)) as i32;
        Self(self.0.saturating_add(half.saturating_add(half)))
    }

    #[inline(always)]
    fn difference_of_products(a: Self, b: Self, c: Self, d: Self) -> Self {
        // The difference is written as a sum, because the processor has a 64-bit multiply-add
        // instruction, but no multiply-subtract.
        let wide = i64::from(a.0) * i64::from(b.0) + i64::from(c.0.wrapping_neg()) * i64::from(d.0);
        Self((wide >> FRACTION) as i32)
    }

    fn exp(self) -> Self {
        through_f32(self, <f32 as Real>::exp)
    }
    fn ln(self) -> Self {
        through_f32(self, <f32 as Real>::ln)
    }
    fn sin(self) -> Self {
        through_f32(self, <f32 as Real>::sin)
    }
    fn atan(self) -> Self {
        through_f32(self, <f32 as Real>::atan)
    }
    #[inline(always)]
    fn is_neutral_exponent(self) -> bool {
        self.0 == 1 << FRACTION
    }
    fn pow(self, exponent: Self) -> Self {
        Self::from_f64(f64::from(Real::pow(self.value() as f32, exponent.value() as f32)))
    }
}

/// Returns the Stribeck curve with 31 fractional bits. `cells` has 32 fractional bits.
#[inline(always)]
fn curve_q31(cells: i64) -> i32 {
    let (whole, fraction) = ((cells >> 32) as i32, cells as u32);
    // The offset from the nearest cell is the fraction, read as a signed number.
    let nearest = whole + (fraction >> 31) as i32;
    let offset = fraction as i32;
    let [curvature, slope, value, _] =
        curve::Q31[nearest.clamp(0, curve::CELLS as i32 - 1) as usize];
    // The offset is a 32-bit fraction, so each product is the upper half of a 64-bit product. A
    // Cortex-M4 multiplies and adds it in one instruction, `smmla`.
    value + upper_half(offset, slope + upper_half(offset, curvature))
}

/// Returns the upper half of the 64-bit product.
#[inline(always)]
fn upper_half(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b)) >> 32) as i32
}

/// Evaluates a function in `f32`.
fn through_f32(number: Fixed, function: impl Fn(f32) -> f32) -> Fixed {
    Fixed::from_f64(f64::from(function(number.value() as f32)))
}
