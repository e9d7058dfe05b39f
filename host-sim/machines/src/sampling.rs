//! From a simulated run to the rows of a log: one sampler for every campaign, and the sensors that it asks.
//!
//! ```text
//! motion, torque, condition of each row ─► sensors ─► lost rows ─► errors of the covariates ─► digits of the file
//! ```
//!
//! [`Sensors`] without an overridden method read the truth. A campaign overrides what its devices change. Each
//! channel has random numbers of its own, so a sensor that draws more or fewer does not change the others. Values have
//! the digits of the file, so that a log in memory equals the one read back from `data.csv`.

use crate::conditions::Condition;
use crate::log::{Log, LoggedRun};
use crate::motion::Motion;
use crate::sampler::Sampler;
use std::ops::Range;

/// A planned run before its simulation.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    /// Motion of the shaft.
    pub motion: Motion,
    /// Angle of the shaft at the start, rad.
    pub start_angle: f64,
    /// Operating conditions.
    pub condition: Condition,
    /// Sample times, s from the start of the motion.
    pub times: Vec<f64>,
    /// Ranges of rows that the log loses.
    pub lost: Vec<Range<usize>>,
    /// Contact torque at the start, as a share of the Coulomb level.
    pub held: f64,
    /// Seed of the run's sensors.
    pub seed: u64,
}

impl PlannedRun {
    /// Returns the values of the rows that are not lost.
    pub fn keep(&self, rows: &[f64]) -> Vec<f64> {
        let is_lost = |row: usize| self.lost.iter().any(|lost| lost.contains(&row));
        rows.iter().enumerate().filter(|(row, _)| !is_lost(*row)).map(|(_, x)| *x).collect()
    }
}

/// Motion and torque at the rows of a run.
#[derive(Clone, Debug)]
pub struct TrueRows<'a> {
    /// Sample times, s from the start of the motion.
    pub times: &'a [f64],
    /// Angles of the shaft, rad.
    pub angles: Vec<f64>,
    /// Velocities, rad/s.
    pub velocities: Vec<f64>,
    /// Accelerations, rad/s^2.
    pub accelerations: Vec<f64>,
    /// Torques, Nm.
    pub torques: &'a [f64],
}

impl<'a> TrueRows<'a> {
    /// Returns the rows of a run with these torques, Nm.
    pub fn new(run: &'a PlannedRun, torques: &'a [f64]) -> Self {
        let instants: Vec<_> = run.times.iter().map(|t| run.motion.at(*t)).collect();
        Self {
            times: &run.times,
            angles: instants.iter().map(|at| run.start_angle + at.angle).collect(),
            velocities: instants.iter().map(|at| at.velocity).collect(),
            accelerations: instants.iter().map(|at| at.acceleration).collect(),
            torques,
        }
    }
}

/// Errors of the covariates' sensors, as shares of the range of each column in the campaign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CovariateErrors {
    /// Standard deviation of the noise.
    pub noise: f64,
    /// Step of the readings.
    pub resolution: f64,
}

/// The sensors of a campaign. By default they are exact.
pub trait Sensors {
    /// Returns the logged angle of each row, rad.
    fn angles(&self, rows: &TrueRows) -> Vec<f64> {
        rows.angles.clone()
    }

    /// Returns the logged velocity of each row, rad/s.
    fn velocities(&self, _: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        rows.velocities.clone()
    }

    /// Returns the logged acceleration of each row, rad/s^2.
    fn accelerations(&self, _: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        rows.accelerations.clone()
    }

    /// Returns the logged torque of each row, Nm.
    fn torques(&self, _: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        rows.torques.to_vec()
    }

    /// Returns a time whose reading of a covariate is logged at `time_s`, s.
    fn covariate_time_s(&self, time_s: f64) -> f64 {
        time_s
    }

    /// Returns the errors of the covariates.
    fn covariate_errors(&self) -> CovariateErrors {
        CovariateErrors::default()
    }

    /// Returns the time stamp of a row at a campaign time, s.
    fn stamp_s(&self, _: &mut Sampler, campaign_s: f64) -> f64 {
        campaign_s
    }
}

