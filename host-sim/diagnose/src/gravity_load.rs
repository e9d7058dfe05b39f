//! Friction that grows with the torque of gravity: a gear whose teeth carry the load.
//!
//! A log without the torque of the load has no cause for it, and the candidates nearest to it are curves over the position. Where
//! the base law contains gravity, its fitted torque is the load. The residual is regressed on its magnitude, times the direction,
//! in parts of the log, which show the error of the slope.

use super::Diagnosis;
use compensator_core::parameter::ParameterId;
use compensator_core::{Quantity, TermKind};
use joint_log::number::{figure, significant};

/// Parts of the log whose slopes are compared.
const PARTS: usize = 8;

/// Minimum slope, standard errors.
const MIN_ERRORS: f64 = 4.0;

/// Minimum share of the squared error that the load takes.
const MIN_SHARE: f64 = 0.05;

/// Speed above which a row moves, as a share of the largest.
const MIN_SPEED_SHARE: f64 = 0.05;

/// Returns a sentence on friction that grows with gravity, if the residual of the base law shows it.
pub fn sentence(diagnosis: &Diagnosis) -> Option<String> {
    let log = &diagnosis.log;
    let joint = log.train.joint;
    let load = Quantity::LoadTorque.name(joint);
    let has_gravity = log.rigid_body.contains(&TermKind::GravityImbalance);
    if !has_gravity || log.has_column(load) || log.decimate > 1 {
        return None;
    }
    let rows = moving_rows(diagnosis);
    let mean = rows.iter().map(|row| row.load).sum::<f64>() / rows.len().max(1) as f64;
    let parts = rows.chunks(rows.len().div_ceil(PARTS).max(1));
    let slopes: Vec<f64> = parts.filter_map(|part| slope(part, mean)).collect();
    if slopes.len() < PARTS {
        return None;
    }
    let (typical, all) = (slopes.iter().sum::<f64>() / PARTS as f64, slope(&rows, mean)?);
    let squares: f64 = slopes.iter().map(|slope| (slope - typical).powi(2)).sum();
    let error = (squares / (PARTS * (PARTS - 1)) as f64).sqrt();
    let left = |of: f64| -> f64 {
        rows.iter().map(|row| (row.residual - of * row.along_load(mean)).powi(2)).sum()
    };
    let share = 1.0 - left(all) / left(0.0);
    let (unit, percent) = (joint.torque_unit(), significant(100.0 * share, 2));
    (typical > MIN_ERRORS * error && share > MIN_SHARE).then(|| {
        format!(
            " Friction rises with the load: by {} {unit} for each {unit} of the fitted torque of gravity, which takes {percent} % \
             of the squared error. Log the torque of the load, {load}, to have this in the model.",
            figure(all)
        )
    })
}

/// A row in which the joint moves.
struct MovingRow {
    /// Sign of the velocity.
    direction: f64,
    /// Magnitude of the torque of gravity, Nm or N.
    load: f64,
    /// What the base law leaves, Nm or N.
    residual: f64,
}

impl MovingRow {
    /// Returns the load above its mean, along the motion.
    fn along_load(&self, mean: f64) -> f64 {
        self.direction * (self.load - mean)
    }
}

/// Returns the rows in which the joint moves.
fn moving_rows(diagnosis: &Diagnosis) -> Vec<MovingRow> {
    let parameters = &diagnosis.baseline.parameters;
    let [sine, cosine] =
        [ParameterId::GravitySine, ParameterId::GravityCosine].map(|id| parameters.get(id));
    let tracks = || diagnosis.log.test_tracks.iter().zip(&diagnosis.before.residuals);
    let samples = || tracks().flat_map(|(track, residual)| track.samples.iter().zip(residual));
    let largest = samples().map(|(sample, _)| sample.velocity_rad_s.abs()).fold(0.0, f64::max);
    samples()
        .filter(|(sample, _)| sample.velocity_rad_s.abs() > MIN_SPEED_SHARE * largest)
        .map(|(sample, residual)| {
            let angle = sample.position_rad;
            let load = (sine * angle.sin() + cosine * angle.cos()).abs();
            MovingRow { direction: sample.velocity_rad_s.signum(), load, residual: *residual }
        })
        .collect()
}

/// Returns the slope of the residual over the load times the direction; `None` if the load does not change.
fn slope(rows: &[MovingRow], mean: f64) -> Option<f64> {
    let (mut xx, mut xy) = (0.0, 0.0);
    for row in rows {
        let x = row.along_load(mean);
        xx += x * x;
        xy += x * row.residual;
    }
    (xx > 0.0).then(|| xy / xx)
}
