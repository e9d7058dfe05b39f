//! Simulation of a fitted model with its derivatives, row by row.
//!
//! Most candidates do not need a simulation of their own. Suppose that the friction level `g`
//! varied with the shaft angle. The torque would change by the wave of the angle times the
//! derivative of the torque by `g`. The core's step computes this derivative in dual numbers. One
//! simulation therefore serves every cause that changes a level or the viscous part, or that adds a
//! torque.
//!
//! Only a cause that changes the dynamics of the bristles is simulated separately ([`exact`]).
//! Examples are a changing side load, backlash, contact age and the exponent of the Stribeck curve.

use ParameterId as Id;
use compensator_core::{ParameterId, Parameters, Real, TermKind};
use friction_fit::{
    Differentiable, Dual, GradientRow, Resolution, Simulation, TorqueAt, Track, TrackLowPass,
    filter_column, initial_state, simulate, treatment_of,
};
use rayon::prelude::*;
use std::ops::Range;

/// A model and its simulation on each track.
#[derive(Clone, Debug)]
pub struct Sensitivities {
    /// Free parameters, with one column of the Jacobian each.
    pub free: Vec<ParameterId>,
    /// Parameter values of the model.
    pub parameters: Parameters<f64>,
    /// Time resolution of the simulation.
    pub resolution: Resolution,
    /// Simulations in the order of the tracks.
    pub tracks: Vec<TrackSensitivities>,
}

/// Simulation of a model along one track, at the full rate.
#[derive(Clone, Debug)]
pub struct TrackSensitivities {
    /// Simulated torque after the low-pass of the torque channel, Nm.
    pub torque: Vec<f64>,
    /// Measured minus simulated torque, Nm, times the square root of the row's weight.
    pub residual: Vec<f64>,
    /// Signed share of the level that the bristles hold; 0 for a law without bristles.
    pub bristle: Vec<f64>,
    /// Derivative of the torque by each free parameter.
    pub jacobian: Vec<Vec<f64>>,
    /// Change of the torque at the shaft if both levels rise by 1 Nm.
    pub added: Vec<f64>,
    /// Change of the torque at the shaft per `x` if the level is scaled by `1 + x`, Nm.
    pub level: Vec<f64>,
    /// Viscous part of the torque at the shaft, Nm.
    pub viscous: Vec<f64>,
    /// Torque that the bristles held at the start, Nm, if it had to be estimated.
    pub held: Option<f64>,
    /// Derivative of the torque by `held`; it decays as the bristles slip.
    pub memory: Vec<f64>,
}

/// Returns the simulation of a model along tracks, with its derivatives.
pub fn sensitivities(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    resolution: Resolution,
) -> Sensitivities {
    let mut parameters = parameters.clone();
    // As in the fit, the declared speed limit is removed. It would restrict the step of the
    // simulation.
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    let levels = parameters.active().filter(|id| treatment_of(*id).is_level);
    let mut columns = free.to_vec();
    columns.extend(levels.filter(|id| !free.contains(id)));
    let model = ByParameters { parameters: &parameters, columns: &columns };
    let follow = |track: &Track| along(&model, free, track, resolution);
    let tracks = tracks.par_iter().map(follow).collect();
    Sensitivities { free: free.to_vec(), parameters, resolution, tracks }
}

/// A model with derivatives by some of its parameters.
struct ByParameters<'a> {
    parameters: &'a Parameters<f64>,
    columns: &'a [ParameterId],
}

impl Differentiable for ByParameters<'_> {
    fn count(&self) -> usize {
        self.columns.len()
    }

    fn parameters<const N: usize>(&self, range: Range<usize>) -> Parameters<Dual<N>> {
        let mut dual = self.parameters.convert::<Dual<N>>();
        for (index, id) in self.columns[range].iter().enumerate() {
            dual.set(*id, Dual::parameter(self.parameters.get(*id), index));
        }
        dual
    }
}

fn along(
    model: &ByParameters,
    free: &[ParameterId],
    track: &Track,
    resolution: Resolution,
) -> TrackSensitivities {
    let ByParameters { parameters, columns } = *model;
    let column = |id: Id| columns.iter().position(|column| *column == id);
    let coulomb: Vec<usize> = [Id::CoulombTorque, Id::CoulombTorqueNegative]
        .into_iter()
        .chain([Id::StaticTorque, Id::StaticTorqueNegative])
        .filter_map(column)
        .collect();
    let is_level = |id: &ParameterId| treatment_of(*id).is_level;
    let levels: Vec<(usize, f64)> = parameters
        .active()
        .filter(is_level)
        .filter_map(|id| Some((column(id)?, parameters.get(id))))
        .collect();
    let viscous = column(Id::ViscousFriction);
    let coefficient = parameters.get(Id::ViscousFriction);
    let start = initial_state(parameters, track, resolution);
    let held = start.as_ref().map(|start| start.held_by(parameters, track));
    let rows = track.len();
    let mut out = TrackSensitivities {
        torque: Vec::with_capacity(rows),
        residual: Vec::with_capacity(rows),
        bristle: Vec::with_capacity(rows),
        jacobian: vec![Vec::with_capacity(rows); free.len()],
        added: Vec::with_capacity(rows),
        level: Vec::with_capacity(rows),
        viscous: Vec::with_capacity(rows),
        held,
        memory: start.as_ref().map(|start| start.memory.clone()).unwrap_or_default(),
    };
    let level_now = parameters.get(Id::CoulombTorque).abs().max(f64::MIN_POSITIVE);
    let bristles = parameters.law.has_bristles();
    let mut channel = TrackLowPass::for_torque(track);
    let simulation = Simulation { track, resolution, at: TorqueAt::Shaft };
    simulation.run(model, &start, |GradientRow { row, torque, bristle, gradient }| {
        let shown = channel.as_mut().map_or(torque, |channel| channel.filter(row, torque));
        out.torque.push(shown);
        out.residual.push(track.weight(row).sqrt() * (track.torque[row] - shown));
        out.bristle.push(if bristles { bristle / level_now } else { 0.0 });
        for (column, g) in out.jacobian.iter_mut().zip(gradient) {
            column.push(*g);
        }
        out.added.push(coulomb.iter().map(|i| gradient[*i]).sum());
        out.level.push(levels.iter().map(|(i, value)| gradient[*i] * value).sum());
        let plain = || coefficient * track.samples[row].velocity_rad_s;
        out.viscous.push(viscous.map_or_else(plain, |i| gradient[i] * coefficient));
    });
    out.jacobian = out.jacobian.into_iter().map(|column| filter_column(track, column)).collect();
    out
}

/// An effect that needs a separate simulation: a term with these settings.
///
/// Its column is the derivative by one parameter, or the whole difference that the term makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Exact {
    /// Term of the effect.
    pub kind: TermKind,
    /// Settings of the term.
    pub settings: Vec<(ParameterId, f64)>,
    /// Parameter of the derivative, at its value in `settings` or its default. `None` selects the
    /// whole difference.
    pub derivative: Option<ParameterId>,
}

/// Returns the column of an effect along one track, Nm per unit of its parameter. It is 0 if the
/// term cannot be added to the model.
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
