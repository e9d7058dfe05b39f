//! Rigid-body parts that were not requested and that a part of the error follows.
//!
//! Inertia, gravity and an offset are linear in their parameters. One least squares with them beside plain friction, evaluated on
//! rows that the fit has not seen, shows what the log holds of them.

use crate::contest::{LinearAnswer, RigidBody, Rows, plain};
use friction_fit::spec::rigid_body_name;
use joint_log::JointKind;
use joint_log::number::significant;

/// Minimum fall of the held-out error, as a share.
const MIN_FALL: f64 = 0.2;

/// What more rigid-body parts take from the held-out error of plain friction.
#[derive(Clone, Debug)]
pub struct RigidBodyHint {
    /// Names of the requested parts and of the others, as `--rigid-body` takes them.
    pub parts: Vec<&'static str>,
    /// Held-out error with the requested parts alone, in the unit of the torque.
    pub rmse: f64,
    /// Held-out error with all these parts.
    pub rmse_with_parts: f64,
}

impl RigidBodyHint {
    /// Returns the parts beside those of the rows; `None` if the error does not fall by enough.
    ///
    /// `without` is plain friction with the requested parts.
    pub fn of(rows: &mut Rows, without: &LinearAnswer) -> Option<Self> {
        let given = rows.rigid_body;
        let has_angle = rows.has_position && rows.joint == JointKind::Revolute;
        let gravity = given.gravity || has_angle;
        let all = RigidBody { inertia: true, gravity, offset: true, ..given };
        if all == given {
            return None;
        }
        rows.rigid_body = all;
        let with_parts = plain(rows);
        rows.rigid_body = given;
        let [rmse, rmse_with_parts] =
            [without, &with_parts].map(|model| held_out_rmse(rows, model));
        let parts = all.terms().into_iter().filter_map(rigid_body_name).collect();
        (rmse_with_parts <= (1.0 - MIN_FALL) * rmse).then_some(Self {
            parts,
            rmse,
            rmse_with_parts,
        })
    }

    /// Returns the advice in a sentence.
    pub fn in_words(&self, unit: &str) -> String {
        let [rmse, with_parts] = [self.rmse, self.rmse_with_parts].map(|rmse| significant(rmse, 2));
        format!(
            "Diagnose this log once more with --rigid-body {}: the held-out error of plain friction then falls from {rmse} to \
             {with_parts} {unit}.",
            self.parts.join(",")
        )
    }
}

/// Returns the RMS error of a model on rows that its fit has not seen.
fn held_out_rmse(rows: &Rows, model: &LinearAnswer) -> f64 {
    let left = model.held_out.iter().zip(&rows.weights);
    let squares: f64 = left.map(|(left, weight)| weight * left * left).sum();
    (squares / rows.weights.iter().sum::<f64>().max(1.0)).sqrt()
}
