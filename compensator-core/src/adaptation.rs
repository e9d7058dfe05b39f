//! Adaptation: gains on the sizes of a model that follow the joint.
//!
//! A seal wears, warms, and is replaced. The tuned set is then wrong by a factor, long before its structure is. This module
//! learns that factor for the levels, for the viscous friction and for each term ([`Gains`]), from the torque that drives
//! the joint beyond its inertia:
//!
//! * **Regression**: While the joint slides, the torque of a window is compared with the steady torque of the law. The
//!   regressors are differences of the law itself, with one gain changed, so every law and term is covered. One more
//!   unknown, a constant torque, takes up what does not depend on the direction of motion; it is not compensated.
//! * **Least squares** in square-root form, which forgets only what new data replaces (see `information`).
//! * **Frozen** at rest, near a reversal, at a fault or a limit, with missing or implausible inputs, during a contact, and
//!   after arming ([`Frozen`]).
//! * **Dead zone**: The structure of every law is wrong by some percent. Changes below this leave the tuned set in use.
//! * **Bounds**: The estimate is projected into a box around the tuned set. The gains in use follow it with a limited rate.
//!
//! # Proof that every path in the box is safe
//!
//! Let `B` be the box, and `L` the largest level of a model with gains in `B` within its envelope. Levels are products of
//! gains and written sizes, so the extremes are at corners of `B`, and a set is used only if
//! [`Parameters::validate`] accepts it.
//! 1. A step of a bristle law limits its state to the level of *its own* gains, for every earlier state. Hence
//!    `|y| <= L` after every step, on every path of gains, for jumps too.
//! 2. The bristle rate `(g v - |v| y) / (g + s |v|)` with `|y| <= L` is at most `2 L / s`, and at most `2 L |v| / g`. The
//!    law's torque is then at most `L + sigma1 2 L / s + sigma2 |v|` with the largest `sigma2` of `B`.
//! 3. The compensator limits torque and slew after the model. So its output has the bounds of the tuned set.
//! 4. While it learns, the gains in use rise by at most `slew_per_s`, and fall ten times as fast. Only *off*
//!    jumps to the set, which 1 to 3 cover.
//!
//! Torque is bounded, work is not: gains above the friction of the joint let it drive itself. So they fall faster than they
//! rise, also where nothing is learnt: beyond the envelope, and in a contact after which the joint needs less torque. The
//! driver bounds the work (`firmware::driver::passivity`).
//!
//! The tests draw paths and check 1 to 3 in `f32` and fixed point.

mod contact;
mod evidence;
mod gains;
mod information;
mod parameters;
#[cfg(all(test, feature = "terms"))]
mod tests;
mod unknowns;

pub use evidence::{FOLLOWED, FollowedQuantity};
pub use gains::{Gains, MAX_GAINS};
pub use parameters::{AdaptationParameters, Frozen};

use crate::model::{FrictionModel, ModelState};
use crate::number::Real;
use crate::parameter::ParameterId;
use crate::parameters::{ParameterError, Parameters};
use crate::quantity::Sample;
use contact::ContactWatch;
use evidence::Evidence;
use information::InformationRoot;
use unknowns::{DIMENSIONS, GAINS_AT, OFFSET, gains_of, unknowns_of};

/// Change of a gain for its regressor.
const STEP: f32 = 0.125;

/// Factor of the sample period at which a bristle law reaches its steady torque in one step: the travel of the step is then
/// thousands of times the presliding travel of any joint that moves.
const STEADY_RATIO: f32 = 1e6;

/// Duration of a window, s. Its samples count as one observation.
const WINDOW_S: f32 = 0.05;

/// Largest share of the information that one window replaces.
const MAX_FORGOTTEN: f32 = 0.5;

/// Time for which errors are alike, s: that of a stroke in a range of speed where the structure of the law is wrong. The
/// windows of this time together count as one observation of the noise.
const CORRELATED_S: f32 = 1.0;

/// Standard deviation of the gains before anything is learnt, and of the gains in use around the tuned set.
const PRIOR_DEVIATION: f32 = 0.3;

/// Standard deviation of the constant torque before anything is learnt, as a share of the Coulomb level. It is larger than
/// that of the gains: a payload is more likely than a new seal.
const PRIOR_OFFSET_DEVIATION: f32 = 0.6;

