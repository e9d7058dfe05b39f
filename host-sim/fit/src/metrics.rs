//! Error metrics of a simulation.

use serde::Serialize;

/// Errors of a model on a set of rows. `e` is measured minus simulated, `y` measured; sums and means are
/// weighted as the rows are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Metrics {
    /// `sqrt(mean(e^2))`, Nm or N.
    pub rmse: f64,
    /// `sum(e^2)`, Nm^2 or N^2.
    pub sse: f64,
    /// RMSE over the standard deviation of `y`; the mean of `y` as a model has 1.
    pub nrmse_std: f64,
    /// RMSE over `max(y) - min(y)`.
    pub nrmse_range: f64,
    /// `100 norm(e) / norm(y)`.
    pub relative_error_percent: f64,
    /// Number of rows.
    #[serde(skip)]
    pub rows: usize,
}

/// Measured and simulated value of a row.
#[derive(Clone, Copy, Debug)]
pub struct WeighedRow {
    /// Measured value.
    pub measured: f64,
    /// Simulated value.
    pub simulated: f64,
    /// Weight of its squared error, 0 to 1.
    pub weight: f64,
}

impl Metrics {
    /// Computes the metrics of rows. Without rows, all metrics are 0. A spread of 0 is replaced
    /// by the smallest positive number, so that the ratios stay finite.
    pub fn of(weighed: impl Iterator<Item = WeighedRow>) -> Self {
        let (mut rows, mut weights, mut sse, mut sum, mut squares) = (0usize, 0.0, 0.0, 0.0, 0.0);
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for WeighedRow { measured, simulated, weight } in weighed {
            let error = measured - simulated;
            rows += 1;
            weights += weight;
            sse += weight * error * error;
            sum += weight * measured;
            squares += weight * measured * measured;
            least = least.min(measured);
            most = most.max(measured);
        }
        if rows == 0 {
            return Self::default();
        }
        let n = f64::max(weights, f64::MIN_POSITIVE);
        let rmse = (sse / n).sqrt();
        let variance = (squares / n - (sum / n) * (sum / n)).max(0.0);
        let over = |size: f64| if rmse == 0.0 { 0.0 } else { rmse / size.max(f64::MIN_POSITIVE) };
        Self {
            rmse,
            sse,
            nrmse_std: over(variance.sqrt()).min(f64::MAX),
            nrmse_range: over(most - least).min(f64::MAX),
            relative_error_percent: (100.0 * over((squares / n).sqrt())).min(f64::MAX),
            rows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the metrics of measured and simulated values with weights.
    fn of<const ROWS: usize>(rows: [(f64, f64, f64); ROWS]) -> Metrics {
        let row = |(measured, simulated, weight)| WeighedRow { measured, simulated, weight };
        Metrics::of(rows.into_iter().map(row))
    }

    #[test]
    fn of_four_rows_matches_definitions() {
        let metrics = of([(1.0, 0.0, 1.0), (3.0, 3.0, 1.0), (-2.0, -1.0, 1.0), (2.0, 2.0, 1.0)]);
        assert_eq!(metrics.sse, 2.0);
        assert_eq!(metrics.rmse, 0.5f64.sqrt());
        assert_eq!(metrics.nrmse_range, 0.5f64.sqrt() / 5.0);
        assert!((metrics.relative_error_percent - 100.0 * (2.0f64 / 18.0).sqrt()).abs() < 1e-12);
        assert!((metrics.nrmse_std - (0.5f64 / 3.5).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn of_row_with_half_weight_counts_half() {
        let half = of([(1.0, 0.0, 1.0), (2.0, 2.0, 0.5)]);
        assert!((half.rmse - (1.0f64 / 1.5).sqrt()).abs() < 1e-12);
        let unweighted = of([(1.0, 0.0, 1.0), (9.0, 2.0, 0.0)]);
        assert_eq!(unweighted.rmse, 1.0);
    }

    #[test]
    fn of_no_rows_and_constant_rows_is_finite() {
        assert_eq!(Metrics::of(std::iter::empty()), Metrics::default());
        let constant = of([(1.0, 0.5, 1.0), (1.0, 0.5, 1.0)]);
        assert!(constant.nrmse_std.is_finite() && constant.nrmse_range.is_finite());
    }
}
