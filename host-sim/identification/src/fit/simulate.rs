//! The core's model stepped along a track, in any number.
//!
//! A log at 100 Hz or 1 kHz is coarse for a bristle: backward Euler is first order, and its error at
//! the log's own period would be taken up by `sigma0` and `sigma1` (at 1 kHz it is 0.5 % of `F_S` in
//! presliding). A simulation may therefore take several sub-steps a sample, the inputs following a straight
//! line between samples, and may be *extrapolated*: two simulations, one with twice the sub-steps of the
//! other, go side by side, and `2 fine - coarse` has the first-order error gone (Richardson). Both are the
//! core's step. [`crate::fit::solve`] chooses.
//!
//! Sub-steps are for bristles on the move. Most rows of most logs slide, or rest, where one step is as good;
//! `settled` says where, so that an extrapolated simulation costs little more than a plain one.

use super::channel::LowPass;
use super::delayed::undelayed;
use super::settled::Pilot;
use super::stepper::{Stepper, Varying};
use super::track::Track;
use compensator_core::effect::NoEffect;
use compensator_core::{Parameters, Real};

/// How finely a simulation steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Steps of the core per sample; at least 1. Of the coarser simulation, where there are two.
    pub substeps: usize,
    /// Whether a second simulation with twice the sub-steps takes the first-order error off, where the
    /// bristles move.
    pub extrapolated: bool,
}

impl Resolution {
    /// One step per sample: what a driver does at the log's rate.
    pub const PLAIN: Self = Self { substeps: 1, extrapolated: false };

    /// The next finer one: extrapolated first, then with twice the sub-steps.
    #[must_use]
    pub fn finer(self) -> Self {
        let substeps = if self.extrapolated { 2 * self.substeps } else { self.substeps };
        Self { substeps, extrapolated: true }
    }
}

/// Steps a model along a track and hands each sample's torque to `sink` as the torque's channel shows it, with the
/// bristle torque; stops early where `sink` returns `false`.
///
/// `held` is the bristle torque at the start, or `None` where the track begins sliding
/// ([`super::initial_state`]). Parameters are not checked: a fit passes through illegal values.
pub fn simulate<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
    held: Option<T>,
    resolution: Resolution,
    mut sink: impl FnMut(usize, T, T) -> bool,
) {
    let Some(mut low_pass) = LowPass::of_torque(track) else {
        return simulate_shaft(parameters, track, held, resolution, sink);
    };
    simulate_shaft(parameters, track, held, resolution, |row, torque, bristle| {
        sink(row, low_pass.pass(row, torque), bristle)
    });
}

/// The same with the torque as it is at the shaft, whatever its channel makes of it.
///
/// `held` is the bristle torque at the start, or `None` where the track begins sliding
/// ([`super::initial_state`]). Parameters are not checked: a fit passes through illegal values.
pub fn simulate_shaft<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
    held: Option<T>,
    resolution: Resolution,
    mut sink: impl FnMut(usize, T, T) -> bool,
) {
    let (parameters, delayed) = &undelayed(parameters, track);
    let varying = &Varying::of::<T>(track);
    let mut single = Stepper::new(parameters, track, varying, held, 1);
    let even = track.period_ratio.is_none();
    if resolution == Resolution::PLAIN && even && single.model.is_plain() && delayed.is_none() {
        // The common case of plain bristles, with the law chosen once instead of at each sample.
        if let Some(law) = single.model.law().plain_bristles() {
            let bristle = &mut single.state.bristle_torque_nm;
            for (row, sample) in track.samples.iter().enumerate() {
                let torque = law.step(bristle, T::from_f64(sample.velocity_rad_s), &NoEffect);
                if !sink(row, torque, *bristle) {
                    return;
                }
            }
            return;
        }
    }
    let delayed = |row: usize| delayed.as_ref().map(|v| [v[row.saturating_sub(1)], v[row]]);
    let rows = || {
        let before = track.samples.iter().take(1).chain(&track.samples);
        before.zip(&track.samples).enumerate().map(|(row, (before, sample))| {
            let ratio = track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
            (row, before, sample, ratio)
        })
    };
    if !resolution.extrapolated {
        let mut stepper = Stepper::new(parameters, track, varying, held, resolution.substeps);
        for (row, before, sample, ratio) in rows() {
            let torque = stepper.row(before, sample, delayed(row), ratio);
            if !sink(row, torque, stepper.state.bristle_torque_nm) {
                return;
            }
        }
        return;
    }
    let mut pilot = Pilot::new(parameters, track, held);
    let mut coarse = Stepper::new(parameters, track, varying, held, resolution.substeps);
    let mut fine = Stepper::new(parameters, track, varying, held, 2 * resolution.substeps);
    // Whether the two were the last to step.
    let mut both = true;
    for (row, before, sample, ratio) in rows() {
        let velocities = delayed(row);
        let share = pilot.share_of_fine(before, sample, velocities, ratio);
        if share > 0.0 && !both {
            (coarse.state, fine.state) = (single.state, single.state);
        }
        if share < 1.0 && both {
            single.state = fine.state;
            single.state.bristle_torque_nm = extrapolated_bristle(&coarse, &fine);
        }
        let mut torque = T::zero();
        if share > 0.0 {
            let first = coarse.row(before, sample, velocities, ratio);
            let second = fine.row(before, sample, velocities, ratio);
            torque = second + (second - first);
        }
        if share < 1.0 {
            let plain = single.row(before, sample, velocities, ratio);
            if share > 0.0 {
                let share = T::from_f64(share);
                let bristle = extrapolated_bristle(&coarse, &fine);
                let own = &mut single.state.bristle_torque_nm;
                *own = *own + (bristle - *own) * share;
                torque = plain + (torque - plain) * share;
            } else {
                torque = plain;
            }
        }
        both = share >= 1.0;
        let bristle = if both {
            extrapolated_bristle(&coarse, &fine)
        } else {
            single.state.bristle_torque_nm
        };
        if !sink(row, torque, bristle) {
            return;
        }
    }
}

