//! Dual numbers: a value and its exact derivative by each of `N` parameters.
//!
//! A fit needs the derivative of every simulated torque by every parameter. Finite differences cost one more simulation
//! per parameter and half the digits. A dual number carries the derivatives through the core's own step in one
//! simulation, exact to rounding. The step is generic over its number type, so this file only implements the
//! arithmetic of `a + b eps` with `eps^2 = 0`.
//!
//! The crate `num-dual` is not used for two reasons. `Real` and its type are both foreign here, so that the orphan rule
//! requires a wrapper as long as this file. Its derivative is an `Option`, whose test in each operation prevents
//! vectorisation of the step.

use compensator_core::number::Share;
use compensator_core::{Real, curve};
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value with its derivatives by `N` parameters. Comparisons use the value only.
#[derive(Clone, Copy, Debug)]
pub struct Dual<const N: usize> {
    /// The value.
    pub value: f64,
    /// Derivative by each parameter.
    pub gradient: [f64; N],
    /// True if the number was converted from an `f64`, so that all derivatives are 0. IEEE arithmetic does not allow the compiler
    /// to remove a product with 0. With this flag it removes a third of a step's arithmetic, because the velocity is
    /// constant.
    constant: bool,
}

impl<const N: usize> Dual<N> {
    /// Creates the parameter with this index, at this value.
    pub fn parameter(value: f64, index: usize) -> Self {
        let mut gradient = [0.0; N];
        gradient[index] = 1.0;
        Self { value, gradient, constant: false }
    }

    /// Applies a function with this value and derivative (chain rule).
    #[inline(always)]
    fn chain(self, value: f64, derivative: f64) -> Self {
        if self.constant {
            return Self::from_f64(value);
        }
        let gradient = if N > MAX_INLINED_DERIVATIVES {
            scaled_outlined(&self.gradient, derivative)
        } else {
            scaled(&self.gradient, derivative)
        };
        Self { value, gradient, constant: false }
    }

    /// Returns this number with another value and the same derivatives.
    #[inline(always)]
    fn with_value(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// Returns the product with an `f64`. Inactive effects of a law leave factors of 1 and 0, which are handled without
    /// arithmetic.
    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        let value = self.value * factor;
        if factor == 1.0 {
            return self;
        }
        if factor == 0.0 && value == 0.0 {
            return Self::from_f64(value);
        }
        self.chain(value, factor)
    }

    /// Returns the magnitude, without a branch on the sign.
    #[inline(always)]
    fn abs_by_sign(self) -> Self {
        self.chain(self.value.abs(), 1f64.copysign(self.value))
    }

    #[inline(always)]
    fn zip(self, other: Self, value: f64, combine: impl Fn(f64, f64) -> f64) -> Self {
        let gradient = if N > MAX_INLINED_DERIVATIVES {
            zipped_outlined(&self.gradient, &other.gradient, combine)
        } else {
            zipped(&self.gradient, &other.gradient, combine)
        };
        Self { value, gradient, constant: false }
    }
}

impl<const N: usize> Default for Dual<N> {
    fn default() -> Self {
        Self::from_f64(0.0)
    }
}

impl<const N: usize> PartialEq for Dual<N> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const N: usize> PartialOrd for Dual<N> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

// Each operation tests whether a side is constant. For a law without terms the compiler resolves the test. For a law with
// terms the branch is well predicted and cheaper than the arithmetic that it saves.
impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let value = self.value + other.value;
        if other.constant {
            return self.with_value(value);
        }
        if self.constant {
            return other.with_value(value);
        }
        self.zip(other, value, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let value = self.value - other.value;
        if other.constant {
            return self.with_value(value);
        }
        if self.constant {
            return other.chain(value, -1.0);
        }
        self.zip(other, value, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    // The product rule is a sum.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        if other.constant {
            return self.times(other.value);
        }
        if self.constant {
            return other.times(self.value);
        }
        self.zip(other, self.value * other.value, move |a, b| a * other.value + self.value * b)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        let inverse = 1.0 / other.value;
        if other.constant {
            return self.chain(quotient, inverse);
        }
        if self.constant {
            return other.chain(quotient, -quotient * inverse);
        }
        self.zip(other, quotient, move |a, b| (a - quotient * b) * inverse)
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Real for Dual<N> {
    type Setting = Self;

    #[inline(always)]
    fn from_setting(setting: Self) -> Self {
        setting
    }
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self { value, gradient: [0.0; N], constant: true }
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.value
    }
    fn represents(value: f32) -> bool {
        value.is_finite()
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }
    #[inline(always)]
    fn copy_sign(self, sign: Self) -> Self {
        let flips = self.value.is_sign_negative() != sign.value.is_sign_negative();
        if flips { -self } else { self }
    }
    #[inline(always)]
    fn sign(self) -> Self {
        Self::from_f64(Real::sign(self.value))
    }
    #[inline(always)]
    fn or_zero_if_nan(self) -> Self {
        if self.value.is_nan() { Self::default() } else { self }
    }
    #[inline(always)]
    fn ratio(self, divisor: Self) -> Self {
        self / divisor
    }
    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        let (value, slope) = curve::value_and_slope(self.value.min(curve::LAST));
        self.chain(value, slope)
    }
    #[inline(always)]
    fn up_to_curve_end(self, _: Self) -> Self {
        self
    }
    // In these functions the constant number, if there is one, is the second operand.
    #[inline(always)]
    fn stribeck_share(self, cells_per_velocity: Self, _: Self) -> Share<Self> {
        Share::of((cells_per_velocity * self).stribeck_curve())
    }
    #[inline(always)]
    fn difference_of_products(a: Self, b: Self, c: Self, d: Self) -> Self {
        a * b - d * c
    }
    // Limits are rarely active: a predicted branch is cheaper than a selection of each derivative.
    #[inline(always)]
    fn limited_with_magnitude(self, bound: Self) -> (Self, Self) {
        let mut limited = self;
        let inside = self.value.abs() <= bound.value;
        if !inside {
            rare_branch();
            // The bound is that of the envelope, which is not fitted.
            limited = Self::from_f64(Real::within(self.value.or_zero_if_nan(), bound.value));
        }
        (limited, limited.abs_by_sign())
    }
    #[inline(always)]
    fn within_level(self, bound: Self) -> Self {
        let mut limited = self;
        let inside = self.value.abs() <= bound.value;
        if !inside {
            rare_branch();
            let sign = 1f64.copysign(self.value);
            let gradient = scaled(&bound.gradient, sign);
            limited = Self { value: bound.value * sign, gradient, constant: false };
        }
        limited
    }
    fn exp(self) -> Self {
        let value = Real::exp(self.value);
        self.chain(value, value)
    }
    fn ln(self) -> Self {
        self.chain(Real::ln(self.value), 1.0 / self.value)
    }
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    fn atan(self) -> Self {
        self.chain(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }
    fn pow(self, exponent: Self) -> Self {
        // At 0 the power is 0 for every positive exponent, and its derivatives are 0 for an exponent above 1. The limit 1e-300
        // keeps the logarithm finite.
        let base = self.value.max(1e-300);
        let value = base.powf(exponent.value);
        let by_base = exponent.value * value / base;
        let by_exponent = value * base.ln();
        self.zip(exponent, value, move |a, b| a * by_base + b * by_exponent)
    }
}

