//! Torques and ripples over the shaft's angle.

use crate::number::Real;

/// `sine sin(angle) + cosine cos(angle)`. Out of line: the angle being the same for all terms of a
/// sample, the compiler would take its sines before the loop, for models that need none as well.
#[inline(never)]
pub(super) fn over_angle<T: Real>(angle: T, sine: T, cosine: T) -> T {
    let quarter_ahead = angle + T::from_f64(core::f64::consts::FRAC_PI_2);
    sine * angle.sin() + cosine * quarter_ahead.sin()
}
