//! Joints whose motion is imposed: the torque along a trajectory.
//!
//! A contact moves with the *travel*, independently of the speed. The bristles of the published seal relax over it:
//!
//! ```text
//! dz/ds = -(z - z_inf(s)),   z_inf = direction x g / k0,   ds = k0 |dq| / g
//! ```
//!
//! A step takes the travel from the motion in closed form. `z_inf` changes linearly from the start to the end of the
//! step, and the equation is solved exactly. The accuracy is therefore the same in presliding and at 10 rad/s, where
//! the relaxation is a thousand times faster than a step. The core uses a different integrator.

use crate::conditions::{Condition, Conditions};
use crate::joint::Joint;
use crate::motion::{self, Motion};

/// An integration point of a run.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Time since the start of the run, s.
    pub t: f64,
    /// Angle of the shaft, rad.
    pub angle: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
}

/// Trajectory of a run: its integration points, and those of them that are rows of the log.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    /// The points, in the order of time.
    pub points: Vec<Point>,
    /// Index of each row in `points`.
    pub rows: Vec<usize>,
    /// Acceleration at each row, rad/s^2.
    pub accelerations: Vec<f64>,
}

/// Minimum number of steps in a row period.
pub const MIN_STEPS_PER_ROW: f64 = 4.0;

/// Time below which two rows share a point, s. It is far above the rounding of a time.
const SAME_TIME_S: f64 = 1e-9;

/// A part of a motion that is divided into steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Motion at the start.
    pub begin: motion::Instant,
    /// Motion at the end.
    pub end: motion::Instant,
    /// Duration, s.
    pub seconds: f64,
}

/// Division of a motion into integration steps.
#[derive(Clone, Copy, Debug)]
pub struct Division<F> {
    /// Time of the first point, s from the start of the motion.
    pub start_s: f64,
    /// Longest part that is divided at once, s. Parts also end at the rows.
    pub longest_part_s: f64,
    /// Returns the number of steps of a part, a positive integer.
    pub steps: F,
}

impl Trajectory {
    /// Creates the points of a motion up to its last row. `times` are those of the rows, s from the start of the motion.
    pub fn new(
        motion: &Motion,
        start_angle: f64,
        times: &[f64],
        division: &Division<impl Fn(&Part) -> f64>,
    ) -> Self {
        let Division { start_s, longest_part_s, steps } = division;
        let (mut t, mut now) = (*start_s, motion.at(*start_s));
        let point = |t, now: &motion::Instant| Point {
            t,
            angle: start_angle + now.angle,
            velocity: now.velocity,
        };
        let mut path = Self { points: vec![point(t, &now)], ..Self::default() };
        for &row in times {
            while row - t > SAME_TIME_S {
                let (from, seconds) = (t, (row - t).min(*longest_part_s));
                let end = motion.at((from + longest_part_s).min(row));
                let count = steps(&Part { begin: now, end, seconds });
                let step_s = seconds / count;
                for index in 1..=count as usize {
                    t = from + index as f64 * step_s;
                    now = motion.at(t);
                    path.points.push(point(t, &now));
                }
            }
            path.rows.push(path.points.len() - 1);
            path.accelerations.push(now.acceleration);
        }
        path
    }
}

/// A step of a contact.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// End of the step.
    pub end: Instant,
    /// Level at the start of the step, for its direction, Nm.
    pub begin_level: f64,
    /// Direction of the motion, 1 or -1.
    pub direction: f64,
    /// True if the direction differs from that of the step before.
    pub has_reversed: bool,
    /// Travel of the shaft, rad.
    pub travel: f64,
    /// Part of the travel that reaches the contact beyond the backlash, rad.
    pub taken_up: f64,
    /// Factor of the level at the end, [`Contact::level_factor`].
    pub level_factor: f64,
    /// Deflection of the contact by a change of the side load, rad.
    pub bent: f64,
    /// Duration, s.
    pub seconds: f64,
    /// Contact age at the end, s.
    pub age_s: f64,
}

/// A point with its conditions and the level there. The end of a step is the start of the next.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// The point.
    pub point: Point,
    /// Operating conditions.
    pub conditions: Conditions,
    /// Level of the friction, Nm.
    pub level: f64,
}

