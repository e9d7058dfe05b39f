//! Standard errors and correlations.
//!
//! At the optimum the covariance of the coordinates is `s^2 (J'J)^-1`. It is transformed to the parameters with the
//! exact derivative of the change of coordinates. The residuals of a log are not independent: model errors are smooth,
//! and a hundred neighbouring rows may be one observation. `s^2` is therefore multiplied by the residual's integrated
//! autocorrelation time (1 for white noise). Directions that no row determines get a very large but finite error.

use super::streaming_qr::Reduced;
use nalgebra::{DMatrix, DVector};

/// Smallest singular value that counts as information, as a share of the largest.
const MIN_SINGULAR_VALUE_RATIO: f64 = 1e-13;

/// Returns the covariance of the coordinates for unit residual variance, `(J'J)^-1`.
pub fn inverse_information(reduced: &Reduced) -> DMatrix<f64> {
    let n = reduced.residual.len();
    if n == 0 {
        return DMatrix::zeros(0, 0);
    }
    // The singular value decomposition does not terminate on NaN or infinity.
    if !reduced.factor.iter().all(|entry| entry.is_finite()) {
        return DMatrix::from_element(n, n, f64::MAX);
    }
    let factor = DMatrix::from_row_slice(n, n, &reduced.factor);
    // The columns are scaled to unit length first, so that the cut-off does not depend on units.
    let lengths = DVector::from_iterator(n, factor.column_iter().map(|c| c.norm()));
    let scale = lengths.map(|length| if length > 0.0 { 1.0 / length } else { 1.0 });
    let scaled = DMatrix::from_fn(n, n, |i, j| factor[(i, j)] * scale[j]);
    let svd = scaled.svd(false, true);
    let Some(right) = svd.v_t else { return DMatrix::from_element(n, n, f64::MAX) };
    let largest = svd.singular_values.max().max(f64::MIN_POSITIVE);
    let inverse =
        svd.singular_values.map(|s| 1.0 / s.max(MIN_SINGULAR_VALUE_RATIO * largest).powi(2));
    let covariance = right.transpose() * DMatrix::from_diagonal(&inverse) * right;
    DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * scale[i] * scale[j])
}

/// Returns how far the optimum would move if residual and derivatives at a point were those of `other` instead of `at`, in
/// standard errors of the parameter that moves most.
pub fn step_in_standard_errors(at: &Reduced, other: &Reduced) -> f64 {
    let n = at.residual.len();
    if n == 0 || at.rows <= n {
        return 0.0;
    }
    let gradient = |of: &Reduced| {
        let factor = DMatrix::from_row_slice(n, n, &of.factor);
        factor.transpose() * DVector::from_column_slice(&of.residual)
    };
    // The remaining step to the optimum of `at` itself is subtracted.
    let gradient = gradient(other) - gradient(at);
    let covariance = inverse_information(other);
    let variance = at.sum_of_squares() / (at.rows - n) as f64;
    let step = &covariance * gradient;
    let in_errors = |i: usize| {
        let error = (variance * covariance[(i, i)]).sqrt();
        if error > 0.0 { (step[i] / error).abs() } else { 0.0 }
    };
    (0..n).map(in_errors).fold(0.0, f64::max)
}

/// Returns the integrated autocorrelation time of a residual in rows, at least 1: the number of neighbouring rows that
/// count as one observation. `tracks` are unbroken stretches.
///
/// The sum of autocorrelations ends where they become negative (Geyer 1992) or fall below the noise of the estimate.
pub fn autocorrelation_time<'a>(tracks: impl Iterator<Item = &'a [f64]> + Clone) -> f64 {
    let rows: usize = tracks.clone().map(<[f64]>::len).sum();
    let squares: f64 = tracks.clone().flatten().map(|r| r * r).sum();
    if rows < 10 || squares == 0.0 {
        return 1.0;
    }
    let correlation = |lag: usize| -> f64 {
        let products = tracks.clone().map(|track| product(track, track.get(lag..).unwrap_or(&[])));
        products.sum::<f64>() / squares
    };
    let noise = 2.0 / (rows as f64).sqrt();
    let mut time = 1.0;
    let mut lag = 1;
    // Long lags grow geometrically, so that a long autocorrelation time needs few sums.
    while lag < rows / 4 {
        let stride = (lag / 8).max(1);
        let here = correlation(lag);
        if here < noise {
            break;
        }
        time += 2.0 * here * stride as f64;
        lag += stride;
    }
    time
}

/// Returns the scalar product over the shorter of two series, with eight partial sums: a single sum would be limited by the
/// latency of the addition.
fn product(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let ((a, a_rest), (b, b_rest)) = (a[..count].as_chunks::<8>(), b[..count].as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_information_with_nan_is_maximal() {
        let reduced = Reduced {
            factor: vec![1.0, f64::NAN, 0.0, f64::NAN],
            residual: vec![0.0; 2],
            rest: 1.0,
            rows: 10,
        };
        assert!(inverse_information(&reduced).iter().all(|entry| *entry == f64::MAX));
    }

    fn noise(count: usize) -> Vec<f64> {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        (0..count).map(|_| (0..12).map(|_| uniform()).sum()).collect()
    }

    #[test]
    fn autocorrelation_time_of_white_and_filtered_noise_matches_theory() {
        let white = noise(50_000);
        let time = autocorrelation_time([white.as_slice()].into_iter());
        assert!((1.0..1.05).contains(&time), "{time}");
        // x[n] = a x[n-1] + e has time (1 + a) / (1 - a).
        let a = 0.9;
        let mut last = 0.0;
        let filtered: Vec<f64> = white
            .iter()
            .map(|e| {
                last = a * last + e;
                last
            })
            .collect();
        let time = autocorrelation_time([filtered.as_slice()].into_iter());
        assert!((15.0..24.0).contains(&time), "{time}");
    }

    #[test]
    fn inverse_information_of_singular_factor_is_large_and_finite() {
        let reduced = |factor: [f64; 4]| Reduced {
            factor: factor.to_vec(),
            residual: vec![0.0; 2],
            rest: 1.0,
            rows: 100,
        };
        let covariance = inverse_information(&reduced([2.0, 1.0, 0.0, 4.0]));
        // (J'J) = [[4, 2], [2, 17]], its inverse is [[17, -2], [-2, 4]] / 64.
        assert!((covariance[(0, 0)] - 17.0 / 64.0).abs() < 1e-12);
        assert!((covariance[(0, 1)] + 2.0 / 64.0).abs() < 1e-12);
        let singular = inverse_information(&reduced([1.0, 1.0, 0.0, 0.0]));
        assert!(singular[(0, 0)].is_finite() && singular[(0, 0)] > 1e20);
    }
}
