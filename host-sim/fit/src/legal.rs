//! A fit whose parameters the core accepts: within their legal ranges, with the envelope that the log covers.

use super::solve::{FitOptions, Solution, fit};
use super::track::{Rows, Track};
use crate::spec::Spec;
use ParameterId as Id;
use compensator_core::parameters::Envelope;
use compensator_core::{ParameterId, Parameters};

/// Fits a model, moves its parameters into their legal ranges and declares the envelope.
pub(super) fn fit_legal(
    spec: &Spec,
    base: &Parameters<f64>,
    [train, test]: [Rows; 2],
    options: &FitOptions,
) -> (Solution, Parameters<f64>) {
    let solution = fit(spec, base, train, options);
    let mut parameters = solution.parameters();
    for (index, id) in solution.coordinates.ids().enumerate() {
        if solution.coordinates.is_at_zero(index, &solution.point) {
            parameters.set(id, 0.0);
        }
    }
    keep_legal(&mut parameters, solution.coordinates.ids());
    declare_envelope(&mut parameters, train.tracks, test.tracks);
    (solution, parameters)
}

/// Moves free parameters at the end of their legal range inside it by a rounding of `f32`. Fixed parameters keep their
/// value. Some of them are indices, for which a rounding below a column selects the column before it.
fn keep_legal(parameters: &mut Parameters<f64>, free: impl Iterator<Item = Id>) {
    const ROUNDING: f64 = 1e-6;
    for id in free {
        let info = id.info();
        let (least, most) =
            (info.lower + ROUNDING * info.lower.abs(), info.upper - ROUNDING * info.upper.abs());
        parameters.set(id, parameters.get(id).max(least).min(most));
    }
    for (coulomb, static_torque) in [
        (Id::CoulombTorque, Id::StaticTorque),
        (Id::CoulombTorqueNegative, Id::StaticTorqueNegative),
    ] {
        let least = parameters.get(coulomb);
        parameters.set(static_torque, parameters.get(static_torque).max(least));
    }
}

/// Largest envelope that the core accepts.
const MAX_ENVELOPE: f64 = 1e9;

/// Declares the envelope that the data cover, with a margin. Quantities without data keep their default.
fn declare_envelope(parameters: &mut Parameters<f64>, train: &[Track], test: &[Track]) {
    let samples = || train.iter().chain(test).flat_map(|track| &track.samples);
    let covers = |field: &mut f32, of: fn(&compensator_core::Sample<f64>) -> f64, room: f64| {
        let largest = samples().map(of).map(f64::abs).fold(0.0, f64::max);
        if largest > 0.0 {
            *field = (largest * room).clamp(1e-9, MAX_ENVELOPE) as f32;
        }
    };
    parameters.envelope = Envelope::default();
    let envelope = &mut parameters.envelope;
    covers(&mut envelope.velocity_max_rad_s, |s| s.velocity_rad_s, 1.5);
    covers(&mut envelope.radial_force_max_n, |s| s.radial_force_n, 1.2);
    covers(&mut envelope.pressure_diff_max_pa, |s| s.pressure_diff_mpa * 1e6, 1.2);
    covers(&mut envelope.load_torque_max_nm, |s| s.load_torque_nm, 1.2);
    covers(&mut envelope.acceleration_max_rad_s2, |s| s.acceleration_rad_s2, 1.5);
    covers(&mut envelope.campaign_max_h, |s| s.campaign_time_h, 2.0);
}