/// What the bristles hold, the first-order error gone, Nm.
fn extrapolated_bristle<T: Real<Setting = T>>(coarse: &Stepper<T>, fine: &Stepper<T>) -> T {
    let (first, second) = (coarse.state.bristle_torque_nm, fine.state.bristle_torque_nm);
    second + (second - first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use compensator_core::Sample;
    use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
    use compensator_core::{LawKind, ParameterId as Id, TermKind};

    /// A joint moving to and fro while its auxiliary covariate sweeps.
    fn track() -> Track {
        let at = |row: usize| row as f64 * 5e-3;
        let sample = |row| Sample {
            velocity_rad_s: (2.0 * at(row)).sin(),
            auxiliary: 10.0 * (0.7 * at(row)).cos(),
            ..Sample::default()
        };
        Track::even((0..2000).map(sample).collect(), vec![0.0; 2000], 5e-3)
    }

    #[test]
    fn knots_of_the_unknown_term_have_the_slopes_differences_have() {
        let mut base = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::StaticTorque, 2.0)
            .with(Id::BristleStiffness, 300.0)
            .with(Id::LookupColumn, 7.0)
            .with(Id::LookupLower, -8.0)
            .with(Id::LookupUpper, 9.0);
        assert!(base.add_term(TermKind::LookupTable));
        let knots: Vec<Id> = LOOKUP_TORQUES.into_iter().chain(LOOKUP_LEVELS).collect();
        for (index, id) in knots.iter().enumerate() {
            base.set(*id, 0.05 * (index as f64 * 1.7).sin());
        }
        let track = track();
        // Steps of one size: how rows of one step and of many mix has no derivative here.
        let resolution = Resolution { substeps: 2, extrapolated: false };
        let torques = |parameters: &Parameters<f64>| {
            let mut torques = Vec::new();
            simulate(parameters, &track, Some(0.0), resolution, |_, torque, _| {
                torques.push(torque);
                true
            });
            torques
        };
        let mut dual = base.convert::<Dual<12>>();
        for (index, id) in knots.iter().enumerate() {
            dual.set(*id, Dual::parameter(base.get(*id), index));
        }
        let mut found = Vec::new();
        simulate(&dual, &track, Some(Dual::default()), resolution, |_, torque, _| {
            found.push(torque);
            true
        });
        for (index, id) in knots.iter().enumerate() {
            let moved = |by: f64| torques(&base.clone().with(*id, base.get(*id) + by));
            let (less, more) = (moved(-1e-5), moved(1e-5));
            let mut largest = 0.0f64;
            for (row, dual) in found.iter().enumerate() {
                let slope = (more[row] - less[row]) / 2e-5;
                let apart = (dual.gradient[index] - slope).abs();
                assert!(
                    apart < 1e-5,
                    "{} at {row}: {:?}, {slope}",
                    id.name(),
                    dual.gradient[index]
                );
                largest = largest.max(slope.abs());
            }
            assert!(largest > 0.5, "{}: a knot no row passes tests nothing", id.name());
        }
    }
}
