//! Inputs of a network in each row, and the friction law whose parameters it scales.

use super::file::CELLS;
use compensator_core::Parameters;
use compensator_core::network::{AugmentedLugre, Network, StrokeRange, StrokeTracker};
use compensator_core::{FrictionModel, Quantity, Real};
use friction_fit::Track;
use joint_log::{Dataset, contract};

/// An input of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkInput {
    /// A covariate, by its index in [`Track::covariates`].
    Covariate(usize),
    /// A quantity of the contract, in its column's unit.
    Quantity(Quantity),
    /// The velocity, rad/s or m/s.
    Velocity,
    /// Bristle torque, the law's own state, Nm or N.
    Held,
    /// None: the value is 0, and the network's weights for it are 0.
    Unused,
}

impl NetworkInput {
    /// Returns the input with this name in a log: `velocity`, `held`, or a column that every run has.
    pub fn named(name: &str, data: &Dataset) -> Option<Self> {
        match (name, data.covariates.iter().position(|column| column == name)) {
            ("velocity", _) => Some(Self::Velocity),
            ("held", _) => Some(Self::Held),
            (_, Some(place)) => Some(Self::Covariate(place)),
            (name, None) => {
                let quantity = known_quantities(data).find(|known| known.name(data.joint) == name);
                quantity.map(Self::Quantity)
            }
        }
    }

    /// Returns the value in a row, at the start of which the bristles hold `held`.
    pub(super) fn at(self, track: &Track, row: usize, held: f64) -> f64 {
        match self {
            Self::Covariate(index) => track.covariates[index][row],
            Self::Quantity(quantity) => {
                let inside = quantity.value_in(&track.samples[row]);
                inside.map_or(f64::NAN, |value| value * quantity.info().outside_scale)
            }
            Self::Velocity => track.samples[row].velocity_rad_s,
            Self::Held => held,
            Self::Unused => 0.0,
        }
    }
}

/// Returns the standard quantities that can be network inputs and are present in every run.
pub(super) fn known_quantities(data: &Dataset) -> impl Iterator<Item = Quantity> {
    let is_logged = |quantity: &Quantity| data.runs.iter().all(|run| run.get(*quantity).is_some());
    contract::covariates().filter(is_logged)
}

/// Travel back that counts as a reversal, m or rad: ten times the integrated velocity noise of the damper in one second at
/// rest.
const REVERSAL_TRAVEL: f64 = 5e-4;

/// Share of the time with the shortest, and with the longest strokes that is not part of the trained range. A test that fades
/// in contains every stroke once.
const IGNORED_STROKE_SHARE: f64 = 0.05;

/// Minimum rate of the law's steps, Hz, for bristles that are stiff in a coarse log.
const MIN_STEP_RATE_HZ: f64 = 512.0;

/// Returns the number of steps of the law per row of a log, given its sample period.
pub fn law_substeps(period_s: f64) -> usize {
    (MIN_STEP_RATE_HZ * period_s).ceil().max(1.0) as usize
}

/// A friction law and the network that scales its parameters.
#[derive(Clone, Debug)]
pub struct NetworkLaw<const INPUTS: usize> {
    /// The law, a `lugre-asymmetric` without terms. The factors multiply its `F_C`, `F_S` and `sigma0`.
    pub base: Parameters<f64>,
    /// Inputs of the network.
    pub inputs: [NetworkInput; INPUTS],
    /// The network.
    pub network: Network<f64, INPUTS, CELLS>,
    /// Range of trained strokes ([`NetworkLaw::set_stroke_range`]); `None` during training.
    pub strokes: Option<StrokeRange<f64>>,
    /// Number of rows between evaluations.
    pub rows_per_evaluation: usize,
    /// Number of steps of the law per row.
    pub substeps: usize,
}

impl<const INPUTS: usize> NetworkLaw<INPUTS> {
    /// Returns the friction law for the steps of a track, in any number type.
    pub(super) fn lugre<T: Real<Setting = T>>(&self, track: &Track) -> AugmentedLugre<T> {
        let period = T::from_f64(track.period_s / self.substeps as f64);
        let model: FrictionModel<T> = self.base.convert::<T>().build_unchecked(period);
        AugmentedLugre::of(&model).expect("a lugre-asymmetric without terms")
    }

    /// Returns the inputs of an evaluation.
    pub(super) fn read(&self, track: &Track, row: usize, held: f64) -> [f64; INPUTS] {
        self.inputs.map(|input| input.at(track, row, held))
    }

    /// Returns the bristle torque at the start of a track: the first measured torque, limited to the level.
    pub(super) fn held_at_start(&self, track: &Track) -> f64 {
        let level = self.lugre::<f64>(track).largest_held_nm(1.0);
        track.torque[0].clamp(-level, level)
    }

    /// Sets the range of trained strokes from these tracks, without the shortest and the longest 5 % by time.
    pub fn set_stroke_range(&mut self, tracks: &[Track]) {
        let Some(first) = tracks.first() else { return };
        let period_s = first.period_s * self.rows_per_evaluation as f64;
        let any = StrokeRange { least: 0.0, most: f64::MAX, reversal: REVERSAL_TRAVEL, period_s };
        let mut lengths = Vec::new();
        for track in tracks {
            let mut stroke = StrokeTracker::default();
            for row in (0..track.len()).step_by(self.rows_per_evaluation) {
                stroke.is_known(track.samples[row].velocity_rad_s, &any);
                lengths.push(stroke.length());
            }
        }
        lengths.sort_by(f64::total_cmp);
        let at = |share: f64| lengths[((lengths.len() - 1) as f64 * share) as usize];
        let (least, most) = (at(IGNORED_STROKE_SHARE), at(1.0 - IGNORED_STROKE_SHARE));
        // The range extends 10 % beyond the longest stroke.
        self.strokes = Some(StrokeRange { least, most: 1.1 * most, ..any });
    }

    /// Returns the velocity in a sub-step of a row, interpolated linearly from the row before.
    pub(super) fn velocity(&self, track: &Track, row: usize, step: usize) -> f64 {
        let (before, now) = (&track.samples[row.saturating_sub(1)], &track.samples[row]);
        let share = (step + 1) as f64 / self.substeps as f64;
        before.velocity_rad_s + (now.velocity_rad_s - before.velocity_rad_s) * share
    }
}