/// Contact of a seal with its shaft: what holds the shaft up to the level of its joint.
pub trait Contact {
    /// State of the contact.
    type State;

    /// Returns the state at the start of a run at a speed, rad/s. `held` is its torque, as a share of the Coulomb level.
    fn start(&self, joint: &Joint, held: f64, speed: f64) -> Self::State;

    /// Returns the value of the Stribeck curve that the level has at a speed, rad/s.
    fn curve(&self, joint: &Joint, _: &Self::State, speed: f64) -> f64 {
        joint.stribeck_curve(speed)
    }

    /// Returns the factor of the level at an angle, rad.
    fn level_factor(&self, _angle: f64) -> f64 {
        1.0
    }

    /// Lets time (s) pass at a mean speed, rad/s.
    fn wait(&self, _: &mut Self::State, _speed: f64, _seconds: f64) {}

    /// Moves the contact.
    fn advance(&self, joint: &Joint, step: &Step, state: &mut Self::State);

    /// Returns the torque of the contact, Nm.
    fn torque(&self, joint: &Joint, here: &Instant, state: &Self::State) -> f64;

    /// Returns the velocity at which a linear law gives the viscous torque, rad/s.
    fn viscous_velocity(&self, velocity: f64) -> f64 {
        velocity
    }
}

/// The bristles of the published seal. Their state is the deflection, rad.
#[derive(Clone, Copy, Debug)]
pub struct Bristles;

impl Contact for Bristles {
    type State = f64;

    fn start(&self, joint: &Joint, held: f64, _: f64) -> f64 {
        held * joint.seal.coulomb_nm / joint.seal.k0
    }

    fn advance(&self, joint: &Joint, step: &Step, z: &mut f64) {
        let Step { end: here, direction, bent, .. } = *step;
        let k0 = joint.seal.k0;
        let passed = 0.5 * k0 * step.taken_up * (1.0 / step.begin_level + 1.0 / here.level);
        let (begin, end) = (direction * step.begin_level / k0, direction * here.level / k0);
        let mean = mean_of_decay(passed);
        // At rest the deflection is constant. The sum would add rounding errors.
        if passed > 0.0 || bent != 0.0 {
            // Equals exp(-passed), without a second exponential.
            let left = 1.0 - passed * mean;
            *z = end + (*z - begin) * left - (end - begin) * mean + bent * mean;
        }
        // The bristle torque is limited to the level at rest: bristles slip at standstill if a side load deflects them
        // further or if the level decreases.
        if (*z * k0).abs() > here.level {
            let angle = here.point.angle;
            let held = joint.level(0.0, z.signum(), angle, step.age_s, &here.conditions);
            let most = held * step.level_factor / k0;
            *z = z.clamp(-most, most);
        }
    }

    fn torque(&self, joint: &Joint, here: &Instant, z: &f64) -> f64 {
        let (seal, velocity) = (&joint.seal, here.point.velocity);
        // Within the backlash, damping acts on the whole motion.
        let rate = velocity - seal.k0 * velocity.abs() * z / here.level
            + seal.eta3 * here.conditions.force_rate;
        seal.k0 * z + seal.k1 * rate
    }
}

/// Returns `(1 - exp(-x)) / x`.
pub fn mean_of_decay(x: f64) -> f64 {
    if x < 1e-6 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

/// A joint with its contact.
#[derive(Clone, Copy, Debug)]
pub struct Machine<'a, C> {
    /// The level with its effects, and the torques besides that of the contact.
    pub joint: &'a Joint,
    /// The contact.
    pub contact: &'a C,
    /// Sample rate of the covariates, Hz. `None` if they are continuous.
    pub covariate_hz: Option<f64>,
    /// True to split a step at a reversal.
    pub splits_reversals: bool,
    /// True if the viscous torque heats the seal too.
    pub film_heats: bool,
}

/// State of a joint and its contact.
struct State<S> {
    contact: S,
    /// Contact age, s.
    age_s: f64,
    /// Position of the drive in its backlash, from 0 to the travel of the backlash.
    play: f64,
    /// Direction of the last motion, 1 or -1.
    direction: f64,
    /// Stored friction heat, J.
    heat_j: f64,
}

