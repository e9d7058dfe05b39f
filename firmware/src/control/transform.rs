//! Clarke and Park transforms of three phase currents.
//!
//! *Clarke*, amplitude-invariant (a phase current of peak `I` gives a vector of length `I`): `alpha = (2 a - b -
//! c) / 3`, `beta = (b - c) / sqrt 3`. With two shunts the third current is minus the sum of the others. *Park*
//! rotates the vector back by the electrical angle: `d = alpha cos + beta sin`, `q = beta cos - alpha sin`. The
//! d axis lies along the magnet; the q current makes the torque.
//!
//! Angles are binary, 2^32 for a turn, and exact. Sine and cosine are parabolas, with a largest error of
//! 1.091e-3 over the whole turn (see the tests). The vector is rotated by at most 1.1 mrad too far and its
//! length is off by at most 0.11 %. The angle costs 1e-6 of the torque. The length changes it by up to 1e-3, four times per
//! electrical turn, less than the current sensors do.

use core::f32::consts::TAU;
use micromath::F32Ext;

/// Maximum error of the sine and cosine of [`Rotation`], measured in the tests.
pub const SINE_ERROR: f32 = 1.1e-3;

/// A quarter of a turn.
const QUARTER: u32 = 1 << 30;

/// Radians in a unit of a binary angle.
pub const RAD_PER_UNIT: f32 = TAU / 4_294_967_296.0;

/// Units of a binary angle in a radian.
pub const UNITS_PER_RAD: f32 = 4_294_967_296.0 / TAU;

/// A vector in the stator frame; phase a lies along alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stationary {
    /// Along phase a.
    pub alpha: f32,
    /// A quarter turn ahead of it.
    pub beta: f32,
}

/// A vector in the rotor frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rotating {
    /// Along the magnet.
    pub d: f32,
    /// A quarter turn (electrical) ahead of it.
    pub q: f32,
}

/// Transforms three measured phases to a vector.
#[inline(always)]
pub fn clarke([a, b, c]: [f32; 3]) -> Stationary {
    const INVERSE_ROOT_3: f32 = 0.577_350_26;
    Stationary { alpha: (2.0 * a - b - c) * (1.0 / 3.0), beta: (b - c) * INVERSE_ROOT_3 }
}

/// Transforms a vector to phases that sum to 0.
#[inline(always)]
pub fn inverse_clarke(vector: Stationary) -> [f32; 3] {
    const HALF_ROOT_3: f32 = 0.866_025_4;
    let half = -0.5 * vector.alpha;
    let side = HALF_ROOT_3 * vector.beta;
    [vector.alpha, half + side, half - side]
}

/// A rotation by an electrical angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    sine: f32,
    cosine: f32,
}

impl Rotation {
    /// Creates the rotation of a binary electrical angle.
    #[inline(always)]
    pub fn at(angle: u32) -> Self {
        Self { sine: sine(angle), cosine: sine(angle.wrapping_add(QUARTER)) }
    }

    /// Transforms from the stator to the rotor frame.
    #[inline(always)]
    pub fn park(self, v: Stationary) -> Rotating {
        Rotating {
            d: v.alpha * self.cosine + v.beta * self.sine,
            q: v.beta * self.cosine - v.alpha * self.sine,
        }
    }

    /// Transforms from the rotor to the stator frame.
    #[inline(always)]
    pub fn inverse_park(self, v: Rotating) -> Stationary {
        Stationary {
            alpha: v.d * self.cosine - v.q * self.sine,
            beta: v.d * self.sine + v.q * self.cosine,
        }
    }
}

/// Returns the sine of a binary angle. The curve is that of micromath; a binary angle needs no reduction of its range, which takes
/// twice as long as the curve.
#[inline(always)]
fn sine(angle: u32) -> f32 {
    // Turns, -0.5 to 0.5. The signed angle keeps the resolution of the float near 0.
    let turns = angle as i32 as f32 * (1.0 / 4_294_967_296.0);
    let parabola = turns * (8.0 - 16.0 * turns.abs());
    parabola + 0.225 * parabola * (parabola.abs() - 1.0)
}

