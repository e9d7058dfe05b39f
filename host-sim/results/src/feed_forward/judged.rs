//! Errors of the table, of the complete model and of no feed-forward on held-out rows.
//!
//! All three have the same rigid-body parts, so that they differ only in friction.

use super::table::{TablePoint, interpolated};
use compensator_core::{ParameterId as Id, Parameters, Sample};
use friction_diagnose::Gain;
use friction_fit::{Metrics, Outcome, Predicted, Rows, Track, predict};

/// Seed of the bootstrap of the intervals.
const SEED: u64 = 0;

/// The parts of the torque that the table does not contain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidBody {
    /// Inertia, kg m^2.
    pub inertia: f64,
    /// Factor of the sine of the position, Nm.
    pub gravity_sine: f64,
    /// Factor of the cosine of the position, Nm.
    pub gravity_cosine: f64,
    /// Constant torque, Nm. The table contains it as well.
    pub offset: f64,
}

impl RigidBody {
    /// Returns the parts of a model; 0 for a part that it does not have.
    pub fn of(parameters: &Parameters<f64>) -> Self {
        let active: Vec<Id> = parameters.active().collect();
        let value = |id: Id| if active.contains(&id) { parameters.get(id) } else { 0.0 };
        Self {
            inertia: value(Id::Inertia),
            gravity_sine: value(Id::GravitySine),
            gravity_cosine: value(Id::GravityCosine),
            offset: value(Id::TorqueOffset),
        }
    }

    /// Returns the torque of inertia and gravity in a row, Nm.
    fn torque(&self, sample: &Sample<f64>) -> f64 {
        let (sine, cosine) = sample.position_rad.sin_cos();
        self.inertia * sample.acceleration_rad_s2
            + sample.position_weight * (self.gravity_sine * sine + self.gravity_cosine * cosine)
    }
}

/// Errors on held-out rows.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// Without friction feed-forward.
    pub nothing: Metrics,
    /// With the table.
    pub table: Metrics,
    /// With the complete model, as a driver of this project runs it.
    pub model: Metrics,
    /// Gain of the table over nothing.
    pub table_gain: Gain,
    /// Gain of the complete model over the table.
    pub model_gain: Gain,
}

impl Judged {
    /// Evaluates a table and the model that it comes from.
    pub fn new(fit: &Outcome, table: &[TablePoint], test: Rows) -> Self {
        let form = fit.for_driver();
        let rigid_body = RigidBody::of(&form.parameters);
        let nothing = errors(test, |sample| rigid_body.torque(sample) + rigid_body.offset);
        let by_table = table_errors(table, &rigid_body, test);
        let model = predict(&form.parameters, test, fit.resolution);
        Self {
            nothing: nothing.metrics,
            table: by_table.metrics,
            model: model.metrics,
            table_gain: Gain::between(&nothing, &by_table, SEED),
            model_gain: Gain::between(&by_table, &model, SEED),
        }
    }

    /// Returns true if the table reduces the error beyond the interval of its gain.
    pub fn has_gain(&self) -> bool {
        self.table_gain.ci95[0] > 0.0
    }
}

/// Returns the errors of a table with the rigid-body parts.
pub fn table_errors(table: &[TablePoint], rigid_body: &RigidBody, rows: Rows) -> Predicted {
    errors(rows, |sample| rigid_body.torque(sample) + interpolated(table, sample.velocity_rad_s))
}

/// Returns the errors of a torque that depends on the row alone.
fn errors(rows: Rows, torque: impl Fn(&Sample<f64>) -> f64) -> Predicted {
    let of_track = |track: &Track| track.samples.iter().map(&torque).collect();
    Predicted::of_torque(rows, rows.tracks.iter().map(of_track).collect())
}
