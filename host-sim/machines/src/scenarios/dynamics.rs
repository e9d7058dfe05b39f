//! Integrator of the bristles, with the travel as the independent variable.
//!
//! At a constant level and direction, bristles relax with *travel*, independently of the speed:
//!
//! ```text
//! dz/ds = -(z - z_inf(s)),   z_inf = direction x g / k0,   ds = k0 |dq| / g
//! ```
//!
//! A step takes the travel from the motion in closed form. `z_inf` changes linearly from the start to the end of the
//! step, and the equation is solved exactly. The accuracy is therefore the same in presliding and at 10 rad/s, where
//! the relaxation is a thousand times faster than a step. A step with a reversal is split at standstill. The core uses
//! a different integrator.

use crate::conditions::{Condition, Conditions};
use crate::joint::Joint;
use crate::motion::Motion;

/// An integration point of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Time since the start of the run, s.
    t: f64,
    /// Angle of the shaft, rad.
    angle: f64,
    /// Velocity, rad/s.
    velocity: f64,
}

/// All integration points of a run. They are computed once and used for every joint that is simulated.
#[derive(Clone, Debug)]
pub(super) struct Path {
    points: Vec<Point>,
    /// Index of each row in `points`.
    rows: Vec<usize>,
    /// Acceleration at each row, rad/s^2.
    accelerations: Vec<f64>,
}

/// Minimum number of steps between two rows.
const MIN_STEPS_PER_ROW: f64 = 4.0;

impl Path {
    /// Creates the points for rows at `times`.
    ///
    /// Steps are at most `longest_s` long, and each is divided into `finer` parts.
    pub fn new(
        motion: &Motion,
        start_angle: f64,
        times: &[f64],
        longest_s: f64,
        finer: f64,
    ) -> Self {
        let mut path = Self {
            points: Vec::with_capacity(times.len() * 8),
            rows: Vec::with_capacity(times.len()),
            accelerations: Vec::with_capacity(times.len()),
        };
        let mut before: Option<f64> = None;
        for &row in times {
            let from = before.unwrap_or(row);
            let steps = ((row - from) / longest_s).ceil().max(MIN_STEPS_PER_ROW) * finer;
            let first = if before.is_some() { 1 } else { steps as usize };
            for step in first..=steps as usize {
                let last = step == steps as usize;
                let t = if last { row } else { from + (row - from) * step as f64 / steps };
                let at = motion.at(t);
                let angle = start_angle + at.angle;
                path.points.push(Point { t, angle, velocity: at.velocity });
                if last {
                    path.rows.push(path.points.len() - 1);
                    path.accelerations.push(at.acceleration);
                }
            }
            before = Some(row);
        }
        path
    }
}

/// State of the joint.
#[derive(Clone, Copy, Debug)]
struct State {
    /// Bristle deflection, rad.
    z: f64,
    /// Contact age, s.
    age_s: f64,
    /// Position of the drive in its backlash, from 0 to the travel of the backlash.
    play: f64,
    /// Direction of the last motion, 1 or -1.
    direction: f64,
    /// Stored friction heat, J.
    heat_j: f64,
}

/// Quantities at the start of a step. They are kept from the end of the previous step to save computation.
#[derive(Clone, Copy, Debug)]
struct StepStart {
    point: Point,
    conditions: Conditions,
    level: f64,
}

/// Returns `(1 - exp(-x)) / x`.
fn mean_of_decay(x: f64) -> f64 {
    if x < 1e-6 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

/// Returns the torque of each row without sensor noise, Nm, and updates the friction heat of the joint, J.
///
/// `held_rad` is the initial deflection of the bristles.
pub(super) fn torque(
    joint: &Joint,
    condition: &Condition,
    path: &Path,
    held_rad: f64,
    heat_j: &mut f64,
) -> Vec<f64> {
    let Some(&first) = path.points.first() else { return Vec::new() };
    let play = joint.play.map_or(0.0, |play| 0.5 * play.travel_rad);
    let state = State { z: held_rad, age_s: 0.0, play, direction: 1.0, heat_j: *heat_j };
    let mut integration = Integration { joint, condition, state };
    let mut here = integration.evaluate(first);
    let mut rows = path.rows.iter().zip(&path.accelerations);
    let mut next = rows.next();
    let mut torques = Vec::with_capacity(path.rows.len());
    for (at, &point) in path.points.iter().enumerate() {
        if at > 0 {
            here = integration.advance(&here, point);
        }
        if let Some((_, &acceleration)) = next.filter(|(row, _)| **row == at) {
            torques.push(integration.torque(&here, acceleration));
            next = rows.next();
        }
    }
    *heat_j = integration.state.heat_j;
    torques
}

/// Simulation of a joint through a run.
struct Integration<'a> {
    joint: &'a Joint,
    condition: &'a Condition,
    state: State,
}

