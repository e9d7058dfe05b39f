//! `f32` and `f64`.
//!
//! `f64` serves the host, where accuracy counts and time hardly does: its functions come from
//! `libm`. `f32` serves the current loop. Its Stribeck curve is the table of [`crate::curve`]; its
//! exponential, logarithm and power come from `libm` too (micromath's exponential is slower and
//! coarser there), its sine from micromath, whose error of about 1e-3 of the amplitude is small
//! beside the ripple amplitudes (a few percent of the friction) it multiplies.

use super::Real;
use crate::curve;

macro_rules! common {
    ($type:ty) => {
        #[inline(always)]
        fn from_f64(value: f64) -> Self {
            value as $type
        }
        #[inline(always)]
        fn value(self) -> f64 {
            f64::from(self)
        }
        fn represents(value: f64) -> bool {
            (value as $type).is_finite()
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
    };
}

impl Real for f32 {
    type Setting = f32;

    common!(f32);

    #[inline(always)]
    fn from_setting(setting: f32) -> Self {
        setting
    }

    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        // Adding 1.5 * 2^23 leaves the nearest integer in the low bits of the sum: an exact,
        // branchless round, where `as usize` compiles to compares and selects.
        const ROUND: f32 = 12_582_912.0;
        let shifted = self + ROUND;
        let cell = &curve::F32[(shifted.to_bits() as usize) % curve::CELLS];
        let offset = self - (shifted - ROUND);
        cell[0] + offset * (cell[1] + offset * cell[2])
    }

    fn exp(self) -> Self {
        libm::expf(self)
    }
    fn ln(self) -> Self {
        libm::logf(self)
    }
    fn sin(self) -> Self {
        use micromath::F32Ext;
        F32Ext::sin(self)
    }
    fn atan(self) -> Self {
        libm::atanf(self)
    }
    fn pow(self, exponent: Self) -> Self {
        libm::powf(self, exponent)
    }
}

impl Real for f64 {
    type Setting = f64;

    common!(f64);

    #[inline(always)]
    fn from_setting(setting: f64) -> Self {
        setting
    }

    #[inline(always)]
    fn stribeck_curve(self) -> Self {
        const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
        let shifted = self + ROUND;
        let cell = &curve::F64[(shifted.to_bits() as usize) % curve::CELLS];
        let offset = self - (shifted - ROUND);
        cell[0] + offset * (cell[1] + offset * cell[2])
    }

    fn exp(self) -> Self {
        libm::exp(self)
    }
    fn ln(self) -> Self {
        libm::log(self)
    }
    fn sin(self) -> Self {
        libm::sin(self)
    }
    fn atan(self) -> Self {
        libm::atan(self)
    }
    fn pow(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }
}