/// Largest error of one window in the estimate, in units of the present scatter.
const MAX_ERROR: f32 = 3.0;

/// Share of a window in the scatter of the errors.
const SCATTER_SHARE: f32 = 0.02;

/// Difference between the dynamic and the steady torque below which the bristles count as saturated, as a share of the
/// steady torque.
const SATURATED_SHARE: f32 = 0.05;

/// Effect of a gain on the torque below which the tuned set applies, as a share of the level: the usual error of a law's
/// structure.
const ZONE: f32 = 0.04;

/// Change of the level below which the tuned level applies: downwards and upwards. A level that is too high by the first is
/// still below the friction, because the compensation has a scale of 0.9. A level that is too low costs more.
const LEVEL_ZONE: [f32; 2] = [0.05, 0.02];

/// Standard deviation of a gain that is kept.
const FIXED_DEVIATION: f32 = 1e-3;

/// Fall of a gain in use per rise: too little compensation costs accuracy, too much moves the joint.
const FALL_FACTOR: f32 = 10.0;

/// Result of one sample of the joint.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Guarded values of the model's inputs.
    pub sample: Sample<f32>,
    /// Torque that drives the joint, less inertia and known load, Nm.
    pub torque_nm: f32,
    /// Measured values of [`FOLLOWED`], each in any unit; `None` without a sensor.
    pub followed: [Option<f32>; FOLLOWED.len()],
    /// Reason of the caller to learn nothing from this sample.
    pub blocked: Option<Frozen>,
}

/// Sums of a window.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    regressors: [f32; DIMENSIONS],
    error_nm: f32,
    level_nm: f32,
    samples: u16,
}

/// Learns the gains of one joint.
#[derive(Clone, Debug)]
pub struct Adaptation {
    parameters: AdaptationParameters,
    written: Parameters<f32>,
    base: FrictionModel<f32>,
    work: FrictionModel<f32>,
    state: ModelState<f32>,
    period_s: f32,
    window_samples: u16,
    /// Share of the information that a row retains in its direction.
    retained: f32,
    /// Number of unknowns.
    count: usize,
    information: InformationRoot,
    /// Gains, and the constant torque in units of `offset_nm`.
    estimate: [f32; DIMENSIONS],
    offset_nm: f32,
    /// Gains in use.
    gains: Gains<f32>,
    /// Mean square of the windows' errors, Nm^2.
    scatter_nm2: f32,
    /// Mean effect of a change of each unknown by 1, Nm.
    effects: [f32; DIMENSIONS],
    window: Window,
    /// Contacts in negative and in positive direction.
    contacts: [ContactWatch; 2],
    evidence: Evidence,
    direction: f32,
    /// Time of sliding in the present direction, s.
    sliding_s: f32,
    /// Time since the reason of the caller ended, s.
    free_s: f32,
    frozen: Frozen,
    /// Time of sliding that was learnt from, s.
    learnt_s: f32,
}

impl Adaptation {
    /// Builds an adaptation that starts at the tuned set, for a period of its samples, s.
    ///
    /// # Errors
    /// As [`AdaptationParameters::validate`] and [`Parameters::build`].
    #[inline(never)]
    pub fn build(
        written: &Parameters<f32>,
        parameters: &AdaptationParameters,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        parameters.validate()?;
        let base = written.build::<f32>(period_s)?;
        let count = 1 + 2 + written.terms.len();
        let noise_nm = parameters.noise_nm;
        let window_samples = (WINDOW_S / period_s + 0.5).at_least(1.0) as u16;
        // A window of a slow log is one sample, which may be longer than the memory.
        let window_s = f32::from(window_samples) * period_s;
        let forgotten = (window_s / parameters.memory_s).at_most(MAX_FORGOTTEN);
        Ok(Self {
            parameters: *parameters,
            written: written.clone(),
            // Built anew: a copy of its fields would take more code.
            work: written.build_unchecked(period_s),
            base,
            state: ModelState::default(),
            period_s,
            window_samples,
            retained: 1.0 - forgotten,
            count,
            information: prior_information(count),
            estimate: unknowns_of(&Gains::default()),
            offset_nm: written.get(ParameterId::CoulombTorque),
            gains: Gains::default(),
            scatter_nm2: noise_nm * noise_nm,
            effects: [0.0; DIMENSIONS],
            window: Window::default(),
            contacts: Default::default(),
            evidence: Evidence::default(),
            direction: 0.0,
            sliding_s: 0.0,
            free_s: 0.0,
            frozen: Frozen::Standstill,
            learnt_s: 0.0,
        })
    }

