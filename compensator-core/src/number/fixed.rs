//! A 32-bit fixed-point number for processors without an FPU.
//!
//! [`Fixed`] has 20 fractional bits: range -2048..2048, resolution 9.5e-7. In the units the step
//! uses (Nm, rad/s, N, MPa, h) that covers a joint of up to a few hundred Nm with torques resolved
//! to a micro-newton-metre.
//!
//! Sums saturate (one `qadd` instruction). Products do not check: a check after each would double
//! the cost of a step, and no product of the step *can* leave the range, because building a model
//! refuses parameters whose products over the declared envelope could
//! ([`crate::parameters::Parameters::build`]).
//! `exp`, `ln`, `sin`, `atan` and `pow` go through `f32` (soft float on such a part): only extension
//! terms use them.

use super::Real;
use crate::curve;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Signed fixed point, 12 integer bits (with the sign) and 20 fractional bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixed(i32);

const FRACTION: u32 = 20;
const SCALE: f64 = (1u32 << FRACTION) as f64;

impl Fixed {
    /// The number with these bits.
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// The bits, value times 2^20.
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
    /// Full precision, saturating; 0 divisor gives the largest magnitude. For building, not for
    /// the step: a 64-bit division is a library call on a Cortex-M.
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
        // `as` saturates and maps NaN to 0; the half rounds to nearest.
        let half = if value < 0.0 { -0.5 } else { 0.5 };
        Self((value * SCALE + half) as i32)
    }

    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self.0) / SCALE
    }

    fn represents(value: f64) -> bool {
        let held = Self::from_f64(value).value();
        (held - value).abs() <= 1e-3 * value.abs()
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.saturating_abs())
    }

    #[inline(always)]
    fn copy_sign(self, sign: Self) -> Self {
        // Branchless: xor and subtract the sign mask. `self` is a magnitude wherever the laws
        // use this; a negative one is made positive first.
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
    fn ratio(self, divisor: Self) -> Self {
        // 1/d from one 32-bit division: shift d up to 2^31..2^32, divide 2^32-1 by its upper 16
        // bits. The quotient holds 2^48/d_shifted in 16 to 17 bits.
        let unsigned = divisor.0 as u32 | 1;
        let shift = unsigned.leading_zeros();
        let reciprocal = u32::MAX / ((unsigned << shift) >> 16);
        // self * 2^20 / d = self * reciprocal * 2^(20 + shift - 48)
        let wide = i64::from(self.0) * i64::from(reciprocal as i32);
        Self((wide >> (28 - shift.min(28))) as i32)
    }

    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        let nearest = (self.0 + (1 << (FRACTION - 1))) >> FRACTION;
        let cell = &curve::Q30[nearest as usize % curve::CELLS];
        // The offset as a 32-bit fraction makes a product the upper half of a 64-bit one:
        // a single `smmul`.
        let offset = self.0.wrapping_sub(nearest << FRACTION) << (32 - FRACTION);
        let high = |a: i32, b: i32| ((i64::from(a) * i64::from(b)) >> 32) as i32;
        let q30 = cell[0] + high(offset, cell[1] + high(offset, cell[2]));
        Self(q30 >> (30 - FRACTION))
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
    fn pow(self, exponent: Self) -> Self {
        Self::from_f64(f64::from(Real::pow(self.value() as f32, exponent.value() as f32)))
    }
}

fn through_f32(number: Fixed, function: impl Fn(f32) -> f32) -> Fixed {
    Fixed::from_f64(f64::from(function(number.value() as f32)))
}
