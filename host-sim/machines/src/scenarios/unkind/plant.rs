//! Two plants, neither of them the core's: bristles, and elements that slip one after another.
//!
//! ```text
//! bristles        dz/ds = -(z - z_inf), z_inf = direction x g / k0, ds = k0 |dq| / g;  F = k0 z + k1 z'
//! slip elements   each sticks (F_i = k_i dq) until |F_i| reaches its share a_i g of the level, then slides:
//!                 dF_i/dt = (direction x a_i g - F_i) / tau, until the joint reverses (generalised Maxwell slip)
//! ```
//!
//! Both slip at the same level `g` ([`Joint::level`]) with every effect in it, so a cause means the same in
//! either; below the level they differ as two machines do: slip elements remember each reversal inside a
//! larger one (hysteresis with nonlocal memory), bristles drift through it. Both are solved exactly for a
//! step whose level goes straight, driven by the travel and not by the velocity.

use super::super::joint::Joint;
use super::super::surroundings::{Around, Condition};

/// An elasto-slip element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    /// Its share of the level.
    pub share: f64,
    /// Travel after which it slips at the Coulomb level, as a share of the joint's.
    pub travel: f64,
}

/// Which plant.
#[derive(Clone, Debug)]
pub(super) enum Plant {
    /// One state.
    Bristles,
    /// One state for each element, and the time in which a sliding one finds its level, s.
    SlipElements { elements: Vec<Element>, lag_s: f64 },
}

/// A place on a run's way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Time of the run, s.
    pub t: f64,
    /// Angle of the shaft, rad.
    pub angle: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
}

/// A run's way: points, which of them are rows of the log, and the acceleration there, rad/s^2.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    pub points: Vec<Point>,
    pub rows: Vec<usize>,
    pub accelerations: Vec<f64>,
}

/// A plant with its joint.
pub(super) struct Machine<'a> {
    pub plant: &'a Plant,
    pub joint: &'a Joint,
    /// Rate at which what surrounds it is refreshed, Hz; as it truly is without one.
    pub covariate_hz: Option<f64>,
}

