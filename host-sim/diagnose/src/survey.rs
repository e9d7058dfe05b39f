//! A fitted model and all candidates beside it, walked along the log once and kept as a [`GramBlocks`].

use super::candidate::{Regressor, Row};
use super::cause::CauseCandidate;
use super::gram_blocks::{Block, GramBlocks, STRETCHES};
use super::sensitivities::{Sensitivities, TrackSensitivities, exact};
use super::train_test::TrainTest;
use friction_fit::Track;
use friction_fit::channel::filter_column;
use friction_fit::statistics::autocorrelation_time;
use joint_log::AntiAlias;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// A block is this many times as long as the residual remembers.
const MEMORIES: f64 = 8.0;

/// Fewest and most blocks a log is cut into, if its runs and the residual's memory allow.
const BLOCKS: (usize, usize) = (40, 240);

/// How many rows (thinned out, if they are) a block of this log has beside a model.
pub fn block_length(log: &TrainTest, model: &Sensitivities) -> usize {
    let rows: usize = log.train_tracks.iter().map(Track::len).sum::<usize>() / log.decimate;
    let residuals = model.tracks.iter().map(|at| at.residual.as_slice());
    let memory = autocorrelation_time(residuals) / log.decimate as f64;
    let least = (rows / BLOCKS.1).max(4);
    ((MEMORIES * memory) as usize).clamp(least, (rows / BLOCKS.0).max(least))
}

/// Walks along the log, in blocks of `length` rows.
pub fn survey(
    log: &TrainTest,
    model: &Sensitivities,
    candidates: &[CauseCandidate],
    other_laws: &[Regressor],
    length: usize,
) -> GramBlocks {
    let both: Vec<(&Track, &TrackSensitivities)> =
        log.train_tracks.iter().zip(&model.tracks).collect();
    let blocks: Vec<Vec<Block>> = both
        .par_iter()
        .map(|(track, at)| blocks(log, model, track, at, (candidates, other_laws), length))
        .collect();
    let widths: Vec<usize> = candidates.iter().map(|c| c.regressors.len()).collect();
    GramBlocks::new(model.free.len(), &widths, blocks.into_iter().flatten().collect())
}

/// All columns along one track, thinned out, cut into blocks.
fn blocks(
    log: &TrainTest,
    model: &Sensitivities,
    track: &Track,
    at: &TrackSensitivities,
    (candidates, other_laws): (&[CauseCandidate], &[Regressor]),
    length: usize,
) -> Vec<Block> {
    let mut columns: Vec<Vec<f64>> = at.jacobian.clone();
    let slope = slope(track, &at.shaft_torque);
    let of_candidates = candidates.iter().flat_map(|candidate| {
        let extra = candidate.extra.map(|index| &track.covariates[index]);
        candidate.regressors.iter().map(move |regressor| (regressor, extra))
    });
    for (regressor, extra) in of_candidates.chain(other_laws.iter().map(|law| (law, None))) {
        columns.push(match regressor {
            Regressor::Exact(effect) => exact(model, track, at, effect),
            Regressor::Track(of) => filter_column(track, of(track, at)),
            Regressor::Row(of) => {
                let row = |row: usize| {
                    of(&Row {
                        sample: &track.samples[row],
                        added: at.added[row],
                        level: at.level[row],
                        viscous: at.viscous[row],
                        slope: slope[row],
                        extra: extra.map_or(0.0, |extra| extra[row]),
                    })
                };
                filter_column(track, (0..track.len()).map(row).collect())
            }
        });
    }
    let mut memory = at.memory.clone();
    if !track.is_evenly_weighted() {
        for column in columns.iter_mut().chain([&mut memory]) {
            let weighed = column.iter_mut().enumerate();
            weighed.for_each(|(row, value)| *value *= track.weight(row).sqrt());
        }
    }
    columns.push(at.residual.clone());
    if log.decimate > 1 {
        let filter = AntiAlias::new(log.decimate);
        memory.resize(track.len(), 0.0);
        memory = filter.thin(memory);
        columns = columns.into_iter().map(|column| filter.thin(column)).collect();
    }
    forget_start(&mut columns, &memory);
    let rows = columns[0].len();
    let count = (rows / length.max(1)).max(1);
    let run_rows = log.train.runs[track.run].len().max(1);
    (0..count)
        .map(|block| {
            let (from, to) = (block * rows / count, (block + 1) * rows / count);
            let middle = track.first_row + (from + to) / 2 * log.decimate;
            let stretch = (middle * STRETCHES / run_rows).min(STRETCHES - 1);
            let part = DMatrix::from_fn(to - from, columns.len(), |row, column| {
                let value = columns[column][from + row];
                if value.is_finite() { value } else { 0.0 }
            });
            Block { run: track.run, stretch, products: part.transpose() * &part, rows: to - from }
        })
        .collect()
}

/// Takes out of every column what the unknown torque held at the start of the track explains.
fn forget_start(columns: &mut [Vec<f64>], memory: &[f64]) {
    let power: f64 = memory.iter().map(|m| m * m).sum();
    if power <= 0.0 {
        return;
    }
    for column in columns {
        let share = column.iter().zip(memory).map(|(c, m)| c * m).sum::<f64>() / power;
        column.iter_mut().zip(memory).for_each(|(c, m)| *c -= share * m);
    }
}

/// Rate of the simulated torque, Nm/s.
fn slope(track: &Track, torque: &[f64]) -> Vec<f64> {
    let last = torque.len() - 1;
    (0..torque.len())
        .map(|row| {
            let (before, after) = (row.saturating_sub(1), (row + 1).min(last));
            let ratio = track.period_ratio.as_ref().map_or(1.0, |ratios| {
                ratios[before + 1..=after].iter().sum::<f64>() / (after - before) as f64
            });
            let time = (after - before) as f64 * track.period_s * ratio;
            if time > 0.0 { (torque[after] - torque[before]) / time } else { 0.0 }
        })
        .collect()
}
