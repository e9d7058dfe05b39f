//! Training with Adam and early stopping by cross-validation.
//!
//! A dozen tests are too few for a fixed validation set: the result would depend on the friction level of the chosen runs.
//! The runs are therefore divided into groups. Each group is held out once while the others train, and the mean
//! held-out loss determines the number of passes. Then all runs train for this number of passes. Whole runs are held
//! out, never rows of a run. The same seed gives the same weights on any number of threads: every training has its own
//! random sampler and does not use the time.

use super::adjoint;
use super::file::CELLS;
use super::input::{NetworkInput, NetworkLaw};
use super::predict::predict;
use compensator_core::Parameters;
use compensator_core::network::{FactorBounds, InputRange, Lstm, Network, Readout, sigmoid};
use friction_fit::Track;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Options of a training.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// Seed of the random sampler. The same seed gives the same weights.
    pub seed: u64,
    /// Maximum number of passes over all runs.
    pub epochs: usize,
    /// Number of groups of runs, each held out once for early stopping; below 2 all passes are made.
    pub groups: usize,
    /// Number of rows between evaluations of the network.
    pub every: usize,
    /// Number of steps of the law per row.
    pub substeps: usize,
    /// Initial learning rate of Adam, which decreases to a fiftieth along half a cosine.
    pub rate: f64,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self { seed: 0, epochs: 200, groups: 3, every: 2, substeps: 2, rate: 0.01 }
    }
}

/// Progress of a training.
#[derive(Clone, Copy, Debug)]
pub struct TrainingProgress {
    /// Index of the held-out group; `None` if all runs train.
    pub group: Option<usize>,
    /// Number of completed passes.
    pub epoch: usize,
    /// Mean loss of the training runs: half the mean squared error over the torque's variance.
    pub loss: f64,
    /// Mean loss of the held-out group, if it was evaluated in this pass.
    pub held_out: Option<f64>,
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct TrainedNetwork<const INPUTS: usize> {
    /// The law and its network.
    pub supplied: NetworkLaw<INPUTS>,
    /// Number of passes of the final training.
    pub epochs: usize,
    /// Mean loss of the training runs in the last pass.
    pub loss: f64,
    /// Mean loss of the held-out groups after this number of passes.
    pub held_out: Option<f64>,
}

/// Bounds of the factors of Coulomb level, static level and stiffness. They contain the range of levels of the damper's
/// tests with a margin. The stiffness almost vanishes while a gap is crossed.
const BOUNDS: [(f64, f64); 3] = [(0.2, 2.5), (0.2, 3.0), (0.02, 4.0)];

/// Maximum change of a factor per evaluation. The stiffness must fall and rise again while a gap is crossed, which takes the
/// damper about ten evaluations.
const MAX_FACTOR_STEP: f64 = 0.5;

/// Decrease of the network's weight per evaluation outside its ranges: it is 0 after a quarter of a second at 128 Hz.
const FADE_PER_EVALUATION: f64 = 1.0 / 32.0;

/// Margin around the range of the training data, as a share of its half-width.
const RANGE_MARGIN: f64 = 0.05;

/// Maximum norm of a gradient. Longer gradients are scaled down, for example in a run with oscillating factors.
const MAX_GRADIENT_NORM: f64 = 1.0;

/// Final learning rate, as a share of the initial one.
const FINAL_RATE_SHARE: f64 = 0.02;

/// Number of passes between evaluations of the held-out runs.
const EVALUATION_PASSES: usize = 5;

/// Trains a network on some runs.
pub fn train<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [NetworkInput; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
    progress: &(dyn Fn(TrainingProgress) + Sync),
) -> TrainedNetwork<INPUTS> {
    let begin = untrained(base, inputs, tracks, options);
    let all: Vec<usize> = (0..tracks.len()).collect();
    let groups = groups(tracks.len(), options);
    let curves: Vec<Vec<f64>> = groups
        .par_iter()
        .enumerate()
        .map(|(group, held_out)| {
            let learn = all.iter().copied().filter(|run| !held_out.contains(run)).collect();
            let parts = Parts { learn, held_out, group: Some(group), epochs: options.epochs };
            descend(begin.clone(), tracks, parts, options, progress).2
        })
        .collect();
    let evaluations = curves.iter().map(Vec::len).min().unwrap_or(0);
    let means = (0..evaluations).map(|at| {
        let mean = curves.iter().map(|curve| curve[at]).sum::<f64>() / curves.len() as f64;
        (mean, (at + 1) * EVALUATION_PASSES)
    });
    let best = means.min_by(|(one, _), (other, _)| one.total_cmp(other));
    let epochs = best.map_or(options.epochs, |(_, epochs)| epochs.min(options.epochs));
    let parts = Parts { learn: all, held_out: &[], group: None, epochs };
    let (supplied, loss, _) = descend(begin, tracks, parts, options, progress);
    TrainedNetwork { supplied, epochs, loss, held_out: best.map(|(mean, _)| mean) }
}

/// Training runs, held-out runs and number of passes.
struct Parts<'a> {
    learn: Vec<usize>,
    held_out: &'a [usize],
    group: Option<usize>,
    epochs: usize,
}

