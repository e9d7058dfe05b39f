//! Measures the speed of three joints in closed loop, driver and plant, relative to real time.
//!
//! `cargo run --profile release -p friction-grading --example joint_speed`

use firmware::parameter_set::ParameterSet;
use joint_rig::{RigError, RigFaults, run_armed};
use rayon::prelude::*;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::time::Instant;

/// Virtual time of each joint, s.
const SECONDS: usize = 20;

fn main() -> Result<(), RigError> {
    let begin = Instant::now();
    let ends: Vec<f64> = (0..3u64)
        .into_par_iter()
        .map(|seed| {
            let plant = JointPlant::new(&Parameters::default(), Load::Propeller, seed);
            run_armed(&ParameterSet::default(), plant, RigFaults::default(), |rig| {
                (0..1000 * SECONDS).for_each(|_| rig.step_with_command(2.0, 5.0));
                rig.plant().position_rad()
            })
        })
        .collect::<Result<_, RigError>>()?;
    let factor = SECONDS as f64 / begin.elapsed().as_secs_f64();
    println!(
        "three joints, {SECONDS} s each on {} threads: {factor:.0} times real time ({ends:.3?} rad)",
        rayon::current_num_threads()
    );
    Ok(())
}
