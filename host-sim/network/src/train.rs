//! Training with Adam and early stopping by cross-validation.
//!
//! A dozen tests are too few for a fixed validation set: the result would depend on the friction level of the chosen runs.
//! The runs are therefore divided into groups. Each group is held out once while the others train, and the mean
//! held-out loss determines the number of passes. Then all runs train for this number of passes. Whole runs are held
//! out, never rows of a run. The same seed gives the same weights on any number of threads: every training has its own
//! random sampler and does not use the time.

use super::adjoint;
use super::error::NetworkError;
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
    pub rows_per_evaluation: usize,
    /// Number of steps of the law per row.
    pub substeps: usize,
    /// Initial learning rate of Adam, which decreases to a fiftieth along half a cosine.
    pub learning_rate: f64,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            epochs: 200,
            groups: 3,
            rows_per_evaluation: 2,
            substeps: 2,
            learning_rate: 0.01,
        }
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
    pub law: NetworkLaw<INPUTS>,
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

/// Changes the seed for the order of the runs, because the initial weights use the seed itself.
const PASS_SEED: u64 = 0x5eed;

/// Changes the seed for the division into groups.
const GROUP_SEED: u64 = 0x6409;

/// Trains a network on some runs.
///
/// # Errors
/// If the loss of the last pass is not finite.
pub fn train<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [NetworkInput; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
    progress: &(dyn Fn(TrainingProgress) + Sync),
) -> Result<TrainedNetwork<INPUTS>, NetworkError> {
    let begin = untrained(base, inputs, tracks, options);
    let all: Vec<usize> = (0..tracks.len()).collect();
    let groups = groups(tracks.len(), options);
    let curves: Vec<Vec<f64>> = groups
        .par_iter()
        .enumerate()
        .map(|(group, held_out)| {
            let learn = all.iter().copied().filter(|run| !held_out.contains(run)).collect();
            let split = RunSplit { learn, held_out, group: Some(group), epochs: options.epochs };
            train_passes(begin.clone(), tracks, split, options, progress).held_out_losses
        })
        .collect();
    let evaluations = curves.iter().map(Vec::len).min().unwrap_or(0);
    let means = (0..evaluations).map(|at| {
        let mean = curves.iter().map(|curve| curve[at]).sum::<f64>() / curves.len() as f64;
        (mean, (at + 1) * EVALUATION_PASSES)
    });
    let best = means.min_by(|(one, _), (other, _)| one.total_cmp(other));
    let epochs = best.map_or(options.epochs, |(_, epochs)| epochs.min(options.epochs));
    let split = RunSplit { learn: all, held_out: &[], group: None, epochs };
    let Descent { law, loss, .. } = train_passes(begin, tracks, split, options, progress);
    // Without any pass there is no loss.
    if epochs > 0 && !loss.is_finite() {
        return Err(NetworkError::Loss(loss));
    }
    Ok(TrainedNetwork { law, epochs, loss, held_out: best.map(|(mean, _)| mean) })
}

/// Training runs, held-out runs and number of passes.
struct RunSplit<'a> {
    learn: Vec<usize>,
    held_out: &'a [usize],
    group: Option<usize>,
    epochs: usize,
}

/// Result of some passes.
struct Descent<const INPUTS: usize> {
    law: NetworkLaw<INPUTS>,
    /// Mean loss of the training runs in the last pass; infinite without any pass.
    loss: f64,
    /// Mean losses of the held-out runs, one per evaluation.
    held_out_losses: Vec<f64>,
}

