//! The integrator: bristles over travel, not over time.
//!
//! While the level and the direction stay, bristles relax with *travel*, at any speed alike:
//!
//! ```text
//! dz/ds = -(z - z_inf(s)),   z_inf = direction x g / k0,   ds = k0 |dq| / g
//! ```
//!
//! A step takes the travel from the motion in closed form, lets `z_inf` go straight from its value
//! at the begin to that at the end, and solves that exactly. So it is as good at 10 rad/s, where
//! bristles are a thousand times faster than a step, as within presliding. A step in which the
//! joint reverses is cut where it stands still. The core does none of this.

use super::joint::Joint;
use super::motion::Motion;
use super::surroundings::{Around, Condition};

/// The end of one step and the begin of the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Time of the run, s.
    t: f64,
    /// Angle of the shaft, rad.
    angle: f64,
    /// Velocity, rad/s.
    velocity: f64,
}

/// All steps of a run, computed once and integrated through for every joint that is tried.
#[derive(Clone, Debug)]
pub(super) struct Path {
    points: Vec<Point>,
    /// Where in `points` each row is.
    rows: Vec<usize>,
    /// Acceleration at each row, rad/s^2.
    accelerations: Vec<f64>,
}

/// Fewest steps from one row to the next.
const FEWEST_STEPS: f64 = 4.0;

impl Path {
    /// The steps between rows that were taken at `times`, none longer than `longest_s`, and each
    /// of them in `finer` parts.
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
            let steps = ((row - from) / longest_s).ceil().max(FEWEST_STEPS) * finer;
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

/// What the joint remembers.
#[derive(Clone, Copy, Debug)]
struct State {
    /// Bristle deflection, rad.
    z: f64,
    /// Contact age, s.
    age_s: f64,
    /// Where the drive stands in its play, 0 to the play's travel.
    play: f64,
    /// Direction of the last motion, 1 or -1.
    direction: f64,
    /// Heat of what was rubbed, J.
    heat_j: f64,
}

/// The begin of the next step, so that nothing is computed twice.
#[derive(Clone, Copy, Debug)]
struct Here {
    point: Point,
    around: Around,
    level: f64,
}

/// `(1 - exp(-x)) / x`.
fn mean_of_decay(x: f64) -> f64 {
    if x < 1e-6 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

/// The torque of each row, Nm, without a sensor's noise. `held_rad` is the deflection the bristles
/// begin with.
pub(super) fn torque(joint: &Joint, condition: &Condition, path: &Path, held_rad: f64) -> Vec<f64> {
    torque_of_warm(joint, condition, path, held_rad, 0.0).0
}

/// The same of a joint that begins with the heat of what was rubbed before, J, and the heat it ends with.
pub(super) fn torque_of_warm(
    joint: &Joint,
    condition: &Condition,
    path: &Path,
    held_rad: f64,
    heat_j: f64,
) -> (Vec<f64>, f64) {
    let Some(&first) = path.points.first() else { return (Vec::new(), heat_j) };
    let play = joint.play.map_or(0.0, |play| 0.5 * play.travel_rad);
    let state = State { z: held_rad, age_s: 0.0, play, direction: 1.0, heat_j };
    let mut walk = Walk { joint, condition, state };
    let mut here = walk.here(first);
    let mut rows = path.rows.iter().zip(&path.accelerations);
    let mut next = rows.next();
    let mut torques = Vec::with_capacity(path.rows.len());
    for (at, &point) in path.points.iter().enumerate() {
        if at > 0 {
            here = walk.go(&here, point);
        }
        if let Some((_, &acceleration)) = next.filter(|(row, _)| **row == at) {
            torques.push(walk.torque(&here, acceleration));
            next = rows.next();
        }
    }
    (torques, walk.state.heat_j)
}

/// A joint on its way through a run.
struct Walk<'a> {
    joint: &'a Joint,
    condition: &'a Condition,
    state: State,
}

impl Walk<'_> {
    /// What is there at a point, seen in the direction of the last motion.
    fn here(&self, point: Point) -> Here {
        let State { age_s, direction, heat_j, .. } = self.state;
        let around = Around { heat_j, ..self.joint.around(self.condition, point.t) };
        let level = self.joint.level(point.velocity.abs(), direction, point.angle, age_s, &around);
        Here { point, around, level }
    }

    /// One step, or two where the joint reverses.
    fn go(&mut self, from: &Here, to: Point) -> Here {
        let (v0, v1) = (from.point.velocity, to.velocity);
        if v0 * v1 < 0.0 {
            let seconds = (to.t - from.point.t) * v0 / (v0 - v1);
            let rest = Point {
                t: from.point.t + seconds,
                angle: from.point.angle + 0.5 * v0 * seconds,
                velocity: 0.0,
            };
            let turned = self.step(from, rest);
            return self.step(&turned, to);
        }
        self.step(from, to)
    }

