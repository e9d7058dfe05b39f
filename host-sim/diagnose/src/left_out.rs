//! Held-out predictions: each row is predicted by a fit without it.
//!
//! Whole runs are held out if there are three or more. With many runs, several are held out at a
//! time. A stretch of each run is held out instead in these cases:
//!
//! - There are only one or two runs.
//! - A log can only show that a cause describes, because its column is constant in each of a few
//!   runs.
//! - A run is more than `FASTER` times as fast as all others, which then do not determine the law
//!   at its speed.
//!
//! A held-out stretch is still simulated, because the bristles depend on the previous motion.

use super::columns::{columns, products};
use super::model::{FittedModel, changed};
use super::sensitivities::sensitivities;
use super::train_test::TrainTest;
use friction_fit::{Metrics, Predicted, Track, predict, run_count};
use joint_log::Dataset;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

/// What is left out of a fit at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
    /// A stretch of every run: shows whether a model describes.
    Stretches,
    /// Whole runs: shows whether it extrapolates.
    Runs,
}

/// Number of stretches into which the rows of each run are cut; one of each is left out at a time.
pub const STRETCHES: usize = 8;

/// Largest number of fits of a model with whole runs held out.
pub const MOST_FITS: usize = 8;

/// Ratio of speeds above which a run cannot be predicted by a fit to the others. Slower runs do not
/// determine the law at its speed.
const FASTER: f64 = 3.0;

/// Fewest runs for which whole runs are held out.
pub const FEWEST_RUNS: usize = 3;

/// Returns the index of the group with which a row is held out.
fn group(log: &TrainTest, track: &Track, row: usize, left_out: LeftOut) -> usize {
    match left_out {
        LeftOut::Runs => track.run % MOST_FITS,
        LeftOut::Stretches => stretch(&log.train, track, row),
    }
}

/// Returns the stretch of its run in which a row of a track lies.
pub fn stretch(data: &Dataset, track: &Track, row: usize) -> usize {
    let rows = data.runs[track.run].len().max(1);
    ((track.first_row + row) * STRETCHES / rows).min(STRETCHES - 1)
}

/// Ridge of such a fit, relative to the diagonal.
const RIDGE: f64 = 1e-7;

/// Ratio of squared errors on its own rows above which such a fit has diverged.
const DIVERGED: f64 = 1.02;

/// Returns the prediction of every row of `judged` by a fit without it: one Gauss-Newton step from the fit to all rows, shorter
/// if that would raise the error of the other rows. `fitted` has the weights of the fit, `judged` those of the evaluation.
pub fn one_step_left_out(fitted: &TrainTest, judged: &TrainTest, model: &FittedModel) -> Predicted {
    let (fitted, judged) =
        (&*fitted.following(model.follows.as_ref()), &*judged.following(model.follows.as_ref()));
    let way = unit(&judged.train_tracks);
    let of_track = |track: &Track| -> Vec<usize> {
        (0..track.len().div_ceil(judged.decimate))
            .map(|row| group(judged, track, row * judged.decimate, way))
            .collect()
    };
    let groups: Vec<Vec<usize>> = judged.train_tracks.iter().map(of_track).collect();
    let count = groups.iter().flatten().max().map_or(0, |most| most + 1);
    let products = group_products(fitted, model, &groups, count);
    let mut whole = predict(&model.parameters, judged.train_rows(), model.resolution);
    let total = products
        .iter()
        .fold(DMatrix::zeros(model.free.len() + 1, model.free.len() + 1), |sum, part| sum + part);
    let parts: Vec<Option<Predicted>> = (0..count)
        .into_par_iter()
        .map(|left| {
            let step = step(&(&total - &products[left]))?;
            stepped(judged, model, &step, &whole, &groups, left)
        })
        .collect();
    for (left, part) in parts.iter().enumerate() {
        let Some(part) = part else { continue };
        for (track, groups) in groups.iter().enumerate() {
            for (row, torque) in whole.torque[track].iter_mut().enumerate() {
                if groups[row / judged.decimate] == left {
                    *torque = part.torque[track][row];
                }
            }
            for (row, residual) in whole.residuals[track].iter_mut().enumerate() {
                if groups[row.min(groups.len() - 1)] == left {
                    *residual = part.residuals[track][row];
                }
            }
        }
    }
    whole.metrics = metrics(judged, &whole);
    whole
}

