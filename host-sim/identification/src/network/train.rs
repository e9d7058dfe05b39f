//! Adam over the runs to learn from; the weights kept are the best on runs set apart from them.
//!
//! A dozen tests are few: whole tests are set apart ([`TrainOptions::set_apart`]), never rows of one, and training ends
//! where they have not got better for a while. The same seed gives the same weights: one thread, a generator of its
//! own, no clock.

use super::adjoint;
use super::input::{CELLS, Input, Supplied};
use super::predict::predict;
use crate::fit::Track;
use compensator_core::Parameters;
use compensator_core::network::{FactorBounds, GATES, InputRange, Lstm, Network, Readout, sigmoid};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// How a network is trained.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// The same seed, the same weights.
    pub seed: u64,
    /// Most passes over all runs.
    pub epochs: usize,
    /// Passes without a better loss on the runs set apart after which training ends.
    pub patience: usize,
    /// How many of the runs are set apart; 0 for none, and then the last weights count.
    pub set_apart: usize,
    /// Rows from one evaluation of the network to the next.
    pub every: usize,
    /// Steps of the law in a row.
    pub substeps: usize,
    /// The largest step of Adam, falling to a fiftieth along half a cosine.
    pub rate: f64,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self { seed: 0, epochs: 200, patience: 60, set_apart: 2, every: 2, substeps: 2, rate: 0.01 }
    }
}

/// Where training stands.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Passes made.
    pub epoch: usize,
    /// Mean loss on the runs learned from: half the mean squared error over the torque's variance.
    pub loss: f64,
    /// The same on the runs set apart, where there are any.
    pub set_apart: Option<f64>,
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct Trained<const INPUTS: usize> {
    /// The law and its network.
    pub supplied: Supplied<INPUTS>,
    /// Where training stood when these weights were taken.
    pub at: Progress,
    /// Passes that were made.
    pub epochs: usize,
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

/// Trains a network on some runs.
pub fn train<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [Input; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
    progress: &dyn Fn(Progress),
) -> Trained<INPUTS> {
    let mut supplied = untrained(base, inputs, tracks, options);
    let mut random = Pcg64Mcg::seed_from_u64(options.seed ^ 0x5eed);
    let scale = deviation(tracks);
    let (mut learn, apart) = set_apart(tracks.len(), options, &mut random);
    let mut weights = Vec::new();
    supplied.network.for_each_weight(|weight| weights.push(weight));
    let mut adam = Adam::new(weights.len());
    let mut best: Option<(f64, Vec<f64>, Progress)> = None;
    let mut epochs = 0;
    for epoch in 0..options.epochs {
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
            adam.step(&mut weights, &mut gradient, rate);
            supplied.network.set_weights(weights.iter().copied());
        }
        epochs = epoch + 1;
        let of_apart = (!apart.is_empty()).then(|| {
            let losses = apart.iter().map(|run| loss(&supplied, &tracks[*run], scale));
            losses.sum::<f64>() / apart.len() as f64
        });
        let at = Progress {
            epoch: epochs,
            loss: total / learn.len().max(1) as f64,
            set_apart: of_apart,
        };
        progress(at);
        let judged = of_apart.unwrap_or(-(epochs as f64));
        match &best {
            Some((least, ..)) if *least <= judged => {}
            _ => best = Some((judged, weights.clone(), at)),
        }
        let since = best.as_ref().map_or(0, |(_, _, at)| epochs - at.epoch);
        if since >= options.patience {
            break;
        }
    }
    let (_, weights, at) =
        best.unwrap_or((0.0, weights, Progress { epoch: 0, loss: f64::INFINITY, set_apart: None }));
    supplied.network.set_weights(weights.into_iter());
    Trained { supplied, at, epochs }
}

/// The loss of a run in plain numbers.
fn loss<const INPUTS: usize>(supplied: &Supplied<INPUTS>, track: &Track, scale: f64) -> f64 {
    let run = predict(supplied, track);
    let squares = run.torque.iter().zip(&track.torque).map(|(s, m)| (s - m).powi(2));
    0.5 * squares.sum::<f64>() / (scale * scale * track.len().max(1) as f64)
}

/// Runs to learn from, and runs to end by.
fn set_apart(
    count: usize,
    options: &TrainOptions,
    random: &mut Pcg64Mcg,
) -> (Vec<usize>, Vec<usize>) {
    let mut all: Vec<usize> = (0..count).collect();
    // At least two thirds are learned from.
    let apart = options.set_apart.min(count / 3);
    for index in 0..apart {
        all.swap(index, random.random_range(index..count));
    }
    let learn = all.split_off(apart);
    (learn, all)
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
    let mut supplied = Supplied { base: base.clone(), inputs, network, every, substeps };
    supplied.network.inputs = inputs.map(|input| range(&supplied, input, tracks));
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    let size = 1.0 / ((INPUTS + CELLS) as f64).sqrt();
    for (index, gate) in supplied.network.lstm.cells.iter_mut().flatten().enumerate() {
        // A forget gate that begins open: the memory a gap needs is some ten evaluations.
        gate.bias = if index % GATES == 0 { 1.0 } else { 0.0 };
        for weight in gate.input.iter_mut().chain(&mut gate.recurrent) {
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

    fn step(&mut self, weights: &mut [f64], gradient: &mut [f64], rate: f64) {
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
