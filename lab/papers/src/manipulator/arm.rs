//! Simulates the arm with a friction model in each joint, from a log's pressures to angles.
//!
//! The known dynamics of the arm are written here as Lagrange's closed form, over the core's number type. The machine uses
//! the recursion of Newton and Euler, and a test compares both. With dual numbers the trajectory carries its exact
//! derivatives by the friction parameters.
//!
//! The step is symplectic Euler: speeds from the present torques, then angles from the new speeds. A law with a jump at rest
//! (every law without a bristle) would chatter, and so would its derivatives. Such a joint sticks instead: a joint whose
//! speed would change its sign stops. It stays at rest while its torque lies between the law's torques just below and just
//! above rest (Moreau's time stepping). The speed of a sticking joint depends on no parameter.

use compensator_core::{FrictionModel, ModelState, Parameters, Real, Sample};
use paper_machines::manipulator::muscle::Pair;
use paper_machines::manipulator::rigid_body::{GRAVITY_M_S2, Links};
use std::f64::consts::FRAC_PI_2;

/// Number of joints.
pub const JOINTS: usize = 3;

/// Known dynamics of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    /// Rigid bodies.
    pub links: Links,
    /// Muscles of each joint.
    pub pairs: [Pair; JOINTS],
}

/// Input of a run: gauge pressures of each joint's muscles (left, right), Pa, one value per row.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Time between rows, s.
    pub period_s: f64,
    /// Pressures, Pa.
    pub pressures_pa: [[Vec<f64>; 2]; JOINTS],
    /// Angles at the first row, rad.
    pub start_rad: [f64; JOINTS],
}

/// Inertia of the arm, and torques other than those of muscles and friction.
pub struct Dynamics<T> {
    /// Mass matrix, kg m^2: (1,1), (2,2), (2,3), (3,3). Joint 1 has no inertial coupling to the others.
    pub mass: [T; 4],
    /// Torque needed against gravity and velocity coupling, Nm.
    pub bias: [T; JOINTS],
}

impl Arm {
    /// Returns inertia and bias at these angles (rad) and speeds (rad/s).
    pub fn dynamics<T: Real>(&self, q: [T; JOINTS], v: [T; JOINTS]) -> Dynamics<T> {
        let number = T::from_f64;
        let cosine = |x: T| (x + number(FRAC_PI_2)).sin();
        let Links { length_2_m: length, centre_3_m: beyond, mass_3_kg: mass, .. } = self.links;
        let on = q[1] + q[2];
        let (s2, c2, s3, c3) = (q[1].sin(), cosine(q[1]), on.sin(), cosine(on));
        let (sine_elbow, cosine_elbow) = (q[2].sin(), cosine(q[2]));
        let [x2, y2, z2] = self.links.inertia_2_kg_m2;
        let [x3, y3, z3] = self.links.inertia_3_kg_m2;
        let about_2 = self.links.mass_2_kg * self.links.centre_2_m * self.links.centre_2_m;
        let reach = number(length) * s2 + number(beyond) * s3;
        let upright = number(y2) * c2 * c2
            + number(z2 + about_2) * s2 * s2
            + number(y3) * c3 * c3
            + number(z3) * s3 * s3;
        let m11 = number(self.links.inertia_1_kg_m2) + upright + number(mass) * reach * reach;
        let elbow = number(mass * length * beyond) * cosine_elbow;
        let m33 = number(x3 + mass * beyond * beyond);
        let m23 = m33 + elbow;
        let m22 = number(x2 + about_2 + mass * length * length) + m33 + elbow + elbow;
        // Half the derivatives of m11.
        let two = number(2.0);
        let by_third = number(z3 - y3) * s3 * c3 + number(mass * beyond) * reach * c3;
        let by_second =
            number(z2 + about_2 - y2) * s2 * c2 + number(mass * length) * reach * c2 + by_third;
        let bend = number(mass * length * beyond) * sine_elbow;
        let weight_3 = number(GRAVITY_M_S2 * mass * beyond) * s3;
        let second = self.links.mass_2_kg * self.links.centre_2_m + mass * length;
        let weight_2 = number(GRAVITY_M_S2 * second) * s2 + weight_3;
        let bias = [
            two * (by_second * v[1] + by_third * v[2]) * v[0],
            weight_2 - bend * v[2] * (two * v[1] + v[2]) - by_second * v[0] * v[0],
            weight_3 + bend * v[1] * v[1] - by_third * v[0] * v[0],
        ];
        Dynamics { mass: [m11, m22, m23, m33], bias }
    }