/// Trains for a number of passes.
fn train_passes<const INPUTS: usize>(
    mut law: NetworkLaw<INPUTS>,
    tracks: &[Track],
    split: RunSplit,
    options: &TrainOptions,
    progress: &(dyn Fn(TrainingProgress) + Sync),
) -> Descent<INPUTS> {
    let mut random = Pcg64Mcg::seed_from_u64(options.seed ^ PASS_SEED);
    let scale = deviation(tracks);
    let mut learn = split.learn;
    let mut weights = Vec::new();
    law.network.for_each_weight(|weight| weights.push(weight));
    let mut adam = Adam::new(weights.len());
    let (mut last_loss, mut held_out_losses) = (f64::INFINITY, Vec::new());
    for epoch in 0..split.epochs {
        // The schedule does not depend on the number of passes, so that a shorter training equals the start of a longer one.
        let share = epoch as f64 / options.epochs as f64;
        let falling = 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
        let rate = options.learning_rate * (FINAL_RATE_SHARE + (1.0 - FINAL_RATE_SHARE) * falling);
        let mut total = 0.0;
        shuffle(&mut learn, &mut random);
        for &run in &learn {
            let mut gradient = vec![0.0; weights.len()];
            total += adjoint::loss(&law, &tracks[run], scale, &mut gradient);
            adam.step(&mut weights, &gradient, rate);
            law.network.set_weights(weights.iter().copied());
        }
        last_loss = total / learn.len().max(1) as f64;
        let is_evaluated = !split.held_out.is_empty() && (epoch + 1) % EVALUATION_PASSES == 0;
        let held_out = is_evaluated.then(|| {
            let losses = split.held_out.iter().map(|run| loss(&law, &tracks[*run], scale));
            losses.sum::<f64>() / split.held_out.len() as f64
        });
        held_out_losses.extend(held_out);
        let (group, epoch) = (split.group, epoch + 1);
        progress(TrainingProgress { group, epoch, loss: last_loss, held_out });
    }
    Descent { law, loss: last_loss, held_out_losses }
}

/// Shuffles the runs (Fisher and Yates).
fn shuffle(runs: &mut [usize], random: &mut Pcg64Mcg) {
    for index in (1..runs.len()).rev() {
        runs.swap(index, random.random_range(0..=index));
    }
}

/// Returns the loss of a run, computed in `f64`.
fn loss<const INPUTS: usize>(law: &NetworkLaw<INPUTS>, track: &Track, scale: f64) -> f64 {
    let run = predict(law, track);
    let squares = run.torque.iter().zip(&track.torque).map(|(s, m)| (s - m).powi(2));
    0.5 * squares.sum::<f64>() / (scale * scale * track.len().max(1) as f64)
}

/// Divides the runs into groups at random. Returns no groups if there are too few runs.
fn groups(count: usize, options: &TrainOptions) -> Vec<Vec<usize>> {
    if options.groups < 2 || count < options.groups.max(3) {
        return Vec::new();
    }
    let mut random = Pcg64Mcg::seed_from_u64(options.seed ^ GROUP_SEED);
    let mut runs: Vec<usize> = (0..count).collect();
    shuffle(&mut runs, &mut random);
    let members = |group: usize| runs.iter().copied().skip(group).step_by(options.groups).collect();
    (0..options.groups).map(members).collect()
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
    let mut law = NetworkLaw {
        base: base.clone(),
        inputs,
        network,
        strokes: None,
        rows_per_evaluation: options.rows_per_evaluation.max(1),
        substeps: options.substeps.max(1),
    };
    law.network.inputs = inputs.map(|input| range(&law, input, tracks));
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    let size = 1.0 / ((INPUTS + CELLS) as f64).sqrt();
    for cell in &mut law.network.lstm.cells {
        // The forget gate starts open, because a gap requires a memory of about ten evaluations.
        cell.bias[0] = 1.0;
        for weight in cell.input.iter_mut().chain(&mut cell.recurrent).flatten() {
            *weight = size * random.random_range(-1.0..1.0);
        }
    }
    for (factor, bounds) in bounds.iter().enumerate() {
        law.network.readout.bias[factor] = sum_for_one(bounds);
        for weight in &mut law.network.readout.weights[factor] {
            *weight = 0.3 * size * random.random_range(-1.0..1.0);
        }
    }
    law
}