/// Trains for a number of passes. Returns the network, the loss of the last pass, and the held-out losses.
fn descend<const INPUTS: usize>(
    mut supplied: NetworkLaw<INPUTS>,
    tracks: &[Track],
    parts: Parts,
    options: &TrainOptions,
    progress: &(dyn Fn(TrainingProgress) + Sync),
) -> (NetworkLaw<INPUTS>, f64, Vec<f64>) {
    let mut random = Pcg64Mcg::seed_from_u64(options.seed ^ 0x5eed);
    let scale = deviation(tracks);
    let mut learn = parts.learn;
    let mut weights = Vec::new();
    supplied.network.for_each_weight(|weight| weights.push(weight));
    let mut adam = Adam::new(weights.len());
    let (mut last, mut curve) = (f64::INFINITY, Vec::new());
    for epoch in 0..parts.epochs {
        // The schedule does not depend on the number of passes, so that a shorter training equals the start of a longer one.
        let share = epoch as f64 / options.epochs as f64;
        let falling = 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
        let rate = options.rate * (FINAL_RATE_SHARE + (1.0 - FINAL_RATE_SHARE) * falling);
        let mut total = 0.0;
        for index in (1..learn.len()).rev() {
            learn.swap(index, random.random_range(0..=index));
        }
        for &run in &learn {
            let mut gradient = vec![0.0; weights.len()];
            total += adjoint::loss(&supplied, &tracks[run], scale, &mut gradient);
            adam.step(&mut weights, &gradient, rate);
            supplied.network.set_weights(weights.iter().copied());
        }
        last = total / learn.len().max(1) as f64;
        let looks = !parts.held_out.is_empty() && (epoch + 1) % EVALUATION_PASSES == 0;
        let held_out = looks.then(|| {
            let losses = parts.held_out.iter().map(|run| loss(&supplied, &tracks[*run], scale));
            losses.sum::<f64>() / parts.held_out.len() as f64
        });
        curve.extend(held_out);
        progress(TrainingProgress { group: parts.group, epoch: epoch + 1, loss: last, held_out });
    }
    (supplied, last, curve)
}

/// Returns the loss of a run, computed in `f64`.
fn loss<const INPUTS: usize>(supplied: &NetworkLaw<INPUTS>, track: &Track, scale: f64) -> f64 {
    let run = predict(supplied, track);
    let squares = run.torque.iter().zip(&track.torque).map(|(s, m)| (s - m).powi(2));
    0.5 * squares.sum::<f64>() / (scale * scale * track.len().max(1) as f64)
}

/// Divides the runs into groups at random. Returns no groups if there are too few runs.
fn groups(count: usize, options: &TrainOptions) -> Vec<Vec<usize>> {
    if options.groups < 2 || count < options.groups.max(3) {
        return Vec::new();
    }
    let mut random = Pcg64Mcg::seed_from_u64(options.seed ^ 0x6409);
    let mut runs: Vec<usize> = (0..count).collect();
    for index in (1..count).rev() {
        runs.swap(index, random.random_range(0..=index));
    }
    let of = |group: usize| runs.iter().copied().skip(group).step_by(options.groups).collect();
    (0..options.groups).map(of).collect()
}

/// Creates an untrained network, with the ranges of the tracks and factors of 1.
pub(super) fn untrained<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [NetworkInput; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
) -> NetworkLaw<INPUTS> {
    let bounds = BOUNDS.map(|(least, most)| FactorBounds { least, most });
    let network = Network {
        inputs: [InputRange::new(-1.0, 1.0, 0.0); INPUTS],
        lstm: Lstm::zero(),
        readout: Readout::zero(),
        bounds,
        slew: MAX_FACTOR_STEP,
        fade: FADE_PER_EVALUATION,
    };
    let (every, substeps) = (options.every.max(1), options.substeps.max(1));
    let mut supplied =
        NetworkLaw { base: base.clone(), inputs, network, strokes: None, every, substeps };
    supplied.network.inputs = inputs.map(|input| range(&supplied, input, tracks));
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    let size = 1.0 / ((INPUTS + CELLS) as f64).sqrt();
    for cell in &mut supplied.network.lstm.cells {
        // The forget gate starts open, because a gap requires a memory of about ten evaluations.
        cell.bias[0] = 1.0;
        for weight in cell.input.iter_mut().chain(&mut cell.recurrent).flatten() {
            *weight = size * random.random_range(-1.0..1.0);
        }
    }
    for (factor, bounds) in bounds.iter().enumerate() {
        supplied.network.readout.bias[factor] = sum_for_one(bounds);
        for weight in &mut supplied.network.readout.weights[factor] {
            *weight = 0.3 * size * random.random_range(-1.0..1.0);
        }
    }
    supplied
}

