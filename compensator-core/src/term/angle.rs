//! Torque and ripple as a function of the shaft angle.

use crate::number::Real;

/// Returns `sine sin(angle) + cosine cos(angle)`; `angle` is in rad.
///
/// The function is out of line. All terms of a sample share the angle, so the compiler would otherwise compute
/// the sines before the loop, even for models that do not need them.
#[inline(never)]
pub(super) fn over_angle<T: Real>(angle: T, sine: T, cosine: T) -> T {
    let quarter_ahead = angle + T::from_f64(core::f64::consts::FRAC_PI_2);
    sine * angle.sin() + cosine * quarter_ahead.sin()
}
