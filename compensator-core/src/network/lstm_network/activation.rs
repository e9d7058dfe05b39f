//! Activation functions of the gates. They are rational: they need one division and no exponential.
//!
//! `squash(x) = x (27 + x^2) / (27 + 9 x^2)` for `|x| <= 3`, and 1 or -1 beyond. At `|x| = 3` its slope is 0. It
//! differs from `tanh` by less than 0.024. Training uses the same function, so this difference causes no error.
//! It takes about 15 instructions (`expf`: about 100) and gives the same bits on every target.

use crate::number::Real;

/// Input at which the curve reaches 1.
const END: f64 = 3.0;

/// Smooth, odd and monotonic step from -1 to 1, in place of `tanh`. Returns 1 or -1 for NaN.
///
/// With [`crate::Fixed`] the result has 16 significant bits.
#[inline(always)]
pub fn squash<T: Real>(x: T) -> T {
    let x = x.within(T::from_f64(END));
    let square = x * x;
    let (above, below) = (T::from_f64(27.0), T::from_f64(9.0));
    (x * (above + square)).ratio(above + below * square)
}

/// Slope of [`squash`] at `x`, for training: `(1 - x^2/9)^2 / (1 + x^2/3)^2`, and 0 for `|x| >= 3`.
#[inline(always)]
pub fn squash_slope(x: f64) -> f64 {
    if x.abs() >= END {
        return 0.0;
    }
    let square = x * x;
    let part = (1.0 - square / 9.0) / (1.0 + square / 3.0);
    part * part
}

/// Smooth step from 0 to 1: `(1 + squash(x / 2)) / 2`. The expanded form saves two instructions.
#[inline(always)]
pub fn sigmoid<T: Real>(x: T) -> T {
    let x = x.within(T::from_f64(2.0 * END));
    let square = x * x;
    let (above, below) = (T::from_f64(108.0), T::from_f64(36.0));
    T::from_f64(0.5) + (x * (above + square)).ratio(T::from_f64(432.0) + below * square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Fixed;

    #[test]
    fn squash_is_close_to_tanh_and_saturates_at_one() {
        let points = || (-4000..=4000).map(|i| f64::from(i) / 1000.0);
        let worst = points().map(|x| (squash(x) - x.tanh()).abs()).fold(0.0, f64::max);
        assert!((0.02..0.024).contains(&worst), "{worst}");
        for x in points() {
            let (float, fixed) = (squash(x as f32), squash(Fixed::from_f64(x)));
            assert!((f64::from(float) - squash(x)).abs() < 1e-6);
            assert!((fixed.value() - squash(x)).abs() < 4e-5, "{x}: {}", fixed.value());
            assert!(squash(x + 1e-3) >= squash(x));
        }
        assert_eq!((squash(3.0f32), squash(-1e30f32), squash(f32::INFINITY)), (1.0, -1.0, 1.0));
        assert_eq!(squash(f32::NAN).abs(), 1.0);
    }

    #[test]
    fn sigmoid_equals_scaled_squash() {
        for x in (-800..=800).map(|i| f64::from(i) / 100.0) {
            assert!((sigmoid(x) - 0.5 * (1.0 + squash(0.5 * x))).abs() < 1e-15, "{x}");
            assert!((sigmoid(Fixed::from_f64(x)).value() - sigmoid(x)).abs() < 4e-5, "{x}");
        }
    }

    #[test]
    fn squash_slope_equals_numerical_derivative() {
        for x in (-350..=350).map(|i| f64::from(i) / 100.0) {
            let difference = (squash(x + 1e-6) - squash(x - 1e-6)) / 2e-6;
            assert!((squash_slope(x) - difference).abs() < 1e-6, "{x}");
        }
    }
}
