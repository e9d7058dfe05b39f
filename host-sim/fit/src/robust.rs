//! Robust loss: rows whose error is far larger than that of the rows beside them count less.
//!
//! Squares let a few wrong values decide a fit. Huber's loss grows linearly beyond `k` standard deviations. It is minimised
//! by iteratively reweighted least squares: a row with the error `e` has the weight `min(1, k s / |e|)`, where `s` is the
//! standard deviation of the errors by their median magnitude (Huber 1964; Holland and Welsch 1977).
//!
//! A model error lasts many rows, and is what a diagnosis looks for. A wrong value lasts one. So `e` is the residual minus
//! the median of the residuals around it, and a smooth model error keeps its weight.

use super::identify::identify;
use super::initial_state::initial_state;
use super::outcome::Outcome;
use super::simulate::{Resolution, simulate};
use super::solve::FitOptions;
use super::track::{Rows, Track};
use crate::spec::Spec;
use compensator_core::Parameters;
use joint_log::statistics::quantile_by_count;
use rayon::prelude::*;

/// Loss of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// Squared errors.
    #[default]
    Squares,
    /// Huber's loss for errors of single rows.
    Huber,
}

/// Error at which the loss becomes linear, standard deviations. Noise hardly reaches it, so that a clean log gives the
/// estimates of squares. With the usual 1.345 the short errors of a law at breakaways would lose weight too.
const LINEAR_FROM: f64 = 2.5;

/// Rows on either side whose median residual is the model's error.
const NEIGHBOURS: usize = 4;

/// Median of the magnitude of a standard normal variable.
const NORMAL_MEDIAN: f64 = 0.6745;

/// Maximum number of fits with new weights.
const MAX_ROUNDS: usize = 8;

/// Movement of a parameter at which the weights count as final, standard errors.
const MAX_MOVEMENT: f64 = 0.1;

/// Fits a model as [`identify`] does, with this loss.
pub fn identify_robustly(
    loss: Loss,
    spec: &Spec,
    base: &Parameters<f64>,
    train: Rows,
    test: Rows,
    options: &FitOptions,
) -> Outcome {
    let mut fit = identify(spec, base, train, test, options);
    if loss == Loss::Squares {
        return fit;
    }
    let mut reduced = 0;
    for round in 0..MAX_ROUNDS {
        let weigh = Weighting::of(train.tracks, &fit.parameters, fit.resolution);
        let (train_tracks, test_tracks) = (weigh.applied(train.tracks), weigh.applied(test.tracks));
        reduced = weigh.reduced;
        let train = Rows { tracks: &train_tracks, ..train };
        let test = Rows { tracks: &test_tracks, ..test };
        // The first start may be in a valley that the wrong values made.
        let options = match round {
            0 => options.clone(),
            _ => FitOptions { starts: 1, start: Some(fit.parameters.clone()), ..options.clone() },
        };
        let next = identify(spec, base, train, test, &options);
        let moved = movement(&fit, &next);
        fit = next;
        if moved < MAX_MOVEMENT {
            break;
        }
    }
    let rows = train.tracks.iter().map(Track::len).sum::<usize>();
    fit.verdicts.push(format!(
        "the loss is huber: {reduced} of {rows} training rows differ from the rows beside them and count less; the errors \
         are weighted alike"
    ));
    fit
}

/// Returns the largest difference of two estimates, in standard errors.
fn movement(before: &Outcome, after: &Outcome) -> f64 {
    let pairs = before.estimates.iter().zip(&after.estimates);
    let moved = pairs.filter_map(|(before, after)| {
        let error = after.std_error.filter(|error| *error > 0.0)?;
        Some((after.value - before.value).abs() / error)
    });
    moved.fold(0.0, f64::max)
}

/// Huber's weights beside a model.
pub struct Weighting<'a> {
    parameters: &'a Parameters<f64>,
    resolution: Resolution,
    /// Standard deviation of the errors of single rows, Nm or N.
    deviation: f64,
    /// Number of rows with a weight below 1.
    pub reduced: usize,
}