/// Purposes of the samplers of a run. Those of its columns follow [`COLUMN_PURPOSE`].
const VELOCITY_PURPOSE: u64 = 1;
const TORQUE_PURPOSE: u64 = 2;
const CLOCK_PURPOSE: u64 = 3;
const ACCELERATION_PURPOSE: u64 = 4;
const COLUMN_PURPOSE: u64 = 16;

/// Logged motion and torque of all rows of a run, lost rows included.
#[derive(Clone, Debug)]
pub struct Readings {
    /// Angles, rad.
    pub position: Vec<f64>,
    /// Velocities, rad/s.
    pub velocity: Vec<f64>,
    /// Accelerations, rad/s^2.
    pub acceleration: Vec<f64>,
    /// Torques, Nm.
    pub torque: Vec<f64>,
}

impl Readings {
    /// Reads the rows of a run with its seed.
    pub fn take(sensors: &impl Sensors, seed: u64, rows: &TrueRows) -> Self {
        let sampler = |purpose| Sampler::new(seed, purpose);
        Self {
            position: sensors.angles(rows),
            velocity: sensors.velocities(&mut sampler(VELOCITY_PURPOSE), rows),
            acceleration: sensors.accelerations(&mut sampler(ACCELERATION_PURPOSE), rows),
            torque: sensors.torques(&mut sampler(TORQUE_PURPOSE), rows),
        }
    }
}

/// A run with its readings, and with columns that are neither a motion nor an operating condition.
pub struct ReadRun<'a> {
    /// The run.
    pub run: &'a PlannedRun,
    /// Its readings.
    pub readings: &'a Readings,
    /// Name and values of each further column, in all rows.
    pub further: Vec<(&'static str, Vec<f64>)>,
}

/// Columns of the motion, in the order of the file. The angle may be missing.
const MOTION_COLUMNS: [&str; 4] = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"];

/// Column that is computed from the motion and not disturbed as a covariate.
const ACCELERATION_COLUMN: &str = "acceleration_rad_s2";

