//! Violation probability of a parameter vector (Ding et al., eq. 2-3), computed fast.
//!
//! ```text
//! outside(w) = 1 where the model's torque at monitoring time w is outside the data's range, else 0
//! P          = mean of outside(w) over w = 1..W, over all trials
//! ```
//!
//! The paper sums from 0, uses `W` for a set and a count, and gives `outside` the name of the Stribeck curve. Each step
//! of a trial depends on the step before it, which leaves most of a processor idle. Eight trials are therefore stepped
//! in turn, each with the core's own step. Whether a vector violates more than `rho` is often known long before the last
//! trial; [`Ensemble::permits`] then stops with the exact result.

use super::range::Ranges;
use super::trials::{Block, Trial, Trials};
use compensator_core::{FrictionModel, ModelState, Parameters, Sample};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of trials stepped together.
const LANES: usize = 8;

/// Relative difference below which periods are equal: the clock of a logger rounds.
const SAME_PERIOD: f64 = 0.02;

/// One value for each lane.
type Lanes = [f32; LANES];

/// Trials that are stepped together.
#[derive(Clone, Debug)]
struct Group {
    /// Sample period of all its trials, s.
    period_s: f64,
    /// Number of lanes with a trial.
    trials: usize,
    /// The block of each lane's trial.
    block: [usize; LANES],
    /// First row of each lane's trial in its block.
    first: [usize; LANES],
    /// State of the fitted model at that row.
    state: [ModelState<f32>; LANES],
    /// Ratio of each row's period to the group's. Empty if the rows of all trials are evenly spaced.
    period_ratio: Vec<Lanes>,
    /// Lower limit of the data's range at each monitoring time. In a lane without a trial, and at an excluded row, the range is
    /// infinite, so that the lane is never outside.
    low: Vec<Lanes>,
    /// Upper limit, likewise.
    high: Vec<Lanes>,
    /// Number of monitoring times with a finite range, over all lanes.
    watched: usize,
}

/// The trials of a class, with the data's range at each monitoring time.
#[derive(Debug)]
pub struct Ensemble<'a> {
    blocks: &'a [Block],
    groups: Vec<Group>,
    rows: usize,
    stride: usize,
    watched: usize,
    simulations: AtomicUsize,
}

impl<'a> Ensemble<'a> {
    /// Monitors trials at `times` evenly spaced times each.
    pub fn new(trials: &'a Trials, ranges: &Ranges, times: usize) -> Self {
        let blocks = trials.blocks.as_slice();
        let stride = (trials.rows / times.max(1)).max(1);
        let rows = trials.rows / stride * stride;
        let mut by_period: Vec<(f64, Vec<Trial>)> = Vec::new();
        for trial in &trials.trials {
            let period = blocks[trial.block].period_s;
            let like = |other: f64| (period / other - 1.0).abs() < SAME_PERIOD;
            match by_period.iter_mut().find(|(other, _)| like(*other)) {
                Some((_, own)) => own.push(*trial),
                None => by_period.push((period, vec![*trial])),
            }
        }
        let groups: Vec<Group> = by_period
            .iter()
            .flat_map(|(period_s, own)| own.chunks(LANES).map(|some| (*period_s, some)))
            .map(|(period_s, some)| group(blocks, some, period_s, ranges, rows, stride))
            .collect();
        Self {
            blocks,
            watched: groups.iter().map(|group| group.watched).sum(),
            groups,
            rows,
            stride,
            simulations: AtomicUsize::new(0),
        }
    }

    /// Returns the number of monitoring times of all trials, `W` times the number of trials.
    pub fn watched(&self) -> usize {
        self.watched
    }

    /// Returns the number of simulated trials so far.
    pub fn simulations(&self) -> usize {
        self.simulations.load(Ordering::Relaxed)
    }

    /// Returns the violation probability of a parameter vector.
    pub fn violation(&self, parameters: &Parameters<f32>) -> f64 {
        let mut violations = 0;
        self.run(parameters, |outside, _| {
            violations += outside;
            true
        });
        violations as f64 / self.watched.max(1) as f64
    }

    /// Returns true if the violation probability is at most `most`.
    pub fn permits(&self, parameters: &Parameters<f32>, most: f64) -> bool {
        // The offset compensates for rounding, so that a probability of exactly `most` is permitted.
        let allowed = (most * self.watched as f64 + 1e-6) as usize;
        let (mut violations, mut left) = (0, self.watched);
        self.run(parameters, |outside, watched| {
            violations += outside;
            left -= watched;
            violations <= allowed && violations + left > allowed
        });
        violations <= allowed
    }

