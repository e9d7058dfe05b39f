//! What a fitted model does, row by row, and how that changes with each of its parameters.
//!
//! The residual of a fitted model can be asked many questions, and most need not run the model again. If
//! the level `g` of the friction followed the shaft angle, the torque would change by the angle's wave
//! times what the torque changes by when `g` does; that derivative comes out of the core's own step in
//! dual numbers, once. So one simulation serves every cause that moves a level, the viscous part, or
//! adds a torque. Only what bends the bristles otherwise (a changing side load, play, contact age, the
//! curve's exponent) is simulated for itself ([`exact`]).

use crate::dual::Dual;
use crate::fit::Track;
use crate::fit::channel::{LowPass, passed};
use crate::fit::initial_state::initial_state;
use crate::fit::simulate::{Resolution, simulate, simulate_shaft};
use crate::fit::treatment;
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters, Real, TermKind};
use rayon::prelude::*;

/// A model and what it does on each track.
#[derive(Clone, Debug)]
pub struct Sensitivities {
    /// The free parameters, a column each.
    pub free: Vec<ParameterId>,
    /// The model.
    pub parameters: Parameters<f64>,
    /// How finely it was stepped.
    pub resolution: Resolution,
    /// The tracks, in order.
    pub tracks: Vec<TrackSensitivities>,
}

/// A model along one track, at the full rate.
#[derive(Clone, Debug)]
pub struct TrackSensitivities {
    /// Simulated torque as its channel shows it, Nm.
    pub torque: Vec<f64>,
    /// Simulated torque at the shaft, Nm; so are `added`, `level` and `viscous`.
    pub shaft_torque: Vec<f64>,
    /// Measured minus simulated, Nm, times the root of the row's weight.
    pub residual: Vec<f64>,
    /// Share of the level the bristles hold, signed; 0 for a law without bristles.
    pub bristle: Vec<f64>,
    /// Derivative by each free parameter.
    pub jacobian: Vec<Vec<f64>>,
    /// Change of the torque where both levels are raised by 1 Nm.
    pub added: Vec<f64>,
    /// Change of the torque where the level is scaled by `1 + x`, per `x`, Nm.
    pub level: Vec<f64>,
    /// The viscous part, Nm.
    pub viscous: Vec<f64>,
    /// What the bristles held at the start, where that had to be solved for, and how long it is
    /// remembered.
    pub held: Option<f64>,
    /// Derivative by it.
    pub memory: Vec<f64>,
}

/// Follows a model along tracks.
pub fn sensitivities(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    resolution: Resolution,
) -> Sensitivities {
    let mut parameters = parameters.clone();
    // As in the fit: the declared speed limits the step, and all that was measured is to be seen.
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    let levels = parameters.active().filter(|id| treatment::of(*id).is_level);
    let mut columns = free.to_vec();
    columns.extend(levels.filter(|id| !free.contains(id)));
    let follow = |track: &Track| match columns.len() {
        0..=4 => along::<4>(&parameters, free, &columns, track, resolution),
        5..=8 => along::<8>(&parameters, free, &columns, track, resolution),
        9..=12 => along::<12>(&parameters, free, &columns, track, resolution),
        13..=20 => along::<20>(&parameters, free, &columns, track, resolution),
        _ => along::<40>(&parameters, free, &columns, track, resolution),
    };
    let tracks = tracks.par_iter().map(follow).collect();
    Sensitivities { free: free.to_vec(), parameters, resolution, tracks }
}