    /// One step without a reversal inside.
    fn step(&mut self, from: &Here, to: Point) -> Here {
        let joint = self.joint;
        let seconds = to.t - from.point.t;
        let way = to.angle - from.point.angle;
        let sum = from.point.velocity + to.velocity;
        let mut begin_level = from.level;
        if sum != 0.0 && sum.signum() != self.state.direction {
            self.state.direction = sum.signum();
            begin_level = self.here(from.point).level;
        }
        let direction = self.state.direction;
        let travel = if sum == 0.0 { 0.0 } else { way.abs() };

        if let Some(dwell) = joint.dwell {
            let forgotten = travel / dwell.travel_rad;
            self.state.age_s =
                self.state.age_s * (-forgotten).exp() + seconds * mean_of_decay(forgotten);
        }
        if let Some(warming) = joint.warming {
            // The level's work and the film's; what the bristles hold comes back.
            let speed = 0.5 * sum.abs();
            let work = (from.level + joint.seal.k2 * speed) * travel;
            self.state.heat_j = self.state.heat_j * (-seconds / warming.cooling_s).exp() + work;
        }
        let here = self.here(to);
        let taken_up = self.taken_up(travel);

        let k0 = joint.seal.k0;
        let passed = 0.5 * k0 * taken_up * (1.0 / begin_level + 1.0 / here.level);
        let begin = direction * begin_level / k0;
        let end = direction * here.level / k0;
        let mean = mean_of_decay(passed);
        // exp(-passed), without a second exponential.
        let left = 1.0 - passed * mean;
        let mut z = end + (self.state.z - begin) * left - (end - begin) * mean;
        if joint.seal.eta3 != 0.0 {
            z += joint.seal.eta3 * (here.around.force - from.around.force) * mean;
        }
        // At rest nothing relaxes: the sum above would round.
        if passed > 0.0 || joint.seal.eta3 != 0.0 {
            self.state.z = z;
        }
        self.slip(&here);
        here
    }

    /// Bristles hold no more than the level at rest: bent further by a side load, or left with less
    /// level under them, they slip, even where the shaft stands still.
    fn slip(&mut self, here: &Here) {
        let State { z, age_s, .. } = self.state;
        if (z * self.joint.seal.k0).abs() <= here.level {
            return;
        }
        let direction = z.signum();
        let held = self.joint.level(0.0, direction, here.point.angle, age_s, &here.around);
        let most = held / self.joint.seal.k0;
        self.state.z = z.clamp(-most, most);
    }

    /// Crosses the play first; the travel that reaches the bristles, rad.
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

    /// The torque at a point, Nm.
    fn torque(&self, here: &Here, acceleration: f64) -> f64 {
        let (joint, seal) = (self.joint, &self.joint.seal);
        let Point { angle, velocity, .. } = here.point;
        // Play takes the stiffness away, not the film: damping sees the whole motion.
        let rate = velocity - seal.k0 * velocity.abs() * self.state.z / here.level
            + seal.eta3 * here.around.force_rate;
        let direction = if velocity == 0.0 { self.state.direction } else { velocity.signum() };
        seal.k0 * self.state.z
            + seal.k1 * rate
            + joint.viscous(velocity, direction, &here.around)
            + joint.added(angle, velocity, acceleration, &here.around)
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::{Speeds, Wave};
    use super::super::surroundings::Signal;
    use super::*;
    use crate::friction::{Seal, Surroundings};

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

    /// Runge and Kutta's step, a hundred to a row, over the same equation.
    #[test]
    fn agrees_with_another_integrator() {
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
            let found = torque(&Joint::plain(SEAL), &condition, &path, 1e-4);
            let mut z = 1e-4;
            for (row, (t, found)) in times().into_iter().zip(found).enumerate() {
                if row > 0 {
                    for step in 0..100 {
                        z = SEAL.advance(z, t - 1e-3 + f64::from(step) * 1e-5, 1e-5, at);
                    }
                }
                let expected = SEAL.torque(z, &at(t));
                assert!((found - expected).abs() < 2e-4, "{motion:?} {t}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_joint_at_rest_holds_what_it_held() {
        let motion = Motion::Speeds(Speeds::from_rest(true));
        let path = Path::new(&motion, 1.0, &times(), 1e-4, 1.0);
        let seal = Seal { per_force: 0.0, per_pressure: 0.0, eta3: 0.0, ..SEAL };
        let found = torque(&Joint::plain(seal), &Condition::default(), &path, 2e-4);
        assert!(found.iter().all(|torque| *torque == seal.k0 * 2e-4));
    }

    #[test]
    fn within_the_play_the_torque_stays_after_a_reversal() {
        let mut speeds = Speeds::from_rest(false);
        speeds.ramp(0.2, 0.2);
        speeds.ramp(-0.2, 0.4);
        speeds.hold(1.0);
        let motion = Motion::Speeds(speeds);
        let path = Path::new(&motion, 0.0, &times(), 1e-4, 1.0);
        let seal = Seal { per_force: 0.0, per_pressure: 0.0, eta3: 0.0, k1: 0.0, k2: 0.0, ..SEAL };
        let mut joint = Joint::plain(seal);
        let play = super::super::joint::Play { travel_rad: 2e-3, leak: 0.0 };
        joint.play = Some(play);
        let found = torque(&joint, &Condition::default(), &path, 0.0);
        // The reversal is at 0.4 s; 2 mrad are crossed after sqrt(2 x 2e-3 / 1) = 63 ms.
        assert!((found[400] - found[460]).abs() < 1e-9, "{} {}", found[400], found[460]);
        assert!(found[420] > 2.0 && found[500] < -2.0);
    }
}
