//! Dual numbers: a value and its exact derivative by each of `N` parameters.
//!
//! A fit needs the derivative of every simulated torque by every parameter. Differences cost one
//! more simulation per parameter and half the digits; a dual number carries the derivatives through the
//! core's own step, to rounding, in one. The step is generic over its number, so this file is all it
//! takes: the arithmetic of `a + b eps`, `eps^2 = 0`.
//!
//! `num-dual` has such numbers; it is not used because `Real` and its type are both foreign here (the
//! orphan rule would want a wrapper as long as this file), and its derivative is an `Option`, whose
//! test per operation keeps the compiler from vectorising the step.

use compensator_core::number::Share;
use compensator_core::{Real, curve};
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value with its derivatives by `N` parameters. Compares by value.
#[derive(Clone, Copy, Debug)]
pub struct Dual<const N: usize> {
    /// The value.
    pub value: f64,
    /// Derivative by each parameter.
    pub gradient: [f64; N],
    /// Made of a plain number: the derivatives are 0. IEEE arithmetic forbids the compiler to drop a
    /// product by 0; this it knows when it compiles a step, whose velocity is a plain number, and
    /// drops a third of the arithmetic.
    constant: bool,
}

impl<const N: usize> Dual<N> {
    /// The parameter with this index, at this value.
    pub fn parameter(value: f64, index: usize) -> Self {
        let mut gradient = [0.0; N];
        gradient[index] = 1.0;
        Self { value, gradient, constant: false }
    }

    /// A function of this number, by its value and derivative.
    #[inline(always)]
    fn chain(self, value: f64, derivative: f64) -> Self {
        if self.constant {
            return Self::from_f64(value);
        }
        let gradient = if N > INLINED {
            scaled_apart(&self.gradient, derivative)
        } else {
            scaled(&self.gradient, derivative)
        };
        Self { value, gradient, constant: false }
    }

    /// With another value, but the same derivatives.
    #[inline(always)]
    fn at(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// The product with a plain number. Most of what may act on a law does not, and leaves factors of 1
    /// and 0.
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

    /// The magnitude, without a branch on the sign.
    #[inline(always)]
    fn abs_by_sign(self) -> Self {
        self.chain(self.value.abs(), 1f64.copysign(self.value))
    }

    #[inline(always)]
    fn zip(self, other: Self, value: f64, combine: impl Fn(f64, f64) -> f64) -> Self {
        let gradient = if N > INLINED {
            zipped_apart(&self.gradient, &other.gradient, combine)
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

// Whether a side is constant is asked in each operation: the compiler answers for a law stepped alone; for a
// law with terms a foreseen branch is cheaper than the arithmetic it saves.
impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let value = self.value + other.value;
        if other.constant {
            return self.at(value);
        }
        if self.constant {
            return other.at(value);
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
            return self.at(value);
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
    fn represents(value: f64) -> bool {
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
    // In these the plain number, where there is one, comes second.
    #[inline(always)]
    fn stribeck_share(self, cells_per_velocity: Self, _: Self) -> Share<Self> {
        Share::of((cells_per_velocity * self).stribeck_curve())
    }
    #[inline(always)]
    fn difference_of_products(a: Self, b: Self, c: Self, d: Self) -> Self {
        a * b - d * c
    }
    // Limits seldom act: a branch that is foreseen is cheaper than a choice of each derivative.
    #[inline(always)]
    fn limited_with_magnitude(self, bound: Self) -> (Self, Self) {
        let mut limited = self;
        let inside = self.value.abs() <= bound.value;
        if !inside {
            seldom();
            // The bound is the envelope's, which nobody fits.
            limited = Self::from_f64(Real::within(self.value.or_zero_if_nan(), bound.value));
        }
        (limited, limited.abs_by_sign())
    }
    #[inline(always)]
    fn within_level(self, bound: Self) -> Self {
        let mut limited = self;
        let inside = self.value.abs() <= bound.value;
        if !inside {
            seldom();
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
        // At 0 the power is 0 for every positive exponent, and so are its derivatives for an
        // exponent above 1; 1e-300 keeps the logarithm finite.
        let base = self.value.max(1e-300);
        let value = base.powf(exponent.value);
        let by_base = exponent.value * value / base;
        let by_exponent = value * base.ln();
        self.zip(exponent, value, move |a, b| a * by_base + b * by_exponent)
    }
}

/// A gradient times a number. Indexed: of a long array the standard library's `map`, and iterators by value,
/// call a function for each number, which took a quarter of a fit.
#[inline(always)]
fn scaled<const N: usize>(gradient: &[f64; N], factor: f64) -> [f64; N] {
    let mut scaled = [0.0; N];
    #[allow(clippy::needless_range_loop)]
    for i in 0..N {
        scaled[i] = gradient[i] * factor;
    }
    scaled
}

/// Two gradients, number by number. Indexed, as in `scaled`.
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

/// Derivatives up to which each operation of a step has its loop where it stands. With more, a call is small beside
/// the loop, and a step of loops is what the compiler spends most of this crate's build on.
const INLINED: usize = 6;

#[inline(never)]
fn scaled_apart<const N: usize>(gradient: &[f64; N], factor: f64) -> [f64; N] {
    scaled(gradient, factor)
}

#[inline(never)]
fn zipped_apart<const N: usize>(
    one: &[f64; N],
    other: &[f64; N],
    combine: impl Fn(f64, f64) -> f64,
) -> [f64; N] {
    zipped(one, other, combine)
}

/// Marks a branch as seldom taken.
#[cold]
fn seldom() {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Derivatives by central differences of the same expression in `f64`.
    fn holds_for(expression: fn([Dual<2>; 2]) -> Dual<2>, at: [f64; 2]) {
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
    fn every_operation_has_the_derivative_of_its_value() {
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
                holds_for(expression, at);
            }
        }
    }
}
