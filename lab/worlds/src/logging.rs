//! The log of a simulated world: what the sensors and the clock make of its rows.

use super::campaign::{AddedColumn, Campaign, RunPlan};
use super::family::Family;
use super::mechanism::Mechanism;
use super::reading::Logged;
use super::truth::{HiddenEffect, UnkindTruth};
use super::visible::Rows;
use super::world::World;
use simulated_machines::imposed::{Point, Trajectory};
use simulated_machines::sampler::Sampler;
use simulated_machines::{Log, LoggedRun};

/// Purposes of the samplers of a run; those of its columns follow.
const COLUMN_PURPOSE: u64 = 16;

impl RunPlan {
    /// Returns the rows that were not lost.
    pub fn keep(&self, rows: &[f64]) -> Vec<f64> {
        let there = |at: &usize| !self.lost.iter().any(|lost| lost.contains(at));
        (0..rows.len()).filter(there).map(|at| rows[at]).collect()
    }
}

impl World {
    /// Returns the sensor readings of a run.
    pub fn log_run(
        &self,
        run: &RunPlan,
        mechanism: &Mechanism,
        trajectory: &Trajectory,
        torque: &[f64],
    ) -> Logged {
        let sensing = &self.campaign.sensing;
        let mut sampler = Sampler::new(run.seed, 1);
        let read = mechanism.read_trajectory(trajectory);
        let at: Vec<&Point> = read.rows.iter().map(|row| &read.points[*row]).collect();
        let angles: Vec<f64> = at.iter().map(|point| point.angle).collect();
        let velocities: Vec<f64> = at.iter().map(|point| point.velocity).collect();
        let mut noise = Sampler::new(run.seed, 2);
        // `torque` already passed the sensor channel. Only the noise is missing.
        let torque = sensing.with_noise(&mut noise, &run.times, torque);
        let accelerations = match mechanism.encoder {
            Some(_) => read.accelerations,
            None => run.times.iter().map(|t| run.motion.at(*t).acceleration).collect(),
        };
        Logged {
            position: sensing.angles(&run.times, &angles),
            velocity: sensing.velocities(&mut sampler, &run.times, &angles, &velocities),
            acceleration: accelerations,
            torque,
        }
    }

    /// Assembles the log from the sensor readings and the covariates.
    pub fn log(&self, logged: &[Logged]) -> Log {
        let Campaign { sensing, columns, extras, added, .. } = &self.campaign;
        let mut names = vec!["time_s", "velocity_rad_s", "torque_nm"];
        if sensing.has_position() {
            names.push("position_rad");
        }
        let contract = names.len();
        names.extend(columns);
        names.extend(extras.iter().map(|extra| extra.column()));
        names.extend(added.iter().map(|(name, _)| name));
        let mut runs: Vec<LoggedRun> = self
            .campaign
            .runs
            .iter()
            .zip(logged)
            .enumerate()
            .map(|(index, (run, logged))| {
                let columns = names.iter().map(|name| run.keep(&self.column(name, run, logged)));
                LoggedRun { name: index.to_string(), columns: columns.collect() }
            })
            .collect();
        for (at, name) in names.iter().enumerate().skip(contract) {
            if *name != "acceleration_rad_s2" {
                self.disturb(&mut runs, at);
            }
        }
        let rounded = |name: &str, values: &mut Vec<f64>| {
            let rounding = if name == "time_s" { microseconds } else { significant };
            values.iter_mut().for_each(|value| *value = rounding(*value));
        };
        for run in &mut runs {
            names.iter().zip(&mut run.columns).for_each(|(name, values)| rounded(name, values));
        }
        Log { columns: names.into_iter().map(str::to_owned).collect(), runs }
    }

    /// Returns a column of a run in all its rows.
    fn column(&self, name: &str, run: &RunPlan, logged: &Logged) -> Vec<f64> {
        let Campaign { sensing, added, .. } = &self.campaign;
        let condition = &run.condition;
        let read = |of: &dyn Fn(f64) -> f64| sensing.covariate(&run.times, of);
        match name {
            "time_s" => self.times(run),
            "velocity_rad_s" => logged.velocity.clone(),
            "torque_nm" => logged.torque.clone(),
            "position_rad" => logged.position.clone(),
            "acceleration_rad_s2" => logged.acceleration.clone(),
            "radial_force_n" => read(&|t| condition.force.at(t)),
            "pressure_diff_pa" => read(&|t| condition.pressure.at(t)),
            "temperature_c" => read(&|t| condition.temperature.at(t)),
            "load_torque_nm" => read(&|t| condition.load.at(t)),
            _ => match added.iter().find(|(added_name, _)| *added_name == name) {
                Some((_, column)) => self.added_column(*column, run, logged),
                None => {
                    let extra = condition.extras.iter().find(|(extra, _)| extra.column() == name);
                    let signal = extra.map(|(_, signal)| *signal).unwrap_or_default();
                    read(&|t| signal.at(t))
                }
            },
        }
    }

