//! A log of all joints of the arm, fitted inside what is known of it: `identify --inside manipulator`.
//!
//! Pressures go in, angles come out, and the friction of all three joints is what is sought, at once, with exact derivatives
//! through the whole trajectory ([`super::fit`]). A joint's own torque is only where the search begins. Whole runs are
//! held out; a trajectory has no blocks.

use super::arm::{Drive, JOINTS};
use super::fit::{Course, Fitted, judge};
use super::printed::{MODELS, Model};
use super::study::{ARM, Extent, TorqueStudy, both, properly};
use super::torques::Joint;
use compensator_core::Parameters;
use friction_identification::data::{Dataset, Quantity, Run};
use rayon::prelude::*;

/// Columns that drive a joint.
const PRESSURES: [&str; 2] = ["pressure_left_pa", "pressure_right_pa"];

/// A step of the fit is as near to this as rows allow, s: as in the short form of the paper.
const STEP_S: f64 = 5e-3;

/// Torques are fitted on about so many rows a second.
const TORQUE_RATE_HZ: f64 = 100.0;

/// A row may come this share of a period early or late.
const UNEVEN: f64 = 0.01;

/// The log of the arm.
pub struct ArmLog {
    train: Vec<Course>,
    test: Vec<Course>,
    torques: Vec<Joint>,
    extent: Extent,
}

/// A model inside the arm.
pub struct Inside {
    /// Its name.
    pub model: &'static str,
    /// What was found in each joint.
    pub fitted: Fitted,
    /// Root mean square error of each joint's angle, deg, on the runs of the fit.
    pub train_deg: [f64; JOINTS],
    /// The same on runs no fit has seen.
    pub test_deg: [f64; JOINTS],
}

impl Inside {
    /// The model of a joint as a driver takes it.
    pub fn joint(&self, joint: usize) -> Parameters<f32> {
        let mut parameters = self.fitted.parameters[joint].convert::<f32>();
        parameters.envelope = compensator_core::parameters::Envelope::default();
        parameters
    }
}

/// The models there are inside the arm.
///
/// # Errors
/// One line: another name.
pub fn model(name: &str) -> Result<&'static Model, String> {
    let found = MODELS.iter().find(|model| model.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| {
        let known = MODELS.map(|model| model.name.to_lowercase()).join(", ");
        format!("--inside manipulator: found model {name:?}, expected of {known}")
    })
}

impl ArmLog {
    /// From each joint's log, and the names of the runs held out.
    ///
    /// # Errors
    /// One line: joints, columns or rows that are not there; runs of which none is left to fit on or to judge by.
    pub fn new(
        joints: &[(String, &Dataset)],
        held_out: &[&str],
        starts: usize,
    ) -> Result<Self, String> {
        if joints.len() != JOINTS {
            let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
            let found = names.join(", ");
            return Err(format!("--inside manipulator: found joints {found}, expected three"));
        }
        let runs = &joints[0].1.runs;
        let is_held_out = |run: &&Run| held_out.contains(&run.name.as_str());
        let of = |wanted: bool| {
            let own = runs.iter().filter(|run| is_held_out(run) == wanted);
            own.map(|run| course(joints, &run.name)).collect::<Result<Vec<_>, String>>()
        };
        let (train, test) = (of(false)?, of(true)?);
        let (Some(first), false) = (train.first(), test.is_empty()) else {
            return Err(
                "--inside manipulator: no run to fit on, or none to judge by: whole runs are held out".into()
            );
        };
        let rows = |time_s: f64| ((time_s / first.drive.period_s).round() as usize).max(1);
        let (stride, torque_stride) = (rows(STEP_S), rows(1.0 / TORQUE_RATE_HZ));
        let torques = joints
            .iter()
            .map(|(name, data)| {
                let thin =
                    thinned(data, torque_stride).map_err(|why| format!("joint {name}: {why}"))?;
                Joint::new(thin, held_out, &[]).map_err(|why| format!("joint {name}: {why}"))
            })
            .collect::<Result<_, String>>()?;
        let extent = Extent { stride, torque_stride, starts: starts.clamp(1, 8), ..Extent::QUICK };
        Ok(Self { train, test, torques, extent })
    }

