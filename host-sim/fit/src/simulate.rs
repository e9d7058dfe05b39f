//! Simulation of the core's model along a track, generic over the number type.
//!
//! A log at 100 Hz or 1 kHz is coarse for a bristle. Backward Euler is a first-order method, and `sigma0` and `sigma1`
//! would absorb its error at the log's own period (at 1 kHz it is 0.5 % of `F_S` in presliding). A simulation
//! may therefore take several sub-steps per sample, with interpolated inputs. It may also be *extrapolated*:
//! two simulations, one with twice the sub-steps of the other, run side by side, and `2 fine - coarse` cancels
//! the first-order error (Richardson extrapolation). Both use the core's step. [`crate::solve`] chooses the
//! resolution.
//!
//! Sub-steps matter only while bristles move. In most rows of most logs the joint slides or rests, and one step is
//! as accurate. `settled` finds these rows, so that an extrapolated simulation costs little more than a plain one.

use super::channel::TrackLowPass;
use super::delayed::undelayed;
use super::settled::Pilot;
use super::stepper::{Stepper, TrackRow, Varying, track_rows};
use super::track::Track;
use compensator_core::adaptation::Gains;
use compensator_core::effect::NoEffect;
use compensator_core::{Parameters, Real};
use joint_log::work::checkpoint_at;
use std::rc::Rc;

/// Step size of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Steps of the core per sample, at least 1; those of the coarser simulation if there are two.
    pub substeps: usize,
    /// If true, a second simulation with twice the sub-steps cancels the first-order error while bristles move.
    pub extrapolated: bool,
}

impl Resolution {
    /// One step per sample, as a driver does at the log's rate.
    pub const PLAIN: Self = Self { substeps: 1, extrapolated: false };

    /// Returns the next finer resolution: extrapolated first, then with twice the sub-steps.
    #[must_use]
    pub fn finer(self) -> Self {
        let substeps = if self.extrapolated { 2 * self.substeps } else { self.substeps };
        Self { substeps, extrapolated: true }
    }
}

/// Simulates a model along a track and passes each row's torque, filtered by the torque's channel, and bristle torque to
/// `sink`. Stops when `sink` returns `false`.
///
/// `held` is the bristle torque at the start, or `None` if the track starts sliding (`initial_state`).
/// Parameters are not validated, because a fit passes through illegal values.
pub fn simulate<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
    held: Option<T>,
    resolution: Resolution,
    mut sink: impl FnMut(usize, T, T) -> bool,
) {
    let Some(mut low_pass) = TrackLowPass::for_torque(track) else {
        return simulate_shaft(parameters, track, held, resolution, sink);
    };
    simulate_shaft(parameters, track, held, resolution, |row, torque, bristle| {
        sink(row, low_pass.filter(row, torque), bristle)
    });
}

/// Simulates a model as [`simulate`] does, with the torque at the shaft, before the torque's channel.
pub fn simulate_shaft<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
    held: Option<T>,
    resolution: Resolution,
    mut sink: impl FnMut(usize, T, T) -> bool,
) {
    let (parameters, delayed) = &undelayed(parameters, track);
    let is_even = track.period_ratio.is_none();
    let has_no_terms = parameters.terms.is_empty();
    if resolution == Resolution::PLAIN && is_even && has_no_terms && delayed.is_none() {
        let mut single = Stepper::new(parameters, track, Varying::of(parameters, track), held, 1);
        // The common case of plain bristles: the law is selected once instead of at each sample.
        if let Some(law) = single.model.law().plain_bristles() {
            let bristle = &mut single.state.bristle_torque_nm;
            for (row, sample) in track.samples.iter().enumerate() {
                checkpoint_at(row);
                let torque = law.step(bristle, T::from_f64(sample.velocity_rad_s), &NoEffect);
                if !sink(row, torque, *bristle) {
                    return;
                }
            }
            return;
        }
    }
    if resolution.extrapolated {
        let mut stepper = ExtrapolatedStepper::new(parameters, track, held, resolution.substeps);
        for row in track_rows(track, delayed.as_deref()) {
            checkpoint_at(row.index);
            let (torque, bristle) = stepper.step(&row);
            if !sink(row.index, torque, bristle) {
                return;
            }
        }
        return;
    }
    let varying = Varying::of(parameters, track);
    let mut stepper = Stepper::new(parameters, track, varying, held, resolution.substeps);
    for row in track_rows(track, delayed.as_deref()) {
        checkpoint_at(row.index);
        let torque = stepper.step(&row);
        if !sink(row.index, torque, stepper.state.bristle_torque_nm) {
            return;
        }
    }
}

