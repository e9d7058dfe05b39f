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

pub use fixed::Fixed;

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

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

    /// `exp(-(x/16)^2)` for `0 <= x <= 63`, see [`crate::curve`].
    fn stribeck_curve(self) -> Self;

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

    /// `self` limited to `-bound..=bound`, for `bound >= 0`; a NaN becomes `bound` in magnitude.
    #[inline(always)]
    fn within(self, bound: Self) -> Self {
        if self.abs() <= bound { self } else { bound.copy_sign(self) }
    }
}
