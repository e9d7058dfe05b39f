//! Trials: stretches of a class's runs on which sampled models are simulated.
//!
//! The paper repeats an experiment, but a log has runs of any length. Each class contributes a few *blocks* of rows, spread
//! over its runs, so that the cost does not depend on the number of rows. The fitted model is simulated along each block
//! twice: at the resolution of the fit, for the residual, and in plain `f32` steps as in a driver, as the reference for
//! sampled models. Trials start at rows drawn evenly over the blocks, with the state of the fitted model there.

use compensator_core::{FrictionModel, ModelState, Parameters, Sample};
use friction_fit::{Resolution, Track, initial_state, simulate};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::ops::Range;

/// Number of full blocks of a class. Short runs give more blocks with the same total number of rows.
const MAX_BLOCKS: usize = 12;

/// Length of a full block, in trials.
const BLOCK_TRIALS: usize = 8;

/// Minimum number of rows of a block; fewer rows do not determine a range.
const MIN_BLOCK_ROWS: usize = 16;

/// A block of rows, as the core's inputs in `f32`.
#[derive(Clone, Debug)]
pub struct Block {
    /// Samples of the rows.
    pub samples: Vec<Sample<f32>>,
    /// Ratio of each row's period to the block's; `None` if the spacing is even.
    pub period_ratio: Option<Vec<f32>>,
    /// Sample period, s.
    pub period_s: f64,
    /// Torque of the fitted model in plain `f32` steps, one value per row, Nm.
    pub predicted: Vec<f32>,
    /// Measured torque minus the model's torque at the resolution of the fit, Nm. The error of plain steps is common to all
    /// vectors and must not count as a spread of the data.
    pub residual: Vec<f32>,
    /// True for each row that counts.
    pub included: Vec<bool>,
    /// Measured torque, Nm, from which the noise of the sensor is estimated.
    pub torque: Vec<f64>,
}

/// Start of a trial.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Index of its block.
    pub block: usize,
    /// First row in the block.
    pub first: usize,
    /// State of the fitted model there.
    pub state: ModelState<f32>,
}

/// All trials of a speed class.
#[derive(Clone, Debug)]
pub struct Trials {
    /// The blocks.
    pub blocks: Vec<Block>,
    /// The trials in random order, so that a few of them represent all.
    pub trials: Vec<Trial>,
    /// Number of rows of a trial; a block may have fewer.
    pub rows: usize,
}

/// Returns the rows of each track that become blocks.
fn choose_blocks(tracks: &[&Track], rows_per_block: usize) -> Vec<(usize, Range<usize>)> {
    let usable: Vec<usize> =
        (0..tracks.len()).filter(|index| tracks[*index].len() >= MIN_BLOCK_ROWS).collect();
    let all_rows: usize = usable.iter().map(|index| tracks[*index].len().min(rows_per_block)).sum();
    let room = MAX_BLOCKS * rows_per_block * usable.len() / all_rows.max(1);
    let taken = usable.len().min(room);
    let spread = |index: usize, of: usize, over: usize| {
        if of > 1 { index * (over - 1) / (of - 1) } else { 0 }
    };
    let mut blocks = Vec::new();
    for index in 0..taken {
        let track = usable[spread(index, taken, usable.len())];
        let length = tracks[track].len();
        let count = (MAX_BLOCKS / taken).max(1).min(length.div_ceil(rows_per_block));
        for block in 0..count {
            let rows = rows_per_block.min(length);
            let first = spread(block, count, length - rows + 1);
            blocks.push((track, first..first + rows));
        }
    }
    blocks
}