    /// Returns the torque of a joint's muscles, Nm.
    fn muscles<T: Real>(&self, joint: usize, pressures_pa: [f64; 2], angle: T) -> T {
        let pair = &self.pairs[joint];
        let (sine, tangent) = (pair.thread_rad.sin(), pair.thread_rad.tan());
        let area = std::f64::consts::PI * pair.radius_m * pair.radius_m * pair.pulley_m;
        let pull = |pressure: f64, direction: f64| {
            let left = T::from_f64(1.0 - pair.contraction)
                - T::from_f64(direction * pair.pulley_m / pair.length_m) * angle;
            let shape = T::from_f64(3.0 / (tangent * tangent)) * left * left
                - T::from_f64(1.0 / (sine * sine));
            (T::from_f64(area * pressure) * shape).at_least(T::zero())
        };
        pull(pressures_pa[1], 1.0) - pull(pressures_pa[0], -1.0)
    }
}

impl<T: Real> Dynamics<T> {
    /// Returns the torque beyond the bias for these accelerations, Nm.
    pub fn torque(&self, a: [T; JOINTS]) -> [T; JOINTS] {
        let [m11, m22, m23, m33] = self.mass;
        [m11 * a[0], m22 * a[1] + m23 * a[2], m23 * a[1] + m33 * a[2]]
    }

    /// Returns the accelerations of the free joints under a torque; those of held joints are given.
    fn accelerations(&self, torque: [T; JOINTS], held: [Option<T>; JOINTS]) -> [T; JOINTS] {
        let [m11, m22, m23, m33] = self.mass;
        let first = held[0].unwrap_or_else(|| torque[0].ratio(m11));
        let (second, third) = match (held[1], held[2]) {
            (Some(second), Some(third)) => (second, third),
            (Some(second), None) => (second, (torque[2] - m23 * second).ratio(m33)),
            (None, Some(third)) => ((torque[1] - m23 * third).ratio(m22), third),
            (None, None) => {
                let inverse = T::one().ratio(m22 * m33 - m23 * m23);
                let second = (m33 * torque[1] - m23 * torque[2]) * inverse;
                (second, (m22 * torque[2] - m23 * torque[1]) * inverse)
            }
        };
        [first, second, third]
    }
}

/// Speed just beside rest, beyond the jump of a static law, rad/s.
const BESIDE_REST_RAD_S: f64 = 1e-12;

/// Speed above which a trajectory counts as diverged, rad/s.
const DIVERGED_RAD_S: f64 = 1e3;

/// Maximum number of iterations for the set of sticking joints in a step; three joints seldom need three.
const MAX_STICK_ITERATIONS: usize = 8;

/// State of a running simulation.
struct ArmSimulation<'a, T: Real> {
    arm: &'a Arm,
    models: [FrictionModel<T>; JOINTS],
    states: [ModelState<T>; JOINTS],
    inputs: [Sample<T>; JOINTS],
    has_jump_at_rest: bool,
    dt: T,
    q: [T; JOINTS],
    v: [T; JOINTS],
}

