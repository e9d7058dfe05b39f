//! A model judged on rows that a fit of its own has not seen, every run left out once.
//!
//! Whole runs are left out where there are three or more; with many, several at a time. Of one or two runs,
//! where a cause can only be shown to describe (its column is constant in each of a few runs), and where a run went
//! more than `FASTER` times as fast as all others (what a law does there nobody can know from them), a stretch of each
//! run is left out instead. A stretch is simulated on the way, since the bristles remember what was before it,
//! and counts for nothing in the fit. Every fit begins at the one that has seen all.

use super::gram_blocks::{LeftOut, STRETCHES};
use super::model::{Fitted, again};
use super::train_test::TrainTest;
use crate::fit::Track;
use crate::fit::metrics::Metrics;
use crate::fit::predict::{Predicted, predict};
use crate::fit::{Rows, track};
use rayon::prelude::*;

/// Most fits of each model that are made.
const MOST_FITS: usize = 8;

/// A run that went so many times as fast as any other cannot be judged by a fit on those: on a drawn joint of which one run
/// of three slides, the fit on the two that creep missed that one by 14 times what the fit on all leaves.
const FASTER: f64 = 3.0;

/// Fewest runs that can be left out whole.
pub const FEWEST_RUNS: usize = 3;

/// The group a row belongs to that is left out as one.
fn group(log: &TrainTest, track: &Track, row: usize, left_out: LeftOut) -> usize {
    match left_out {
        LeftOut::Runs => track.run % MOST_FITS,
        LeftOut::Stretches => {
            let rows = log.train.runs[track.run].len().max(1);
            ((track.first_row + row) * STRETCHES / rows).min(STRETCHES - 1)
        }
    }
}

/// What a model makes of every row of the log, fitted without it.
pub fn predict_left_out(log: &TrainTest, model: &Fitted, left_out: LeftOut) -> Predicted {
    let log = &*log.following(model.follows.as_ref());
    let groups: Vec<Vec<usize>> = log
        .train_tracks
        .iter()
        .map(|track| (0..track.len()).map(|row| group(log, track, row, left_out)).collect())
        .collect();
    let count = groups.iter().flatten().max().map_or(0, |most| most + 1);
    let parts: Vec<Option<Predicted>> =
        (0..count).into_par_iter().map(|own| part(log, model, &groups, own)).collect();
    let mut whole = predict(&model.parameters, log.train_rows(), model.resolution);
    for (own, part) in parts.iter().enumerate() {
        let Some(part) = part else { continue };
        for (at, groups) in groups.iter().enumerate() {
            for (row, torque) in whole.torque[at].iter_mut().enumerate() {
                if groups[row] == own {
                    *torque = part.torque[at][row];
                }
            }
            for (row, residual) in whole.residuals[at].iter_mut().enumerate() {
                if groups[(row * log.decimate).min(groups.len() - 1)] == own {
                    *residual = part.residuals[at][row];
                }
            }
        }
    }
    whole.metrics = metrics(log, &whole);
    whole
}

/// The model fitted without one group; none where nothing of that group, or nothing else, is there.
fn part(log: &TrainTest, model: &Fitted, groups: &[Vec<usize>], own: usize) -> Option<Predicted> {
    let mut others: Vec<Track> = Vec::with_capacity(groups.len());
    let mut any = false;
    for (track, groups) in log.train_tracks.iter().zip(groups) {
        any |= groups.contains(&own);
        if groups.iter().all(|group| *group == own) {
            continue;
        }
        let mut track = track.clone();
        if groups.contains(&own) {
            track.weigh(|row| f64::from(u8::from(groups[row] != own)));
        }
        others.push(track);
    }
    if !any || others.is_empty() {
        return None;
    }
    let fitted = again(Rows { tracks: &others, decimate: log.decimate }, model);
    Some(predict(&fitted.parameters, log.train_rows(), model.resolution))
}

/// Errors of what has been put together.
fn metrics(log: &TrainTest, whole: &Predicted) -> Metrics {
    let rows = log.train_tracks.iter().zip(&whole.torque).zip(&whole.residuals);
    Metrics::of(rows.flat_map(|((track, torque), residuals)| {
        (0..residuals.len()).filter_map(move |at| {
            let row = at * log.decimate;
            let weight = track.weight(row);
            let measured = track.torque[row];
            // Thinned out, the residual is a filtered one: it stands for itself.
            let simulated = if log.decimate > 1 { measured - residuals[at] } else { torque[row] };
            (weight > 0.0).then_some((measured, simulated, weight))
        })
    }))
}

/// What can be left out of a log at a time.
pub fn unit(log: &TrainTest) -> LeftOut {
    let runs = track::runs(&log.train_tracks);
    if runs >= FEWEST_RUNS && !goes_beyond(log) { LeftOut::Runs } else { LeftOut::Stretches }
}

/// Whether some runs that would be left out together go `FASTER` than all others.
pub fn goes_beyond(log: &TrainTest) -> bool {
    let mut fastest = [0.0f64; MOST_FITS];
    for track in &log.train_tracks {
        let speeds = track.samples.iter().map(|sample| sample.velocity_rad_s.abs());
        let own = &mut fastest[group(log, track, 0, LeftOut::Runs)];
        *own = speeds.fold(*own, f64::max);
    }
    fastest.sort_by(f64::total_cmp);
    fastest[MOST_FITS - 1] > FASTER * fastest[MOST_FITS - 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Dataset, SplitRule, split};

    fn left_out(speeds: [f64; 3]) -> LeftOut {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let runs = speeds.into_iter().enumerate().map(|(run, speed)| {
            let time: Vec<f64> = (0..400).map(|row| f64::from(row) * 0.005).collect();
            let velocity: Vec<f64> = time.iter().map(|time| speed * (9.0 * time).sin()).collect();
            let torque = velocity.iter().map(|velocity| velocity.signum()).collect();
            (run.to_string(), vec![time, velocity, torque])
        });
        let data = Dataset::of_columns(&names, runs).expect("the columns of a log");
        let parts = split(&data, &SplitRule::EachOut, 0).expect("runs to leave out");
        unit(&TrainTest::new(&data, &parts, 1, &[]))
    }

    #[test]
    fn a_run_that_alone_is_fast_is_left_out_stretch_by_stretch() {
        assert_eq!(left_out([1.0, 0.4, 0.9]), LeftOut::Runs);
        assert_eq!(left_out([0.1, 1.0, 0.2]), LeftOut::Stretches);
    }
}
