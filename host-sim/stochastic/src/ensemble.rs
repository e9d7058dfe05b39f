//! Violation probability of a parameter vector (Ding et al., eq. 2-3).
//!
//! ```text
//! outside(w) = 1 where the model's torque at monitoring time w is outside the data's range, else 0
//! P          = mean of outside(w) over w = 1..W, over all trials
//! ```
//!
//! The paper sums from 0, uses `W` for a set and a count, and gives `outside` the name of the Stribeck curve. Whether a vector
//! violates more than `rho` is often known long before the last trial; [`Ensemble::permits`] then stops with the exact result.

use super::range::Ranges;
use super::trials::{Block, Trial, Trials};
use compensator_core::{FrictionModel, Parameters};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Relative difference below which periods are equal: the clock of a logger rounds.
const SAME_PERIOD: f64 = 0.02;

/// A trial with the data's range along it.
#[derive(Clone, Debug)]
struct MonitoredTrial {
    trial: Trial,
    /// Sample period, s; that of the first trial with a similar one.
    period_s: f64,
    /// Smallest and largest torque at each monitoring time, Nm; `None` at an excluded row.
    ranges: Vec<Option<(f32, f32)>>,
    /// Number of monitoring times with a range.
    watched: usize,
}

/// The trials of a class, with the data's range at each monitoring time.
#[derive(Debug)]
pub struct Ensemble<'a> {
    blocks: &'a [Block],
    trials: Vec<MonitoredTrial>,
    stride: usize,
    watched: usize,
    simulations: AtomicUsize,
}

impl<'a> Ensemble<'a> {
    /// Monitors trials at `times` evenly spaced times each.
    pub fn new(trials: &'a Trials, ranges: &Ranges, times: usize) -> Self {
        let blocks = trials.blocks.as_slice();
        let stride = (trials.rows / times.max(1)).max(1);
        let mut periods: Vec<f64> = Vec::new();
        let mut monitored = |trial: &Trial| {
            let block = &blocks[trial.block];
            let is_like = |other: &&f64| (block.period_s / **other - 1.0).abs() < SAME_PERIOD;
            let known = periods.iter().find(is_like).copied();
            let period_s = known.unwrap_or(block.period_s);
            if known.is_none() {
                periods.push(period_s);
            }
            let range = |row: usize| {
                let at = trial.first + row;
                let (low, high) = ranges.at(block.samples[at].velocity_rad_s);
                let predicted = block.predicted[at];
                block.included[at].then_some((predicted + low, predicted + high))
            };
            // A trial that starts near the end of its block is shorter.
            let rows = trials.rows.min(block.samples.len() - trial.first);
            let rows = (stride - 1..rows).step_by(stride);
            let ranges: Vec<_> = rows.map(range).collect();
            let watched = ranges.iter().flatten().count();
            MonitoredTrial { trial: *trial, period_s, ranges, watched }
        };
        let mut trials: Vec<MonitoredTrial> = trials.trials.iter().map(&mut monitored).collect();
        // A model is built once for each period.
        trials.sort_by(|one, other| one.period_s.total_cmp(&other.period_s));
        let watched = trials.iter().map(|trial| trial.watched).sum();
        Self { blocks, trials, stride, watched, simulations: AtomicUsize::new(0) }
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

    /// Simulates trial by trial. `sink` receives the violations and monitoring times of each and returns false to stop.
    fn run(&self, parameters: &Parameters<f32>, mut sink: impl FnMut(usize, usize) -> bool) {
        let mut built: Option<(f64, FrictionModel<f32>)> = None;
        for trial in &self.trials {
            let (_, model) = match &mut built {
                Some(same) if same.0 == trial.period_s => same,
                built => {
                    let model = parameters.build_unchecked(trial.period_s as f32);
                    built.insert((trial.period_s, model))
                }
            };
            let outside = self.violations(model, trial);
            self.simulations.fetch_add(1, Ordering::Relaxed);
            if !sink(outside, trial.watched) {
                return;
            }
        }
    }

    /// Simulates a trial and returns its violations. NaN is outside of a range.
    fn violations(&self, model: &FrictionModel<f32>, monitored: &MonitoredTrial) -> usize {
        let Trial { block, first, mut state } = monitored.trial;
        let block = &self.blocks[block];
        let mut rescaled = model.clone();
        let mut step = |at: usize| match &block.period_ratio {
            Some(ratios) => {
                rescaled.rescale_period(model, ratios[at]);
                rescaled.step(&mut state, &block.samples[at])
            }
            None => model.step(&mut state, &block.samples[at]),
        };
        let mut violations = 0;
        for (time, range) in monitored.ranges.iter().enumerate() {
            let rows = (first + time * self.stride..).take(self.stride);
            let torque = rows.fold(0.0, |_, at| step(at));
            violations +=
                usize::from(range.is_some_and(|(low, high)| !(low..=high).contains(&torque)));
        }
        violations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id, Sample, TermKind};
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
    fn violation_of_trials_matches_definition() {
        let ranges = Ranges::symmetric(0.22);
        for uneven in [false, true] {
            for parameters in models() {
                let track = track(uneven);
                // With some excluded rows.
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
        let ensemble = Ensemble::new(&trials, &Ranges::symmetric(0.22), 50);
        let mut wild = parameters.convert::<f32>();
        wild.set(Id::ViscousFriction, f32::NAN);
        assert_eq!(ensemble.violation(&wild), 1.0);
    }
}
