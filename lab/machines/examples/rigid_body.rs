//! Prints the rigid-body dynamics of the arm at random states, for a comparison in `tests/rigid_body/run`.
//!
//! Each line has 23 numbers with full precision: angles (rad), speeds (rad/s), accelerations (rad/s^2) and torques (Nm) of
//! the three joints, the mass matrix row by row (kg m^2), and the kinetic and potential energy (J).

use paper_machines::manipulator::rigid_body::{GRAVITY_M_S2, TABLE_2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Number of random states.
const STATES: usize = 200;

fn main() {
    let mut random = Pcg64::seed_from_u64(16);
    for _ in 0..STATES {
        let mut within =
            |most: f64| -> [f64; 3] { std::array::from_fn(|_| random.random_range(-most..most)) };
        let (q, v, a) = (within(3.1), within(4.0), within(20.0));
        let torque = TABLE_2.inverse_dynamics(q, v, a, GRAVITY_M_S2);
        let mass = TABLE_2.mass_matrix(q);
        let numbers = [q, v, a, torque].concat().into_iter().chain(mass.concat());
        let numbers = numbers.chain(TABLE_2.energy(q, v));
        println!("{}", numbers.map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" "));
    }
}
