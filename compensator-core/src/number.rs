//! The number a friction law is computed with.
//!
//! Every law in this crate is written once, over [`Real`], and compiled for four kinds of number:
//! `f32` on a microcontroller with an FPU, [`Fixed`] on one without, `f64` on the host, and a dual
//! number on the host when the derivative by each parameter is wanted (the host brings that one).
//!
//! The trait is small on purpose: each method is an operation whose *cost and bits* matter in the
//! current loop, so each type may do it its own way but all must mean the same. Nothing here
//! branches on data where a select will do, and nothing calls `mul_add` or the platform's maths
//! library: the same `f32` step gives the same bits on x86-64 and on a Cortex-M4F.

mod fixed;
mod float;
mod mask;

pub use fixed::Fixed;
pub use mask::Mask;

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number 0..=1 a quantity is scaled by, as [`Real::stribeck_share`] gives and
/// [`Real::plus_share`] takes it. A float as it is; [`Fixed`] gives it more fractional bits.
#[derive(Clone, Copy, Debug)]
pub struct Share<T>(T);

impl<T: Real> Share<T> {
    /// The share a curve's value is.
    #[inline(always)]
    pub fn of(value: T) -> Self {
        value.into_share()
    }
}

/// A number a friction law can be computed with.
///
/// # Contract
/// Arithmetic follows IEEE 754 for the floats and saturating two's complement for [`Fixed`].
/// Comparisons see the value only (a dual number compares by its real part).
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
    /// What parameters are held in before a model is built: `f32` for the embedded types, so that
    /// a parameter record means the same on host and target; the type itself on the host.
    type Setting: Real<Setting = Self::Setting>;

    /// Takes a built coefficient over into the type of the step.
    fn from_setting(setting: Self::Setting) -> Self;

    /// A constant; rounded to the type, saturated where it does not fit.
    fn from_f64(value: f64) -> Self;

    /// The value as `f64`; of a dual number, its real part.
    fn value(self) -> f64;

    /// Whether the type can hold `value` with a relative resolution better than 1e-3 (or as an
    /// exact zero). Always true for a finite value and a float; [`Fixed`] has a range.
    fn represents(value: f64) -> bool;

    /// Magnitude.
    fn abs(self) -> Self;

    /// `self` with the sign of `sign`.
    fn copy_sign(self, sign: Self) -> Self;

    /// `-1`, `0` or `1`; 0 at 0 of either sign, so that a static law is silent at rest.
    fn sign(self) -> Self;

    /// `self` where it is a number, 0 where it is NaN.
    fn or_zero_if_nan(self) -> Self;

    /// `self / divisor` for `divisor > 0`; the one division of a bristle step.
    ///
    /// Exact to rounding for floats. [`Fixed`] uses one 32-bit division and keeps 16 significant
    /// bits, which the step needs only on a *rate*: the error vanishes at rest and in steady
    /// sliding, where the numerator does.
    fn ratio(self, divisor: Self) -> Self;

    /// `exp(-(x/16)^2)` for `0 <= x <= 63`, see [`crate::curve`]. `f32` and `f64` take any finite
    /// `x >= 0` and give 0 beyond the end.
    fn stribeck_curve(self) -> Self;

    /// The curve at a speed, `self`, that lies `self * cells_per_velocity` along its axis: 0 from
    /// `end`, the speed of 63 cells, on.
    #[inline(always)]
    fn stribeck_share(self, cells_per_velocity: Self, end: Self) -> Share<Self> {
        Share((self.up_to_curve_end(end) * cells_per_velocity).stribeck_curve())
    }

    /// A value 0..=1 as a share.
    #[inline(always)]
    fn into_share(self) -> Share<Self> {
        Share(self)
    }

    /// `self` and a share of `part` besides. The sum is known to be in range.
    #[inline(always)]
    fn plus_share(self, part: Self, share: Share<Self>) -> Self {
        self + part * share.0
    }

    /// `self + a b`, where the sum is known to be in range: [`Fixed`] does not check it.
    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    /// `self + a b + c d`.
    #[inline(always)]
    fn plus_products(self, a: Self, b: Self, c: Self, d: Self) -> Self {
        self + a * b + c * d
    }

    /// `a b - c d`, where the result is known to be in range; [`Fixed`] rounds once, at the end.
    #[inline(always)]
    fn difference_of_products(a: Self, b: Self, c: Self, d: Self) -> Self {
        a * b - c * d
    }

    /// A speed made fit for the curve, which has fallen to 0 at `end`: at most `end`, or just
    /// itself where the look-up saturates by itself, which is cheaper.
    #[inline(always)]
    fn up_to_curve_end(self, end: Self) -> Self {
        self.at_most(end)
    }

    /// Exponential.
    fn exp(self) -> Self;
    /// Natural logarithm; for a positive argument.
    fn ln(self) -> Self;
    /// Sine of an angle in rad.
    fn sin(self) -> Self;
    /// Arc tangent in rad.
    fn atan(self) -> Self;
    /// `self^exponent` for `self >= 0`; 0 at 0.
    fn pow(self, exponent: Self) -> Self;

    /// Whether [`Real::pow`] with this exponent may be left out. Always false for numbers to which
    /// an exponent of 1 costs no digit, so that one with derivatives keeps that by the exponent.
    #[inline(always)]
    fn is_neutral_exponent(self) -> bool {
        false
    }

    /// The number 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }

    /// The number 1.
    #[inline(always)]
    fn one() -> Self {
        Self::from_f64(1.0)
    }

    /// The smaller of two numbers; `other` where `self` is NaN.
    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// The larger of two numbers; `other` where `self` is NaN.
    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// `self` limited to `-bound..=bound`, and the magnitude of that; both 0 where `self` is NaN.
    /// The bound is a positive number.
    #[inline(always)]
    fn limited_with_magnitude(self, bound: Self) -> (Self, Self) {
        let limited = self.or_zero_if_nan().within(bound);
        (limited, limited.abs())
    }

    /// Whether `self < other`, both at least 0. A NaN lies above every number.
    #[inline(always)]
    fn lt_mask(self, other: Self) -> Mask {
        Mask::of(self < other)
    }

    /// Whether `|self| > bound`, for `bound >= 0`, or `self` is NaN.
    #[inline(always)]
    fn abs_gt_mask(self, bound: Self) -> Mask {
        !Mask::of(self.abs() <= bound)
    }

    /// Whether `self` is less than 0, -0 or NaN.
    #[inline(always)]
    fn negative_or_nan_mask(self) -> Mask {
        !Mask::of(self >= Self::zero())
    }

    /// Whether [`Real::within_level`] may change `self`: where `|self| > bound` or `self` is NaN, and wherever else it does.
    #[inline(always)]
    fn past_level_mask(self, bound: Self) -> Mask {
        self.abs_gt_mask(bound)
    }

    /// Whether `self` is negative, -0, NaN, or more than `bound`, which is a number and at least 0.
    #[inline(always)]
    fn outside_mask(self, bound: Self) -> Mask {
        self.negative_or_nan_mask() | bound.lt_mask(self)
    }

    /// `if_set` where the mask is set, else `otherwise`.
    #[inline(always)]
    fn select(mask: Mask, if_set: Self, otherwise: Self) -> Self {
        if mask.is_set() { if_set } else { otherwise }
    }

    /// The whole part of `self`, which is at least 0, and what is left; of a part beyond `last`,
    /// `last` and 1. The whole part of what is not a number is 0.
    #[inline(always)]
    fn cell_and_share(self, last: usize) -> (usize, Self) {
        let cell = (self.value() as usize).min(last);
        (cell, (self - Self::from_f64(cell as f64)).at_most(Self::one()))
    }

    /// The larger of `self` and 0; `self` is a number.
    #[inline(always)]
    fn positive_part(self) -> Self {
        self.at_least(Self::zero())
    }

    /// As [`Real::within`], for a bound that has been validated: a number, and at least +0. [`Fixed`]
    /// ends one unit of its resolution below `bound` on the positive side.
    #[inline(always)]
    fn within_level(self, bound: Self) -> Self {
        self.within(bound)
    }

    /// `self` limited to `-bound..=bound`, for `bound >= 0`; a NaN becomes `bound` in magnitude.
    #[inline(always)]
    fn within(self, bound: Self) -> Self {
        if self.abs() <= bound { self } else { bound.copy_sign(self) }
    }
}
