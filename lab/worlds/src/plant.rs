//! Plants that are independent of the core: bristles, elements that slip one after another, and a lubricated seal.
//!
//! ```text
//! bristles        dz/ds = -(z - z_inf), z_inf = direction x g / k0, ds = k0 |dq| / g;  F = k0 z + k1 z'
//! slip elements   each sticks (F_i = k_i dq) until |F_i| reaches its share a_i g of the level, then slides:
//!                 dF_i/dt = (direction x a_i g - F_i) / tau, until the joint reverses (generalised Maxwell slip)
//! lubricated seal elasto-plastic elements on a film that remembers the speed ([`super::lubricated`])
//! ```
//!
//! All slip at the same level `g` ([`Joint::level`]), which contains every effect. A cause therefore means the same
//! in all plants. Below the level they differ: slip elements have hysteresis with nonlocal memory, and bristles drift.
//! Each step of the bristles is solved exactly for a level that changes linearly. The input is the travel, not the
//! velocity.

use super::lubricated::{ContactStep, LubricatedSeal, mean_of_decay};
use super::mechanism::{Beside, Mechanism};
use super::trajectory::{Point, Trajectory};
use simulated_machines::conditions::{Condition, Conditions};

/// An elasto-slip element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    /// Share of the level.
    pub share: f64,
    /// Travel to the slip at the Coulomb level, as a share of the joint's presliding travel.
    pub travel: f64,
}

/// Friction model of the plant.
#[derive(Clone, Debug)]
pub(super) enum Plant {
    /// One state.
    Bristles,
    /// One state for each element. `lag_s` is the time constant with which a sliding element approaches its level, s.
    SlipElements { elements: Vec<Element>, lag_s: f64 },
    /// One state for each contact element, and one for the film.
    LubricatedSeal(LubricatedSeal),
}

impl Plant {
    /// Returns the name of the plant in `truth.json`.
    pub const fn name(&self) -> &'static str {
        match self {
            Plant::Bristles => "bristles",
            Plant::SlipElements { .. } => "slip-elements",
            Plant::LubricatedSeal(_) => "lubricated-seal",
        }
    }

    /// Returns the share of the level of each element.
    fn shares(&self) -> Vec<f64> {
        match self {
            Plant::Bristles => Vec::new(),
            Plant::SlipElements { elements, .. } => elements.iter().map(|one| one.share).collect(),
            Plant::LubricatedSeal(own) => own.elements.iter().map(|one| one.share).collect(),
        }
    }
}

/// A run of a machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunInput<'a> {
    pub condition: &'a Condition,
    pub beside: &'a Beside,
    pub trajectory: &'a Trajectory,
    /// Contact torque at the start, as a share of the Coulomb level.
    pub held: f64,
}

/// A plant with the parameters and effects of its joint.
pub(super) struct Machine<'a> {
    pub plant: &'a Plant,
    pub mechanism: &'a Mechanism,
    /// Sample rate of the covariates, Hz. `None` if they are continuous.
    pub covariate_hz: Option<f64>,
}

/// State of the plant.
struct State {
    /// Deflection of the bristles, rad.
    z: f64,
    /// Torque of each element, Nm.
    torques: Vec<f64>,
    /// True for each slip element that slides.
    slides: Vec<bool>,
    /// Speed at which the film is in equilibrium, rad/s.
    film_rad_s: f64,
    age_s: f64,
    play: f64,
    direction: f64,
    heat_j: f64,
}

impl<'a> Machine<'a> {
    /// Returns the bristle plant with continuous covariates.
    pub fn bristles(mechanism: &'a Mechanism) -> Self {
        Self { plant: &Plant::Bristles, mechanism, covariate_hz: None }
    }

