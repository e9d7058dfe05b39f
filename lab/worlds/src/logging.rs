//! The log of a simulated world, and its ground truth.

use super::campaign::{AddedColumn, Campaign, RunPlan};
use super::family::Family;
use super::mechanism::Mechanism;
use super::truth::{HiddenEffect, UnkindTruth};
use super::visible::Rows;
use super::world::World;
use simulated_machines::Log;
use simulated_machines::imposed::{Point, Trajectory};
use simulated_machines::sampling::{self, PlannedRun, ReadRun, Readings, TrueRows};

impl World {
    /// Returns the sensor readings of a run. The torque has passed [`super::sensing::Sensing::torque_channel`].
    pub fn read(
        &self,
        run: &PlannedRun,
        mechanism: &Mechanism,
        trajectory: &Trajectory,
        torques: &[f64],
    ) -> Readings {
        let turned = mechanism.read_trajectory(trajectory);
        let at: Vec<&Point> = turned.rows.iter().map(|row| &turned.points[*row]).collect();
        let rows = TrueRows {
            times: &run.times,
            angles: at.iter().map(|point| point.angle).collect(),
            velocities: at.iter().map(|point| point.velocity).collect(),
            accelerations: turned.accelerations,
            torques,
        };
        Readings::take(&self.campaign.sensing, run.seed, &rows)
    }

    /// Assembles the log from the sensor readings.
    pub fn log(&self, logged: &[Readings]) -> Log {
        let Campaign { sensing, columns, extras, added, runs, .. } = &self.campaign;
        let mut names: Vec<&'static str> = columns.clone();
        names.extend(sensing.has_position().then_some("position_rad"));
        names.extend(extras.iter().map(|extra| extra.column()));
        names.extend(added.iter().map(|(name, _)| name));
        let read = runs.iter().zip(logged).map(|(plan, readings)| {
            let further = added.iter();
            let further =
                further.map(|(name, column)| (*name, self.added_column(*column, plan, readings)));
            ReadRun { run: &plan.run, readings, further: further.collect() }
        });
        sampling::log(sensing, &names, &read.collect::<Vec<ReadRun>>())
    }

    /// Returns a column that is neither a motion nor an operating condition, in all rows of a run.
    fn added_column(&self, column: AddedColumn, plan: &RunPlan, readings: &Readings) -> Vec<f64> {
        /// Torque of a usual motor, Nm/A, as a share of the Coulomb torque.
        const CURRENT_SHARE: f64 = 0.3;
        let RunPlan { run, beside } = plan;
        let over_time = |value: &dyn Fn(f64) -> f64| run.times.iter().map(|t| value(*t)).collect();
        let other = |t: f64| beside.other.as_ref().map(|motion| motion.at(t));
        match column {
            AddedColumn::OtherVelocity => over_time(&|t| other(t).map_or(0.0, |at| at.velocity)),
            AddedColumn::OtherAcceleration => {
                over_time(&|t| other(t).map_or(0.0, |at| at.acceleration))
            }
            AddedColumn::Payload => over_time(&|t| beside.payload.at(t)),
            AddedColumn::MotorCurrent => {
                let constant = CURRENT_SHARE * self.campaign.seal.coulomb_nm;
                readings.torque.iter().map(|torque| torque / constant).collect()
            }
            AddedColumn::VelocitySetpoint => over_time(&|t| run.motion.at(t).velocity),
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