/// Returns the products of the derivatives and the residual over the rows of each group.
fn group_products(
    log: &TrainTest,
    model: &FittedModel,
    groups: &[Vec<usize>],
    count: usize,
) -> Vec<DMatrix<f64>> {
    let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
    let size = model.free.len() + 1;
    let tracks: Vec<_> = log.train_tracks.iter().zip(&at.tracks).zip(groups).collect();
    let of_track = |((track, along), groups): &((&Track, &_), &Vec<usize>)| {
        let columns = columns(log, &at, track, along, &[]);
        let mut sums = vec![DMatrix::zeros(size, size); count];
        let mut from = 0;
        while from < columns[0].len() {
            let group = groups[from.min(groups.len() - 1)];
            let same = (from..columns[0].len())
                .take_while(|row| groups[(*row).min(groups.len() - 1)] == group);
            let rows = from..from + same.count();
            from = rows.end;
            sums[group] += products(&columns, rows);
        }
        sums
    };
    let parts: Vec<Vec<DMatrix<f64>>> = tracks.par_iter().map(of_track).collect();
    let mut sums = vec![DMatrix::zeros(size, size); count];
    for part in parts {
        sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
    }
    sums
}

/// Returns the Gauss-Newton step of products whose last column is the residual.
fn step(products: &DMatrix<f64>) -> Option<DVector<f64>> {
    let size = products.nrows() - 1;
    let scale: Vec<f64> =
        (0..size).map(|at| products[(at, at)].sqrt().max(f64::MIN_POSITIVE)).collect();
    let ridge = |i: usize, j: usize| if i == j { RIDGE } else { 0.0 };
    let system =
        DMatrix::from_fn(size, size, |i, j| products[(i, j)] / (scale[i] * scale[j]) + ridge(i, j));
    let right = DVector::from_fn(size, |i, _| products[(i, size)] / scale[i]);
    let solved = Cholesky::new(system)?.solve(&right);
    Some(DVector::from_fn(size, |i, _| solved[i] / scale[i]))
}

/// Returns the prediction after a step; `None` if even a short one raises the error of the rows outside the group.
fn stepped(
    log: &TrainTest,
    model: &FittedModel,
    step: &DVector<f64>,
    whole: &Predicted,
    groups: &[Vec<usize>],
    left: usize,
) -> Option<Predicted> {
    let outside = |predicted: &Predicted| -> f64 {
        let tracks = predicted.residuals.iter().zip(groups);
        let rows = tracks.flat_map(|(residuals, groups)| {
            let rows = residuals.iter().enumerate();
            rows.filter(|(row, _)| groups[(*row).min(groups.len() - 1)] != left)
        });
        rows.map(|(_, residual)| residual * residual).sum()
    };
    let before = outside(whole);
    [1.0, 0.5, 0.25].into_iter().find_map(|share| {
        let mut parameters = model.parameters.clone();
        for (id, change) in model.free.iter().zip(step.iter()) {
            parameters.set(*id, changed(*id, model.parameters.get(*id), share * change));
        }
        let predicted = predict(&parameters, log.train_rows(), model.resolution);
        (outside(&predicted) <= DIVERGED * before).then_some(predicted)
    })
}

/// Returns the errors of the combined prediction.
fn metrics(log: &TrainTest, whole: &Predicted) -> Metrics {
    let rows = log.train_tracks.iter().zip(&whole.torque).zip(&whole.residuals);
    Metrics::of(rows.flat_map(|((track, torque), residuals)| {
        (0..residuals.len()).filter_map(move |at| {
            let row = at * log.decimate;
            // A decimated residual is filtered. The simulated torque is then the measured torque
            // minus the residual.
            let filtered = || track.torque[row] - residuals[at];
            let simulated = if log.decimate > 1 { filtered() } else { torque[row] };
            track.is_included(row).then(|| track.compared(row, simulated))
        })
    }))
}