/// Returns the readout's sum for a factor of 1, by bisection.
fn sum_for_one(bounds: &FactorBounds<f64>) -> f64 {
    let share = (1.0 - bounds.least) / (bounds.most - bounds.least);
    let (mut below, mut above) = (-6.0, 6.0);
    for _ in 0..60 {
        let middle = 0.5 * (below + above);
        if sigmoid(middle) < share { below = middle } else { above = middle }
    }
    below
}

/// Returns the range of an input over some tracks, with a margin. The range of the held torque is its largest possible one.
fn range<const INPUTS: usize>(
    supplied: &NetworkLaw<INPUTS>,
    input: NetworkInput,
    tracks: &[Track],
) -> InputRange<f64> {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for track in tracks {
        if input == NetworkInput::Held {
            most = supplied.law::<f64>(track).largest_held_nm(supplied.network.bounds[1].most);
            least = -most;
            continue;
        }
        for row in 0..track.len() {
            let value = input.at(track, row, 0.0);
            (least, most) = (least.min(value), most.max(value));
        }
    }
    let room = RANGE_MARGIN * 0.5 * (most - least);
    // For a constant column the range is 10 % of its value.
    InputRange::new(least - room, most + room, 1e-9 + 0.1 * most.abs())
}

/// Returns the standard deviation of the torque of some tracks.
fn deviation(tracks: &[Track]) -> f64 {
    let torques = || tracks.iter().flat_map(|track| &track.torque);
    let rows = torques().count().max(1) as f64;
    let mean = torques().sum::<f64>() / rows;
    let squares: f64 = torques().map(|torque| (torque - mean).powi(2)).sum();
    (squares / rows).sqrt().max(f64::MIN_POSITIVE)
}

/// Adam optimiser (Kingma and Ba 2015), with the constants of the paper.
struct Adam {
    mean: Vec<f64>,
    square: Vec<f64>,
    steps: i32,
}

impl Adam {
    fn new(count: usize) -> Self {
        Self { mean: vec![0.0; count], square: vec![0.0; count], steps: 0 }
    }

    fn step(&mut self, weights: &mut [f64], gradient: &[f64], rate: f64) {
        const MEAN: f64 = 0.9;
        const SQUARE: f64 = 0.999;
        let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        if !length.is_finite() {
            return;
        }
        let shortened = (MAX_GRADIENT_NORM / length).min(1.0);
        self.steps += 1;
        let of_mean = 1.0 - MEAN.powi(self.steps);
        let of_square = 1.0 - SQUARE.powi(self.steps);
        let moments = self.mean.iter_mut().zip(&mut self.square);
        for ((weight, gradient), (mean, square)) in weights.iter_mut().zip(gradient).zip(moments) {
            let gradient = *gradient * shortened;
            *mean = MEAN * *mean + (1.0 - MEAN) * gradient;
            *square = SQUARE * *square + (1.0 - SQUARE) * gradient * gradient;
            *weight -= rate * (*mean / of_mean) / ((*square / of_square).sqrt() + 1e-8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_contain_every_run_once() {
        for (count, group_count) in [(12, 3), (7, 2), (3, 3)] {
            let options = TrainOptions { groups: group_count, seed: 5, ..TrainOptions::default() };
            let groups = groups(count, &options);
            assert_eq!(groups.len(), group_count);
            let mut all = groups.concat();
            all.sort_unstable();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
        assert!(groups(2, &TrainOptions::default()).is_empty());
        assert!(groups(9, &TrainOptions { groups: 1, ..TrainOptions::default() }).is_empty());
    }

    #[test]
    fn sum_for_one_gives_factor_of_one() {
        for (least, most) in BOUNDS {
            let bounds = FactorBounds { least, most };
            let factor = least + (most - least) * sigmoid(sum_for_one(&bounds));
            assert!((factor - 1.0).abs() < 1e-9, "{factor}");
        }
    }
}
