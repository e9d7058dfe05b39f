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

use super::lubricated::{ContactStep, LubricatedSeal};
use super::mechanism::{Beside, Mechanism};
use simulated_machines::conditions::Condition;
use simulated_machines::imposed::{self, Bristles, Contact, Instant, Step, Trajectory};
use simulated_machines::joint::Joint;

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
            Plant::LubricatedSeal(seal) => seal.elements.iter().map(|one| one.share).collect(),
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

/// Contact of a plant whose level also depends on the place of its mechanism.
struct PlantContact<'a> {
    plant: &'a Plant,
    mechanism: &'a Mechanism,
}

/// State of a contact.
struct ContactState {
    /// Deflection of the bristles, rad.
    z: f64,
    /// Torque of each element, Nm.
    torques: Vec<f64>,
    /// True for each slip element that slides.
    slides: Vec<bool>,
    /// Speed at which the film is in equilibrium, rad/s.
    film_rad_s: f64,
}

impl Contact for PlantContact<'_> {
    type State = ContactState;

    fn start(&self, joint: &Joint, held: f64, speed: f64) -> ContactState {
        let shares = self.plant.shares();
        ContactState {
            z: Bristles.start(joint, held, speed),
            torques: shares.iter().map(|share| held * share * joint.seal.coulomb_nm).collect(),
            slides: vec![false; shares.len()],
            film_rad_s: speed,
        }
    }

    fn curve(&self, joint: &Joint, state: &ContactState, speed: f64) -> f64 {
        match self.plant {
            Plant::LubricatedSeal(seal) => seal.mean_curve(joint, state.film_rad_s),
            _ => joint.stribeck_curve(speed),
        }
    }

    fn level_factor(&self, angle: f64) -> f64 {
        self.mechanism.level_factor(angle)
    }

    fn wait(&self, state: &mut ContactState, speed: f64, seconds: f64) {
        if let Plant::LubricatedSeal(seal) = self.plant {
            state.film_rad_s = seal.film_after(state.film_rad_s, speed, seconds);
        }
    }

    fn advance(&self, joint: &Joint, step: &Step, state: &mut ContactState) {
        let Step { end, direction, taken_up, bent, .. } = *step;
        match self.plant {
            Plant::Bristles => Bristles.advance(joint, step, &mut state.z),
            Plant::SlipElements { elements, lag_s } => {
                let displacement = direction * taken_up + bent;
                let settles = -(-step.seconds / lag_s).exp_m1();
                state.slides.iter_mut().for_each(|slides| *slides &= !step.has_reversed);
                move_slip_elements(joint, elements, step, displacement, settles, state);
            }
            Plant::LubricatedSeal(seal) => {
                let film_rad_s = state.film_rad_s;
                let contact = ContactStep { direction, travel: taken_up, bent, film_rad_s };
                let (speed, angle) = (end.point.velocity.abs(), end.point.angle);
                seal.advance(joint, &contact, &mut state.torques, |curve, direction| {
                    joint.level_on_curve(
                        curve,
                        speed,
                        direction,
                        angle,
                        step.age_s,
                        &end.conditions,
                    ) * step.level_factor
                });
            }
        }
    }

    fn torque(&self, joint: &Joint, here: &Instant, state: &ContactState) -> f64 {
        match self.plant {
            Plant::Bristles => Bristles.torque(joint, here, &state.z),
            Plant::SlipElements { .. } | Plant::LubricatedSeal(_) => state.torques.iter().sum(),
        }
    }

    fn viscous_velocity(&self, velocity: f64) -> f64 {
        match self.plant {
            Plant::LubricatedSeal(seal) => seal.viscous_velocity(velocity),
            _ => velocity,
        }
    }
}

/// Moves the slip elements by a displacement, rad. `settles` is the share of its way to the level that a sliding
/// element covers.
fn move_slip_elements(
    joint: &Joint,
    elements: &[Element],
    step: &Step,
    displacement: f64,
    settles: f64,
    state: &mut ContactState,
) {
    let direction = step.direction;
    for (at, one) in elements.iter().enumerate() {
        let (torque, slides) = (&mut state.torques[at], &mut state.slides[at]);
        let level = one.share * step.end.level;
        if *slides {
            *torque += (direction * level - *torque) * settles;
            continue;
        }
        let stiffness = joint.seal.k0 * one.share / one.travel;
        *torque += stiffness * displacement;
        if torque.abs() >= level {
            *torque = torque.clamp(-level, level);
            *slides = step.travel > 0.0 && *torque * direction > 0.0;
        }
    }
}

impl<'a> Machine<'a> {
    /// Returns the bristle plant with continuous covariates.
    pub fn bristles(mechanism: &'a Mechanism) -> Self {
        Self { plant: &Plant::Bristles, mechanism, covariate_hz: None }
    }

    /// Returns the torque of each row of each run without sensor effects, Nm.
    pub fn torques<'r>(&self, runs: impl Iterator<Item = RunInput<'r>>) -> Vec<Vec<f64>> {
        let (mut heat_j, mut end_s) = (0.0, f64::NEG_INFINITY);
        let joint = &self.mechanism.joint;
        let contact = &PlantContact { plant: self.plant, mechanism: self.mechanism };
        let machine = imposed::Machine {
            joint,
            contact,
            covariate_hz: self.covariate_hz,
            splits_reversals: false,
            film_heats: false,
        };
        runs.map(|RunInput { condition, beside, trajectory, held }| {
            if let (Some(warm), Some(first)) = (joint.warming, trajectory.points.first()) {
                let pause_s = (condition.start_s + first.t - end_s).max(0.0);
                heat_j *= if pause_s.is_finite() { (-pause_s / warm.cooling_s).exp() } else { 0.0 };
            }
            let mut torques = machine.torques(condition, trajectory, held, &mut heat_j);
            let rows = trajectory.rows.iter().zip(&trajectory.accelerations);
            for (torque, (row, acceleration)) in torques.iter_mut().zip(rows) {
                *torque += self.mechanism.added(beside, &trajectory.points[*row], *acceleration);
            }
            end_s = condition.start_s + trajectory.points.last().map_or(0.0, |point| point.t);
            torques
        })
        .collect()
    }
}