    /// Simulates group by group. `sink` receives the violations and monitoring times of each group and returns false to stop.
    fn run(&self, parameters: &Parameters<f32>, mut sink: impl FnMut(usize, usize) -> bool) {
        let mut built: Option<(f64, FrictionModel<f32>)> = None;
        for group in &self.groups {
            let (_, model) = match &mut built {
                Some(same) if same.0 == group.period_s => same,
                built => {
                    let model = parameters.build_unchecked(group.period_s as f32);
                    built.insert((group.period_s, model))
                }
            };
            let outside = violations(model, group, self.blocks, self.rows, self.stride);
            self.simulations.fetch_add(group.trials, Ordering::Relaxed);
            if !sink(outside, group.watched) {
                return;
            }
        }
    }
}

/// Prepares up to [`LANES`] trials of one period.
fn group(
    blocks: &[Block],
    trials: &[Trial],
    period_s: f64,
    ranges: &Ranges,
    rows: usize,
    stride: usize,
) -> Group {
    // Lanes without a trial repeat the last one with an infinite range.
    let of_lane = |lane: usize| &trials[lane.min(trials.len() - 1)];
    let sample = |lane: usize, row: usize| -> &Sample<f32> {
        let trial = of_lane(lane);
        &blocks[trial.block].samples[trial.first + row]
    };
    let is_even = trials.iter().all(|trial| blocks[trial.block].period_ratio.is_none());
    let ratio = |lane: usize, row: usize| -> f32 {
        let trial = of_lane(lane);
        let ratios = blocks[trial.block].period_ratio.as_ref();
        ratios.map_or(1.0, |ratios| ratios[trial.first + row])
    };
    let mut watched = 0;
    let mut bounds = |lane: usize, row: usize| {
        let trial = of_lane(lane);
        let (block, at) = (&blocks[trial.block], trial.first + row);
        match (block.predicted.get(at), block.included.get(at)) {
            (Some(predicted), Some(true)) if lane < trials.len() => {
                watched += 1;
                let (low, high) = ranges.at(sample(lane, row).velocity_rad_s);
                (predicted + low, predicted + high)
            }
            _ => (f32::NEG_INFINITY, f32::INFINITY),
        }
    };
    let (mut low, mut high) = (Vec::new(), Vec::new());
    for row in (stride - 1..rows).step_by(stride) {
        let of_row: [(f32, f32); LANES] = std::array::from_fn(|lane| bounds(lane, row));
        low.push(of_row.map(|bounds| bounds.0));
        high.push(of_row.map(|bounds| bounds.1));
    }
    Group {
        period_s,
        trials: trials.len(),
        block: std::array::from_fn(|lane| of_lane(lane).block),
        first: std::array::from_fn(|lane| of_lane(lane).first),
        state: std::array::from_fn(|lane| of_lane(lane).state),
        period_ratio: (0..if is_even { 0 } else { rows })
            .map(|row| std::array::from_fn(|lane| ratio(lane, row)))
            .collect(),
        low,
        high,
        watched,
    }
}

/// Returns the number of lanes outside their range. NaN counts as outside.
#[inline(always)]
fn outside(torque: &Lanes, low: &Lanes, high: &Lanes) -> usize {
    let inside = |lane: usize| low[lane] <= torque[lane] && torque[lane] <= high[lane];
    (0..LANES).map(|lane| usize::from(!inside(lane))).sum()
}