    fn added_column(&self, column: AddedColumn, run: &RunPlan, logged: &Logged) -> Vec<f64> {
        /// Torque of a usual motor, Nm/A, as a share of the Coulomb torque.
        const CURRENT_SHARE: f64 = 0.3;
        let motion = |of: &dyn Fn(f64) -> f64| run.times.iter().map(|t| of(*t)).collect();
        let other = || run.beside.other.as_ref();
        match column {
            AddedColumn::OtherVelocity => {
                motion(&|t| other().map_or(0.0, |motion| motion.at(t).velocity))
            }
            AddedColumn::OtherAcceleration => {
                motion(&|t| other().map_or(0.0, |motion| motion.at(t).acceleration))
            }
            AddedColumn::Payload => motion(&|t| run.beside.payload.at(t)),
            AddedColumn::MotorCurrent => {
                let constant = CURRENT_SHARE * self.campaign.seal.coulomb_nm;
                logged.torque.iter().map(|torque| torque / constant).collect()
            }
            AddedColumn::VelocitySetpoint => motion(&|t| run.motion.at(t).velocity),
        }
    }

    /// Returns the time stamps of a run.
    fn times(&self, run: &RunPlan) -> Vec<f64> {
        let clock = &self.campaign.clock;
        let mut sampler = Sampler::new(run.seed, 3);
        let stamp = |t: &f64| {
            let error =
                if clock.error_s > 0.0 { clock.error_s * sampler.between(-0.5, 0.5) } else { 0.0 };
            let stamp = run.condition.start_s + t + error;
            if clock.step_s > 0.0 { (stamp / clock.step_s).round() * clock.step_s } else { stamp }
        };
        run.times.iter().map(stamp).collect()
    }

    /// Adds the noise and the resolution of a covariate's sensor.
    fn disturb(&self, runs: &mut [LoggedRun], at: usize) {
        let [noise, resolution] = self.campaign.sensing.covariate_errors;
        if noise == 0.0 && resolution == 0.0 {
            return;
        }
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let values = runs.iter().flat_map(|run| &run.columns[at]);
        let (low, high) = values.fold(ends, |(low, high), v| (low.min(*v), high.max(*v)));
        let (range, step) = (high - low, resolution * (high - low));
        for (run, plan) in runs.iter_mut().zip(&self.campaign.runs) {
            let mut sampler = Sampler::new(plan.seed, COLUMN_PURPOSE + at as u64);
            for value in &mut run.columns[at] {
                let noisy = *value + noise * range * sampler.normal();
                *value = if step > 0.0 { (noisy / step).round() * step } else { noisy };
            }
        }
    }

    /// Assembles the ground truth.
    pub fn truth(
        &self,
        hidden: Vec<HiddenEffect>,
        floor_nm: f64,
        floor_errors: Rows,
        torque: Rows,
    ) -> UnkindTruth {
        let Campaign { sensing, plant, rigid_body, rate_hz, drive, correlation, runs, .. } =
            &self.campaign;
        let plant = plant.name();
        let words: Vec<&str> =
            hidden.iter().map(|effect| effect.hidden.in_words.as_str()).collect();
        let what = if words.is_empty() { "nothing hidden".into() } else { words.join(" and ") };
        let description = format!(
            "{what}; {plant}, {} runs of {:.1} s at {rate_hz} Hz, presliding {:.1e} rad, top {:.1} rad/s, {}",
            runs.len(),
            drive.seconds,
            drive.travel_rad,
            drive.top_rad_s,
            sensing.words()
        );
        let mut true_of_the_log = sensing.true_of_the_log();
        if self.campaign.family == Family::Mixed && sensing.has_angle_error() {
            true_of_the_log.push("encoder-error");
        }
        UnkindTruth {
            seed: self.seed,
            sensor: sensing.kind,
            plant,
            hidden,
            rigid_body: rigid_body.clone(),
            true_of_the_log,
            floor_nm,
            floor_errors,
            torque,
            noise_nm: sensing.noise_nm,
            rate_hz: *rate_hz,
            travel_rad: drive.travel_rad,
            correlation: *correlation,
            description,
        }
    }
}

/// Rounds to nine significant digits, so that values in memory equal those read back from the file.
fn significant(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let scale = 10f64.powi(8 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale + 0.0
}

/// Rounds to microseconds.
fn microseconds(time_s: f64) -> f64 {
    (time_s * 1e6).round() / 1e6
}
