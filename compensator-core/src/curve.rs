//! The normalised Stribeck curve `exp(-u^2)` as a constant table.
//!
//! The friction level decreases from the static to the Coulomb torque as
//! `g = F_C + (F_S - F_C) exp(-(v/v_s)^2)`. A table of `g` would need RAM for each joint, and an update
//! whenever load or pressure change `F_C` or `F_S`. The normalised curve is constant, so one table in flash
//! serves all joints and loads.
//!
//! The axis `x = 16 |v| / v_s` has 64 cells, centred on the integers 0..=63. The table ends at `v = 3.9 v_s`,
//! where the curve is 2e-7. In each cell, a parabola interpolates the curve at both edges and at the centre.
//! The result is continuous, has zero slope at rest, and is within 1.3e-5 of the exact curve. Linear
//! interpolation on the same cells needs one multiplication less, but has an error of 5e-4.

/// Number of cells. It is a power of two, so that one instruction limits an index to the table and the
/// compiler can omit the bounds check.
pub const CELLS: usize = 64;

/// Number of cells per unit of `v / v_s`.
pub const CELLS_PER_STRIBECK_VELOCITY: f64 = 16.0;

/// Largest argument, in cells: the centre of the last cell, where the tabulated curve is 0.
pub const LAST: f64 = (CELLS - 1) as f64;

/// Coefficients `[value, slope, curvature]` of each cell, in powers of the offset from its centre (-0.5..=0.5).
pub static F64: [[f64; 3]; CELLS] = coefficients();

/// [`F64`] in powers of the argument itself, rounded to `f32`. The step then needs no offset.
///
/// The additional rounding error is about 1e-7 of the curve. The fourth number is padding: a cell of 16 bytes
/// saves one instruction in the address computation.
pub static F32: [[f32; 4]; CELLS] = rounded();

/// [`F64`] with 31 fractional bits, where 1 is stored as `1 - 2^-31`. The order is that of use in a step:
/// curvature, slope, value, and padding as in [`F32`].
pub static Q31: [[i32; 4]; CELLS] = scaled();

/// Returns the curve of [`F64`] at `x` cells and its exact slope per cell, for `0 <= x <= 63`.
///
/// Number types with derivatives use it.
pub fn value_and_slope(x: f64) -> (f64, f64) {
    let nearest = libm::round(x);
    let cell = &F64[nearest as usize % CELLS];
    let offset = x - nearest;
    (cell[0] + offset * (cell[1] + offset * cell[2]), cell[1] + 2.0 * offset * cell[2])
}

const fn exp_of_negative_square(u: f64) -> f64 {
    // exp(-s) = exp(-s/1024)^1024: the series needs few terms, because s <= 16.
    let reduced = -u * u / 1024.0;
    let mut term = 1.0;
    let mut sum = 1.0;
    let mut order = 1;
    while order < 10 {
        term = term * reduced / order as f64;
        sum += term;
        order += 1;
    }
    let mut doublings = 0;
    while doublings < 10 {
        sum = sum * sum;
        doublings += 1;
    }
    sum
}

const fn coefficients() -> [[f64; 3]; CELLS] {
    let mut table = [[0.0; 3]; CELLS];
    let mut cell = 0;
    // The last cell stays 0, because the Stribeck torque is 0 beyond the table.
    while cell < CELLS - 1 {
        let centre = cell as f64 / CELLS_PER_STRIBECK_VELOCITY;
        let half = 0.5 / CELLS_PER_STRIBECK_VELOCITY;
        let left = exp_of_negative_square(centre - half);
        let middle = exp_of_negative_square(centre);
        let right = exp_of_negative_square(centre + half);
        table[cell] = [middle, right - left, 2.0 * (left + right - 2.0 * middle)];
        cell += 1;
    }
    table
}

const fn rounded() -> [[f32; 4]; CELLS] {
    let exact = coefficients();
    let mut table = [[0.0; 4]; CELLS];
    let mut cell = 0;
    while cell < CELLS {
        let ([value, slope, curvature], centre) = (exact[cell], cell as f64);
        table[cell] = [
            (value - centre * (slope - centre * curvature)) as f32,
            (slope - 2.0 * centre * curvature) as f32,
            curvature as f32,
            0.0,
        ];
        cell += 1;
    }
    table
}

const fn scaled() -> [[i32; 4]; CELLS] {
    let exact = coefficients();
    let scale = (1u32 << 31) as f64;
    let mut table = [[0; 4]; CELLS];
    let mut cell = 0;
    while cell < CELLS {
        table[cell] = [
            (exact[cell][2] * scale) as i32,
            (exact[cell][1] * scale) as i32,
            (exact[cell][0] * scale) as i32,
            0,
        ];
        cell += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::{Fixed, Real};

    fn max_error(curve: impl Fn(f64) -> f64) -> f64 {
        (0..=63_000)
            .map(|i| f64::from(i) / 1000.0)
            .map(|x| (curve(x) - (-(x / 16.0) * (x / 16.0)).exp()).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn stribeck_curve_over_table_range_matches_exponential_within_documented_error() {
        let f64_error = max_error(|x| x.stribeck_curve());
        assert!((0.5e-5..1.3e-5).contains(&f64_error), "{f64_error:e}");
        let f32_error = max_error(|x| f64::from((x as f32).stribeck_curve()));
        assert!((0.5e-5..1.4e-5).contains(&f32_error), "{f32_error:e}");
        let fixed_error = max_error(|x| Fixed::from_f64(x).stribeck_curve().value());
        assert!((0.5e-5..2.0e-5).contains(&fixed_error), "{fixed_error:e}");
    }

    #[test]
    fn stribeck_curve_at_ends_is_one_and_zero() {
        assert_eq!(0.0f32.stribeck_curve(), 1.0);
        assert_eq!((LAST as f32).stribeck_curve(), 0.0);
        assert_eq!(0.0f64.stribeck_curve(), 1.0);
    }
}