impl<C: Contact> Machine<'_, C> {
    /// Returns the torque of each row of a run without sensors, Nm, and updates the friction heat of the joint, J.
    ///
    /// `held` is the torque of the contact at the start, as a share of the Coulomb level.
    pub fn torques(
        &self,
        condition: &Condition,
        trajectory: &Trajectory,
        held: f64,
        heat_j: &mut f64,
    ) -> Vec<f64> {
        let Some(&first) = trajectory.points.first() else { return Vec::new() };
        let mut state = State {
            contact: self.contact.start(self.joint, held, first.velocity.abs()),
            age_s: 0.0,
            play: self.joint.play.map_or(0.0, |play| 0.5 * play.travel_rad),
            direction: if held < 0.0 { -1.0 } else { 1.0 },
            heat_j: *heat_j,
        };
        let mut here = self.evaluate(condition, first, &state);
        let mut torques = Vec::with_capacity(trajectory.rows.len());
        let mut rows = trajectory.rows.iter().zip(&trajectory.accelerations).peekable();
        for (at, &point) in trajectory.points.iter().enumerate() {
            if at > 0 {
                here = self.advance(condition, &here, point, &mut state);
            }
            // Several rows may share a point: with a delay, all rows before the start of the motion.
            while let Some((_, &acceleration)) = rows.next_if(|(row, _)| **row == at) {
                torques.push(self.torque(&here, acceleration, &state));
            }
        }
        *heat_j = state.heat_j;
        torques
    }

    /// Evaluates the conditions and the level at a point, for the direction of the last motion.
    fn evaluate(&self, condition: &Condition, point: Point, state: &State<C::State>) -> Instant {
        let seen_s = self.covariate_hz.map_or(point.t, |hz| (point.t * hz).floor() / hz);
        let conditions = Conditions {
            heat_j: state.heat_j,
            campaign_s: condition.start_s + point.t,
            ..self.joint.conditions_at(condition, seen_s)
        };
        Instant { point, conditions, level: self.level(point, &conditions, state) }
    }

    /// Returns the friction level at a point, Nm.
    fn level(&self, point: Point, conditions: &Conditions, state: &State<C::State>) -> f64 {
        let (speed, angle) = (point.velocity.abs(), point.angle);
        let curve = self.contact.curve(self.joint, &state.contact, speed);
        let State { direction, age_s, .. } = *state;
        self.joint.level_on_curve(curve, speed, direction, angle, age_s, conditions)
            * self.contact.level_factor(angle)
    }

    /// Integrates to a point: one step, or two if the joint reverses.
    fn advance(
        &self,
        condition: &Condition,
        from: &Instant,
        to: Point,
        state: &mut State<C::State>,
    ) -> Instant {
        let (v0, v1) = (from.point.velocity, to.velocity);
        if self.splits_reversals && v0 * v1 < 0.0 {
            let seconds = (to.t - from.point.t) * v0 / (v0 - v1);
            let rest = Point {
                t: from.point.t + seconds,
                angle: from.point.angle + 0.5 * v0 * seconds,
                velocity: 0.0,
            };
            let reversal = self.step(condition, from, rest, state);
            return self.step(condition, &reversal, to, state);
        }
        self.step(condition, from, to, state)
    }

    /// Integrates one step.
    fn step(
        &self,
        condition: &Condition,
        from: &Instant,
        to: Point,
        state: &mut State<C::State>,
    ) -> Instant {
        let joint = self.joint;
        let (seconds, displacement) = (to.t - from.point.t, to.angle - from.point.angle);
        let has_reversed = displacement != 0.0 && displacement.signum() != state.direction;
        let mut begin_level = from.level;
        if has_reversed {
            state.direction = displacement.signum();
            begin_level = self.level(from.point, &from.conditions, state);
        }
        let travel = displacement.abs();
        let speed = 0.5 * (from.point.velocity.abs() + to.velocity.abs());
        if let Some(dwell) = joint.dwell {
            let forgotten = travel / dwell.travel_rad;
            state.age_s = state.age_s * (-forgotten).exp() + seconds * mean_of_decay(forgotten);
        }
        if let Some(warming) = joint.warming {
            // Work of the level and of the viscous film. The energy of the bristles is recovered.
            let film_nm = if self.film_heats { joint.seal.k2 * speed } else { 0.0 };
            let work = (begin_level + film_nm) * travel;
            state.heat_j = state.heat_j * (-seconds / warming.cooling_s).exp() + work;
        }
        self.contact.wait(&mut state.contact, speed, seconds);
        let end = self.evaluate(condition, to, state);
        let step = Step {
            end,
            begin_level,
            direction: state.direction,
            has_reversed,
            travel,
            taken_up: self.taken_up(travel, state),
            level_factor: self.contact.level_factor(to.angle),
            bent: joint.seal.eta3 * (end.conditions.force - from.conditions.force),
            seconds,
            age_s: state.age_s,
        };
        self.contact.advance(joint, &step, &mut state.contact);
        end
    }

    /// Crosses the backlash and returns the travel that reaches the contact, rad.
    fn taken_up(&self, travel: f64, state: &mut State<C::State>) -> f64 {
        let Some(play) = self.joint.play else { return travel };
        let room = if state.direction > 0.0 { play.travel_rad - state.play } else { state.play };
        let crossed = travel.min(room.max(0.0));
        state.play += state.direction * crossed;
        travel - crossed * (1.0 - play.leak)
    }

    /// Returns the torque at a point, Nm.
    fn torque(&self, here: &Instant, acceleration: f64, state: &State<C::State>) -> f64 {
        let Point { angle, velocity, .. } = here.point;
        let direction = if velocity == 0.0 { state.direction } else { velocity.signum() };
        let viscous_velocity = self.contact.viscous_velocity(velocity);
        self.contact.torque(self.joint, here, &state.contact)
            + self.joint.viscous(viscous_velocity, direction, &here.conditions)
            + self.joint.added(angle, velocity, acceleration, &here.conditions)
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

    /// Returns the torques of a joint whose bristles are deflected at the start, rad.
    fn torque(joint: &Joint, condition: &Condition, path: &Trajectory, held_rad: f64) -> Vec<f64> {
        let machine = Machine {
            joint,
            contact: &Bristles,
            covariate_hz: None,
            splits_reversals: true,
            film_heats: true,
        };
        let held = held_rad * joint.seal.k0 / joint.seal.coulomb_nm;
        machine.torques(condition, path, held, &mut 0.0)
    }

    fn times() -> Vec<f64> {
        (0..1500).map(|row| f64::from(row) * 1e-3).collect()
    }

    fn path(motion: &Motion) -> Trajectory {
        let steps = |part: &Part| (part.seconds / 1e-4).ceil();
        let division = Division { start_s: 0.0, longest_part_s: f64::INFINITY, steps };
        Trajectory::new(motion, 0.0, &times(), &division)
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
            let path = path(&motion);
            let found = torque(&Joint::plain(SEAL), &condition, &path, 1e-4);
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
        let path = path(&motion);
        let seal = Seal { per_force: 0.0, per_pressure: 0.0, eta3: 0.0, ..SEAL };
        let found = torque(&Joint::plain(seal), &Condition::default(), &path, 2e-4);
        assert!(found.iter().all(|torque| *torque == seal.k0 * 2e-4));
    }

    #[test]
    fn torque_within_backlash_is_constant_after_reversal() {
        let mut speeds = Speeds::from_rest(false);
        speeds.ramp(0.2, 0.2);
        speeds.ramp(-0.2, 0.4);
        speeds.hold(1.0);
        let motion = Motion::Speeds(speeds);
        let path = path(&motion);
        let seal = Seal { per_force: 0.0, per_pressure: 0.0, eta3: 0.0, k1: 0.0, k2: 0.0, ..SEAL };
        let mut joint = Joint::plain(seal);
        let play = crate::joint::Play { travel_rad: 2e-3, leak: 0.0 };
        joint.play = Some(play);
        let found = torque(&joint, &Condition::default(), &path, 0.0);
        // The reversal is at 0.4 s. The backlash of 2 mrad is crossed after sqrt(2 x 2e-3 / 1) = 63 ms.
        assert!((found[400] - found[460]).abs() < 1e-9, "{} {}", found[400], found[460]);
        assert!(found[420] > 2.0 && found[500] < -2.0);
    }
}
