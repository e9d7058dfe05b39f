//! The core's model stepped along a track, in any number.
//!
//! A log at 100 Hz or 1 kHz is coarse for a bristle: backward Euler is first order, and its error at
//! the log's own period would be taken up by `sigma0` and `sigma1` (at 1 kHz it is 0.5 % of `F_S` in
//! presliding). A simulation may therefore take several sub-steps a sample, the inputs following a straight
//! line between samples, and may be *extrapolated*: two simulations, one with twice the sub-steps of the
//! other, go side by side, and `2 fine - coarse` has the first-order error gone (Richardson). Both are the
//! core's step. [`crate::fit::solve`] chooses.

use super::track::Track;
use super::warmth::heat;
use compensator_core::effect::NoEffect;
use compensator_core::{Model, ParameterId, Parameters, Real, Sample, State, TermKind};

/// How finely a simulation steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Steps of the core per sample; at least 1. Of the coarser simulation, where there are two.
    pub substeps: usize,
    /// Whether a second simulation with twice the sub-steps takes the first-order error off.
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

/// A model on its way along a track.
struct Stepper<T: Real> {
    model: Model<T>,
    /// The model for the sample period at hand, where periods vary.
    rescaled: Model<T>,
    ratio: f64,
    state: State<T>,
    substeps: usize,
}

impl<T: Real<Setting = T>> Stepper<T> {
    fn new(parameters: &Parameters<T>, track: &Track, held: Option<T>, substeps: usize) -> Self {
        let period = T::from_f64(track.period_s / substeps as f64);
        let model: Model<T> = parameters.build_unchecked(period);
        let held = held.unwrap_or_else(|| sliding(&model, track));
        let state = State::holding(held).warmed(heat(parameters, track));
        Self { rescaled: model.clone(), model, ratio: 1.0, state, substeps }
    }

    fn row(
        &mut self,
        before: &Sample<f64>,
        sample: &Sample<f64>,
        delayed: Option<[T; 2]>,
        ratio: f64,
    ) -> T {
        if ratio != self.ratio {
            self.ratio = ratio;
            self.rescaled.rescale_period(&self.model, T::from_f64(ratio));
        }
        let mut torque = T::zero();
        for step in 1..=self.substeps {
            let mut input = between(before, sample, step, self.substeps);
            if let Some([from, to]) = delayed {
                let share = T::from_f64(step as f64 / self.substeps as f64);
                input.velocity_rad_s = from + (to - from) * share;
            }
            torque = self.rescaled.step(&mut self.state, &input);
        }
        torque
    }
}

/// Steps a model along a track and hands each sample's torque to `sink`, with the bristle torque;
/// stops early where `sink` returns `false`.
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
    let (parameters, delayed) = &undelayed(parameters, track);
    let mut coarse = Stepper::new(parameters, track, held, resolution.substeps);
    let even = track.period_ratio.is_none();
    if resolution == Resolution::PLAIN && even && coarse.model.is_plain() && delayed.is_none() {
        // The common case of plain bristles, with the law chosen once instead of at each sample.
        if let Some(law) = coarse.model.law().plain_bristles() {
            let bristle = &mut coarse.state.bristle_torque_nm;
            for (row, sample) in track.samples.iter().enumerate() {
                let torque = law.step(bristle, T::from_f64(sample.velocity_rad_s), &NoEffect);
                if !sink(row, torque, *bristle) {
                    return;
                }
            }
            return;
        }
    }
    let mut fine = resolution
        .extrapolated
        .then(|| Stepper::new(parameters, track, held, 2 * resolution.substeps));
    let mut before = track.samples[0];
    for (row, sample) in track.samples.iter().enumerate() {
        let ratio = track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
        let velocities = delayed.as_ref().map(|v| [v[row.saturating_sub(1)], v[row]]);
        let mut torque = coarse.row(&before, sample, velocities, ratio);
        let mut bristle = coarse.state.bristle_torque_nm;
        if let Some(fine) = &mut fine {
            let finer = fine.row(&before, sample, velocities, ratio);
            torque = finer + (finer - torque);
            bristle = fine.state.bristle_torque_nm + (fine.state.bristle_torque_nm - bristle);
        }
        if !sink(row, torque, bristle) {
            return;
        }
        before = *sample;
    }
}

/// The model without its delay, and the delayed velocities, if it has one.
///
/// The driver's delay line counts its own steps. A log is stepped at another rate, and finer where that is
/// needed, so here the delay is in time: the velocity `d` ago on the straight line between samples, the
/// first one before the track began.
fn undelayed<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
) -> (Parameters<T>, Option<Vec<T>>) {
    if !parameters.terms.contains(&TermKind::ChannelDelay) {
        return (parameters.clone(), None);
    }
    let mut plain = parameters.clone();
    plain.terms.retain(|term| *term != TermKind::ChannelDelay);
    let delay = parameters.get(ParameterId::ChannelDelay);
    let ratio = |row: usize| track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
    let mut time = 0.0;
    let times: Vec<f64> = (0..track.len())
        .map(|row| {
            time += if row > 0 { track.period_s * ratio(row) } else { 0.0 };
            time
        })
        .collect();
    let velocity = |row: usize| T::from_f64(track.samples[row].velocity_rad_s);
    let mut earlier = 0;
    let delayed = times
        .iter()
        .map(|time| {
            let then = time - delay.value();
            while earlier + 1 < times.len() && times[earlier + 1] <= then {
                earlier += 1;
            }
            if then <= 0.0 || earlier + 1 == times.len() {
                return velocity(earlier);
            }
            let step = times[earlier + 1] - times[earlier];
            let share = (T::from_f64(time - times[earlier]) - delay) * T::from_f64(1.0 / step);
            velocity(earlier) + (velocity(earlier + 1) - velocity(earlier)) * share
        })
        .collect();
    (plain, Some(delayed))
}

/// The bristle torque of a joint that slides where the track begins: the Coulomb level.
fn sliding<T: Real<Setting = T>>(model: &Model<T>, track: &Track) -> T {
    let coulomb = model.law().sliding_torque();
    coulomb.copy_sign(T::from_f64(track.samples[0].velocity_rad_s))
}

/// The sample a share `step/steps` of the way from `before` to `now`, in the number of the model.
#[inline(always)]
fn between<T: Real>(
    before: &Sample<f64>,
    now: &Sample<f64>,
    step: usize,
    steps: usize,
) -> Sample<T> {
    let share = step as f64 / steps as f64;
    let on_line = |from: f64, to: f64| {
        T::from_f64(if step == steps { to } else { from + (to - from) * share })
    };
    Sample {
        position_trust: T::from_f64(now.position_trust),
        radial_force_change_n: T::from_f64(now.radial_force_change_n / steps as f64),
        lookup_trust: T::from_f64(now.lookup_trust),
        ..before.zip(now, on_line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
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
        let resolution = Resolution::PLAIN.finer();
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
