//! How far a model is from each test: the paper's measure and ours.

use friction_identification::fit::{Metrics, Track};

/// The tests of a campaign as one model has them.
#[derive(Clone, Debug)]
pub(super) struct Score {
    /// Simulated force, test by test, N.
    pub force: Vec<Vec<f64>>,
    /// Errors, test by test.
    pub tests: Vec<Metrics>,
}

impl Score {
    /// Judges the simulated forces of all tests.
    pub fn of(tracks: &[Track], force: Vec<Vec<f64>>) -> Self {
        let tests = tracks.iter().zip(&force).map(|(track, force)| {
            let pairs = track.torque.iter().zip(force);
            Metrics::of(pairs.map(|(measured, simulated)| (*measured, *simulated, 1.0)))
        });
        Self { tests: tests.collect(), force }
    }

    /// RMSE over the range of the test, %: the paper's NRMSE, by the size of its numbers.
    pub fn percent_of_range(&self, test: usize) -> f64 {
        100.0 * self.tests[test].nrmse_range
    }

    /// Mean over the tests of [`Score::percent_of_range`].
    pub fn mean_percent_of_range(&self) -> f64 {
        let sum: f64 = (0..self.tests.len()).map(|test| self.percent_of_range(test)).sum();
        sum / self.tests.len().max(1) as f64
    }

    /// RMSE of all rows of all tests, N.
    pub fn pooled_rmse(&self) -> f64 {
        let rows: usize = self.tests.iter().map(|test| test.rows).sum();
        let squares: f64 = self.tests.iter().map(|test| test.sse).sum();
        (squares / rows.max(1) as f64).sqrt()
    }
}
