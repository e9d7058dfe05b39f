//! Rigid-body dynamics of the arm by the recursive Newton-Euler method.
//!
//! The arm hangs from its support. Joint 1 turns about the vertical. Joints 2 and 3 turn about parallel horizontal axes
//! that rotate with joint 1. All angles are 0 if both links hang straight down, which is the equilibrium at equal
//! pressures. Table 2 of the paper gives no mass of link 1, so only its inertia about the vertical is modelled.
//!
//! In the frame of a link, `x` is the joint axis, `y` points along the link, and `z` is orthogonal to both. With this
//! interpretation, Table 2 contains exactly the quantities that the dynamics need.
//!
//! The recursion computes velocities and accelerations from the base to the tip, and torques from the tip to the base.
//! The columns of the mass matrix are the torques of unit accelerations.

/// Gravity, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.81;

/// Masses and lengths, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Links {
    /// Length of link 2, m.
    pub length_2_m: f64,
    /// Distance from joint 2 to the centre of mass of link 2, m.
    pub centre_2_m: f64,
    /// Distance from joint 3 to the centre of mass of link 3, m.
    pub centre_3_m: f64,
    /// Mass of link 2, kg.
    pub mass_2_kg: f64,
    /// Mass of link 3, kg.
    pub mass_3_kg: f64,
    /// Inertia of link 1 about the vertical, kg m^2.
    pub inertia_1_kg_m2: f64,
    /// Inertia of link 2 about its centre of mass and axes `x`, `y`, `z`, kg m^2.
    pub inertia_2_kg_m2: [f64; 3],
    /// Inertia of link 3 about its centre of mass and axes `x`, `y`, `z`, kg m^2.
    pub inertia_3_kg_m2: [f64; 3],
}

/// Table 2 of the paper.
pub const TABLE_2: Links = Links {
    length_2_m: 0.8100,
    centre_2_m: 0.5050,
    centre_3_m: 0.1943,
    mass_2_kg: 11.895,
    mass_3_kg: 4.7538,
    inertia_1_kg_m2: 0.0014,
    inertia_2_kg_m2: [0.0798, 0.0031, 0.0035],
    inertia_3_kg_m2: [0.0654, 0.0420, 0.0910],
};

type Vector = [f64; 3];

fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn scaled(a: Vector, factor: f64) -> Vector {
    a.map(|x| x * factor)
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

const UP: Vector = [0.0, 0.0, 1.0];

/// Axes of a body in world coordinates: joint axis, along the link, orthogonal to both.
type Axes = [Vector; 3];

/// Returns the axes of a link at an angle `lean` (rad) from the hanging position.
///
/// Its joint axis is turned by `turn` (rad) about the vertical.
fn axes(turn: f64, lean: f64) -> Axes {
    let joint = [turn.cos(), turn.sin(), 0.0];
    let ahead = [-turn.sin(), turn.cos(), 0.0];
    let along = add(scaled(UP, -lean.cos()), scaled(ahead, lean.sin()));
    [joint, along, cross(joint, along)]
}

/// Returns the product of the inertia of a body with these axes and a vector.
fn inertia_times(axes: &Axes, inertia: [f64; 3], vector: Vector) -> Vector {
    let part = |i: usize| scaled(axes[i], inertia[i] * dot(axes[i], vector));
    add(add(part(0), part(1)), part(2))
}

impl Links {
    /// Returns the joint torques, Nm, for these accelerations (rad/s^2), angles (rad), speeds (rad/s) and gravity (m/s^2).
    pub fn inverse_dynamics(&self, q: Vector, v: Vector, a: Vector, gravity: f64) -> Vector {
        let [second, third] = [axes(q[0], q[1]), axes(q[0], q[1] + q[2])];
        let joint = second[0];
        let rate_1 = scaled(UP, v[0]);
        let spin_1 = scaled(UP, a[0]);
        // The velocity of a joint adds to the angular velocity of its base, in the rotating frame of the base.
        let onto = |rate: Vector, spin: Vector, v: f64, a: f64| {
            let carried = cross(rate, scaled(joint, v));
            (add(rate, scaled(joint, v)), add(add(spin, scaled(joint, a)), carried))
        };
        let (rate_2, spin_2) = onto(rate_1, spin_1, v[1], a[1]);
        let (rate_3, spin_3) = onto(rate_2, spin_2, v[2], a[2]);
        let carried = |rate: Vector, spin: Vector, arm: Vector| {
            add(cross(spin, arm), cross(rate, cross(rate, arm)))
        };
        let centre_2 = scaled(second[1], self.centre_2_m);
        let elbow = scaled(second[1], self.length_2_m);
        let beyond = scaled(third[1], self.centre_3_m);
        let weight = scaled(UP, gravity);
        let force_2 = scaled(add(carried(rate_2, spin_2, centre_2), weight), self.mass_2_kg);
        let at_elbow = carried(rate_2, spin_2, elbow);
        let at_centre_3 = add(at_elbow, carried(rate_3, spin_3, beyond));
        let force_3 = scaled(add(at_centre_3, weight), self.mass_3_kg);
        let turning = |axes: &Axes, inertia: [f64; 3], rate: Vector, spin: Vector| {
            let momentum = inertia_times(axes, inertia, rate);
            add(inertia_times(axes, inertia, spin), cross(rate, momentum))
        };
        let moment_3 = turning(&third, self.inertia_3_kg_m2, rate_3, spin_3);
        let moment_2 = turning(&second, self.inertia_2_kg_m2, rate_2, spin_2);
        let about_elbow = add(moment_3, cross(beyond, force_3));
        let about_shoulder =
            add(add(about_elbow, cross(elbow, force_3)), add(moment_2, cross(centre_2, force_2)));
        [
            dot(UP, about_shoulder) + self.inertia_1_kg_m2 * a[0],
            dot(joint, about_shoulder),
            dot(joint, about_elbow),
        ]
    }

    /// Returns the mass matrix at these angles, kg m^2.
    pub fn mass_matrix(&self, q: Vector) -> [Vector; 3] {
        let unit = |i: usize| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
        std::array::from_fn(|i| self.inverse_dynamics(q, [0.0; 3], unit(i), 0.0))
    }

    /// Returns the accelerations, rad/s^2, for these joint torques, Nm.
    pub fn forward_dynamics(&self, q: Vector, v: Vector, torque: Vector) -> Vector {
        let bias = self.inverse_dynamics(q, v, [0.0; 3], GRAVITY_M_S2);
        let rest = std::array::from_fn(|i| torque[i] - bias[i]);
        solve(self.mass_matrix(q), rest)
    }

    /// Returns the kinetic and potential energy, J. The potential energy is 0 at the height of joint 2.
    pub fn energy(&self, q: Vector, v: Vector) -> [f64; 2] {
        let momentum = self.mass_matrix(q).map(|row| dot(row, v));
        let height_2 = -self.centre_2_m * q[1].cos();
        let height_3 = -self.length_2_m * q[1].cos() - self.centre_3_m * (q[1] + q[2]).cos();
        let weights = self.mass_2_kg * height_2 + self.mass_3_kg * height_3;
        [0.5 * dot(momentum, v), GRAVITY_M_S2 * weights]
    }
}

/// Solves a symmetric positive definite system by its Cholesky factor.
fn solve(matrix: [Vector; 3], right: Vector) -> Vector {
    let mut factor = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = matrix[i][j] - known;
            factor[i][j] = if i == j { rest.sqrt() } else { rest / factor[j][j] };
        }
    }
    let mut x = right;
    for i in 0..3 {
        let known: f64 = (0..i).map(|k| factor[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / factor[i][i];
    }
    for i in (0..3).rev() {
        let known: f64 = (i + 1..3).map(|k| factor[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / factor[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates one Runge-Kutta step without friction or muscles.
    fn swing(q: Vector, v: Vector, torque: Vector, dt: f64) -> (Vector, Vector) {
        let step = |x: Vector, slope: Vector, h: f64| add(x, scaled(slope, h));
        let at = |q, v| TABLE_2.forward_dynamics(q, v, torque);
        let (v1, a1) = (v, at(q, v));
        let (v2, a2) = (step(v, a1, dt / 2.0), at(step(q, v1, dt / 2.0), step(v, a1, dt / 2.0)));
        let (v3, a3) = (step(v, a2, dt / 2.0), at(step(q, v2, dt / 2.0), step(v, a2, dt / 2.0)));
        let (v4, a4) = (step(v, a3, dt), at(step(q, v3, dt), step(v, a3, dt)));
        let mean = |a: Vector, b: Vector, c: Vector, d: Vector| {
            scaled(add(add(a, d), scaled(add(b, c), 2.0)), 1.0 / 6.0)
        };
        (step(q, mean(v1, v2, v3, v4), dt), step(v, mean(a1, a2, a3, a4), dt))
    }

    #[test]
    fn forward_dynamics_of_free_arm_conserves_energy_and_vertical_momentum() {
        let (mut q, mut v) = ([0.3, 0.9, -0.7], [1.5, -0.4, 2.0]);
        let total = |q, v| TABLE_2.energy(q, v).iter().sum::<f64>();
        let vertical = |q, v| dot(TABLE_2.mass_matrix(q)[0], v);
        let (energy, momentum) = (total(q, v), vertical(q, v));
        for _ in 0..20_000 {
            (q, v) = swing(q, v, [0.0; 3], 5e-4);
        }
        assert!((total(q, v) - energy).abs() < 1e-6 * energy.abs(), "{}", total(q, v) - energy);
        assert!((vertical(q, v) - momentum).abs() < 1e-8, "{}", vertical(q, v) - momentum);
    }

    #[test]
    fn forward_dynamics_of_driven_arm_gains_the_work_of_its_torques() {
        let (mut q, mut v) = ([0.1, -0.5, 0.4], [0.0; 3]);
        let (from, torque) = (q, [0.3, 4.0, -1.0]);
        let before: f64 = TABLE_2.energy(q, v).iter().sum();
        for _ in 0..4000 {
            (q, v) = swing(q, v, torque, 5e-4);
        }
        let gained = TABLE_2.energy(q, v).iter().sum::<f64>() - before;
        let work = dot(torque, std::array::from_fn(|i| q[i] - from[i]));
        assert!((gained - work).abs() < 1e-7 * work.abs().max(1.0), "{gained} {work}");
    }

    /// Reference: Lagrange's equation with numerical derivatives. It shares only Table 2 with the recursion.
    #[test]
    fn inverse_dynamics_agrees_with_lagranges_equation() {
        let lagrangian = |q: Vector, v: Vector| {
            let h = 1e-5;
            let at = |t: f64| -> Vector { std::array::from_fn(|i| q[i] + t * v[i]) };
            let places = |q: Vector| {
                let down =
                    |lean: f64| [-q[0].sin() * lean.sin(), q[0].cos() * lean.sin(), -lean.cos()];
                let (along, on) = (down(q[1]), down(q[1] + q[2]));
                let elbow = scaled(along, TABLE_2.length_2_m);
                [scaled(along, TABLE_2.centre_2_m), add(elbow, scaled(on, TABLE_2.centre_3_m))]
            };
            let (before, after) = (places(at(-h)), places(at(h)));
            let masses = [TABLE_2.mass_2_kg, TABLE_2.mass_3_kg];
            let mut kinetic = 0.5 * TABLE_2.inertia_1_kg_m2 * v[0] * v[0];
            let mut height = 0.0;
            for body in 0..2 {
                let speed = scaled(add(after[body], scaled(before[body], -1.0)), 0.5 / h);
                kinetic += 0.5 * masses[body] * dot(speed, speed);
                height += masses[body] * places(q)[body][2];
            }
            // Angular velocity in the frame of the body: lean about x; the rotation about the vertical has components in y and z.
            for (inertia, lean, rate) in [
                (TABLE_2.inertia_2_kg_m2, q[1], v[1]),
                (TABLE_2.inertia_3_kg_m2, q[1] + q[2], v[1] + v[2]),
            ] {
                let body = [rate, -v[0] * lean.cos(), v[0] * lean.sin()];
                kinetic += (0..3).map(|i| 0.5 * inertia[i] * body[i] * body[i]).sum::<f64>();
            }
            kinetic - GRAVITY_M_S2 * height
        };
        let (q, v, a) = ([0.4, 0.7, -0.5], [0.9, -1.1, 0.6], [2.0, -1.5, 3.0]);
        let h = 1e-3;
        let moved = |x: Vector, i: usize, by: f64| {
            let mut x = x;
            x[i] += by;
            x
        };
        let momentum = |i: usize, t: f64| {
            // Path with these initial speeds and accelerations.
            let q = std::array::from_fn(|j| q[j] + t * v[j] + 0.5 * t * t * a[j]);
            let v = std::array::from_fn(|j| v[j] + t * a[j]);
            (lagrangian(q, moved(v, i, h)) - lagrangian(q, moved(v, i, -h))) / (2.0 * h)
        };
        let recursive = TABLE_2.inverse_dynamics(q, v, a, GRAVITY_M_S2);
        for i in 0..3 {
            let changes = (momentum(i, h) - momentum(i, -h)) / (2.0 * h);
            let slope =
                (lagrangian(moved(q, i, h), v) - lagrangian(moved(q, i, -h), v)) / (2.0 * h);
            let torque = changes - slope;
            assert!((torque - recursive[i]).abs() < 1e-3, "{i}: {torque} {recursive:?}");
        }
    }
}