impl<'a> Weighting<'a> {
    /// Computes the size of the errors from the training rows.
    pub fn of(train: &[Track], parameters: &'a Parameters<f64>, resolution: Resolution) -> Self {
        let mut weighting = Self { parameters, resolution, deviation: 0.0, reduced: 0 };
        let errors: Vec<Vec<f64>> =
            train.par_iter().map(|track| weighting.isolated_errors(track)).collect();
        let included = |(track, errors): (&Track, &Vec<f64>)| -> Vec<f64> {
            let rows = errors.iter().enumerate().filter(|(row, _)| track.is_included(*row));
            rows.map(|(_, error)| error.abs()).collect()
        };
        let sizes: Vec<f64> = train.iter().zip(&errors).flat_map(included).collect();
        weighting.deviation =
            quantile_by_count(sizes.clone(), 0.5).unwrap_or_default() / NORMAL_MEDIAN;
        weighting.reduced = sizes.iter().filter(|size| weighting.weight(**size) < 1.0).count();
        weighting
    }

    /// Returns the tracks with these weights in addition to their own.
    pub fn applied(&self, tracks: &[Track]) -> Vec<Track> {
        let weighed = |track: &Track| {
            let errors = self.isolated_errors(track);
            let mut track = track.clone();
            track.scale_weights(|row| self.weight(errors[row].abs()));
            track
        };
        tracks.par_iter().map(weighed).collect()
    }

    fn weight(&self, size: f64) -> f64 {
        let linear_from = LINEAR_FROM * self.deviation;
        if size > linear_from { linear_from / size } else { 1.0 }
    }

    /// Returns the residual of each row minus the median of the residuals around it.
    fn isolated_errors(&self, track: &Track) -> Vec<f64> {
        let held = initial_state(self.parameters, track, self.resolution).map(|start| start.held);
        let mut residual = Vec::with_capacity(track.len());
        simulate(self.parameters, track, held, self.resolution, |row, torque: f64, _| {
            residual.push(track.torque[row] - torque);
            true
        });
        let median = |row: usize| {
            let end = (row + NEIGHBOURS + 1).min(residual.len());
            let mut near = residual[row.saturating_sub(NEIGHBOURS)..end].to_vec();
            let middle = near.len() / 2;
            *near.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        (0..residual.len()).map(|row| residual[row] - median(row)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id, Sample};

    /// Coulomb and viscous friction with noise, and moderate wrong values of one sign in every sixth row.
    fn track(wrong_nm: f64, wavy_nm: f64) -> Track {
        let velocity = |row: usize| 2.0 * (0.02 * row as f64).sin();
        let samples: Vec<Sample<f64>> = (0..3000)
            .map(|row| Sample { velocity_rad_s: velocity(row), ..Sample::default() })
            .collect();
        let torque = (0..3000)
            .map(|row| {
                let noise = 2e-3 * ((row * 7919 % 101) as f64 / 50.0 - 1.0);
                let wrong = if row % 6 == 0 { wrong_nm } else { 0.0 };
                let wavy = wavy_nm * (0.01 * row as f64).cos();
                velocity(row).signum() * 0.5 + 0.2 * velocity(row) + noise + wrong + wavy
            })
            .collect();
        Track::even(samples, torque, 0.01)
    }

    fn fitted(loss: Loss, track: Track) -> Outcome {
        let tracks = [track];
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let spec = Spec::parse("linear+torque-offset").expect("a model");
        let base = spec.parameters().expect("parameters");
        let options = FitOptions::default();
        identify_robustly(loss, &spec, &base, rows, rows, &options)
    }

    #[test]
    fn identify_robustly_with_moderate_outliers_returns_true_offset() {
        let offset = |loss| fitted(loss, track(0.3, 0.0)).parameters.get(Id::TorqueOffset);
        assert!((offset(Loss::Squares) - 0.05).abs() < 2e-3, "a sixth of 0.3 Nm");
        assert!(offset(Loss::Huber).abs() < 2e-3, "{}", offset(Loss::Huber));
    }

    #[test]
    fn identify_robustly_with_smooth_model_error_agrees_with_squares() {
        let [squares, huber] =
            [Loss::Squares, Loss::Huber].map(|loss| fitted(loss, track(0.0, 0.2)).parameters);
        for id in LawKind::Linear.parameters() {
            let difference = (squares.get(*id) - huber.get(*id)).abs();
            assert!(difference < 5e-3, "{}: {difference}, 1 % of the torque", id.name());
        }
    }

    #[test]
    fn identify_robustly_with_squares_equals_identify() {
        let tracks = [track(0.3, 0.0)];
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let spec = Spec::parse("linear").expect("a model");
        let base = spec.parameters().expect("parameters");
        let plain = identify(&spec, &base, rows, rows, &FitOptions::default());
        let squares =
            identify_robustly(Loss::Squares, &spec, &base, rows, rows, &FitOptions::default());
        assert_eq!(plain.parameters, squares.parameters);
    }
}