/// Returns the readout's sum for a factor of 1, by bisection: [`sigmoid`] is the core's rational approximation, so that the
/// logit is not its inverse.
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
    law: &NetworkLaw<INPUTS>,
    input: NetworkInput,
    tracks: &[Track],
) -> InputRange<f64> {
    let (least, most) = match (input, tracks.first()) {
        // The law's levels alone determine it, so that any track serves.
        (NetworkInput::Held, Some(track)) => {
            let static_factor = &law.network.bounds[1];
            let largest = law.lugre::<f64>(track).largest_held_nm(static_factor.most);
            (-largest, largest)
        }
        _ => {
            let rows =
                tracks.iter().flat_map(|track| (0..track.len()).map(move |row| (track, row)));
            let values = rows.map(|(track, row)| input.at(track, row, 0.0));
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
                (least.min(value), most.max(value))
            })
        }
    };
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
            // One run must not spoil all weights. The loss of its pass shows it.
            return;
        }
        let shortened = (MAX_GRADIENT_NORM / length).min(1.0);
        self.steps += 1;
        let mean_correction = 1.0 - MEAN.powi(self.steps);
        let square_correction = 1.0 - SQUARE.powi(self.steps);
        let moments = self.mean.iter_mut().zip(&mut self.square);
        for ((weight, gradient), (mean, square)) in weights.iter_mut().zip(gradient).zip(moments) {
            let gradient = *gradient * shortened;
            *mean = MEAN * *mean + (1.0 - MEAN) * gradient;
            *square = SQUARE * *square + (1.0 - SQUARE) * gradient * gradient;
            *weight -=
                rate * (*mean / mean_correction) / ((*square / square_correction).sqrt() + 1e-8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id, Sample};

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

    fn base() -> Parameters<f64> {
        Parameters::new(LawKind::LugreAsymmetric)
            .with(Id::CoulombTorque, 9.0)
            .with(Id::StaticTorque, 10.0)
            .with(Id::CoulombTorqueNegative, 7.0)
            .with(Id::StaticTorqueNegative, 9.0)
            .with(Id::StribeckVelocity, 0.04)
            .with(Id::BristleStiffness, 2000.0)
            .with(Id::BristleDamping, 4.0)
            .with(Id::ViscousFriction, 2.0)
    }

    fn run(frequency: f64) -> Track {
        let velocity = |row: usize| 0.1 * (frequency * row as f64 / 128.0).sin();
        let samples = |row| Sample { velocity_rad_s: velocity(row), ..Sample::default() };
        let torque = |row| 9.0 * velocity(row).signum() + (row % 7) as f64;
        Track::even((0..60).map(samples).collect(), (0..60).map(torque).collect(), 1.0 / 128.0)
    }

    fn trained(tracks: &[Track]) -> Result<TrainedNetwork<2>, NetworkError> {
        let options = TrainOptions { epochs: 6, ..TrainOptions::default() };
        let inputs = [NetworkInput::Velocity, NetworkInput::Held];
        train(&base(), inputs, tracks, &options, &|_| {})
    }

    #[test]
    fn weights_are_the_same_on_any_number_of_threads() {
        let tracks = [5.0, 9.0, 14.0, 20.0].map(run);
        let bits = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let trained = pool.install(|| trained(&tracks)).unwrap();
            let mut bits = vec![trained.loss.to_bits(), trained.held_out.unwrap().to_bits()];
            trained.law.network.for_each_weight(|weight| bits.push(weight.to_bits()));
            bits
        };
        assert_eq!(bits(1), bits(4));
    }

    #[test]
    fn loss_that_is_not_finite_is_an_error() {
        let mut tracks = [5.0, 9.0, 14.0].map(run);
        tracks[1].torque[7] = f64::NAN;
        let error = trained(&tracks).unwrap_err().to_string();
        assert_eq!(error, "training: the loss of the last pass is NaN, expected a finite number");
    }
}
