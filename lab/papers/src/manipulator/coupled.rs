//! Fits a log of all joints of the arm within its known dynamics: `identify --inside manipulator`.
//!
//! The input is the pressures and the output the angles. The friction of all three joints is fitted at once, with exact
//! derivatives through the whole trajectory (module `fit`). The torques of each joint only give a starting point. Whole
//! runs are held out, because a trajectory cannot be split into blocks.

use super::arm::{Drive, JOINTS};
use super::fit::{Course, Fitted, evaluate};
use super::printed::{MODELS, PrintedModel};
use super::study::{ARM, Extent, TorqueStudy, fit_by_both_protocols, fit_properly};
use super::torques::Joint;
use crate::PaperError;
use compensator_core::Parameters;
use joint_log::{Dataset, Quantity, Run};
use rayon::prelude::*;

/// Columns with the input pressures of a joint.
const PRESSURES: [&str; 2] = ["pressure_left_pa", "pressure_right_pa"];

/// Target step of the fit, s, to the nearest number of rows; as in the short form of the paper.
const STEP_S: f64 = 5e-3;

/// Target rate of the rows for the fit of torques, Hz.
const TORQUE_RATE_HZ: f64 = 100.0;

/// Maximum deviation of a row's time, as a share of the period.
const MAX_PERIOD_DEVIATION: f64 = 0.01;

/// A log of the arm.
pub struct ArmLog {
    train: Vec<Course>,
    test: Vec<Course>,
    torques: Vec<Joint>,
    extent: Extent,
}

/// A model fitted within the arm.
pub struct InsideFit {
    /// Name of the model.
    pub model: &'static str,
    /// Fitted parameters of each joint.
    pub fitted: Fitted,
    /// Root mean square error of each joint's angle, deg, on the fitted runs.
    pub train_deg: [f64; JOINTS],
    /// Root mean square error on the held-out runs, deg.
    pub test_deg: [f64; JOINTS],
}

impl InsideFit {
    /// Returns the parameters of a joint for the driver.
    pub fn joint(&self, joint: usize) -> Parameters<f32> {
        let mut parameters = self.fitted.parameters[joint].convert::<f32>();
        parameters.envelope = compensator_core::parameters::Envelope::default();
        parameters
    }
}

/// Returns the model of this name.
///
/// # Errors
/// Returns one line for an unknown name.
pub fn model(name: &str) -> Result<&'static PrintedModel, PaperError> {
    let found = MODELS.iter().find(|model| model.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| {
        let known = MODELS.map(|model| model.name.to_lowercase()).join(", ");
        PaperError::UnknownModel(name.to_owned(), known)
    })
}

impl ArmLog {
    /// Builds the log from the logs of the joints and the names of the held-out runs.
    ///
    /// # Errors
    /// Returns one line if joints, columns or rows are missing, or if no run is left to fit or to evaluate.
    pub fn new(
        joints: &[(String, &Dataset)],
        held_out: &[&str],
        starts: usize,
    ) -> Result<Self, PaperError> {
        if joints.len() != JOINTS {
            let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
            return Err(PaperError::Joints(names.join(", ")));
        }
        let runs = &joints[0].1.runs;
        let is_held_out = |run: &&Run| held_out.contains(&run.name.as_str());
        let of = |wanted: bool| {
            let chosen = runs.iter().filter(|run| is_held_out(run) == wanted);
            chosen.map(|run| course(joints, &run.name)).collect::<Result<Vec<_>, PaperError>>()
        };
        let (train, test) = (of(false)?, of(true)?);
        let (Some(first), false) = (train.first(), test.is_empty()) else {
            return Err(PaperError::NoRuns);
        };
        let rows = |time_s: f64| ((time_s / first.drive.period_s).round() as usize).max(1);
        let (stride, torque_stride) = (rows(STEP_S), rows(1.0 / TORQUE_RATE_HZ));
        let torques = joints
            .iter()
            .map(|(name, data)| {
                let joint = decimate_rows(data, torque_stride);
                let joint = joint.and_then(|thin| Joint::new(thin, held_out, &[]));
                joint.map_err(|error| error.of(format!("joint {name}")))
            })
            .collect::<Result<_, PaperError>>()?;
        let extent = Extent { stride, torque_stride, starts: starts.clamp(1, 8), ..Extent::QUICK };
        Ok(Self { train, test, torques, extent })
    }

