//! What a network is fed with, row by row, and the law it supplies.

use super::file::CELLS;
use crate::fit::Track;
use compensator_core::Parameters;
use compensator_core::network::{AugmentedLugre, Network, Stroke, StrokeRange};
use compensator_core::{Model, Quantity, Real};

/// An input of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A covariate, by its place in [`Track::covariates`].
    Covariate(usize),
    /// A quantity of the contract, in its column's unit.
    Quantity(Quantity),
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
            Self::Quantity(quantity) => {
                let inside = quantity.of_sample(&track.samples[row]);
                inside.map_or(f64::NAN, |value| value * quantity.info().outside_scale)
            }
            Self::Velocity => track.samples[row].velocity_rad_s,
            Self::Held => held,
        }
    }
}

/// Way back that makes a reversal, m or rad: ten times what the damper's velocity noise adds up to in a second at rest.
const REVERSAL: f64 = 5e-4;

/// Share of the time at either end of the strokes that does not count as trained on: a test that fades in has been at
/// every stroke once.
const STROKES_LEFT_OUT: f64 = 0.05;

/// A law and the network that supplies it: what is trained, and what is run.
#[derive(Clone, Debug)]
pub struct Supplied<const INPUTS: usize> {
    /// The law, a `lugre-asymmetric` without terms; its `F_C`, `F_S` and `sigma0` are what the factors multiply.
    pub base: Parameters<f64>,
    /// What the network is fed with.
    pub inputs: [Input; INPUTS],
    /// The network.
    pub network: Network<f64, INPUTS, CELLS>,
    /// The strokes it was trained on ([`Supplied::watch_strokes`]); none while it is trained.
    pub strokes: Option<StrokeRange<f64>>,
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

    /// Takes the strokes of these tracks for those it knows: all but the shortest and the longest twentieth by time.
    pub fn watch_strokes(&mut self, tracks: &[Track]) {
        let Some(first) = tracks.first() else { return };
        let period_s = first.period_s * self.every as f64;
        let any = StrokeRange { least: 0.0, most: f64::MAX, reversal: REVERSAL, period_s };
        let mut lengths = Vec::new();
        for track in tracks {
            let mut stroke = Stroke::default();
            for row in (0..track.len()).step_by(self.every) {
                stroke.is_known(track.samples[row].velocity_rad_s, &any);
                lengths.push(stroke.length());
            }
        }
        lengths.sort_by(f64::total_cmp);
        let at = |share: f64| lengths[((lengths.len() - 1) as f64 * share) as usize];
        let (least, most) = (at(STROKES_LEFT_OUT), at(1.0 - STROKES_LEFT_OUT));
        // The longest are as good as those next to them; beyond a tenth more nothing is known.
        self.strokes = Some(StrokeRange { least, most: 1.1 * most, ..any });
    }

    /// The velocity in a sub-step of a row, on a straight line from the row before.
    pub(super) fn velocity(&self, track: &Track, row: usize, step: usize) -> f64 {
        let (before, now) = (&track.samples[row.saturating_sub(1)], &track.samples[row]);
        let share = (step + 1) as f64 / self.substeps as f64;
        before.velocity_rad_s + (now.velocity_rad_s - before.velocity_rad_s) * share
    }
}