    /// Forgets everything that was learnt: the estimate is the tuned set. The gains in use return to it when the joint
    /// slides again.
    pub fn reset(&mut self) {
        self.information = prior_information(self.count);
        self.estimate = unknowns_of(&Gains::default());
        self.scatter_nm2 = self.parameters.noise_nm * self.parameters.noise_nm;
        self.evidence = Evidence::default();
        self.learnt_s = 0.0;
    }

    /// Begins a new stretch of samples, after a gap in time: keeps what was learnt, and discards the present window and
    /// contact. `state` is that of the model at the first sample.
    pub fn resume(&mut self, state: ModelState<f32>) {
        self.state = state;
        self.contacts = Default::default();
        self.direction = 0.0;
        self.free_s = 0.0;
        self.freeze(Frozen::Standstill);
    }

    /// Returns the quantity that the learnt level follows, if the model does not use it: a term of it would explain more
    /// than a level that is learnt anew.
    pub fn followed(&self) -> Option<FollowedQuantity> {
        self.evidence.followed(&self.written)
    }

    /// Returns the gains in use.
    pub fn gains(&self) -> &Gains<f32> {
        &self.gains
    }

    /// Returns the standard deviations of the gains, in the order of [`Gains::to_array`].
    #[inline(never)]
    pub fn deviations(&self) -> [f32; MAX_GAINS] {
        gains_of(&self.information.deviations()).to_array()
    }

    /// Returns why nothing is learnt at present.
    pub fn frozen(&self) -> Frozen {
        self.frozen
    }

    /// Returns the time of sliding that was learnt from, s.
    pub fn learnt_s(&self) -> f32 {
        self.learnt_s
    }

    /// Returns the torque that does not depend on the direction of motion, Nm: a payload, gravity or a sensor offset.
    pub fn constant_torque_nm(&self) -> f32 {
        self.estimate[OFFSET] * self.offset_nm
    }

    /// Returns the written parameters with the gains in use.
    pub fn learnt_parameters(&self) -> Parameters<f32> {
        self.written.with_gains(&self.gains)
    }

    /// Processes one sample. Returns true if the gains in use have changed.
    pub fn step(&mut self, observation: &Observation) -> bool {
        let sample = &observation.sample;
        let reason = observation.blocked.or_else(|| self.implausible(observation));
        if let Some(reason) = reason {
            if reason.restarts() {
                self.free_s = 0.0;
                self.contacts = Default::default();
            }
            self.freeze(reason);
            if !matches!(reason, Frozen::Inputs) {
                self.advance(sample);
            }
            let is_held = matches!(reason, Frozen::Off | Frozen::Hold | Frozen::NotArmed);
            return !is_held && self.is_too_fast(sample) && self.retreat(self.period_s);
        }
        self.free_s += self.period_s;
        let dynamic_nm = self.advance(sample);
        if self.free_s < self.parameters.settle_s {
            self.freeze(Frozen::Settling);
            return false;
        }
        if !self.slides(sample.velocity_rad_s) {
            self.freeze(Frozen::Standstill);
            return false;
        }
        self.observe(sample, observation.torque_nm, dynamic_nm);
        self.window.samples >= self.window_samples && self.close_window(&observation.followed)
    }

    #[inline(never)]
    fn implausible(&self, observation: &Observation) -> Option<Frozen> {
        let sample = &observation.sample;
        let mut is_finite = observation.torque_nm.is_finite();
        let _ = sample.map(|value| is_finite &= value.is_finite());
        (!is_finite || self.is_too_fast(sample)).then_some(Frozen::Inputs)
    }

    /// Returns true beyond the speeds of the set.
    fn is_too_fast(&self, sample: &Sample<f32>) -> bool {
        Real::abs(sample.velocity_rad_s) > self.written.envelope.velocity_max_rad_s
    }

