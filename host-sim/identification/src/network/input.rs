//! What a network is fed with, row by row, and the law it supplies.

use crate::fit::Track;
use compensator_core::Parameters;
use compensator_core::network::{AugmentedLugre, Network};
use compensator_core::{Model, Real};

/// Cells of the recurrent layer.
pub const CELLS: usize = 8;

/// An input of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A covariate, by its place in [`Track::covariates`].
    Covariate(usize),
    /// The velocity, rad/s or m/s.
    Velocity,
    /// The torque the bristles hold: the law's own state, Nm or N.
    Held,
}

impl Input {
    /// Its value in a row before which the bristles hold `held`.
    pub(super) fn at(self, track: &Track, row: usize, held: f64) -> f64 {
        match self {
            Self::Covariate(index) => track.covariates[index][row],
            Self::Velocity => track.samples[row].velocity_rad_s,
            Self::Held => held,
        }
    }
}

/// A law and the network that supplies it: what is trained, and what is run.
#[derive(Clone, Debug)]
pub struct Supplied<const INPUTS: usize> {
    /// The law, a `lugre-asymmetric` without terms; its `F_C`, `F_S` and `sigma0` are what the factors multiply.
    pub base: Parameters<f64>,
    /// What the network is fed with.
    pub inputs: [Input; INPUTS],
    /// The network.
    pub network: Network<f64, INPUTS, CELLS>,
    /// Rows from one evaluation to the next.
    pub every: usize,
    /// Steps of the law in a row.
    pub substeps: usize,
}

impl<const INPUTS: usize> Supplied<INPUTS> {
    /// The law for the steps of a track, in any number.
    pub(super) fn law<T: Real<Setting = T>>(&self, track: &Track) -> AugmentedLugre<T> {
        let period = T::from_f64(track.period_s / self.substeps as f64);
        let model: Model<T> = self.base.convert::<T>().build_unchecked(period);
        AugmentedLugre::of(&model).expect("a lugre-asymmetric without terms")
    }

    /// The inputs of an evaluation.
    pub(super) fn read(&self, track: &Track, row: usize, held: f64) -> [f64; INPUTS] {
        self.inputs.map(|input| input.at(track, row, held))
    }

    /// What the bristles hold where a track begins: the first torque, within the level.
    pub(super) fn held_at_start(&self, track: &Track) -> f64 {
        let level = self.law::<f64>(track).largest_held_nm(1.0);
        track.torque[0].clamp(-level, level)
    }

    /// The velocity in a sub-step of a row, on a straight line from the row before.
    pub(super) fn velocity(&self, track: &Track, row: usize, step: usize) -> f64 {
        let (before, now) = (&track.samples[row.saturating_sub(1)], &track.samples[row]);
        let share = (step + 1) as f64 / self.substeps as f64;
        before.velocity_rad_s + (now.velocity_rad_s - before.velocity_rad_s) * share
    }
}