impl<T: Real<Setting = T>> ArmSimulation<'_, T> {
    fn friction(&mut self, joint: usize, velocity: T) -> T {
        self.inputs[joint].velocity_rad_s = velocity;
        self.models[joint].step(&mut self.states[joint], &self.inputs[joint])
    }

    fn step(&mut self, pressures_pa: [[f64; 2]; JOINTS]) {
        let dynamics = self.arm.dynamics(self.q, self.v);
        let drive: [T; JOINTS] = std::array::from_fn(|i| {
            self.arm.muscles(i, pressures_pa[i], self.q[i]) - dynamics.bias[i]
        });
        let a = if self.has_jump_at_rest {
            self.accelerations_with_sticking(&dynamics, drive)
        } else {
            let torque = std::array::from_fn(|i| drive[i] - self.friction(i, self.v[i]));
            dynamics.accelerations(torque, [None; JOINTS])
        };
        for (i, a) in a.into_iter().enumerate() {
            self.v[i] = self.v[i] + self.dt * a;
            self.q[i] = self.q[i] + self.dt * self.v[i];
        }
    }

    /// Returns the accelerations with sticking joints.
    fn accelerations_with_sticking(
        &mut self,
        dynamics: &Dynamics<T>,
        drive: [T; JOINTS],
    ) -> [T; JOINTS] {
        // A sliding joint has its friction; the friction of a sticking joint follows from the accelerations.
        let mut sliding: [Option<T>; JOINTS] = std::array::from_fn(|i| {
            (self.v[i].value() != 0.0).then(|| self.friction(i, self.v[i]))
        });
        let mut released = [0.0; JOINTS];
        let mut a = [T::zero(); JOINTS];
        for _ in 0..MAX_STICK_ITERATIONS {
            let stops: [Option<T>; JOINTS] = std::array::from_fn(|i| {
                sliding[i].is_none().then(|| {
                    if self.v[i].value() == 0.0 { T::zero() } else { -(self.v[i].ratio(self.dt)) }
                })
            });
            let torque = std::array::from_fn(|i| drive[i] - sliding[i].unwrap_or_default());
            a = dynamics.accelerations(torque, stops);
            let borne = dynamics.torque(a);
            let mut settled = true;
            for i in 0..JOINTS {
                let next = (self.v[i] + self.dt * a[i]).value();
                if sliding[i].is_some() {
                    let from = if released[i] == 0.0 { self.v[i].value() } else { released[i] };
                    if next * from < 0.0 && released[i] == 0.0 {
                        sliding[i] = None;
                        settled = false;
                    }
                    continue;
                }
                let load = drive[i] - borne[i];
                for direction in [1.0, -1.0] {
                    let limit = self.friction(i, T::from_f64(direction * BESIDE_REST_RAD_S));
                    if released[i] == 0.0 && direction * (load.value() - limit.value()) > 0.0 {
                        sliding[i] = Some(limit);
                        released[i] = direction;
                        settled = false;
                    }
                }
            }
            if settled {
                break;
            }
        }
        // The speed of a sticking joint is exactly 0.
        for ((v, a), _) in
            self.v.iter_mut().zip(&mut a).zip(&sliding).filter(|(_, sliding)| sliding.is_none())
        {
            (*v, *a) = (T::zero(), T::zero());
        }
        a
    }
}

