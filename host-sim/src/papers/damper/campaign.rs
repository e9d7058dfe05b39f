//! A log of tests: one track a test, and which of them are held out together.
//!
//! Rows of one test are all but the same measurement, so whole tests are held out. [`Campaign::folds`] leaves each
//! test out once, or in the short form every third at a time; each test is then judged by a fit that has not seen it.

use friction_identification::data::{Dataset, ReadOptions, read};
use friction_identification::fit::{Track, tracks_with};
use std::path::Path;

/// The covariate that says how tight the bands were set.
pub(super) const TENSION: &str = "tension_n";

/// The forces of the two actuators.
pub(super) const ACTUATORS: [&str; 2] = ["actuator1_force_n", "actuator2_force_n"];

/// The actuators' channels are logged this much late against the force, s: 46 rows of the first campaign's 1024 Hz, in
/// all its tests.
const ACTUATORS_LATE_S: f64 = 46.0 / 1024.0;

/// A log, one track a test.
pub(super) struct Campaign {
    /// Names of the tests, in the order of the tracks.
    pub names: Vec<String>,
    /// The tests, following the preset tension.
    pub tracks: Vec<Track>,
    /// Names of the covariates, in the order of [`Track::covariates`].
    pub covariates: Vec<String>,
}

impl Campaign {
    /// Reads a log; `None` where there is none at this place.
    ///
    /// # Errors
    /// One line: what is wrong with it.
    pub fn read(folder: &Path, file: &str) -> Result<Option<Self>, String> {
        let path = folder.join(file);
        if !path.exists() {
            return Ok(None);
        }
        let data = read(&[path], &ReadOptions::default(), &|_, _| {});
        data.map(|data| Some(Self::of(&data))).map_err(|error| error.to_string())
    }

    /// The tests of a data set.
    pub fn of(data: &Dataset) -> Self {
        let tracks = tracks_with(data, Some(TENSION));
        let names = tracks.iter().map(|track| data.runs[track.run].name.clone()).collect();
        Self { names, tracks, covariates: data.covariates.clone() }
    }

    /// Puts the actuators' channels back into step with the force.
    pub fn actuators_in_step(&mut self) {
        for track in &mut self.tracks {
            let late = ACTUATORS_LATE_S / track.period_s;
            let columns = self.covariates.iter().zip(track.covariates.iter());
            let moved: Vec<Vec<f64>> = columns
                .map(|(name, column)| {
                    if ACTUATORS.contains(&name.as_str()) {
                        earlier(column, late)
                    } else {
                        column.clone()
                    }
                })
                .collect();
            track.covariates = moved.into();
        }
    }

    /// Every second row: a log of 512 Hz at the rate of the others.
    pub fn halved(&mut self) {
        for track in &mut self.tracks {
            let every_second = |column: &[f64]| column.iter().copied().step_by(2).collect();
            track.samples = track.samples.iter().copied().step_by(2).collect();
            track.torque = every_second(&track.torque);
            track.covariates = track.covariates.iter().map(|column| every_second(column)).collect();
            track.period_s *= 2.0;
        }
    }

    /// Which tests are held out together: one after the other, or every `of`-th.
    pub fn folds(&self, of: Option<usize>) -> Vec<Vec<usize>> {
        let count = self.tracks.len();
        let folds = of.unwrap_or(count).min(count);
        (0..folds).map(|fold| (fold..count).step_by(folds).collect()).collect()
    }

    /// The tests that are not among these.
    pub fn others(&self, held_out: &[usize]) -> Vec<Track> {
        let kept = (0..self.tracks.len()).filter(|test| !held_out.contains(test));
        kept.map(|test| self.tracks[test].clone()).collect()
    }

    /// All forces, N.
    pub fn forces(&self) -> impl Iterator<Item = f64> + '_ {
        self.tracks.iter().flat_map(|track| track.torque.iter().copied())
    }

    /// Standard deviation of all forces, N.
    pub fn deviation(&self) -> f64 {
        let rows = self.forces().count().max(1) as f64;
        let mean = self.forces().sum::<f64>() / rows;
        (self.forces().map(|force| (force - mean).powi(2)).sum::<f64>() / rows).sqrt()
    }
}

/// A column as it was logged `rows` later, on a straight line between them; the last value is held.
fn earlier(column: &[f64], rows: f64) -> Vec<f64> {
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
    fn a_late_channel_is_put_back_into_step() {
        let late: Vec<f64> = (0..10).map(f64::from).collect();
        assert_eq!(earlier(&late, 2.5)[..3], [2.5, 3.5, 4.5]);
        assert_eq!(earlier(&late, 2.5)[7..], [9.0, 9.0, 9.0]);
    }

    fn campaign(tests: usize) -> Campaign {
        let track = |test| Track::even(Vec::new(), vec![test as f64], 0.01);
        Campaign {
            names: (0..tests).map(|test| test.to_string()).collect(),
            tracks: (0..tests).map(track).collect(),
            covariates: Vec::new(),
        }
    }

    #[test]
    fn each_test_is_held_out_once_and_not_fitted_on_then() {
        let tests = campaign(7);
        for of in [None, Some(3)] {
            let folds = tests.folds(of);
            assert_eq!(folds.len(), of.unwrap_or(7));
            let mut seen: Vec<usize> = folds.concat();
            seen.sort_unstable();
            assert_eq!(seen, [0, 1, 2, 3, 4, 5, 6]);
            for fold in folds {
                let rest = tests.others(&fold);
                assert_eq!(rest.len() + fold.len(), 7);
                assert!(rest.iter().all(|track| !fold.contains(&(track.torque[0] as usize))));
            }
        }
    }
}