fn along<const N: usize>(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    columns: &[ParameterId],
    track: &Track,
    resolution: Resolution,
) -> TrackSensitivities {
    let mut dual = parameters.convert::<Dual<N>>();
    for (index, id) in columns.iter().enumerate() {
        dual.set(*id, Dual::parameter(parameters.get(*id), index));
    }
    let column = |id: Id| columns.iter().position(|own| *own == id);
    let coulomb: Vec<usize> = [Id::CoulombTorque, Id::CoulombTorqueNegative]
        .into_iter()
        .chain([Id::StaticTorque, Id::StaticTorqueNegative])
        .filter_map(column)
        .collect();
    let is_level = |id: &ParameterId| treatment::of(*id).is_level;
    let levels: Vec<(usize, f64)> = parameters
        .active()
        .filter(is_level)
        .filter_map(|id| Some((column(id)?, parameters.get(id))))
        .collect();
    let viscous = column(Id::ViscousFriction);
    let coefficient = parameters.get(Id::ViscousFriction);
    let start = initial_state(parameters, track, resolution);
    let held = start.as_ref().map(|start| start.held_by(&dual));
    let rows = track.len();
    let mut out = TrackSensitivities {
        torque: Vec::with_capacity(rows),
        shaft_torque: Vec::with_capacity(rows),
        residual: Vec::with_capacity(rows),
        bristle: Vec::with_capacity(rows),
        jacobian: vec![Vec::with_capacity(rows); free.len()],
        added: Vec::with_capacity(rows),
        level: Vec::with_capacity(rows),
        viscous: Vec::with_capacity(rows),
        held: held.map(Real::value),
        memory: start.map(|start| start.memory).unwrap_or_default(),
    };
    let level_now = parameters.get(Id::CoulombTorque).abs().max(f64::MIN_POSITIVE);
    let bristles = parameters.law.has_bristles();
    let mut channel = LowPass::of_torque(track);
    simulate_shaft(&dual, track, held, resolution, |row, torque: Dual<N>, bristle: Dual<N>| {
        let gradient = &torque.gradient;
        let shown =
            channel.as_mut().map_or(torque.value, |channel| channel.pass(row, torque.value));
        out.torque.push(shown);
        out.shaft_torque.push(torque.value);
        out.residual.push(track.weight(row).sqrt() * (track.torque[row] - shown));
        out.bristle.push(if bristles { bristle.value / level_now } else { 0.0 });
        for (column, g) in out.jacobian.iter_mut().zip(gradient) {
            column.push(*g);
        }
        out.added.push(coulomb.iter().map(|i| gradient[*i]).sum());
        out.level.push(levels.iter().map(|(i, value)| gradient[*i] * value).sum());
        let plain = || coefficient * track.samples[row].velocity_rad_s;
        out.viscous.push(viscous.map_or_else(plain, |i| gradient[i] * coefficient));
        true
    });
    out.jacobian = out.jacobian.into_iter().map(|column| passed(track, column)).collect();
    out
}

/// An effect that is simulated for itself: a term with these settings, and the parameter whose
/// derivative is its column, or none where the column is the whole difference it makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Exact {
    /// The term.
    pub kind: TermKind,
    /// Its settings.
    pub settings: Vec<(ParameterId, f64)>,
    /// Derivative by this one, at its value in `settings` or its default.
    pub derivative: Option<ParameterId>,
}

/// The column of an effect along one track, Nm per unit of its parameter.
pub fn exact(
    model: &Sensitivities,
    track: &Track,
    at: &TrackSensitivities,
    effect: &Exact,
) -> Vec<f64> {
    let mut parameters = model.parameters.clone();
    if !parameters.add_term(effect.kind) {
        return vec![0.0; track.len()];
    }
    for (id, value) in &effect.settings {
        parameters.set(*id, *value);
    }
    let mut column = Vec::with_capacity(track.len());
    match effect.derivative {
        Some(id) => {
            let mut dual = parameters.convert::<Dual<1>>();
            dual.set(id, Dual::parameter(parameters.get(id), 0));
            let held = at.held.map(Dual::from_f64);
            simulate(&dual, track, held, model.resolution, |_, torque, _| {
                column.push(torque.gradient[0]);
                true
            });
        }
        None => simulate(&parameters, track, at.held, model.resolution, |row, torque, _| {
            column.push(torque - at.torque[row]);
            true
        }),
    }
    column
}
