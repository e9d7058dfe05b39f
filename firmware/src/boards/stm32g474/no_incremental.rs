//! A board without inputs of an ABZ encoder and of Hall sensors (feature `without-incremental`).
//!
//! With such an encoder in its parameters, the joint is not armed: `encoder-lost`.

use firmware::sensors::quadrature::Quadrature;

/// Returns lines that do not change.
#[inline(always)]
pub fn counts() -> Quadrature {
    Quadrature::default()
}

/// Returns an illegal level.
#[inline(always)]
pub fn hall_levels() -> u8 {
    0
}