    /// Returns the torque of each row of each run without sensor effects, Nm.
    pub fn torques<'r>(&self, runs: impl Iterator<Item = RunInput<'r>>) -> Vec<Vec<f64>> {
        let (mut heat_j, mut end_s) = (0.0, f64::NEG_INFINITY);
        runs.map(|input| {
            let RunInput { condition, trajectory, .. } = input;
            let warming = self.mechanism.joint.warming;
            if let (Some(warm), Some(first)) = (warming, trajectory.points.first()) {
                let pause_s = (condition.start_s + first.t - end_s).max(0.0);
                heat_j *= if pause_s.is_finite() { (-pause_s / warm.cooling_s).exp() } else { 0.0 };
            }
            let torques = self.run(&input, &mut heat_j);
            end_s = condition.start_s + trajectory.points.last().map_or(0.0, |point| point.t);
            torques
        })
        .collect()
    }

    /// Returns the torque of each row of a run, Nm, and updates the heat.
    fn run(&self, input: &RunInput, heat_j: &mut f64) -> Vec<f64> {
        let RunInput { condition, beside, trajectory, held } = *input;
        let Some(&first) = trajectory.points.first() else { return Vec::new() };
        let seal = &self.mechanism.joint.seal;
        let shares = self.plant.shares();
        let mut state = State {
            z: held * seal.coulomb_nm / seal.k0,
            torques: shares.iter().map(|share| held * share * seal.coulomb_nm).collect(),
            slides: vec![false; shares.len()],
            film_rad_s: first.velocity.abs(),
            age_s: 0.0,
            play: self.mechanism.joint.play.map_or(0.0, |play| 0.5 * play.travel_rad),
            direction: if held < 0.0 { -1.0 } else { 1.0 },
            heat_j: *heat_j,
        };
        let mut here = self.evaluate(condition, first, &state);
        let mut torques = Vec::with_capacity(trajectory.rows.len());
        let mut rows = trajectory.rows.iter().zip(&trajectory.accelerations).peekable();
        for (at, &point) in trajectory.points.iter().enumerate() {
            if at > 0 {
                here = self.step(condition, &here, point, &mut state);
            }
            // Several rows may share a point: with a delay, all rows before the start of the motion.
            while let Some((_, &acceleration)) = rows.next_if(|(row, _)| **row == at) {
                let added = self.mechanism.added(beside, &here.point, acceleration);
                torques.push(self.torque(&here, acceleration, &state) + added);
            }
        }
        *heat_j = state.heat_j;
        torques
    }

    /// Evaluates the covariates and the level at a point.
    fn evaluate(&self, condition: &Condition, point: Point, state: &State) -> StepStart {
        let seen_s = self.covariate_hz.map_or(point.t, |hz| (point.t * hz).floor() / hz);
        let conditions = Conditions {
            heat_j: state.heat_j,
            campaign_s: condition.start_s + point.t,
            ..self.mechanism.joint.conditions_at(condition, seen_s)
        };
        let level = self.level(&point, &conditions, state);
        StepStart { point, conditions, level }
    }

    /// Returns the friction level at a point, Nm.
    fn level(&self, point: &Point, conditions: &Conditions, state: &State) -> f64 {
        let State { direction, age_s, .. } = *state;
        let (joint, speed) = (&self.mechanism.joint, point.velocity.abs());
        let level = match self.plant {
            Plant::LubricatedSeal(seal) => {
                let curve = seal.mean_curve(joint, state.film_rad_s);
                joint.level_on_curve(curve, speed, direction, point.angle, age_s, conditions)
            }
            _ => joint.level(speed, direction, point.angle, age_s, conditions),
        };
        level * self.mechanism.level_factor(point.angle)
    }

    /// Integrates to the point `to`.
    fn step(
        &self,
        condition: &Condition,
        from: &StepStart,
        to: Point,
        state: &mut State,
    ) -> StepStart {
        let joint = &self.mechanism.joint;
        let (seconds, displacement) = (to.t - from.point.t, to.angle - from.point.angle);
        let has_reversed = displacement != 0.0 && displacement.signum() != state.direction;
        let mut begin_level = from.level;
        if has_reversed {
            state.direction = displacement.signum();
            begin_level = self.level(&from.point, &from.conditions, state);
        }
        let travel = displacement.abs();
        if let Some(dwell) = joint.dwell {
            let forgotten = travel / dwell.travel_rad;
            state.age_s = state.age_s * (-forgotten).exp() + seconds * mean_of_decay(forgotten);
        }
        if let Some(warm) = joint.warming {
            state.heat_j = state.heat_j * (-seconds / warm.cooling_s).exp() + begin_level * travel;
        }
        if let Plant::LubricatedSeal(seal) = self.plant {
            let speed = 0.5 * (from.point.velocity.abs() + to.velocity.abs());
            state.film_rad_s = seal.film_after(state.film_rad_s, speed, seconds);
        }
        let here = self.evaluate(condition, to, state);
        let bent = joint.seal.eta3 * (here.conditions.force - from.conditions.force);
        let taken_up = self.taken_up(travel, state);
        match self.plant {
            Plant::Bristles => self.move_bristles(&here, begin_level, taken_up, bent, state),
            Plant::SlipElements { elements, lag_s } => {
                let displacement = state.direction * taken_up + bent;
                let settles = -(-seconds / lag_s).exp_m1();
                state.slides.iter_mut().for_each(|slides| *slides &= !has_reversed);
                let level = here.level;
                self.move_slip_elements(
                    elements,
                    level,
                    displacement,
                    settles,
                    travel > 0.0,
                    state,
                );
            }
            Plant::LubricatedSeal(seal) => {
                let State { direction, film_rad_s, age_s, .. } = *state;
                let step = ContactStep { direction, travel: taken_up, bent, film_rad_s };
                let (speed, now) = (to.velocity.abs(), &here.conditions);
                seal.advance(joint, &step, &mut state.torques, |curve, direction| {
                    joint.level_on_curve(curve, speed, direction, to.angle, age_s, now)
                        * self.mechanism.level_factor(to.angle)
                });
            }
        }
        here
    }

    /// Moves the bristles to the point `here`.
    fn move_bristles(
        &self,
        here: &StepStart,
        begin_level: f64,
        taken_up: f64,
        bent: f64,
        state: &mut State,
    ) {
        let joint = &self.mechanism.joint;
        let (k0, direction) = (joint.seal.k0, state.direction);
        let passed = 0.5 * k0 * taken_up * (1.0 / begin_level + 1.0 / here.level);
        let (begin, end) = (direction * begin_level / k0, direction * here.level / k0);
        let mean = mean_of_decay(passed);
        if passed > 0.0 || bent != 0.0 {
            let left = 1.0 - passed * mean;
            state.z = end + (state.z - begin) * left - (end - begin) * mean + bent * mean;
        }
        // The bristle torque is limited to the level at rest.
        if (state.z * k0).abs() > here.level {
            let (side, angle) = (state.z.signum(), here.point.angle);
            let held = joint.level(0.0, side, angle, state.age_s, &here.conditions)
                * self.mechanism.level_factor(angle);
            state.z = state.z.clamp(-held / k0, held / k0);
        }
    }

    /// Moves the slip elements by a displacement, rad. `settles` is the share of its way to the level that a sliding
    /// element covers.
    fn move_slip_elements(
        &self,
        elements: &[Element],
        joint_level: f64,
        displacement: f64,
        settles: f64,
        has_moved: bool,
        state: &mut State,
    ) {
        let direction = state.direction;
        for (at, one) in elements.iter().enumerate() {
            let (torque, slides) = (&mut state.torques[at], &mut state.slides[at]);
            let level = one.share * joint_level;
            if *slides {
                *torque += (direction * level - *torque) * settles;
                continue;
            }
            let stiffness = self.mechanism.joint.seal.k0 * one.share / one.travel;
            *torque += stiffness * displacement;
            if torque.abs() >= level {
                *torque = torque.clamp(-level, level);
                *slides = has_moved && *torque * direction > 0.0;
            }
        }
    }

    /// Crosses the play and returns the travel that reaches the contact, rad.
    fn taken_up(&self, travel: f64, state: &mut State) -> f64 {
        let Some(play) = self.mechanism.joint.play else { return travel };
        let room = if state.direction > 0.0 { play.travel_rad - state.play } else { state.play };
        let crossed = travel.min(room.max(0.0));
        state.play += state.direction * crossed;
        travel - crossed * (1.0 - play.leak)
    }

    /// Returns the torque at a point, Nm.
    fn torque(&self, here: &StepStart, acceleration: f64, state: &State) -> f64 {
        let (joint, seal) = (&self.mechanism.joint, &self.mechanism.joint.seal);
        let Point { angle, velocity, .. } = here.point;
        let direction = if velocity == 0.0 { state.direction } else { velocity.signum() };
        let contact = match self.plant {
            Plant::Bristles => {
                let rate = velocity - seal.k0 * velocity.abs() * state.z / here.level
                    + seal.eta3 * here.conditions.force_rate;
                seal.k0 * state.z + seal.k1 * rate
            }
            Plant::SlipElements { .. } | Plant::LubricatedSeal(_) => state.torques.iter().sum(),
        };
        let viscous_velocity = match self.plant {
            Plant::LubricatedSeal(seal) => seal.viscous_velocity(velocity),
            _ => velocity,
        };
        contact
            + joint.viscous(viscous_velocity, direction, &here.conditions)
            + joint.added(angle, velocity, acceleration, &here.conditions)
    }
}

/// Quantities at the start of a step. They are kept from the end of the previous step to save computation.
#[derive(Clone, Copy, Debug)]
struct StepStart {
    point: Point,
    conditions: Conditions,
    level: f64,
}
