//! A condition stored as a number, for selection without branches.

use core::ops::{BitAnd, BitOr, Not};

/// A condition, stored as the sign of a word.
///
/// A Cortex-M computes it with one subtraction. [`crate::Real::select`] uses it without a branch.
#[derive(Clone, Copy, Debug)]
pub struct Mask(i32);

impl Mask {
    /// Creates a mask that is set if the number is negative.
    #[inline(always)]
    pub const fn of_sign(number: i32) -> Self {
        Self(number)
    }

    /// Creates a mask that is set if the condition is true.
    #[inline(always)]
    pub const fn of(condition: bool) -> Self {
        Self(if condition { -1 } else { 0 })
    }

    /// Returns true if the mask is set.
    #[inline(always)]
    pub const fn is_set(self) -> bool {
        self.0 < 0
    }

    /// Returns a word with all bits set if the mask is set, else 0.
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        (self.0 >> 31) as u32
    }
}

impl BitOr for Mask {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitAnd for Mask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl Not for Mask {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}