/// Simulates the fitted model along rows of a track, with a lead-in if the track starts earlier. `starts` are rows of the
/// block in ascending order. Returns the block and the state at each start.
fn simulate_block(
    parameters: &Parameters<f64>,
    track: &Track,
    rows: &Range<usize>,
    lead_in: usize,
    starts: &[usize],
    resolution: Resolution,
) -> (Block, Vec<ModelState<f32>>) {
    let lead = lead_in.min(rows.start);
    let piece = track.part(rows.start - lead..rows.end);
    let model: FrictionModel<f32> =
        parameters.convert::<f32>().build_unchecked::<f32>(piece.period_s as f32);
    // A block within a track starts sliding; the lead-in lets its state settle.
    let rest =
        if rows.start == lead { initial_state(parameters, &piece, resolution) } else { None };
    let held = rest.map(|rest| rest.held);
    let mut residual = Vec::with_capacity(rows.len());
    simulate(parameters, &piece, held, resolution, |row, torque, _| {
        if row >= lead {
            residual.push((piece.torque[row] - torque) as f32);
        }
        true
    });
    let mut rescaled = model.clone();
    let mut state =
        ModelState::holding(held.map_or_else(|| sliding(&model, &piece), |held| held as f32));
    let samples: Vec<Sample<f32>> = piece.samples.iter().map(in_f32).collect();
    let ratios: Option<Vec<f32>> =
        piece.period_ratio.map(|ratios| ratios.into_iter().map(|ratio| ratio as f32).collect());
    let mut states = Vec::with_capacity(starts.len());
    let mut predicted = Vec::with_capacity(rows.len());
    for (row, sample) in samples.iter().enumerate() {
        let at = row.checked_sub(lead);
        while starts.get(states.len()).is_some_and(|start| Some(*start) == at) {
            states.push(state);
        }
        let torque = if let Some(ratios) = &ratios {
            rescaled.rescale_period(&model, ratios[row]);
            rescaled.step(&mut state, sample)
        } else {
            model.step(&mut state, sample)
        };
        if at.is_some() {
            predicted.push(torque);
        }
    }
    let block = Block {
        samples: samples[lead..].to_vec(),
        period_ratio: ratios.map(|ratios| ratios[lead..].to_vec()),
        period_s: piece.period_s,
        included: rows.clone().map(|row| track.is_included(row)).collect(),
        residual,
        predicted,
        torque: piece.torque[lead..].to_vec(),
    };
    (block, states)
}

/// Returns the bristle torque of a joint that slides at the start of a piece, as in a fit.
fn sliding(model: &FrictionModel<f32>, piece: &Track) -> f32 {
    let coulomb = model.law().sliding_torque();
    coulomb.copysign(piece.samples[0].velocity_rad_s as f32)
}

impl Block {
    /// Returns velocity and residual of each row that counts.
    pub fn residuals(&self) -> impl Iterator<Item = (f32, f32)> + '_ {
        let velocities = self.samples.iter().map(|sample| sample.velocity_rad_s);
        let rows = velocities.zip(self.residual.iter().copied()).zip(&self.included);
        rows.filter(|(_, included)| **included).map(|(row, _)| row)
    }
}

impl Trials {
    /// Draws `count` trials of `rows` rows each from the tracks of one class.
    pub fn new(
        parameters: &Parameters<f64>,
        tracks: &[&Track],
        count: usize,
        rows: usize,
        resolution: Resolution,
        seed: u64,
    ) -> Self {
        let chosen = choose_blocks(tracks, BLOCK_TRIALS * rows.max(MIN_BLOCK_ROWS));
        let longest = chosen.iter().map(|(_, rows)| rows.len()).max().unwrap_or(0);
        let rows = rows.clamp(1, longest.max(1));
        let mut random = Pcg64::seed_from_u64(seed);
        let starts = draw_starts(&chosen, rows, count, &mut random);
        let simulated: Vec<_> = chosen
            .par_iter()
            .zip(&starts)
            .map(|((track, of_track), starts)| {
                simulate_block(parameters, tracks[*track], of_track, rows, starts, resolution)
            })
            .collect();
        let mut blocks = Vec::with_capacity(simulated.len());
        let mut trials = Vec::with_capacity(count);
        for (index, ((block, states), starts)) in simulated.into_iter().zip(&starts).enumerate() {
            let begins = starts.iter().zip(states);
            trials.extend(begins.map(|(first, state)| Trial {
                block: index,
                first: *first,
                state,
            }));
            blocks.push(block);
        }
        for last in (1..trials.len()).rev() {
            trials.swap(last, random.random_range(0..=last));
        }
        Self { blocks, trials, rows }
    }
}

