//! Adam over the runs to learn from, for as many passes as runs held out ask for.
//!
//! A dozen tests are few, and two or three of them set apart are a poor judge: which level they happen to have
//! decides. So the runs are parted into groups, each is held out once while the others are learned from, and the
//! mean of what they leave says after how many passes to stop; then all are learned from for that long. Held out are
//! whole runs, never rows of one. The same seed gives the same weights on any number of threads: every
//! training has a generator of its own, and no clock is asked.

use super::adjoint;
use super::file::CELLS;
use super::input::{Input, Supplied};
use super::predict::predict;
use crate::fit::Track;
use compensator_core::Parameters;
use compensator_core::network::{FactorBounds, InputRange, Lstm, Network, Readout, sigmoid};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// How a network is trained.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// The same seed, the same weights.
    pub seed: u64,
    /// Most passes over all runs.
    pub epochs: usize,
    /// Groups of runs, each held out once to say when to stop; below 2 all passes are made.
    pub groups: usize,
    /// Rows from one evaluation of the network to the next.
    pub every: usize,
    /// Steps of the law in a row.
    pub substeps: usize,
    /// The largest step of Adam, falling to a fiftieth along half a cosine.
    pub rate: f64,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self { seed: 0, epochs: 200, groups: 3, every: 2, substeps: 2, rate: 0.01 }
    }
}

/// Where training stands.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The group that is held out; `None` where all runs are learned from.
    pub group: Option<usize>,
    /// Passes made.
    pub epoch: usize,
    /// Mean loss on the runs learned from: half the mean squared error over the torque's variance.
    pub loss: f64,
    /// The same on the group held out, where it was looked at.
    pub held_out: Option<f64>,
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct Trained<const INPUTS: usize> {
    /// The law and its network.
    pub supplied: Supplied<INPUTS>,
    /// Passes after which training was stopped.
    pub epochs: usize,
    /// Mean loss on the runs learned from in the last pass.
    pub loss: f64,
    /// Mean loss on groups held out, at as many passes.
    pub held_out: Option<f64>,
}

/// Bounds of the factors: a level of a fifth to two and a half times the base law's, a stiffness that may all but vanish
/// while a gap is crossed. On the damper's twelve tests the levels span 0.45 to 1.35 of their common one.
const BOUNDS: [(f64, f64); 3] = [(0.2, 2.5), (0.2, 3.0), (0.02, 4.0)];

/// Most a factor moves in an evaluation: across a gap, which takes the damper at 1 Hz some ten of 128 Hz, the
/// stiffness must be able to fall and rise again.
const SLEW: f64 = 0.5;

/// Share the network loses in an evaluation outside: gone after a quarter of a second at 128 Hz.
const FADE: f64 = 1.0 / 32.0;

/// Room around the range seen in training, as a share of its half-width.
const ROOM: f64 = 0.05;

/// Gradients are shortened to this length: a run in which the factors ring would else throw the weights far.
const LONGEST_GRADIENT: f64 = 1.0;

/// The smallest rate, as a share of the largest.
const LAST_RATE: f64 = 0.02;

/// Passes from one look at the runs held out to the next.
const LOOK_EVERY: usize = 5;

/// Trains a network on some runs.
pub fn train<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [Input; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Trained<INPUTS> {
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
    let looks = curves.iter().map(Vec::len).min().unwrap_or(0);
    let means = (0..looks).map(|at| {
        let mean = curves.iter().map(|curve| curve[at]).sum::<f64>() / curves.len() as f64;
        (mean, (at + 1) * LOOK_EVERY)
    });
    let best = means.min_by(|(one, _), (other, _)| one.total_cmp(other));
    let epochs = best.map_or(options.epochs, |(_, epochs)| epochs.min(options.epochs));
    let parts = Parts { learn: all, held_out: &[], group: None, epochs };
    let (supplied, loss, _) = descend(begin, tracks, parts, options, progress);
    Trained { supplied, epochs, loss, held_out: best.map(|(mean, _)| mean) }
}

/// Which runs are learned from, which looked at, and for how many passes.
struct Parts<'a> {
    learn: Vec<usize>,
    held_out: &'a [usize],
    group: Option<usize>,
    epochs: usize,
}