/// Returns the square root, to 5e-6 of the value; 0 for 0, negative values, NaN, and values from `f32::MAX` on.
///
/// The square root of micromath has an error of 4 %. Its inverse square root and two Newton steps, `y (1.5 - x
/// y^2 / 2)`, need no division. The FPU's `vsqrt` is not available without the platform's maths library.
// Not inlined: only a vector near a limit needs it, and the limits of power and voltage call it in several places.
#[inline(never)]
pub fn square_root(x: f32) -> f32 {
    if x > 0.0 && x < f32::MAX {
        let mut y = F32Ext::invsqrt(x);
        for _ in 0..2 {
            y *= 1.5 - 0.5 * x * y * y;
        }
        x * y
    } else {
        0.0
    }
}

/// Converts radians to a binary angle; a value that is not finite gives 0.
#[inline(always)]
pub fn binary_angle(rad: f32) -> u32 {
    // Beyond half a turn the conversion would saturate, so whole turns are removed first.
    let turns = rad * (1.0 / TAU);
    let share = turns - F32Ext::floor(turns);
    if share.is_finite() { (share * 4_294_967_296.0) as u32 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEPS: u32 = 1 << 16;

    fn angles() -> impl Iterator<Item = (u32, f64)> {
        (0..STEPS).map(|i| (i << 16, f64::from(i) / f64::from(STEPS) * std::f64::consts::TAU))
    }

    #[test]
    fn rotation_sine_error_is_as_stated() {
        let worst = angles().fold(0.0f64, |worst, (binary, angle)| {
            let r = Rotation::at(binary);
            worst
                .max((f64::from(r.sine) - angle.sin()).abs())
                .max((f64::from(r.cosine) - angle.cos()).abs())
        });
        assert!((1.08e-3..f64::from(SINE_ERROR)).contains(&worst), "{worst:e}");
    }

    #[test]
    fn park_of_balanced_currents_gives_their_amplitude_on_q() {
        for (binary, angle) in angles().step_by(97) {
            let third = std::f64::consts::TAU / 3.0;
            // The current leads the magnet by a quarter turn.
            let phase = |shift: f64| (-8.0 * (angle - shift).sin()) as f32;
            let seen = Rotation::at(binary).park(clarke([phase(0.0), phase(third), phase(-third)]));
            assert!((seen.q - 8.0).abs() < 0.011, "{seen:?}");
            assert!(seen.d.abs() < 0.011, "{seen:?}");
        }
    }

    #[test]
    fn inverse_transforms_restore_the_vector() {
        for (binary, _) in angles().step_by(31) {
            let v = Rotating { d: -1.5, q: 3.0 };
            let turned = Rotation::at(binary);
            let back = turned.park(clarke(inverse_clarke(turned.inverse_park(v))));
            assert!((back.d - v.d).abs() < 4e-3 && (back.q - v.q).abs() < 8e-3, "{back:?}");
        }
    }

    #[test]
    fn square_root_is_within_5e_6_and_0_for_invalid_input() {
        for exponent in -60..60 {
            let x = 1.37f32.powi(exponent);
            let error = (square_root(x) / x.sqrt() - 1.0).abs();
            assert!(error < 5e-6, "{x}: {error:e}");
        }
        for x in [0.0, -0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(square_root(x), 0.0);
        }
    }

    #[test]
    fn binary_angle_of_radians_wraps() {
        use std::f32::consts::PI;
        for (rad, turns) in [(0.0, 0.0), (PI, 0.5), (-PI / 2.0, 0.75), (5.0 * PI, 0.5)] {
            let error = binary_angle(rad).wrapping_sub((turns * 4_294_967_296.0) as u32) as i32;
            assert!(error.abs() < 4000, "{rad}: {error}");
        }
        for rad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(binary_angle(rad), 0);
        }
    }
}
