//! Creates the log of a campaign: the sensor readings of all columns.

use super::sensors::{MICRO, NANO, rounded};
use super::setting::{RunSetting, Setting};
use crate::conditions::Condition;
use crate::log::{Log, LoggedRun};
use crate::sampler::Sampler;

/// Encoder steps per radian: 21 bits per turn.
const ENCODER_STEPS_PER_RAD: f64 = (1 << 21) as f64 / std::f64::consts::TAU;

/// Relative error of the measured velocity. It models uneven encoder lines, so it is zero at rest.
const RELATIVE_VELOCITY_ERROR: f64 = 1e-3;

/// Columns of every log.
const REQUIRED: [&str; 3] = ["time_s", "velocity_rad_s", "torque_nm"];

/// Optional columns of the data contract, in the order of the file.
const OPTIONAL: [&str; 6] = [
    "position_rad",
    "acceleration_rad_s2",
    "radial_force_n",
    "pressure_diff_pa",
    "temperature_c",
    "load_torque_nm",
];

/// Returns the log of all runs. `torques` are the true torques, to which sensor noise is added.
pub(crate) fn log(setting: &Setting, torques: &[Vec<f64>], noise_nm: f64) -> Log {
    let runs = setting
        .runs
        .iter()
        .zip(torques)
        .enumerate()
        .map(|(index, (run, torque))| log_run(setting, run, index, torque, noise_nm))
        .collect();
    let optional = OPTIONAL.into_iter().filter(|name| setting.columns.contains(name));
    let columns = REQUIRED.into_iter().chain(optional).chain(setting.extra_columns());
    Log { columns: columns.map(str::to_owned).collect(), runs }
}

/// Returns the log of one run.
fn log_run(
    setting: &Setting,
    run: &RunSetting,
    index: usize,
    torque: &[f64],
    noise_nm: f64,
) -> LoggedRun {
    let mut sampler = Sampler::new(run.seed, 1);
    let noise: Vec<f64> = torque.iter().map(|_| noise_nm * sampler.normal()).collect();
    let instants: Vec<_> = run.times.iter().map(|&t| run.motion.at(t)).collect();
    let steepest = instants.iter().map(|at| at.acceleration.abs()).fold(0.0, f64::max);
    let encoder = setting.sensors.encoder;
    let velocity = instants.iter().map(|at| {
        let error =
            if encoder { RELATIVE_VELOCITY_ERROR * at.velocity * sampler.normal() } else { 0.0 };
        rounded(at.velocity + error, NANO)
    });
    let velocity: Vec<f64> = velocity.collect();
    let angle = |angle: f64| {
        let angle = run.start_angle + angle;
        rounded(if encoder { rounded(angle, ENCODER_STEPS_PER_RAD) } else { angle }, NANO)
    };
    let acceleration = instants.iter().map(|at| {
        let error = if encoder { 2e-3 * steepest * sampler.normal() } else { 0.0 };
        rounded(at.acceleration + error, MICRO)
    });
    let acceleration: Vec<f64> = acceleration.collect();
    let sampled = |of: &dyn Fn(&Condition, f64) -> f64, per_unit: f64| -> Vec<f64> {
        run.times.iter().map(|&t| rounded(of(&run.condition, t), per_unit)).collect()
    };
    let optional = |column: &str| -> Vec<f64> {
        match column {
            "position_rad" => instants.iter().map(|at| angle(at.angle)).collect(),
            "acceleration_rad_s2" => acceleration.clone(),
            "radial_force_n" => sampled(&|conditions, t| conditions.force.at(t), MICRO),
            "pressure_diff_pa" => sampled(&|conditions, t| conditions.pressure.at(t), 1e3),
            "temperature_c" => sampled(&|conditions, t| conditions.temperature.at(t), MICRO),
            _ => sampled(&|conditions, t| conditions.load.at(t), MICRO),
        }
    };
    let has = |column: &str| setting.columns.contains(&column);
    let start_s = run.condition.start_s;
    let mut columns = vec![
        run.times.iter().map(|t| rounded(start_s + t, MICRO)).collect(),
        velocity,
        torque.iter().zip(&noise).map(|(f, e)| rounded(f + e, MICRO)).collect(),
    ];
    columns.extend(OPTIONAL.into_iter().filter(|column| has(column)).map(optional));
    let extras = run.condition.extras.iter().filter(|(extra, _)| has(extra.column()));
    columns.extend(extras.map(|(_, signal)| sampled(&|_, t| signal.at(t), MICRO)));
    LoggedRun { name: index.to_string(), columns }
}