    fn freeze(&mut self, reason: Frozen) {
        self.frozen = reason;
        self.window = Window::default();
        self.sliding_s = 0.0;
    }

    /// Advances the state of the model with the present estimate. Returns its friction torque, Nm.
    #[inline(never)]
    fn advance(&mut self, sample: &Sample<f32>) -> f32 {
        self.work.set_gains(&self.base, &self.gains);
        self.work.step(&mut self.state, sample)
    }

    /// Returns true if the joint has slid in one direction for long enough that its bristles are saturated.
    fn slides(&mut self, velocity_rad_s: f32) -> bool {
        let direction = velocity_rad_s.sign();
        let is_fast = Real::abs(velocity_rad_s) > self.parameters.least_velocity_rad_s;
        if !is_fast || direction != self.direction {
            self.direction = if is_fast { direction } else { 0.0 };
            return false;
        }
        true
    }

    /// Returns the steady torque with these unknowns, Nm.
    fn steady_nm(&mut self, unknowns: &[f32; DIMENSIONS], sample: &Sample<f32>) -> f32 {
        let gains = gains_of(unknowns);
        self.work.set_gains(&self.base, &gains);
        self.work.law.rescale_period(&self.base.law, STEADY_RATIO);
        let mut state = self.state;
        self.work.step(&mut state, sample)
    }

    /// Adds a sliding sample to the window.
    #[inline(never)]
    fn observe(&mut self, sample: &Sample<f32>, torque_nm: f32, dynamic_nm: f32) {
        let mut unknowns = self.estimate;
        let steady_nm = self.steady_nm(&unknowns, sample);
        let present_nm = self.steady_nm(&unknowns_of(&self.gains), sample);
        self.sliding_s += self.period_s;
        let is_saturated =
            Real::abs(dynamic_nm - present_nm) <= SATURATED_SHARE * Real::abs(present_nm);
        if self.sliding_s < self.parameters.reversal_s || !is_saturated {
            self.frozen = Frozen::Reversal;
            self.window = Window::default();
            return;
        }
        for index in 0..self.count {
            let regressor = if index == OFFSET {
                self.offset_nm
            } else {
                unknowns[index] = self.estimate[index] + STEP;
                let changed_nm = self.steady_nm(&unknowns, sample);
                unknowns[index] = self.estimate[index];
                (changed_nm - steady_nm) / STEP
            };
            self.window.regressors[index] += regressor;
        }
        self.window.error_nm += torque_nm - steady_nm - self.constant_torque_nm();
        self.window.level_nm += Real::abs(steady_nm);
        self.window.samples += 1;
    }

    /// Learns from a complete window. Returns true if the gains in use have changed.
    #[inline(never)]
    fn close_window(&mut self, followed: &[Option<f32>; FOLLOWED.len()]) -> bool {
        let window = core::mem::take(&mut self.window);
        let share = 1.0 / f32::from(window.samples.max(1));
        let noise_nm = self.parameters.noise_nm;
        let error_nm = window.error_nm * share;
        let duration_s = f32::from(window.samples) * self.period_s;
        let contact = &mut self.contacts[usize::from(self.direction > 0.0)];
        if contact.step(error_nm, window.level_nm * share, noise_nm, duration_s) {
            self.frozen = Frozen::Contact;
            return error_nm * self.direction < 0.0 && self.retreat(duration_s);
        }
        let scatter_nm = libm::sqrtf(self.scatter_nm2);
        let limited_nm = error_nm.within(MAX_ERROR * scatter_nm);
        let square = error_nm.within(2.0 * MAX_ERROR * scatter_nm);
        self.scatter_nm2 += SCATTER_SHARE * (square * square - self.scatter_nm2);
        self.scatter_nm2 = self.scatter_nm2.at_least(noise_nm * noise_nm);
        for (effect, sum) in self.effects.iter_mut().zip(&window.regressors) {
            *effect += (1.0 - self.retained) * (Real::abs(*sum) * share - *effect);
        }
        let weight = libm::sqrtf(duration_s / CORRELATED_S) / noise_nm;
        let mut row = window.regressors;
        row.iter_mut().for_each(|sum| *sum *= share * weight);
        self.learn(&row, limited_nm * weight);
        self.learnt_s += duration_s;
        self.evidence.step(self.estimate[GAINS_AT], followed, duration_s);
        self.follow(self.parameters.slew_per_s * duration_s)
    }

