//! A fitted model and all candidates beside it, walked along the log once and kept as a [`GramBlocks`].

use super::candidate::Regressor;
use super::cause::CauseCandidate;
use super::columns::columns;
use super::gram_blocks::{Block, GramBlocks, STRETCHES};
use super::sensitivities::{Sensitivities, TrackSensitivities};
use super::train_test::TrainTest;
use friction_fit::Track;
use friction_fit::statistics::autocorrelation_time;
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
    let of_candidates = candidates
        .iter()
        .flat_map(|candidate| candidate.regressors.iter().map(move |own| (own, candidate.extra)));
    let regressors: Vec<(&Regressor, Option<usize>)> =
        of_candidates.chain(other_laws.iter().map(|law| (law, None))).collect();
    let columns = columns(log, model, (track, at), &regressors);
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
