//! Positions of a reference: integers of 2^-44 rad.
//!
//! A reference moves by parts of a microradian in a step, and over hundreds of turns. `f32` has too few digits for both,
//! and the processor emulates `f64`. Sums of integers are exact, and a difference of two positions is small enough for `f32`.
//! The range, 500,000 rad, holds every position of the profile (2147 rad) and any way beyond it.

use core::ops::Sub;

/// A position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Angle(i64);

const UNITS_PER_RAD: f32 = (1u64 << 44) as f32;

impl Angle {
    /// Returns the position at this angle, rad. It saturates, and is 0 for NaN.
    // Not inlined: one copy takes less flash than one for each caller.
    #[inline(never)]
    pub fn from_rad(rad: f32) -> Self {
        Self((rad * UNITS_PER_RAD) as i64)
    }

    /// Returns the position at this angle, 1e-6 rad.
    #[inline(never)]
    pub const fn from_micro_rad(micro_rad: i32) -> Self {
        // 2^44 / 1e6 in two parts, so that no product overflows.
        let micro_rad = micro_rad as i64;
        Self(micro_rad * 17_592_186 + micro_rad * 44_416 / 1_000_000)
    }

    /// Returns the nearest angle, 1e-6 rad; it saturates.
    #[inline(never)]
    pub fn micro_rad(self) -> i32 {
        const BEYOND: i64 = 2200 << 44;
        let bounded = self.0.clamp(-BEYOND, BEYOND);
        let micro_rad = ((bounded >> 16) * 1_000_000 + (1 << 27)) >> 28;
        micro_rad.clamp(i32::MIN.into(), i32::MAX.into()) as i32
    }

    /// Returns the angle, rad, with the resolution of `f32`.
    #[inline(never)]
    pub fn rad(self) -> f32 {
        self.0 as f32 * (1.0 / UNITS_PER_RAD)
    }

    /// Returns the position this angle, rad, further.
    #[must_use]
    #[inline(never)]
    pub fn plus(self, rad: f32) -> Self {
        Self(self.0.saturating_add(Self::from_rad(rad).0))
    }
}

/// The angle from one position to another, rad.
impl Sub for Angle {
    type Output = f32;

    #[inline(never)]
    fn sub(self, from: Self) -> f32 {
        Self(self.0.saturating_sub(from.0)).rad()
    }
}

/// Converts to millionths, whatever the unit; it saturates and converts NaN to 0.
#[inline(never)]
pub(crate) fn micro(number: f32) -> i32 {
    Angle::from_rad(number).micro_rad()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angle_returns_every_micro_rad_that_it_was_made_of() {
        let steps = (0..4_000_000u32).map(|step| step.wrapping_mul(1073) as i32);
        for micro_rad in steps.chain([i32::MIN, i32::MAX, -1, 0, 1]) {
            let angle = Angle::from_micro_rad(micro_rad);
            assert_eq!(angle.micro_rad(), micro_rad);
            let exact = 1e-6 * f64::from(micro_rad);
            assert!(
                (f64::from(angle.rad()) - exact).abs() <= 1e-12 + 6e-8 * exact.abs(),
                "{micro_rad}"
            );
        }
    }

    #[test]
    fn slow_motion_far_from_zero_is_not_lost() {
        let (start, step) = (Angle::from_rad(2000.0), 1e-9f32);
        let end = (0..100_000).fold(start, |angle, _| angle.plus(step));
        assert!(((end - start) - 1e-4).abs() < 1e-8, "{}", end - start);
    }

    #[test]
    fn value_out_of_range_saturates() {
        assert_eq!(Angle::from_rad(f32::NAN), Angle::default());
        assert_eq!(Angle::from_rad(f32::INFINITY).micro_rad(), i32::MAX);
        assert_eq!(Angle::from_rad(-1e30).plus(-1e30).micro_rad(), i32::MIN);
    }
}
