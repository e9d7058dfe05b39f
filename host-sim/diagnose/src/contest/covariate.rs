//! Columns beside the motion that may explain the torque.
//!
//! A column that follows the torque from row to row explains nothing ([`TorqueLikeness`]). A copy of another column would make
//! both of them useless. Neither is a covariate, nor is a second reading of the joint's own motion.

use crate::column_likeness::{TorqueLikeness, is_same_column};
use friction_fit::linear::Factor;
use joint_log::statistics::correlation;
use joint_log::{Dataset, Quantity, Run, contract};

/// Correlation above which a column is another reading of the joint's own motion, such as a set-point or the speed of the other
/// end of its shaft.
const SAME_MOTION: f64 = 0.9;

/// Number of different values from which a column counts as continuous.
pub const MOST_LEVELS: usize = 12;

/// A column beside the motion.
#[derive(Clone, Debug)]
pub struct Covariate {
    /// Its name in the log.
    pub name: String,
    /// Its quantity, if the contract names it.
    pub quantity: Option<Quantity>,
    /// Its values in all rows.
    pub values: Vec<f64>,
    /// The values minus their mean, divided by their spread.
    pub scaled: Vec<f64>,
    /// Number of different values, up to [`MOST_LEVELS`].
    pub levels: usize,
    /// Whether it is a velocity or an acceleration of another joint.
    pub motion: Option<OtherMotion>,
}

/// What a column says of another joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherMotion {
    /// Its velocity.
    Velocity,
    /// Its acceleration.
    Acceleration,
}

impl OtherMotion {
    /// Returns what the name of a column says, by its words and its unit.
    fn of_name(name: &str) -> Option<Self> {
        let name = name.to_lowercase();
        let has = |parts: &[&str]| parts.iter().any(|part| name.contains(part));
        if has(&["accel", "ddq", "qdd", "rad_s2", "m_s2", "rad/s2", "rad/s^2"]) {
            return Some(Self::Acceleration);
        }
        has(&["veloc", "speed", "dq", "qd", "rad_s", "rad/s", "rpm"]).then_some(Self::Velocity)
    }
}

/// Returns the columns of a log that vary and are neither the torque nor a copy.
pub(crate) fn covariates(data: &Dataset) -> Vec<Covariate> {
    let long = |name: &str| -> Option<Vec<f64>> {
        let columns = data.runs.iter().map(|run| data.column(run, name));
        Some(columns.collect::<Option<Vec<&[f64]>>>()?.concat())
    };
    let motion =
        [Quantity::CampaignTime, Quantity::Velocity, Quantity::Position, Quantity::Acceleration]
            .map(|quantity| quantity.name(data.joint));
    let slope = |run: &Run| run.acceleration_or_derived().into_owned();
    let joint_motion: Vec<Vec<f64>> = [
        data.runs.iter().flat_map(|run| run.velocity.iter().copied()).collect(),
        data.runs.iter().flat_map(slope).collect(),
    ]
    .into();
    let mut found: Vec<Covariate> = Vec::new();
    let known = contract::covariates()
        .map(|quantity| (Some(quantity), quantity.name(data.joint).to_owned()));
    // The position beyond the gear is nearly the position: what follows one of them follows the other.
    let extras = data.covariates.iter().filter(|name| !contract::is_joint_position(name));
    for (quantity, name) in known.chain(extras.map(|name| (None, name.clone()))) {
        let Some(values) = long(&name) else { continue };
        let Some(scaled) = scaled(&values) else { continue };
        let is_extra = quantity.is_none();
        let other = OtherMotion::of_name(&name).filter(|_| is_extra);
        let is_joint_motion = |motion: &Vec<f64>| {
            let rows = values.iter().copied().zip(motion.iter().copied());
            correlation(rows).abs() > SAME_MOTION
        };
        // The motion of another joint may make most of the torque, and is no reading of it.
        let is_torque =
            || other.is_none() && TorqueLikeness::new(data, &name).is_reading_of_torque();
        let others = || motion.into_iter().chain(found.iter().map(|other| other.name.as_str()));
        let is_second_reading = is_extra
            && (is_torque()
                || others().any(|other| is_same_column(data, &name, other))
                || joint_motion.iter().any(is_joint_motion));
        if is_second_reading {
            continue;
        }
        let levels = levels(&values);
        found.push(Covariate { name, quantity, values, scaled, levels, motion: other });
    }
    found
}

impl Covariate {
    /// Returns the values less their mean, over their spread, as a factor.
    pub fn factor(&self) -> Factor {
        self.late(0.0)
    }

    /// Returns the same of a column that is `late_s` after the motion.
    pub fn late(&self, late_s: f64) -> Factor {
        let (mean, spread) = self.mean_and_spread();
        Factor::Column { name: self.name.clone(), mean, spread, late_s }
    }

    /// Returns the mean of the values, and their spread.
    pub fn mean_and_spread(&self) -> (f64, f64) {
        mean_and_spread(&self.values)
    }
}

fn mean_and_spread(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt())
}

/// Returns the values minus their mean over their spread; `None` if they do not vary.
fn scaled(values: &[f64]) -> Option<Vec<f64>> {
    let (mean, spread) = mean_and_spread(values);
    let varies = spread > 1e-9 * mean.abs() && spread > 0.0;
    varies.then(|| values.iter().map(|v| (v - mean) / spread).collect())
}

fn levels(values: &[f64]) -> usize {
    let mut seen: Vec<f64> = Vec::new();
    for value in values {
        if !seen.contains(value) {
            seen.push(*value);
        }
        if seen.len() >= MOST_LEVELS {
            break;
        }
    }
    seen.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariates_without_the_torque_in_another_unit_copies_and_the_position_beyond_the_gear() {
        let names = [
            "time_s",
            "velocity_rad_s",
            "torque_nm",
            "temperature_c",
            "current_a",
            "copy",
            "constant",
            "joint_position_rad",
        ];
        let row = |row: usize| {
            let (t, wave) = (0.01 * row as f64, (0.3 * row as f64).sin());
            [
                t,
                wave,
                wave * 2.0 + t.cos(),
                20.0 + (7.0 * t).sin(),
                (wave * 2.0 + t.cos()) / 0.1,
                20.0 + (7.0 * t).sin(),
                5.0,
                0.2 * (0.31 * row as f64).sin(),
            ]
        };
        let columns = (0..8).map(|column| (0..500).map(|r| row(r)[column]).collect()).collect();
        let data =
            Dataset::from_columns(&names.map(String::from), [("a".to_owned(), columns)]).unwrap();
        let found = covariates(&data);
        let names: Vec<&str> = found.iter().map(|covariate| covariate.name.as_str()).collect();
        assert_eq!(names, ["temperature_c"]);
    }
}
