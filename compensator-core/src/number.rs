//! The number types of the friction laws.
//!
//! Every law is generic over [`Real`] and is compiled for four number types. `f32` serves microcontrollers with
//! an FPU, [`Fixed`] those without, and `f64` the host. A dual number, which the host crate defines, computes
//! the derivatives with respect to the parameters.
//!
//! Each method of the trait is an operation whose cost and exact bits matter in the current loop. Each type can
//! therefore implement it differently, with the same meaning. Implementations use a select instead of a branch
//! on data where possible. They do not call `mul_add` or the maths library of the platform. An `f32` step thus
//! gives the same bits on x86-64 and on a Cortex-M4F.

mod fixed;
mod float;
mod mask;

pub use fixed::Fixed;
pub use mask::Mask;

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A factor in 0..=1, returned by [`Real::stribeck_share`] and used by [`Real::plus_share`].
///
/// A float is stored unchanged. [`Fixed`] uses more fractional bits.
#[derive(Clone, Copy, Debug)]
pub struct Share<T>(T);

impl<T: Real> Share<T> {
    /// Creates a share from a value in 0..=1.
    #[inline(always)]
    pub fn of(value: T) -> Self {
        value.into_share()
    }
}

/// A number type with which a friction law can be computed.
///
/// # Contract
/// Arithmetic follows IEEE 754 for the floats and saturating two's complement for [`Fixed`].
/// Comparisons use the value only: a dual number is compared by its real part.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// Number type of the parameters from which a model is built.
    ///
    /// It is `f32` for the embedded types, so that a parameter record has the same meaning on host and
    /// target. For the host types it is the type itself.
    type Setting: Real<Setting = Self::Setting>;

    /// Converts a coefficient to the number type of the step.
    fn from_setting(setting: Self::Setting) -> Self;

    /// Converts a constant. The result is rounded, and saturated if it is out of range.
    fn from_f64(value: f64) -> Self;

    /// Converts a count. An `f32` does so without emulated arithmetic.
    #[inline(always)]
    fn from_count(count: u8) -> Self {
        Self::from_f64(f64::from(count))
    }

    /// Returns the value as `f64`; for a dual number, its real part.
    fn value(self) -> f64;

    /// Returns the value in single precision: in it, parameters are checked. A processor without double precision
    /// then needs no emulated arithmetic, and a PC finds what a driver finds.
    #[inline(always)]
    fn single(self) -> f32 {
        self.value() as f32
    }

    /// Returns true if the type can represent `value` with a relative error of at most 1e-3, or as exact 0.
    ///
    /// A float returns true if the converted value is finite. [`Fixed`] has a limited range and resolution.
    fn represents(value: f32) -> bool;

    /// Returns the magnitude.
    fn abs(self) -> Self;

    /// Returns the magnitude of `self` with the sign of `sign`.
    fn copy_sign(self, sign: Self) -> Self;

    /// Returns -1, 0 or 1. The result for +0 and -0 is 0, so that the Coulomb torque of a static law is 0 at rest.
    fn sign(self) -> Self;

    /// Returns `self`, or 0 if `self` is NaN.
    fn or_zero_if_nan(self) -> Self;

    /// Returns `self / divisor` for `divisor > 0`: the single division of a bristle step.
    ///
    /// Floats round correctly. [`Fixed`] uses one 32-bit division and keeps 16 significant bits. This is
    /// sufficient, because the step divides only to obtain the bristle rate: at rest and in steady sliding the
    /// numerator is 0, and so is the error.
    fn ratio(self, divisor: Self) -> Self;

    /// Returns `exp(-(x/16)^2)` for `0 <= x <= 63`, where `x` is `self`; see [`crate::curve`].
    ///
    /// `f32` and `f64` accept any finite `x >= 0` and return 0 beyond the end of the table.
    fn stribeck_curve(self) -> Self;

    /// Returns the Stribeck curve at the speed `self`. The speed `end` corresponds to 63 cells; from there on
    /// the result is 0.
    #[inline(always)]
    fn stribeck_share(self, cells_per_velocity: Self, end: Self) -> Share<Self> {
        Share((self.up_to_curve_end(end) * cells_per_velocity).stribeck_curve())
    }

    /// Converts a value in 0..=1 to a share.
    #[inline(always)]
    fn into_share(self) -> Share<Self> {
        Share(self)
    }

    /// Returns `self + part * share`. The caller guarantees that the sum is in range.
    #[inline(always)]
    fn plus_share(self, part: Self, share: Share<Self>) -> Self {
        self + part * share.0
    }

    /// Returns `self + a b`. The caller guarantees that the sum is in range; [`Fixed`] does not check it.
    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    /// Returns `self + a b + c d`.
    #[inline(always)]
    fn plus_products(self, a: Self, b: Self, c: Self, d: Self) -> Self {
        self + a * b + c * d
    }

    /// Returns `a b - c d`. The caller guarantees that the result is in range. [`Fixed`] rounds once, at the end.
    #[inline(always)]
    fn difference_of_products(a: Self, b: Self, c: Self, d: Self) -> Self {
        a * b - c * d
    }

    /// Limits a speed to `end`, where the Stribeck curve ends. A type whose table look-up saturates returns
    /// `self` unchanged, which is cheaper.
    #[inline(always)]
    fn up_to_curve_end(self, end: Self) -> Self {
        self.at_most(end)
    }

    /// Returns the exponential.
    fn exp(self) -> Self;
    /// Returns the natural logarithm of a positive argument.
    fn ln(self) -> Self;
    /// Returns the sine of an angle in rad.
    fn sin(self) -> Self;
    /// Returns the arc tangent in rad.
    fn atan(self) -> Self;
    /// Returns `self^exponent` for `self >= 0`; 0 if `self` is 0.
    fn pow(self, exponent: Self) -> Self;

    /// Returns true if the caller may omit [`Real::pow`] with this exponent.
    ///
    /// The default is false for types that compute the power with exponent 1 without loss. A dual number then
    /// keeps the derivative with respect to the exponent.
    #[inline(always)]
    fn is_neutral_exponent(self) -> bool {
        false
    }

    /// Returns 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }

    /// Returns 1.
    #[inline(always)]
    fn one() -> Self {
        Self::from_f64(1.0)
    }

    /// Returns the smaller of two numbers, or `other` if `self` is NaN.
    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// Returns the larger of two numbers, or `other` if `self` is NaN.
    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// Returns `self` limited to `-bound..=bound`, and the magnitude of the result. Both are 0 if `self` is NaN.
    /// The bound must be positive.
    #[inline(always)]
    fn limited_with_magnitude(self, bound: Self) -> (Self, Self) {
        let limited = self.or_zero_if_nan().within(bound);
        (limited, limited.abs())
    }

    /// Returns whether `self < other`. Both must be at least 0; NaN is greater than every number.
    #[inline(always)]
    fn lt_mask(self, other: Self) -> Mask {
        Mask::of(self < other)
    }

    /// Returns whether `|self| > bound` or `self` is NaN. The bound must be at least 0.
    #[inline(always)]
    fn abs_gt_mask(self, bound: Self) -> Mask {
        !Mask::of(self.abs() <= bound)
    }

    /// Returns whether `self` is negative or NaN. -0 may count as negative.
    #[inline(always)]
    fn negative_or_nan_mask(self) -> Mask {
        !Mask::of(self >= Self::zero())
    }

    /// Returns whether [`Real::within_level`] can change `self`. This includes `|self| > bound` and NaN.
    #[inline(always)]
    fn past_level_mask(self, bound: Self) -> Mask {
        self.abs_gt_mask(bound)
    }

    /// Returns whether `self` is negative, NaN or greater than `bound`. The bound must be at least 0 and not NaN.
    #[inline(always)]
    fn outside_mask(self, bound: Self) -> Mask {
        self.negative_or_nan_mask() | bound.lt_mask(self)
    }

    /// Returns `if_set` if the mask is set, else `otherwise`.
    #[inline(always)]
    fn select(mask: Mask, if_set: Self, otherwise: Self) -> Self {
        if mask.is_set() { if_set } else { otherwise }
    }

    /// Splits `self`, which must be at least 0, into its integer part and its fractional part.
    ///
    /// If the integer part is greater than `last`, the result is `last` and 1. The integer part of NaN is 0.
    #[inline(always)]
    fn cell_and_share(self, last: usize) -> (usize, Self) {
        let cell = (self.value() as usize).min(last);
        (cell, (self - Self::from_f64(cell as f64)).at_most(Self::one()))
    }

    /// Returns the larger of `self` and 0. `self` must not be NaN.
    #[inline(always)]
    fn positive_part(self) -> Self {
        self.at_least(Self::zero())
    }

    /// As [`Real::within`], for a validated bound, which is at least +0 and not NaN.
    ///
    /// The largest result of [`Fixed`] is one unit of its resolution below `bound`.
    #[inline(always)]
    fn within_level(self, bound: Self) -> Self {
        self.within(bound)
    }

    /// Returns `self` limited to `-bound..=bound`, for `bound >= 0`. The result for NaN has the magnitude `bound`.
    #[inline(always)]
    fn within(self, bound: Self) -> Self {
        if self.abs() <= bound { self } else { bound.copy_sign(self) }
    }
}