/// Simulates a model as [`simulate`] does, with the gains of each row.
pub fn simulate_with_gains(
    parameters: &Parameters<f64>,
    track: &Track,
    held: Option<f64>,
    resolution: Resolution,
    gains: impl Fn(usize) -> Gains<f64>,
    mut sink: impl FnMut(usize, f64, f64),
) {
    let mut low_pass = TrackLowPass::for_torque(track);
    let (written, delayed) = undelayed(parameters, track);
    // The gains are in the order of all terms, with the delay that the simulation removes.
    let scale = |gains: &Gains<f64>| {
        let mut scaled = parameters.with_gains(gains);
        scaled.terms = written.terms.clone();
        scaled
    };
    let mut present = gains(0);
    let scaled = scale(&present);
    let substeps = resolution.substeps;
    let mut plain = Stepper::new(&scaled, track, Varying::of(&scaled, track), held, substeps);
    let mut extrapolated =
        resolution.extrapolated.then(|| ExtrapolatedStepper::new(&scaled, track, held, substeps));
    for row in track_rows(track, delayed.as_deref()) {
        checkpoint_at(row.index);
        let next = gains(row.index);
        if next != present {
            present = next;
            let scaled = scale(&present);
            plain.replace_parameters(&scaled, track);
            if let Some(stepper) = &mut extrapolated {
                stepper.replace_parameters(&scaled, track);
            }
        }
        let (torque, bristle) = match &mut extrapolated {
            Some(stepper) => stepper.step(&row),
            None => (plain.step(&row), plain.state.bristle_torque_nm),
        };
        let torque = low_pass.as_mut().map_or(torque, |filter| filter.filter(row.index, torque));
        sink(row.index, torque, bristle);
    }
}

/// Three simulations of one model: one step per row, and two step sizes for Richardson extrapolation.
struct ExtrapolatedStepper<T: Real> {
    /// Decides how much of a row is taken from the extrapolation.
    pilot: Pilot,
    /// One step per row.
    single: Stepper<T>,
    coarse: Stepper<T>,
    /// Twice the sub-steps of `coarse`.
    fine: Stepper<T>,
    /// True if the last row came from the extrapolation alone.
    was_extrapolated: bool,
}

impl<T: Real<Setting = T>> ExtrapolatedStepper<T> {
    /// Places the simulations at the start of a track; `substeps` are those of the coarser one.
    fn new(parameters: &Parameters<T>, track: &Track, held: Option<T>, substeps: usize) -> Self {
        let varying = Rc::new(Varying::of(parameters, track));
        let stepper = |steps| Stepper::new(parameters, track, Rc::clone(&varying), held, steps);
        Self {
            pilot: Pilot::new(parameters, track, held),
            single: stepper(1),
            coarse: stepper(substeps),
            fine: stepper(2 * substeps),
            was_extrapolated: true,
        }
    }

    /// Replaces the parameters of the same model and keeps its states.
    fn replace_parameters(&mut self, parameters: &Parameters<T>, track: &Track) {
        self.pilot.replace_parameters(&parameters.convert(), track);
        for stepper in [&mut self.single, &mut self.coarse, &mut self.fine] {
            stepper.replace_parameters(parameters, track);
        }
    }

