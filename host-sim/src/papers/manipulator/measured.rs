//! The measured industrial arm: the same four models on the torques of its three axes.
//!
//! Motor side, with its authors' rigid-body model as a column; runs A and B are fitted on, C, another trajectory, is
//! held out. Its rigid body belongs to the model (inertia, a gain on their column, an offset), as nobody says it is exact.

use super::printed::MODELS;
use super::study::{TorqueStudy, both};
use super::torques::Joint;
use friction_identification::data::{ReadOptions, read};
use friction_identification::spec::parse_rigid_body;
use rayon::prelude::*;
use std::path::Path;

/// An axis of it.
pub struct Axis {
    /// From 1.
    pub number: usize,
    /// A study for each model.
    pub models: Vec<TorqueStudy>,
}

/// The run that is held out.
pub const HELD_OUT: &str = "C";

/// The axes; `None` where a file is not there.
///
/// # Errors
/// One line: what of a file that is there cannot be read or fitted.
pub fn axes(folder: &Path) -> Result<Vec<Option<Axis>>, String> {
    let rigid_body = parse_rigid_body("inertia,load,offset").map_err(|error| error.to_string())?;
    let axis = |number: usize| {
        let file = folder.join(format!("robot-axis{number}.csv"));
        if !file.is_file() {
            return Ok(None);
        }
        let data = read(&[file], &ReadOptions::default(), &|_, _| {}).map_err(|e| e.to_string())?;
        let joint = Joint::new(data, &[HELD_OUT], &rigid_body)?;
        let models = MODELS.par_iter().map(|model| both(&joint, model.law));
        Ok(Some(Axis { number, models: models.collect::<Result<_, String>>()? }))
    };
    (1..=3).map(axis).collect()
}