/// Simulates a model and returns the violations.
fn violations(
    model: &FrictionModel<f32>,
    group: &Group,
    blocks: &[Block],
    rows: usize,
    stride: usize,
) -> usize {
    let mut state = group.state;
    let mut rescaled = model.clone();
    let mut torque = [0.0; LANES];
    let mut violations = 0;
    let rows_of = |lane: usize| group.first[lane]..group.first[lane] + rows;
    let samples: [&[Sample<f32>]; LANES] =
        std::array::from_fn(|lane| &blocks[group.block[lane]].samples[rows_of(lane)]);
    for (time, (low, high)) in group.low.iter().zip(&group.high).enumerate() {
        for row in (time * stride..).take(stride) {
            for lane in 0..LANES {
                let sample = &samples[lane][row];
                torque[lane] = if let Some(ratios) = group.period_ratio.get(row) {
                    rescaled.rescale_period(model, ratios[lane]);
                    rescaled.step(&mut state[lane], sample)
                } else {
                    model.step(&mut state[lane], sample)
                };
            }
        }
        violations += outside(&torque, low, high);
    }
    violations
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id, TermKind};
    use friction_fit::{Resolution, Track};

    fn track(uneven: bool) -> Track {
        let sample = |row: usize| Sample {
            velocity_rad_s: 2.0 * (row as f64 * 0.013).sin(),
            pressure_diff_mpa: 0.1 + 1e-4 * row as f64,
            ..Sample::default()
        };
        let ratio = |row: usize| if row.is_multiple_of(3) { 1.4 } else { 0.8 };
        let torque = (0..2500).map(|row| (row as f64 * 0.013).sin().signum()).collect();
        Track {
            period_ratio: uneven.then(|| (0..2500).map(ratio).collect()),
            weights: (0..2500).map(|row| f64::from(u8::from(row <= 2300))).collect(),
            ..Track::even((0..2500).map(sample).collect(), torque, 0.005)
        }
    }

    fn models() -> [Parameters<f64>; 3] {
        let plain = Parameters::new(LawKind::Lugre)
            .with(Id::StaticTorque, 1.4)
            .with(Id::BristleStiffness, 300.0)
            .with(Id::BristleDamping, 0.5)
            .with(Id::PressureCoulomb, 1e-6);
        let mut improved = plain.clone();
        improved.law = LawKind::ImprovedLugre;
        let mut with_term = plain.clone();
        assert!(with_term.add_term(TermKind::PressureCoulomb));
        [plain, improved, with_term]
    }

    /// Direct implementation of eq. 2 and 3.
    fn by_definition(
        parameters: &Parameters<f32>,
        trials: &Trials,
        ranges: &Ranges,
        stride: usize,
    ) -> (usize, usize) {
        let (mut outside, mut watched) = (0, 0);
        for trial in &trials.trials {
            let block = &trials.blocks[trial.block];
            let model: FrictionModel<f32> = parameters.build_unchecked(block.period_s as f32);
            let mut state = trial.state;
            for row in 0..trials.rows {
                let at = trial.first + row;
                let ratio = block.period_ratio.as_ref().map_or(1.0, |ratios| ratios[at]);
                let torque = model.rescaled(ratio).step(&mut state, &block.samples[at]);
                if (row + 1).is_multiple_of(stride) && block.included[at] {
                    let (low, high) = ranges.at(block.samples[at].velocity_rad_s);
                    let predicted = block.predicted[at];
                    watched += 1;
                    outside += usize::from(!(predicted + low..=predicted + high).contains(&torque));
                }
            }
        }
        (outside, watched)
    }

    #[test]
    fn violation_of_grouped_trials_matches_definition() {
        let ranges = Ranges::of_noise(0.1, 50);
        for uneven in [false, true] {
            for parameters in models() {
                let track = track(uneven);
                // Not a multiple of the lanes, and with some excluded rows.
                let trials = Trials::new(&parameters, &[&track], 21, 200, Resolution::PLAIN, 5);
                let ensemble = Ensemble::new(&trials, &ranges, 50);
                let mut varied = parameters.convert::<f32>();
                assert_eq!(ensemble.violation(&varied), 0.0);
                varied.set(Id::CoulombTorque, 1.15);
                varied.set(Id::BristleStiffness, 100.0);
                let (outside, watched) = by_definition(&varied, &trials, &ranges, 4);
                assert_eq!(ensemble.watched(), watched);
                assert!(watched < 21 * 50 && outside > watched / 20, "{outside} of {watched}");
                let violation = ensemble.violation(&varied);
                assert_eq!(violation, outside as f64 / watched as f64);
                assert_eq!(ensemble.simulations(), 42);
                // The early decision equals the complete one, also close to the limit.
                assert!(ensemble.permits(&varied, violation));
                assert!(!ensemble.permits(&varied, violation - 1.0 / watched as f64));
                assert!(ensemble.permits(&varied, 1.0) && !ensemble.permits(&varied, 0.0));
            }
        }
    }

    #[test]
    fn violation_with_nan_parameter_is_one() {
        let [parameters, ..] = models();
        let track = track(false);
        let trials = Trials::new(&parameters, &[&track], 8, 200, Resolution::PLAIN, 5);
        let ensemble = Ensemble::new(&trials, &Ranges::of_noise(0.1, 50), 50);
        let mut wild = parameters.convert::<f32>();
        wild.set(Id::ViscousFriction, f32::NAN);
        assert_eq!(ensemble.violation(&wild), 1.0);
    }
}
