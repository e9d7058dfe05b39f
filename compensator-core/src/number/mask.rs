//! A condition that is a number: what choices without branches are made of.

use core::ops::{BitAnd, BitOr, Not};

/// A condition, held as the sign of a word: forming one costs a Cortex-M a subtraction, and
/// [`crate::Real::select`] makes a choice of it that is never a branch.
#[derive(Clone, Copy, Debug)]
pub struct Mask(i32);

impl Mask {
    /// Set where the number is negative.
    #[inline(always)]
    pub const fn of_sign(number: i32) -> Self {
        Self(number)
    }

    /// Set where the condition holds.
    #[inline(always)]
    pub const fn of(condition: bool) -> Self {
        Self(if condition { -1 } else { 0 })
    }

    /// Whether it is set.
    #[inline(always)]
    pub const fn is_set(self) -> bool {
        self.0 < 0
    }

    /// All bits where it is set, else none.
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