    /// Fits a model to the angles of all joints.
    ///
    /// # Errors
    /// One line: a joint's torques cannot be fitted.
    pub fn fit(&self, model: &'static Model) -> Result<Inside, String> {
        let torques = self.torques.par_iter().map(|joint| both(joint, model.law));
        let torques: Vec<TorqueStudy> = torques.collect::<Result<_, String>>()?;
        let fitted = properly(model, &self.train, &torques, &self.extent);
        let rmse = |courses: &[Course]| -> [f64; JOINTS] {
            let (mut squares, mut rows) = ([0.0; JOINTS], 0usize);
            for course in courses {
                let judged = judge(&ARM, course, &fitted.parameters, fitted.deflection_rad);
                squares.iter_mut().zip(judged.sse_deg2).for_each(|(sum, own)| *sum += own);
                rows += course.angles_rad[0].len();
            }
            squares.map(|sum| (sum / rows as f64).sqrt())
        };
        let (train_deg, test_deg) = (rmse(&self.train), rmse(&self.test));
        Ok(Inside { model: model.name, fitted, train_deg, test_deg })
    }

    /// Names of the runs: fitted on, and held out.
    pub fn runs(&self) -> [Vec<&str>; 2] {
        [&self.train, &self.test].map(|of| of.iter().map(|course| course.name.as_str()).collect())
    }
}

/// A run of all joints.
fn course(joints: &[(String, &Dataset)], name: &str) -> Result<Course, String> {
    let mut angles_rad: [Vec<f64>; JOINTS] = Default::default();
    let mut pressures_pa: [[Vec<f64>; 2]; JOINTS] = Default::default();
    let mut times: Vec<&[f64]> = Vec::new();
    for (at, (joint, data)) in joints.iter().enumerate() {
        let wanting = |what: &str| format!("joint {joint}: run {name}: found no {what}");
        let run = data.runs.iter().find(|run| run.name == name).ok_or_else(|| wanting("rows"))?;
        angles_rad[at] =
            run.get(Quantity::Position).ok_or_else(|| wanting("position_rad"))?.to_vec();
        for (side, column) in PRESSURES.iter().enumerate() {
            let place = data.covariates.iter().position(|own| own == column);
            let values =
                place.and_then(|place| run.extra.get(place)).ok_or_else(|| wanting(column))?;
            pressures_pa[at][side].clone_from(values);
        }
        times.push(&run.time_s);
    }
    let time_s = times[0];
    let rows = time_s.len();
    if let Some((joint, other)) = joints.iter().zip(&times).find(|(_, other)| other.len() != rows) {
        let (joint, found) = (&joint.0, other.len());
        return Err(format!(
            "run {name}: found {found} rows of joint {joint}, expected {rows} as of the first"
        ));
    }
    if rows < 2 {
        return Err(format!("run {name}: found {rows} rows, expected two or more"));
    }
    let period_s = (time_s[rows - 1] - time_s[0]) / (rows - 1) as f64;
    let uneven = |pair: &[f64]| (pair[1] - pair[0] - period_s).abs() > UNEVEN * period_s;
    if let Some(row) = time_s.windows(2).position(uneven) {
        let step = time_s[row + 1] - time_s[row];
        return Err(format!(
            "run {name}, row {}: found a step of {step:.6} s, expected {period_s:.6} s: a trajectory is simulated in even steps",
            row + 2
        ));
    }
    let start_rad = std::array::from_fn(|at| angles_rad[at][0]);
    Ok(Course {
        name: name.to_owned(),
        drive: Drive { period_s, pressures_pa, start_rad },
        angles_rad,
    })
}

/// Motion and torque of every so many rows.
fn thinned(data: &Dataset, stride: usize) -> Result<Dataset, String> {
    let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"].map(str::to_owned);
    let runs = data.runs.iter().map(|run| {
        let position = run.get(Quantity::Position).unwrap_or_default();
        let columns = [&run.time_s, &run.velocity, &run.torque, position];
        let thin = |column: &[f64]| column.iter().step_by(stride).copied().collect();
        (run.name.clone(), columns.into_iter().map(thin).collect::<Vec<Vec<f64>>>())
    });
    Dataset::of_columns(&names, runs)
}
