//! The log of a campaign: what the sensors made of it, column by column.

use super::sampler::Sampler;
use super::sensors::{MICRO, NANO, rounded};
use super::setting::{RunSetting, Setting};
use super::surroundings::Condition;
use crate::log::{Log, LoggedRun};

/// Steps of an encoder in one radian: 21 bits a turn.
const ENCODER_STEPS: f64 = (1 << 21) as f64 / std::f64::consts::TAU;

/// Error of a measured velocity, in proportion to it: an encoder's lines are uneven, and at rest
/// it counts nothing.
const VELOCITY_ERROR: f64 = 1e-3;

/// Columns every log has.
const REQUIRED: [&str; 3] = ["time_s", "velocity_rad_s", "torque_nm"];

/// Columns of the contract a setting may have, in the order they are written.
const OPTIONAL: [&str; 6] = [
    "position_rad",
    "acceleration_rad_s2",
    "radial_force_n",
    "pressure_diff_pa",
    "temperature_c",
    "load_torque_nm",
];

/// The log of all runs, with the torques as they truly are and a torque sensor's noise.
pub(super) fn log(setting: &Setting, torques: &[Vec<f64>], noise_nm: f64) -> Log {
    let runs = setting
        .runs
        .iter()
        .zip(torques)
        .enumerate()
        .map(|(index, (run, torque))| logged(setting, run, index, torque, noise_nm))
        .collect();
    let optional = OPTIONAL.into_iter().filter(|name| setting.columns.contains(name));
    let columns = REQUIRED.into_iter().chain(optional).chain(setting.extra_columns());
    Log { columns: columns.map(str::to_owned).collect(), runs }
}

fn logged(
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
        let error = if encoder { VELOCITY_ERROR * at.velocity * sampler.normal() } else { 0.0 };
        rounded(at.velocity + error, NANO)
    });
    let velocity: Vec<f64> = velocity.collect();
    let angle = |angle: f64| {
        let angle = run.start_angle + angle;
        rounded(if encoder { rounded(angle, ENCODER_STEPS) } else { angle }, NANO)
    };
    let acceleration = instants.iter().map(|at| {
        let error = if encoder { 2e-3 * steepest * sampler.normal() } else { 0.0 };
        rounded(at.acceleration + error, MICRO)
    });
    let acceleration: Vec<f64> = acceleration.collect();
    let taken = |of: &dyn Fn(&Condition, f64) -> f64, per_unit: f64| -> Vec<f64> {
        run.times.iter().map(|&t| rounded(of(&run.condition, t), per_unit)).collect()
    };
    let optional = |column: &str| -> Vec<f64> {
        match column {
            "position_rad" => instants.iter().map(|at| angle(at.angle)).collect(),
            "acceleration_rad_s2" => acceleration.clone(),
            "radial_force_n" => taken(&|around, t| around.force.at(t), MICRO),
            "pressure_diff_pa" => taken(&|around, t| around.pressure.at(t), 1e3),
            "temperature_c" => taken(&|around, t| around.temperature.at(t), MICRO),
            _ => taken(&|around, t| around.load.at(t), MICRO),
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
    columns.extend(extras.map(|(_, signal)| taken(&|_, t| signal.at(t), MICRO)));
    LoggedRun { name: index.to_string(), columns }
}