/// Makes the passes; returns the network, the loss of the last pass, and the loss held out at every look.
fn descend<const INPUTS: usize>(
    mut supplied: Supplied<INPUTS>,
    tracks: &[Track],
    parts: Parts,
    options: &TrainOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> (Supplied<INPUTS>, f64, Vec<f64>) {
    let mut random = Pcg64Mcg::seed_from_u64(options.seed ^ 0x5eed);
    let scale = deviation(tracks);
    let mut learn = parts.learn;
    let mut weights = Vec::new();
    supplied.network.for_each_weight(|weight| weights.push(weight));
    let mut adam = Adam::new(weights.len());
    let (mut last, mut curve) = (f64::INFINITY, Vec::new());
    for epoch in 0..parts.epochs {
        // The same schedule whatever is held out: stopped early it is the beginning of the longest.
        let share = epoch as f64 / options.epochs as f64;
        let falling = 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
        let rate = options.rate * (LAST_RATE + (1.0 - LAST_RATE) * falling);
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
        let looks = !parts.held_out.is_empty() && (epoch + 1) % LOOK_EVERY == 0;
        let held_out = looks.then(|| {
            let losses = parts.held_out.iter().map(|run| loss(&supplied, &tracks[*run], scale));
            losses.sum::<f64>() / parts.held_out.len() as f64
        });
        curve.extend(held_out);
        progress(Progress { group: parts.group, epoch: epoch + 1, loss: last, held_out });
    }
    (supplied, last, curve)
}

/// The loss of a run in plain numbers.
fn loss<const INPUTS: usize>(supplied: &Supplied<INPUTS>, track: &Track, scale: f64) -> f64 {
    let run = predict(supplied, track);
    let squares = run.torque.iter().zip(&track.torque).map(|(s, m)| (s - m).powi(2));
    0.5 * squares.sum::<f64>() / (scale * scale * track.len().max(1) as f64)
}

/// The runs parted into groups by lot; none where each could not hold one and leave two.
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

/// A network at the start of training: its ranges those of the tracks, its factors 1.
pub(super) fn untrained<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [Input; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
) -> Supplied<INPUTS> {
    let bounds = BOUNDS.map(|(least, most)| FactorBounds { least, most });
    let network = Network {
        inputs: [InputRange::new(-1.0, 1.0, 0.0); INPUTS],
        lstm: Lstm::zero(),
        readout: Readout::zero(),
        bounds,
        slew: SLEW,
        fade: FADE,
    };
    let (every, substeps) = (options.every.max(1), options.substeps.max(1));
    let mut supplied =
        Supplied { base: base.clone(), inputs, network, strokes: None, every, substeps };
    supplied.network.inputs = inputs.map(|input| range(&supplied, input, tracks));
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    let size = 1.0 / ((INPUTS + CELLS) as f64).sqrt();
    for cell in &mut supplied.network.lstm.cells {
        // A forget gate that begins open: the memory a gap needs is some ten evaluations.
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

/// The readout's sum at which a factor is 1.
fn sum_for_one(bounds: &FactorBounds<f64>) -> f64 {
    let share = (1.0 - bounds.least) / (bounds.most - bounds.least);
    let (mut below, mut above) = (-6.0, 6.0);
    for _ in 0..60 {
        let middle = 0.5 * (below + above);
        if sigmoid(middle) < share { below = middle } else { above = middle }
    }
    below
}

/// The range of an input over some tracks, with room. The held torque's is as far as it can go.
fn range<const INPUTS: usize>(
    supplied: &Supplied<INPUTS>,
    input: Input,
    tracks: &[Track],
) -> InputRange<f64> {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for track in tracks {
        if input == Input::Held {
            most = supplied.law::<f64>(track).largest_held_nm(supplied.network.bounds[1].most);
            least = -most;
            continue;
        }
        for row in 0..track.len() {
            let value = input.at(track, row, 0.0);
            (least, most) = (least.min(value), most.max(value));
        }
    }
    let room = ROOM * 0.5 * (most - least);
    // A column that never moved in training: a tenth of it is as far as it is known.
    InputRange::new(least - room, most + room, 1e-9 + 0.1 * most.abs())
}

/// Standard deviation of the torque of some tracks.
fn deviation(tracks: &[Track]) -> f64 {
    let torques = || tracks.iter().flat_map(|track| &track.torque);
    let rows = torques().count().max(1) as f64;
    let mean = torques().sum::<f64>() / rows;
    let squares: f64 = torques().map(|torque| (torque - mean).powi(2)).sum();
    (squares / rows).sqrt().max(f64::MIN_POSITIVE)
}

/// Adam (Kingma and Ba 2015), with the constants of its paper.
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
        let shortened = (LONGEST_GRADIENT / length).min(1.0);
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
    fn every_run_is_in_one_group() {
        for (count, asked) in [(12, 3), (7, 2), (3, 3)] {
            let options = TrainOptions { groups: asked, seed: 5, ..TrainOptions::default() };
            let groups = groups(count, &options);
            assert_eq!(groups.len(), asked);
            let mut all = groups.concat();
            all.sort_unstable();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
        assert!(groups(2, &TrainOptions::default()).is_empty());
        assert!(groups(9, &TrainOptions { groups: 1, ..TrainOptions::default() }).is_empty());
    }

    #[test]
    fn a_factor_begins_at_one() {
        for (least, most) in BOUNDS {
            let bounds = FactorBounds { least, most };
            let factor = least + (most - least) * sigmoid(sum_for_one(&bounds));
            assert!((factor - 1.0).abs() < 1e-9, "{factor}");
        }
    }
}