/// Returns the rows that are held out of these tracks at a time.
pub fn unit(tracks: &[Track]) -> LeftOut {
    let runs = run_count(tracks);
    if runs >= FEWEST_RUNS && !goes_beyond(tracks) { LeftOut::Runs } else { LeftOut::Stretches }
}

/// Returns true if runs that are held out together are more than `FASTER` times as fast as all
/// others.
fn goes_beyond(tracks: &[Track]) -> bool {
    let mut fastest = [0.0f64; MOST_FITS];
    for track in tracks {
        let speeds = track.samples.iter().map(|sample| sample.velocity_rad_s.abs());
        let speed = &mut fastest[track.run % MOST_FITS];
        *speed = speeds.fold(*speed, f64::max);
    }
    fastest.sort_by(f64::total_cmp);
    fastest[MOST_FITS - 1] > FASTER * fastest[MOST_FITS - 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finalist::fitted;
    use crate::fixtures::{HandMadeLog, linear_base, pressure_torque};
    use joint_log::{SplitRule, split};

    fn left_out(speeds: [f64; 3]) -> LeftOut {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let runs = speeds.into_iter().enumerate().map(|(run, speed)| {
            let time: Vec<f64> = (0..400).map(|row| f64::from(row) * 0.005).collect();
            let velocity: Vec<f64> = time.iter().map(|time| speed * (9.0 * time).sin()).collect();
            let torque = velocity.iter().map(|velocity| velocity.signum()).collect();
            (run.to_string(), vec![time, velocity, torque])
        });
        let data = Dataset::from_columns(&names, runs).expect("the columns of a log");
        let parts = split(&data, &SplitRule::LeaveOneRunOut, 0).expect("runs to leave out");
        unit(&TrainTest::new(&data, &parts, 1, &[]).train_tracks)
    }

    #[test]
    fn unit_with_single_fast_run_is_stretches() {
        assert_eq!(left_out([1.0, 0.4, 0.9]), LeftOut::Runs);
        assert_eq!(left_out([0.1, 1.0, 0.2]), LeftOut::Stretches);
    }

    /// Returns the held-out error of fits that have not seen the rows of each group.
    fn refitted_left_out(log: &TrainTest, model: &FittedModel) -> f64 {
        assert_eq!(unit(&log.train_tracks), LeftOut::Runs);
        let mut residuals = Vec::new();
        for run in 0..log.train.runs.len() {
            let mut others = log.clone();
            others.train_tracks.retain(|track| track.run != run);
            let other = fitted(&others, &model.spec, Some(&model.parameters), &[], None);
            let other = other.expect("a law without terms");
            let predicted = predict(&other.parameters, log.train_rows(), model.resolution);
            let tracks = log.train_tracks.iter().zip(predicted.residuals);
            residuals.extend(tracks.filter(|(track, _)| track.run == run).flat_map(|left| left.1));
        }
        let squares: f64 = residuals.iter().map(|residual| residual * residual).sum();
        (squares / residuals.len() as f64).sqrt()
    }

    #[test]
    fn one_step_left_out_is_close_to_a_refit_without_the_rows() {
        let log = HandMadeLog::new(pressure_torque).train_test();
        let model = linear_base(&log);
        let refitted = refitted_left_out(&log, &model);
        let stepped = one_step_left_out(&log, &log, &model).metrics.rmse;
        assert!((stepped / refitted - 1.0).abs() < 0.01, "{stepped} {refitted}");
        let seen = predict(&model.parameters, log.train_rows(), model.resolution).metrics.rmse;
        assert!(stepped > seen, "{stepped} {seen}");
    }
}