    #[inline(never)]
    fn learn(&mut self, row: &[f32; DIMENSIONS], error: f32) {
        self.information.forget(row, self.retained);
        let change = self.information.update(row, error);
        if !self.information.is_regular() {
            self.reset();
            return;
        }
        let [least, most] = [self.parameters.least_gain, self.parameters.largest_gain];
        for (index, (unknown, change)) in self.estimate.iter_mut().zip(change).enumerate() {
            let bounds = if index == OFFSET { [-MAX_OFFSET, MAX_OFFSET] } else { [least, most] };
            *unknown = (*unknown + change).at_least(bounds[0]).at_most(bounds[1]);
        }
    }

    /// Returns the estimate, with gains near the tuned set replaced by those of the tuned set.
    ///
    /// The structure of a law is wrong by some percent, by other values in other motions. Gains that fit these errors make
    /// the compensation worse. So every gain has a guess, and a dead zone in units of its effect on the torque. What a dead
    /// zone removes from one gain, the data give to the level. The information itself does not contain the guesses.
    fn guarded_estimate(&self) -> [f32; DIMENSIONS] {
        let mut information = self.information.clone();
        let mut unknowns = self.estimate;
        let others = || GAINS_AT + 1..self.count;
        others().for_each(|index| information.pull(&mut unknowns, index, 1.0, PRIOR_DEVIATION));
        let mut kept = [1.0; DIMENSIONS];
        for index in others() {
            let effect = self.effects[index] / self.effects[GAINS_AT].at_least(f32::MIN_POSITIVE);
            kept[index] += beyond(unknowns[index] - 1.0, [ZONE / effect.at_least(1e-6); 2]);
            information.pull(&mut unknowns, index, kept[index], FIXED_DEVIATION);
        }
        kept[GAINS_AT] += beyond(unknowns[GAINS_AT] - 1.0, LEVEL_ZONE);
        let [least, most] = [self.parameters.least_gain, self.parameters.largest_gain];
        kept.map(|gain| gain.at_least(least).at_most(most))
    }

    /// Moves the gains in use towards the estimate, by at most `step` upwards.
    #[inline(never)]
    fn follow(&mut self, step: f32) -> bool {
        let target = gains_of(&self.guarded_estimate()).to_array();
        self.frozen = Frozen::None;
        self.move_towards(&target, step)
    }

    /// Lets the gains in use that are above the tuned set fall for this time, s.
    #[inline(never)]
    fn retreat(&mut self, duration_s: f32) -> bool {
        let target = self.gains.to_array().map(|gain| gain.at_most(1.0));
        self.move_towards(&target, self.parameters.slew_per_s * duration_s)
    }

    /// Moves the gains in use. Returns true if they have changed.
    fn move_towards(&mut self, target: &[f32; MAX_GAINS], step: f32) -> bool {
        let mut next = self.gains.to_array();
        for (gain, target) in next.iter_mut().zip(target) {
            *gain += (target - *gain).at_least(-FALL_FACTOR * step).at_most(step);
        }
        let next = Gains::from_array(&next);
        if self.written.with_gains(&next).validate().is_err() {
            self.frozen = Frozen::Refused;
            return false;
        }
        let has_changed = next != self.gains;
        self.gains = next;
        has_changed
    }
}

/// Largest constant torque, in units of the Coulomb level.
const MAX_OFFSET: f32 = 10.0;

/// Returns a change without what lies in a dead zone (downwards and upwards). The zone closes: twice as far, the change is
/// complete.
fn beyond(change: f32, [down, up]: [f32; 2]) -> f32 {
    let zone = if change < 0.0 { down } else { up };
    let rest = 2.0 * (Real::abs(change) - zone);
    change.within(rest.at_least(0.0))
}

/// Returns the information before anything is learnt, for this number of unknowns.
fn prior_information(count: usize) -> InformationRoot {
    let mut deviations = [PRIOR_DEVIATION; DIMENSIONS];
    deviations[OFFSET] = PRIOR_OFFSET_DEVIATION;
    InformationRoot::of_deviations(&deviations[..count])
}