/// Draws the start rows of the trials, block by block in ascending order: one trial from each of `count` equal shares of all
/// rows.
fn draw_starts(
    blocks: &[(usize, Range<usize>)],
    rows: usize,
    count: usize,
    random: &mut Pcg64,
) -> Vec<Vec<usize>> {
    let total: usize = blocks.iter().map(|(_, rows)| rows.len()).sum();
    let mut shares: Vec<f64> = (0..if total > 0 { count } else { 0 })
        .map(|trial| {
            let within: f64 = random.random();
            (trial as f64 + within) / count as f64 * total as f64
        })
        .collect();
    shares.reverse();
    let mut end = 0.0;
    let mut starts = Vec::with_capacity(blocks.len());
    for (index, (_, of_block)) in blocks.iter().enumerate() {
        let length = of_block.len();
        let begin = end;
        end += length as f64;
        let mut in_block = Vec::new();
        let is_last = index + 1 == blocks.len();
        while let Some(share) = shares.pop_if(|share| *share < end || is_last) {
            let part = (share - begin) / length as f64;
            let room = length.saturating_sub(rows);
            in_block.push(((part * (room + 1) as f64) as usize).min(room));
        }
        in_block.sort_unstable();
        starts.push(in_block);
    }
    starts
}

fn in_f32(sample: &Sample<f64>) -> Sample<f32> {
    sample.map(|number| number as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id};

    fn track(rows: usize) -> Track {
        let sample =
            |row: usize| Sample { velocity_rad_s: (row as f64 * 0.01).sin(), ..Sample::default() };
        Track::even((0..rows).map(sample).collect(), vec![0.5; rows], 0.01)
    }

    fn parameters() -> Parameters<f64> {
        Parameters::new(LawKind::Lugre).with(Id::StaticTorque, 1.4)
    }

    #[test]
    fn choose_blocks_with_any_lengths_returns_few_spread_blocks() {
        for lengths in [vec![3], vec![100; 3], vec![300; 400], vec![100_000], vec![5000; 100]] {
            let tracks: Vec<Track> = lengths.iter().map(|rows| track(*rows)).collect();
            let tracks: Vec<&Track> = tracks.iter().collect();
            let blocks = choose_blocks(&tracks, 4000);
            let rows: usize = blocks.iter().map(|(_, rows)| rows.len()).sum();
            assert!(rows <= MAX_BLOCKS * 4000);
            assert_eq!(blocks.is_empty(), lengths == [3]);
            for (index, rows) in &blocks {
                assert!(rows.len() <= 4000 && rows.end <= tracks[*index].len());
            }
            if lengths.len() == 400 {
                assert_eq!(blocks.len(), 160);
            }
            if lengths == [100_000] {
                assert_eq!(blocks.len(), MAX_BLOCKS);
                assert_eq!((blocks[0].1.start, blocks[11].1.end), (0, 100_000));
            }
        }
    }

    #[test]
    fn trial_from_start_state_reproduces_predicted_torque() {
        let track = track(3000);
        let trials = Trials::new(&parameters(), &[&track], 40, 200, Resolution::PLAIN, 3);
        assert_eq!(trials.trials.len(), 40);
        let model: FrictionModel<f32> = parameters().convert::<f32>().build_unchecked(0.01);
        for trial in &trials.trials {
            let block = &trials.blocks[trial.block];
            let mut state = trial.state;
            for row in trial.first..trial.first + 200 {
                let torque = model.step(&mut state, &block.samples[row]);
                assert_eq!(torque.to_bits(), block.predicted[row].to_bits());
            }
        }
    }

    #[test]
    fn new_with_short_or_no_tracks_returns_valid_trials() {
        let short = track(20);
        let trials = Trials::new(&parameters(), &[&short], 5, 500, Resolution::PLAIN, 3);
        assert_eq!((trials.rows, trials.trials.len()), (20, 5));
        assert_eq!(trials.blocks[0].samples.len(), 20);
        let none = Trials::new(&parameters(), &[], 5, 500, Resolution::PLAIN, 3);
        assert!(none.blocks.is_empty() && none.trials.is_empty());
    }
}
