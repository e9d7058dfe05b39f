//! Errors of a model in each test, by the paper's measure and ours.

use friction_fit::{Metrics, Track, WeighedRow};

/// Forces and errors of one model in all tests of a campaign.
#[derive(Clone, Debug)]
pub(super) struct CampaignScore {
    /// Simulated force, test by test, N.
    pub force: Vec<Vec<f64>>,
    /// Errors, test by test.
    pub tests: Vec<Metrics>,
}

impl CampaignScore {
    /// Computes the errors of the simulated forces.
    pub fn of(tracks: &[Track], force: Vec<Vec<f64>>) -> Self {
        let tests = tracks.iter().zip(&force).map(|(track, force)| {
            let rows = track.torque.iter().zip(force);
            let row = |(&measured, &simulated)| WeighedRow { measured, simulated, weight: 1.0 };
            Metrics::of(rows.map(row))
        });
        Self { tests: tests.collect(), force }
    }

    /// Returns RMSE over the range of the test, %; this is the paper's NRMSE, by the size of its values.
    pub fn percent_of_range(&self, test: usize) -> f64 {
        100.0 * self.tests[test].nrmse_range
    }

    /// Mean over the tests of [`CampaignScore::percent_of_range`].
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