    /// Fits a model to the angles of all joints.
    ///
    /// # Errors
    /// Returns one line if the torques of a joint cannot be fitted.
    pub fn fit(&self, model: &'static PrintedModel) -> Result<InsideFit, PaperError> {
        let torques = self.torques.par_iter().map(|joint| fit_by_both_protocols(joint, model.law));
        let torques: Vec<TorqueStudy> = torques.collect::<Result<_, PaperError>>()?;
        let fitted = fit_properly(model, &self.train, &torques, &self.extent);
        let rmse = |courses: &[Course]| -> [f64; JOINTS] {
            let (mut squares, mut rows) = ([0.0; JOINTS], 0usize);
            for course in courses {
                let errors = evaluate(&ARM, course, &fitted.parameters, fitted.deflection_rad);
                squares.iter_mut().zip(errors.sse_deg2).for_each(|(sum, error)| *sum += error);
                rows += course.angles_rad[0].len();
            }
            squares.map(|sum| (sum / rows as f64).sqrt())
        };
        let (train_deg, test_deg) = (rmse(&self.train), rmse(&self.test));
        Ok(InsideFit { model: model.name, fitted, train_deg, test_deg })
    }

    /// Returns the names of the fitted and of the held-out runs.
    pub fn runs(&self) -> [Vec<&str>; 2] {
        [&self.train, &self.test].map(|of| of.iter().map(|course| course.name.as_str()).collect())
    }
}

/// Returns a run of all joints.
fn course(joints: &[(String, &Dataset)], name: &str) -> Result<Course, PaperError> {
    let mut angles_rad: [Vec<f64>; JOINTS] = Default::default();
    let mut pressures_pa: [[Vec<f64>; 2]; JOINTS] = Default::default();
    let mut times: Vec<&[f64]> = Vec::new();
    for (at, (joint, data)) in joints.iter().enumerate() {
        let lacks = |missing: &str| PaperError::Missing {
            joint: joint.clone(),
            run: name.to_owned(),
            missing: missing.to_owned(),
        };
        let run = data.runs.iter().find(|run| run.name == name).ok_or_else(|| lacks("rows"))?;
        angles_rad[at] = run.get(Quantity::Position).ok_or_else(|| lacks("position_rad"))?.to_vec();
        for (side, column) in PRESSURES.iter().enumerate() {
            let place = data.covariates.iter().position(|known| known == column);
            let values =
                place.and_then(|place| run.extra.get(place)).ok_or_else(|| lacks(column))?;
            pressures_pa[at][side].clone_from(values);
        }
        times.push(&run.time_s);
    }
    let time_s = times[0];
    let rows = time_s.len();
    if let Some((joint, other)) = joints.iter().zip(&times).find(|(_, other)| other.len() != rows) {
        return Err(PaperError::UnequalRows(name.into(), other.len(), joint.0.clone(), rows));
    }
    if rows < 2 {
        return Err(PaperError::ShortRun(name.into(), rows));
    }
    let period_s = (time_s[rows - 1] - time_s[0]) / (rows - 1) as f64;
    let uneven =
        |pair: &[f64]| (pair[1] - pair[0] - period_s).abs() > MAX_PERIOD_DEVIATION * period_s;
    if let Some(row) = time_s.windows(2).position(uneven) {
        let step_s = time_s[row + 1] - time_s[row];
        return Err(PaperError::UnevenSteps { run: name.into(), row: row + 2, step_s, period_s });
    }
    let start_rad = std::array::from_fn(|at| angles_rad[at][0]);
    Ok(Course {
        name: name.to_owned(),
        drive: Drive { period_s, pressures_pa, start_rad },
        angles_rad,
    })
}

/// Keeps every `stride`-th row of motion and torque.
fn decimate_rows(data: &Dataset, stride: usize) -> Result<Dataset, PaperError> {
    let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"].map(str::to_owned);
    let runs = data.runs.iter().map(|run| {
        let position = run.get(Quantity::Position).unwrap_or_default();
        let columns = [&run.time_s, &run.velocity, &run.torque, position];
        let thin = |column: &[f64]| column.iter().step_by(stride).copied().collect();
        (run.name.clone(), columns.into_iter().map(thin).collect::<Vec<Vec<f64>>>())
    });
    Dataset::from_columns(&names, runs).map_err(PaperError::source)
}
