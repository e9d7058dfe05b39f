//! The measured industrial arm: the same four models on the torques of its three axes.
//!
//! Torques are motor side, and the authors' rigid-body model is a column. Runs A and B are fitted; C, another trajectory, is
//! held out. The model includes a rigid-body part (inertia, a gain on the column, an offset), because the accuracy of the
//! authors' model is not stated.

use super::printed::MODELS;
use super::study::{TorqueStudy, fit_by_both_protocols};
use super::torques::Joint;
use crate::PaperError;
use crate::measured_file;
use friction_fit::spec::parse_rigid_body;
use joint_log::{ReadOptions, read};
use rayon::prelude::*;
use std::path::Path;

/// An axis of the industrial arm.
pub struct RobotAxis {
    /// Number of the axis, from 1.
    pub number: usize,
    /// Fits of each model.
    pub models: Vec<TorqueStudy>,
}

/// Held-out run.
pub const HELD_OUT: &str = "C";

/// Fits the models to each axis; `None` if the file of an axis does not exist.
///
/// # Errors
/// Returns one line if an existing file cannot be read or fitted.
pub fn axes(folder: &Path) -> Result<Vec<Option<RobotAxis>>, PaperError> {
    let rigid_body = parse_rigid_body("inertia,load,offset").map_err(PaperError::source)?;
    let axis = |number: usize| {
        let Some(file) = measured_file(folder, &format!("robot-axis{number}.csv")) else {
            return Ok(None);
        };
        let data =
            read(&[file], &ReadOptions::default(), &|_, _| {}).map_err(PaperError::source)?;
        let joint = Joint::new(data, &[HELD_OUT], &rigid_body)?;
        let models = MODELS.par_iter().map(|model| fit_by_both_protocols(&joint, model.law));
        Ok(Some(RobotAxis { number, models: models.collect::<Result<_, PaperError>>()? }))
    };
    (1..=3).map(axis).collect()
}