/// Creates the log of a campaign with these columns besides time, velocity and torque. A column that a run does not have is
/// left out.
pub fn log(sensors: &impl Sensors, optional: &[&'static str], runs: &[ReadRun]) -> Log {
    let [required @ .., position] = MOTION_COLUMNS;
    let exists = |name: &&str| runs.iter().all(|read| column(sensors, name, read).is_some());
    let position_column = optional.contains(&position).then_some(position);
    let others = optional.iter().copied().filter(|name| *name != position).filter(exists);
    let names: Vec<&str> = required.into_iter().chain(position_column).chain(others).collect();
    let mut logged: Vec<LoggedRun> = runs
        .iter()
        .enumerate()
        .map(|(index, read)| {
            let columns = names.iter().filter_map(|name| column(sensors, name, read));
            let columns = columns.map(|values| read.run.keep(&values)).collect();
            LoggedRun { name: index.to_string(), columns }
        })
        .collect();
    for (place, name) in names.iter().enumerate() {
        if !MOTION_COLUMNS.contains(name) && *name != ACCELERATION_COLUMN {
            disturb(sensors.covariate_errors(), &mut logged, runs, place);
        }
    }
    Log { columns: names.into_iter().map(str::to_owned).collect(), runs: logged }.rounded()
}

/// Returns a column of a run in all its rows, or `None` if the run does not have it.
fn column(sensors: &impl Sensors, name: &str, read: &ReadRun) -> Option<Vec<f64>> {
    let ReadRun { run, readings, further } = read;
    if let Some((_, values)) = further.iter().find(|(column, _)| *column == name) {
        return Some(values.clone());
    }
    let values = match name {
        "time_s" => {
            let mut sampler = Sampler::new(run.seed, CLOCK_PURPOSE);
            let stamp = |t: &f64| sensors.stamp_s(&mut sampler, run.condition.start_s + t);
            run.times.iter().map(stamp).collect()
        }
        "velocity_rad_s" => readings.velocity.clone(),
        "torque_nm" => readings.torque.clone(),
        "position_rad" => readings.position.clone(),
        ACCELERATION_COLUMN => readings.acceleration.clone(),
        _ => {
            let signal = run.condition.signal(name)?;
            run.times.iter().map(|t| signal.at(sensors.covariate_time_s(*t))).collect()
        }
    };
    Some(values)
}

/// Adds noise and resolution to a column of all runs.
fn disturb(errors: CovariateErrors, logged: &mut [LoggedRun], runs: &[ReadRun], place: usize) {
    if errors == CovariateErrors::default() {
        return;
    }
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let values = logged.iter().flat_map(|run| &run.columns[place]);
    let (low, high) = values.fold(ends, |(low, high), v| (low.min(*v), high.max(*v)));
    let (noise, step) = (errors.noise * (high - low), errors.resolution * (high - low));
    for (run, ReadRun { run: planned, .. }) in logged.iter_mut().zip(runs) {
        let mut sampler = Sampler::new(planned.seed, COLUMN_PURPOSE + place as u64);
        for value in &mut run.columns[place] {
            let noisy = *value + noise * sampler.normal();
            *value = if step > 0.0 { (noisy / step).round() * step } else { noisy };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditions::{Extra, Signal};
    use crate::motion::Wave;

    struct Exact;

    impl Sensors for Exact {}

    /// Loses its third row.
    fn planned() -> PlannedRun {
        let force = Signal { level: 30.0, per_s: 10.0, ..Signal::default() };
        let extras = vec![(Extra::Humidity, Signal { level: 40.0, ..Signal::default() })];
        PlannedRun {
            motion: Motion::Waves(vec![Wave { peak: 2.0, hz: 1.0 }]),
            start_angle: 0.5,
            condition: Condition { start_s: 100.0, force, extras, ..Condition::default() },
            times: (0..5).map(|row| f64::from(row) * 0.1).collect(),
            lost: std::iter::once(2..3).collect(),
            held: 0.0,
            seed: 7,
        }
    }

    fn logged(sensors: &impl Sensors, optional: &[&'static str]) -> Log {
        let run = planned();
        let readings = Readings::take(sensors, run.seed, &TrueRows::new(&run, &[1.0; 5]));
        let further = vec![("payload", vec![9.0; 5])];
        log(sensors, optional, &[ReadRun { run: &run, readings: &readings, further }])
    }

    #[test]
    fn log_with_exact_sensors_holds_the_truth_of_the_kept_rows() {
        let log =
            logged(&Exact, &["radial_force_n", "humidity_percent", "position_rad", "payload"]);
        let motion = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"];
        let others = ["radial_force_n", "humidity_percent", "payload"];
        assert_eq!(log.columns, [&motion[..], &others[..]].concat());
        let run = &log.runs[0];
        assert_eq!(log.column(run, "time_s").unwrap(), [100.0, 100.1, 100.3, 100.4]);
        assert_eq!(log.column(run, "radial_force_n").unwrap(), [30.0, 31.0, 33.0, 34.0]);
        assert_eq!(log.column(run, "payload").unwrap(), [9.0; 4]);
        let angle = 0.5 + planned().motion.at(0.3).angle;
        assert!((log.column(run, "position_rad").unwrap()[2] - angle).abs() < 1e-8);
    }

    #[test]
    fn log_leaves_out_a_column_that_the_run_does_not_have() {
        let log = logged(&Exact, &["lubricant_age_h", "temperature_c"]);
        assert_eq!(log.columns[3..], ["temperature_c"]);
        assert_eq!(log.runs[0].columns.len(), 4);
    }

    #[test]
    fn log_with_covariate_errors_disturbs_the_covariates_only() {
        struct Coarse;
        impl Sensors for Coarse {
            fn covariate_errors(&self) -> CovariateErrors {
                CovariateErrors { noise: 0.0, resolution: 0.5 }
            }
        }
        let optional = ["radial_force_n", "acceleration_rad_s2"];
        let (exact, coarse) = (logged(&Exact, &optional), logged(&Coarse, &optional));
        let force = |log: &Log| log.column(&log.runs[0], "radial_force_n").unwrap().to_vec();
        // Steps of half the range of 4 N.
        assert_eq!(force(&coarse), [30.0, 32.0, 34.0, 34.0]);
        let without_force = |log: &Log| {
            let columns = log.columns.iter().zip(&log.runs[0].columns);
            columns.filter(|(name, _)| *name != "radial_force_n").map(|(_, x)| x.clone()).collect()
        };
        let [exact, coarse]: [Vec<Vec<f64>>; 2] = [&exact, &coarse].map(without_force);
        assert_eq!(exact, coarse);
    }
}