/// Returns a gradient times a number. The loop is indexed, because `map` and iterators by value call a function for each
/// element of a long array.
#[inline(always)]
fn scaled<const N: usize>(gradient: &[f64; N], factor: f64) -> [f64; N] {
    let mut scaled = [0.0; N];
    #[allow(clippy::needless_range_loop)]
    for i in 0..N {
        scaled[i] = gradient[i] * factor;
    }
    scaled
}

/// Combines two gradients element by element. The loop is indexed, as in `scaled`.
#[inline(always)]
fn zipped<const N: usize>(
    one: &[f64; N],
    other: &[f64; N],
    combine: impl Fn(f64, f64) -> f64,
) -> [f64; N] {
    let mut zipped = [0.0; N];
    #[allow(clippy::needless_range_loop)]
    for i in 0..N {
        zipped[i] = combine(one[i], other[i]);
    }
    zipped
}

/// Maximum number of derivatives for which operations are inlined. With more, a call is cheap compared with the loop, and
/// inlined loops would dominate the compile time of this crate.
const MAX_INLINED_DERIVATIVES: usize = 8;

#[inline(never)]
fn scaled_outlined<const N: usize>(gradient: &[f64; N], factor: f64) -> [f64; N] {
    scaled(gradient, factor)
}

#[inline(never)]
fn zipped_outlined<const N: usize>(
    one: &[f64; N],
    other: &[f64; N],
    combine: impl Fn(f64, f64) -> f64,
) -> [f64; N] {
    zipped(one, other, combine)
}

/// Marks a branch as rarely taken.
#[cold]
fn rare_branch() {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the derivatives with central differences.
    fn check_derivatives(expression: fn([Dual<2>; 2]) -> Dual<2>, at: [f64; 2]) {
        let seeded = |x: [f64; 2]| [Dual::parameter(x[0], 0), Dual::parameter(x[1], 1)];
        let exact = expression(seeded(at));
        for index in 0..2 {
            let step = 1e-6 * at[index].abs().max(1e-3);
            let (mut above, mut below) = (at, at);
            above[index] += step;
            below[index] -= step;
            let difference = expression(seeded(above)).value - expression(seeded(below)).value;
            let numeric = difference / (2.0 * step);
            let error = (exact.gradient[index] - numeric).abs();
            assert!(error < 1e-5 * (1.0 + numeric.abs()), "{at:?} {index}: {exact:?} {numeric}");
        }
    }

    #[test]
    fn operations_have_derivatives_of_finite_differences() {
        let expressions: [fn([Dual<2>; 2]) -> Dual<2>; 17] = [
            |[a, b]| a + b * a - b,
            |[a, b]| a / b + b.ratio(a),
            |[a, b]| -(a * b).abs(),
            |[a, b]| (a * b).exp(),
            |[a, b]| a.abs().ln() * b,
            |[a, b]| (a * b).sin(),
            |[a, b]| (a - b).atan(),
            |[a, b]| a.abs().pow(b.abs()),
            |[a, b]| a.copy_sign(b),
            |[a, b]| a.within(b.abs()),
            |[a, b]| a.at_most(b) + b.at_least(a) * a,
            |[a, b]| (a * b).abs().stribeck_curve(),
            |[a, b]| a.within_level(b.abs()) * b,
            |[a, b]| a * Dual::from_f64(0.3) - Dual::from_f64(0.7) * b + Dual::from_f64(2.0),
            |[a, b]| Dual::difference_of_products(a, Dual::from_f64(0.3), Dual::from_f64(0.7), b),
            |[a, b]| a.plus_share(b, Dual::from_f64(1.1).stribeck_share(a.abs(), b)),
            |[a, b]| a * b.limited_with_magnitude(Dual::from_f64(9.0)).1,
        ];
        for expression in expressions {
            for at in [[0.7, 1.9], [-1.3, 0.4], [2.1, -3.3], [-0.2, -0.9]] {
                check_derivatives(expression, at);
            }
        }
    }
}