impl Arm {
    /// Simulates the arm with one model per joint. `held` is the initial bristle torque, Nm. A step covers `stride` rows.
    ///
    /// `each` receives every such row with its angles (rad) and bristle torques (Nm). Returns false if the trajectory diverges.
    pub fn run<T: Real<Setting = T>>(
        &self,
        drive: &Drive,
        parameters: &[Parameters<T>; JOINTS],
        held: [T; JOINTS],
        stride: usize,
        mut each: impl FnMut(usize, &[T; JOINTS], [T; JOINTS]),
    ) -> bool {
        let dt = T::from_f64(drive.period_s * stride as f64);
        let mut motion = ArmSimulation {
            arm: self,
            models: parameters.each_ref().map(|of| of.build_unchecked(dt)),
            states: held.map(ModelState::holding),
            inputs: std::array::from_fn(|_| Sample::default()),
            has_jump_at_rest: !parameters[0].law.has_bristles(),
            dt,
            q: drive.start_rad.map(T::from_f64),
            v: [T::zero(); JOINTS],
        };
        let rows = drive.pressures_pa[0][0].len();
        for row in (0..rows).step_by(stride) {
            let holding = motion.states.each_ref().map(|state| state.bristle_torque_nm);
            each(row, &motion.q, holding);
            // The pressure at half the step, to the nearest row.
            let at = (row + stride / 2).min(rows - 1);
            let pressures = std::array::from_fn(|joint| {
                std::array::from_fn(|side| drive.pressures_pa[joint][side][at])
            });
            motion.step(pressures);
            let has_diverged = |v: &T| v.value().is_nan() || v.value().abs() > DIVERGED_RAD_S;
            if motion.v.iter().any(has_diverged) {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id};
    use paper_machines::manipulator::muscle::PAIRS;
    use paper_machines::manipulator::rigid_body::TABLE_2;

    const ARM: Arm = Arm { links: TABLE_2, pairs: PAIRS };

    #[test]
    fn dynamics_closed_form_matches_machine_recursion() {
        for (q, v, a) in [
            ([0.3, 0.7, -0.4], [1.0, -0.6, 2.0], [3.0, -2.0, 1.0]),
            ([-1.0, 0.1, 1.3], [-2.0, 1.5, 0.3], [0.0, 4.0, -5.0]),
        ] {
            let dynamics = ARM.dynamics(q, v);
            let inertial = dynamics.torque(a);
            let expected = TABLE_2.inverse_dynamics(q, v, a, GRAVITY_M_S2);
            for i in 0..JOINTS {
                let ours = inertial[i] + dynamics.bias[i];
                assert!((ours - expected[i]).abs() < 1e-12, "{i} {ours} {expected:?}");
            }
        }
    }

    #[test]
    fn muscle_torque_matches_machine() {
        for (joint, pair) in PAIRS.iter().enumerate() {
            let ours = ARM.muscles(joint, [300e3, 520e3], 0.2);
            let theirs = pair.torque_nm([300e3, 520e3], 0.2);
            assert!((ours - theirs).abs() < 1e-12);
        }
    }

    /// Equal pressures, with a pull to one side on joint 1 from 0.5 s.
    fn drive() -> Drive {
        let steady = || vec![550e3; 2000];
        let mut pressures_pa: [[Vec<f64>; 2]; 3] = std::array::from_fn(|_| [steady(), steady()]);
        pressures_pa[0][1][500..].fill(500e3);
        Drive { period_s: 1e-3, pressures_pa, start_rad: [0.0; 3] }
    }

    fn last_angle(parameters: &[Parameters<f64>; 3], stride: usize) -> [f64; 3] {
        let mut last = [0.0; 3];
        assert!(ARM.run(&drive(), parameters, [0.0; 3], stride, |_, q, _| last = *q));
        last
    }

    #[test]
    fn joint_below_coulomb_level_sticks_and_above_slides() {
        let with = |level: f64| {
            let joint = |level: f64| {
                Parameters::new(LawKind::Linear)
                    .with(Id::CoulombTorque, level)
                    .with(Id::ViscousFriction, 1.0)
            };
            [joint(level), joint(1.0), joint(0.1)]
        };
        let torque = PAIRS[0].torque_nm([550e3, 500e3], 0.0).abs();
        assert_eq!(last_angle(&with(1.01 * torque), 1), [0.0; 3]);
        let free = last_angle(&with(0.5 * torque), 1)[0];
        // Friction stops the joint before the muscles' equilibrium.
        let left = PAIRS[0].torque_nm([550e3, 500e3], free).abs();
        assert!(free < -0.01 && left < 0.5 * torque && left > 0.3 * torque, "{free} {left}");
    }

    #[test]
    fn longer_step_gives_same_final_angle() {
        let bristles = Parameters::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 0.3)
            .with(Id::StaticTorque, 0.4)
            .with(Id::BristleStiffness, 100.0)
            .with(Id::ViscousFriction, 1.0);
        let parameters = [bristles.clone(), bristles.clone(), bristles];
        let (fine, coarse) = (last_angle(&parameters, 1)[0], last_angle(&parameters, 4)[0]);
        assert!((fine - coarse).abs() < 1e-2 * fine.abs(), "{fine} {coarse}");
    }
}