impl Integration<'_> {
    /// Evaluates the conditions and the level at a point, for the direction of the last motion.
    fn evaluate(&self, point: Point) -> StepStart {
        let State { age_s, direction, heat_j, .. } = self.state;
        let conditions = Conditions { heat_j, ..self.joint.conditions_at(self.condition, point.t) };
        let level =
            self.joint.level(point.velocity.abs(), direction, point.angle, age_s, &conditions);
        StepStart { point, conditions, level }
    }

    /// Integrates to a point: one step, or two if the joint reverses.
    fn advance(&mut self, from: &StepStart, to: Point) -> StepStart {
        let (v0, v1) = (from.point.velocity, to.velocity);
        if v0 * v1 < 0.0 {
            let seconds = (to.t - from.point.t) * v0 / (v0 - v1);
            let rest = Point {
                t: from.point.t + seconds,
                angle: from.point.angle + 0.5 * v0 * seconds,
                velocity: 0.0,
            };
            let reversal = self.step(from, rest);
            return self.step(&reversal, to);
        }
        self.step(from, to)
    }

    /// Integrates one step without a reversal inside.
    fn step(&mut self, from: &StepStart, to: Point) -> StepStart {
        let joint = self.joint;
        let seconds = to.t - from.point.t;
        let displacement = to.angle - from.point.angle;
        let sum = from.point.velocity + to.velocity;
        let mut begin_level = from.level;
        if sum != 0.0 && sum.signum() != self.state.direction {
            self.state.direction = sum.signum();
            begin_level = self.evaluate(from.point).level;
        }
        let direction = self.state.direction;
        let travel = if sum == 0.0 { 0.0 } else { displacement.abs() };

        if let Some(dwell) = joint.dwell {
            let forgotten = travel / dwell.travel_rad;
            self.state.age_s =
                self.state.age_s * (-forgotten).exp() + seconds * mean_of_decay(forgotten);
        }
        if let Some(warming) = joint.warming {
            // Work of the level and of the viscous film. The energy of the bristles is recovered.
            let speed = 0.5 * sum.abs();
            let work = (from.level + joint.seal.k2 * speed) * travel;
            self.state.heat_j = self.state.heat_j * (-seconds / warming.cooling_s).exp() + work;
        }
        let here = self.evaluate(to);
        let taken_up = self.taken_up(travel);

        let k0 = joint.seal.k0;
        let passed = 0.5 * k0 * taken_up * (1.0 / begin_level + 1.0 / here.level);
        let begin = direction * begin_level / k0;
        let end = direction * here.level / k0;
        let mean = mean_of_decay(passed);
        // Equals exp(-passed), without a second exponential.
        let left = 1.0 - passed * mean;
        let mut z = end + (self.state.z - begin) * left - (end - begin) * mean;
        if joint.seal.eta3 != 0.0 {
            z += joint.seal.eta3 * (here.conditions.force - from.conditions.force) * mean;
        }
        // At rest the deflection is constant. The sum above would add rounding errors.
        if passed > 0.0 || joint.seal.eta3 != 0.0 {
            self.state.z = z;
        }
        self.slip(&here);
        here
    }

    /// Limits the bristle torque to the level at rest.
    ///
    /// Bristles slip at standstill if a side load deflects them further or if the level decreases.
    fn slip(&mut self, here: &StepStart) {
        let State { z, age_s, .. } = self.state;
        if (z * self.joint.seal.k0).abs() <= here.level {
            return;
        }
        let direction = z.signum();
        let held = self.joint.level(0.0, direction, here.point.angle, age_s, &here.conditions);
        let most = held / self.joint.seal.k0;
        self.state.z = z.clamp(-most, most);
    }

    /// Crosses the backlash and returns the travel that reaches the bristles, rad.
    fn taken_up(&mut self, travel: f64) -> f64 {
        let Some(play) = self.joint.play else { return travel };
        let room = if self.state.direction > 0.0 {
            play.travel_rad - self.state.play
        } else {
            self.state.play
        };
        let crossed = travel.min(room.max(0.0));
        self.state.play += self.state.direction * crossed;
        travel - crossed * (1.0 - play.leak)
    }

    /// Returns the torque at a point, Nm.
    fn torque(&self, here: &StepStart, acceleration: f64) -> f64 {
        let (joint, seal) = (self.joint, &self.joint.seal);
        let Point { angle, velocity, .. } = here.point;
        // Within the backlash, damping acts on the whole motion.
        let rate = velocity - seal.k0 * velocity.abs() * self.state.z / here.level
            + seal.eta3 * here.conditions.force_rate;
        let direction = if velocity == 0.0 { self.state.direction } else { velocity.signum() };
        seal.k0 * self.state.z
            + seal.k1 * rate
            + joint.viscous(velocity, direction, &here.conditions)
            + joint.added(angle, velocity, acceleration, &here.conditions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditions::Signal;
    use crate::friction::Seal;
    use crate::motion::{Speeds, Wave};
    use crate::seal_equation::{self, Surroundings};

    const SEAL: Seal = Seal {
        k0: 6e3,
        k1: 15.0,
        k2: 0.05,
        coulomb_nm: 2.0,
        static_nm: 2.7,
        stribeck_rad_s: 0.1,
        per_pressure: 2e-6,
        per_force: 0.01,
        eta3: 2e-6,
    };

    fn times() -> Vec<f64> {
        (0..1500).map(|row| f64::from(row) * 1e-3).collect()
    }

    fn motions() -> [Motion; 3] {
        let mut speeds = Speeds::from_rest(false);
        speeds.hold(0.2);
        speeds.ramp(0.5, 0.3);
        speeds.ramp(-0.8, 0.3);
        speeds.ramp(-0.1, 0.2);
        [
            Motion::Waves(vec![Wave { peak: 3.0, hz: 0.8 }, Wave { peak: 0.3, hz: 2.1 }]),
            Motion::Presliding { travel: 3e-3, hz: 3.0, growth: 1.5 },
            Motion::Speeds(speeds),
        ]
    }

    /// Reference: Runge-Kutta with 100 steps per row on the same equation.
    #[test]
    fn torque_agrees_with_runge_kutta() {
        let force = Signal { level: 30.0, swing: 5.0, hz: 1.3, ..Signal::default() };
        let pressure = Signal { level: 1e5, per_s: 1e4, ..Signal::default() };
        let condition = Condition { force, pressure, ..Condition::default() };
        for motion in motions() {
            let at = |t: f64| Surroundings {
                velocity: motion.at(t).velocity,
                force: force.at(t),
                force_rate: force.rate(t),
                pressure: pressure.at(t),
            };
            let path = Path::new(&motion, 0.0, &times(), 1e-4, 1.0);
            let found = torque(&Joint::plain(SEAL), &condition, &path, 1e-4, &mut 0.0);
            let mut z = 1e-4;
            for (row, (t, found)) in times().into_iter().zip(found).enumerate() {
                if row > 0 {
                    for step in 0..100 {
                        let from = t - 1e-3 + f64::from(step) * 1e-5;
                        z = seal_equation::advance(&SEAL, z, from, 1e-5, at);
                    }
                }
                let expected = seal_equation::torque(&SEAL, z, &at(t));
                assert!((found - expected).abs() < 2e-4, "{motion:?} {t}: {found} {expected}");
            }
        }
    }

    #[test]
    fn torque_at_rest_is_constant() {
        let motion = Motion::Speeds(Speeds::from_rest(true));
        let path = Path::new(&motion, 1.0, &times(), 1e-4, 1.0);
        let seal = Seal { per_force: 0.0, per_pressure: 0.0, eta3: 0.0, ..SEAL };
        let found = torque(&Joint::plain(seal), &Condition::default(), &path, 2e-4, &mut 0.0);
        assert!(found.iter().all(|torque| *torque == seal.k0 * 2e-4));
    }

    #[test]
    fn torque_within_backlash_is_constant_after_reversal() {
        let mut speeds = Speeds::from_rest(false);
        speeds.ramp(0.2, 0.2);
        speeds.ramp(-0.2, 0.4);
        speeds.hold(1.0);
        let motion = Motion::Speeds(speeds);
        let path = Path::new(&motion, 0.0, &times(), 1e-4, 1.0);
        let seal = Seal { per_force: 0.0, per_pressure: 0.0, eta3: 0.0, k1: 0.0, k2: 0.0, ..SEAL };
        let mut joint = Joint::plain(seal);
        let play = crate::joint::Play { travel_rad: 2e-3, leak: 0.0 };
        joint.play = Some(play);
        let found = torque(&joint, &Condition::default(), &path, 0.0, &mut 0.0);
        // The reversal is at 0.4 s. The backlash of 2 mrad is crossed after sqrt(2 x 2e-3 / 1) = 63 ms.
        assert!((found[400] - found[460]).abs() < 1e-9, "{} {}", found[400], found[460]);
        assert!(found[420] > 2.0 && found[500] < -2.0);
    }
}