/// `(1 - exp(-x)) / x`.
fn mean_of_decay(x: f64) -> f64 {
    if x < 1e-6 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

/// What a machine remembers.
struct State {
    /// Deflection of the bristles, rad.
    z: f64,
    /// Torque of each element, Nm, and whether it slides.
    elements: Vec<(f64, bool)>,
    age_s: f64,
    play: f64,
    direction: f64,
    heat_j: f64,
}

impl<'a> Machine<'a> {
    /// Bristles, in true surroundings.
    pub fn bristles(joint: &'a Joint) -> Self {
        Self { plant: &Plant::Bristles, joint, covariate_hz: None }
    }
    /// The torque of each row of each run without a sensor in between, Nm. `held` is what the joint holds at
    /// the start of each run as a share of the Coulomb level.
    pub fn torques<'r>(
        &self,
        runs: impl Iterator<Item = (&'r Condition, &'r Way, f64)>,
    ) -> Vec<Vec<f64>> {
        let (mut heat_j, mut end_s) = (0.0, f64::NEG_INFINITY);
        runs.map(|(condition, way, held)| {
            if let (Some(warm), Some(first)) = (self.joint.warming, way.points.first()) {
                let pause_s = (condition.start_s + first.t - end_s).max(0.0);
                heat_j *= if pause_s.is_finite() { (-pause_s / warm.cooling_s).exp() } else { 0.0 };
            }
            let torques = self.run(condition, way, held, &mut heat_j);
            end_s = condition.start_s + way.points.last().map_or(0.0, |point| point.t);
            torques
        })
        .collect()
    }

    fn run(&self, condition: &Condition, way: &Way, held: f64, heat_j: &mut f64) -> Vec<f64> {
        let Some(&first) = way.points.first() else { return Vec::new() };
        let seal = &self.joint.seal;
        let elements = match self.plant {
            Plant::Bristles => Vec::new(),
            Plant::SlipElements { elements, .. } => {
                elements.iter().map(|one| (held * one.share * seal.coulomb_nm, false)).collect()
            }
        };
        let mut state = State {
            z: held * seal.coulomb_nm / seal.k0,
            elements,
            age_s: 0.0,
            play: self.joint.play.map_or(0.0, |play| 0.5 * play.travel_rad),
            direction: if held < 0.0 { -1.0 } else { 1.0 },
            heat_j: *heat_j,
        };
        let mut here = self.here(condition, first, &state);
        let mut torques = Vec::with_capacity(way.rows.len());
        let mut rows = way.rows.iter().zip(&way.accelerations).peekable();
        for (at, &point) in way.points.iter().enumerate() {
            if at > 0 {
                here = self.step(condition, &here, point, &mut state);
            }
            // Several rows may be one point: those before a late channel has begun.
            while let Some((_, &acceleration)) = rows.next_if(|(row, _)| **row == at) {
                torques.push(self.torque(&here, acceleration, &state));
            }
        }
        *heat_j = state.heat_j;
        torques
    }

    fn here(&self, condition: &Condition, point: Point, state: &State) -> Here {
        let seen_s = self.covariate_hz.map_or(point.t, |hz| (point.t * hz).floor() / hz);
        let around = Around {
            heat_j: state.heat_j,
            campaign_s: condition.start_s + point.t,
            ..self.joint.around(condition, seen_s)
        };
        let level = self.level(&point, &around, state);
        Here { point, around, level }
    }

    fn level(&self, point: &Point, around: &Around, state: &State) -> f64 {
        let State { direction, age_s, .. } = *state;
        self.joint.level(point.velocity.abs(), direction, point.angle, age_s, around)
    }

    fn step(&self, condition: &Condition, from: &Here, to: Point, state: &mut State) -> Here {
        let joint = self.joint;
        let (seconds, way) = (to.t - from.point.t, to.angle - from.point.angle);
        let turned = way != 0.0 && way.signum() != state.direction;
        let mut begin_level = from.level;
        if turned {
            state.direction = way.signum();
            begin_level = self.level(&from.point, &from.around, state);
        }
        let travel = way.abs();
        if let Some(dwell) = joint.dwell {
            let forgotten = travel / dwell.travel_rad;
            state.age_s = state.age_s * (-forgotten).exp() + seconds * mean_of_decay(forgotten);
        }
        if let Some(warm) = joint.warming {
            state.heat_j = state.heat_j * (-seconds / warm.cooling_s).exp() + begin_level * travel;
        }
        let here = self.here(condition, to, state);
        let bent = joint.seal.eta3 * (here.around.force - from.around.force);
        let taken_up = self.taken_up(travel, state);
        match self.plant {
            Plant::Bristles => {
                let (k0, direction) = (joint.seal.k0, state.direction);
                let passed = 0.5 * k0 * taken_up * (1.0 / begin_level + 1.0 / here.level);
                let (begin, end) = (direction * begin_level / k0, direction * here.level / k0);
                let mean = mean_of_decay(passed);
                if passed > 0.0 || bent != 0.0 {
                    let left = 1.0 - passed * mean;
                    state.z = end + (state.z - begin) * left - (end - begin) * mean + bent * mean;
                }
                // Bristles hold no more than the level at rest.
                if (state.z * k0).abs() > here.level {
                    let held =
                        joint.level(0.0, state.z.signum(), to.angle, state.age_s, &here.around);
                    state.z = state.z.clamp(-held / k0, held / k0);
                }
            }
            Plant::SlipElements { elements, lag_s } => {
                let way = state.direction * taken_up + bent;
                let settles = -(-seconds / lag_s).exp_m1();
                for (one, (torque, slides)) in elements.iter().zip(&mut state.elements) {
                    let level = one.share * here.level;
                    *slides &= !turned;
                    if *slides {
                        *torque += (state.direction * level - *torque) * settles;
                        continue;
                    }
                    let stiffness = joint.seal.k0 * one.share / one.travel;
                    *torque += stiffness * way;
                    if torque.abs() >= level {
                        *torque = torque.clamp(-level, level);
                        *slides = travel > 0.0 && *torque * state.direction > 0.0;
                    }
                }
            }
        }
        here
    }

    /// Crosses the play first; the travel that reaches the contact, rad.
    fn taken_up(&self, travel: f64, state: &mut State) -> f64 {
        let Some(play) = self.joint.play else { return travel };
        let room = if state.direction > 0.0 { play.travel_rad - state.play } else { state.play };
        let crossed = travel.min(room.max(0.0));
        state.play += state.direction * crossed;
        travel - crossed * (1.0 - play.leak)
    }

    /// The torque at a point, Nm.
    fn torque(&self, here: &Here, acceleration: f64, state: &State) -> f64 {
        let (joint, seal) = (self.joint, &self.joint.seal);
        let Point { angle, velocity, .. } = here.point;
        let direction = if velocity == 0.0 { state.direction } else { velocity.signum() };
        let contact = match self.plant {
            Plant::Bristles => {
                let rate = velocity - seal.k0 * velocity.abs() * state.z / here.level
                    + seal.eta3 * here.around.force_rate;
                seal.k0 * state.z + seal.k1 * rate
            }
            Plant::SlipElements { .. } => state.elements.iter().map(|(torque, _)| torque).sum(),
        };
        contact
            + joint.viscous(velocity, direction, &here.around)
            + joint.added(angle, velocity, acceleration, &here.around)
    }
}

/// The begin of the next step, so that nothing is computed twice.
#[derive(Clone, Copy, Debug)]
struct Here {
    point: Point,
    around: Around,
    level: f64,
}
