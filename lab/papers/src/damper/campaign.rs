//! A log of tests as one track per test, and its folds.
//!
//! Rows of one test are nearly repeats of the same measurement, so whole tests are held out. [`TestCampaign::folds`] holds out
//! each test once, or every third test together in the short form. Each test is evaluated by a fit that has not used it.

use crate::PaperError;
use crate::measured_file;
use friction_fit::{Track, tracks_with};
use joint_log::{Dataset, ReadOptions, read};
use std::path::Path;

/// Name of the covariate with the preset tension of the bands.
pub(super) const TENSION: &str = "tension_n";

/// Names of the covariates with the forces of the actuators.
pub(super) const ACTUATORS: [&str; 2] = ["actuator1_force_n", "actuator2_force_n"];

/// Delay of the actuators' channels against the force, s: 46 rows of the first campaign's 1024 Hz, in all tests.
const ACTUATOR_DELAY_S: f64 = 46.0 / 1024.0;

/// A log with one track per test.
pub(super) struct TestCampaign {
    /// Names of the tests, in the order of the tracks.
    pub names: Vec<String>,
    /// The tests, with the preset tension as auxiliary input.
    pub tracks: Vec<Track>,
    /// Names of the covariates, in the order of [`Track::covariates`].
    pub covariates: Vec<String>,
}

impl TestCampaign {
    /// Reads a log; `None` if the file does not exist.
    ///
    /// # Errors
    /// Returns one line that states what is wrong with the file.
    pub fn read(folder: &Path, file: &str) -> Result<Option<Self>, PaperError> {
        let Some(path) = measured_file(folder, file) else { return Ok(None) };
        let data = read(&[path], &ReadOptions::default(), &|_, _| {});
        data.map(|data| Some(Self::of(&data))).map_err(PaperError::source)
    }

    /// Returns the tests of a data set.
    pub fn of(data: &Dataset) -> Self {
        let tracks = tracks_with(data, Some(TENSION));
        let names = tracks.iter().map(|track| data.runs[track.run].name.clone()).collect();
        Self { names, tracks, covariates: data.covariates.clone() }
    }

    /// Returns the position of a covariate.
    ///
    /// # Errors
    /// Returns the name if the tests do not have it.
    pub fn covariate(&self, name: &'static str) -> Result<usize, PaperError> {
        let position = self.covariates.iter().position(|covariate| covariate == name);
        position.ok_or(PaperError::NoCovariate(name))
    }

    /// Removes the delay of the actuators' channels.
    pub fn remove_actuator_delay(&mut self) {
        for track in &mut self.tracks {
            let late = ACTUATOR_DELAY_S / track.period_s;
            let columns = self.covariates.iter().zip(track.covariates.iter());
            let moved: Vec<Vec<f64>> = columns
                .map(|(name, column)| {
                    if ACTUATORS.contains(&name.as_str()) {
                        shift_earlier(column, late)
                    } else {
                        column.clone()
                    }
                })
                .collect();
            track.covariates = moved.into();
        }
    }

    /// Keeps every second row, for a log with twice the sample rate of the others.
    pub fn halve_sample_rate(&mut self) {
        for track in &mut self.tracks {
            let every_second = |column: &[f64]| column.iter().copied().step_by(2).collect();
            track.samples = track.samples.iter().copied().step_by(2).collect();
            track.torque = every_second(&track.torque);
            track.covariates = track.covariates.iter().map(|column| every_second(column)).collect();
            track.period_s *= 2.0;
        }
    }

    /// Returns the folds: one per test, or `fold_count` folds of every `fold_count`-th test.
    pub fn folds(&self, fold_count: Option<usize>) -> Vec<Vec<usize>> {
        let count = self.tracks.len();
        let folds = fold_count.unwrap_or(count).min(count);
        (0..folds).map(|fold| (fold..count).step_by(folds).collect()).collect()
    }

    /// Returns the tests outside a fold.
    pub fn tests_outside(&self, held_out: &[usize]) -> Vec<Track> {
        let kept = (0..self.tracks.len()).filter(|test| !held_out.contains(test));
        kept.map(|test| self.tracks[test].clone()).collect()
    }

    /// Returns all forces, N.
    pub fn forces(&self) -> impl Iterator<Item = f64> + '_ {
        self.tracks.iter().flat_map(|track| track.torque.iter().copied())
    }

    /// Returns the standard deviation of all forces, N.
    pub fn deviation(&self) -> f64 {
        let rows = self.forces().count().max(1) as f64;
        let mean = self.forces().sum::<f64>() / rows;
        (self.forces().map(|force| (force - mean).powi(2)).sum::<f64>() / rows).sqrt()
    }
}

/// Shifts a column earlier by `rows`, with linear interpolation; the last value is held.
fn shift_earlier(column: &[f64], rows: f64) -> Vec<f64> {
    let last = column.len().saturating_sub(1);
    let at = |row: usize| {
        let place = (row as f64 + rows).min(last as f64);
        let (below, share) = (place as usize, place.fract());
        column[below] + (column[(below + 1).min(last)] - column[below]) * share
    };
    (0..column.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shift_earlier_by_fraction_interpolates_and_holds_last() {
        let late: Vec<f64> = (0..10).map(f64::from).collect();
        assert_eq!(shift_earlier(&late, 2.5)[..3], [2.5, 3.5, 4.5]);
        assert_eq!(shift_earlier(&late, 2.5)[7..], [9.0, 9.0, 9.0]);
    }

    fn campaign(tests: usize) -> TestCampaign {
        let track = |test| Track::even(Vec::new(), vec![test as f64], 0.01);
        TestCampaign {
            names: (0..tests).map(|test| test.to_string()).collect(),
            tracks: (0..tests).map(track).collect(),
            covariates: Vec::new(),
        }
    }

    #[test]
    fn folds_hold_out_each_test_once() {
        let tests = campaign(7);
        for of in [None, Some(3)] {
            let folds = tests.folds(of);
            assert_eq!(folds.len(), of.unwrap_or(7));
            let mut held_out_once: Vec<usize> = folds.concat();
            held_out_once.sort_unstable();
            assert_eq!(held_out_once, [0, 1, 2, 3, 4, 5, 6]);
            for fold in folds {
                let rest = tests.tests_outside(&fold);
                assert_eq!(rest.len() + fold.len(), 7);
                assert!(rest.iter().all(|track| !fold.contains(&(track.torque[0] as usize))));
            }
        }
    }
}