    /// Simulates a row and returns its torque and bristle torque, Nm.
    #[inline(always)]
    fn step(&mut self, row: &TrackRow<T>) -> (T, T) {
        let share = self.pilot.fine_share(row);
        if share > 0.0 && !self.was_extrapolated {
            (self.coarse.state, self.fine.state) = (self.single.state, self.single.state);
        }
        if share < 1.0 && self.was_extrapolated {
            self.single.state = self.fine.state;
            self.single.state.bristle_torque_nm = self.extrapolated_bristle();
        }
        let mut torque = T::zero();
        if share > 0.0 {
            let first = self.coarse.step(row);
            let second = self.fine.step(row);
            torque = second + (second - first);
        }
        if share < 1.0 {
            let plain = self.single.step(row);
            if share > 0.0 {
                let share = T::from_f64(share);
                let bristle = self.extrapolated_bristle();
                let plain_bristle = &mut self.single.state.bristle_torque_nm;
                *plain_bristle = *plain_bristle + (bristle - *plain_bristle) * share;
                torque = plain + (torque - plain) * share;
            } else {
                torque = plain;
            }
        }
        self.was_extrapolated = share >= 1.0;
        let bristle = if self.was_extrapolated {
            self.extrapolated_bristle()
        } else {
            self.single.state.bristle_torque_nm
        };
        (torque, bristle)
    }

    /// Returns the bristle torque without the first-order error, Nm.
    #[inline(always)]
    fn extrapolated_bristle(&self) -> T {
        let [first, second] =
            [&self.coarse, &self.fine].map(|stepper| stepper.state.bristle_torque_nm);
        second + (second - first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use compensator_core::Sample;
    use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
    use compensator_core::{LawKind, ParameterId as Id, TermKind};

    /// Joint with oscillating velocity and a swept auxiliary covariate.
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
    fn simulate_with_lookup_knots_has_derivatives_of_finite_differences() {
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
        // Steps of one size: the mixing weight of an extrapolated simulation has no derivative here.
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
            let shifted = |by: f64| torques(&base.clone().with(*id, base.get(*id) + by));
            let (less, more) = (shifted(-1e-5), shifted(1e-5));
            let mut largest = 0.0f64;
            for (row, dual) in found.iter().enumerate() {
                let slope = (more[row] - less[row]) / 2e-5;
                let difference = (dual.gradient[index] - slope).abs();
                assert!(
                    difference < 1e-5,
                    "{} at {row}: {:?}, {slope}",
                    id.name(),
                    dual.gradient[index]
                );
                largest = largest.max(slope.abs());
            }
            assert!(largest > 0.5, "{}: no row reaches this knot", id.name());
        }
    }

    #[test]
    fn simulate_with_exact_velocity_follows_the_motion_between_rows() {
        /// Rows at rest before the motion.
        const REST: usize = 40;
        let parameters = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::StaticTorque, 2.0)
            .with(Id::StribeckVelocity, 0.05)
            .with(Id::BristleStiffness, 300.0)
            .with(Id::BristleDamping, 3.0);
        // Six rows in a quarter of a period, and a jerk at the start.
        let velocity = |time: f64| if time > 0.0 { 0.1 * (50.0 * time).sin() } else { 0.0 };
        let torques = |rows: usize, period_s: f64, is_exact: bool, substeps: usize| {
            let at = |row: usize| row as f64 * period_s - REST as f64 * 5e-3;
            let sample = |row| Sample { velocity_rad_s: velocity(at(row)), ..Sample::default() };
            let mut track = Track::even((0..rows).map(sample).collect(), vec![0.0; rows], period_s);
            track.velocity_is_exact = is_exact;
            let mut torques = Vec::new();
            let resolution = Resolution { substeps, extrapolated: false };
            simulate(&parameters, &track, Some(0.0), resolution, |_, torque, _| {
                torques.push(torque);
                true
            });
            torques
        };
        let reference: Vec<f64> =
            torques(64 * 400, 5e-3 / 64.0, false, 1).into_iter().step_by(64).collect();
        let error = |torques: &[f64]| {
            let squares =
                torques.iter().zip(&reference).map(|(torque, exact)| (torque - exact).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let [polygon, curve] = [false, true].map(|is_exact| torques(400, 5e-3, is_exact, 64));
        assert!(4.0 * error(&curve) < error(&polygon), "{} {}", error(&curve), error(&polygon));
        assert!(curve[..=REST].iter().all(|torque| *torque == 0.0), "it rests until it starts");
    }
}
