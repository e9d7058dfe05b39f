//! Residual and derivatives of a model on its rows, reduced to a small triangular factor.
//!
//! Values and derivatives come from one simulation in dual numbers. Each simulated row goes into a streaming QR
//! ([`super::streaming_qr`]), so that the tall Jacobian is never stored.

use super::coordinates::Coordinates;
use super::gradient::{Differentiable, GradientRow, Held, Simulation, TorqueAt};
use super::initial_state::{InitialState, initial_state};
use super::simulate::Resolution;
use super::streaming_qr::{Reduced, StreamingQr};
use super::track::{Rows, Track};
use crate::dual::Dual;
use compensator_core::{Parameters, Real};
use joint_log::AntiAlias;
use rayon::prelude::*;
use std::ops::Range;

/// Returns the reduced residual and derivatives at a point.
pub fn reduce(
    coordinates: &Coordinates,
    point: &[f64],
    rows: Rows,
    resolution: Resolution,
) -> Reduced {
    let plain: Parameters<f64> = coordinates.parameters(point);
    let model = AtPoint { coordinates, point };
    let reduce_track = |track: &Track| {
        let start = initial_state(&plain, track, resolution);
        let simulation = Simulation { track, resolution, at: TorqueAt::Channel };
        if rows.decimate > 1 {
            return decimated(&simulation, &model, &start, rows.decimate);
        }
        every_row(&simulation, &model, start)
    };
    // All factors are collected before they are merged, so that the sum does not depend on the order of the threads.
    let factors: Vec<StreamingQr> = rows.tracks.par_iter().map(reduce_track).collect();
    let mut prior = StreamingQr::new(point.len());
    let mut derivatives = vec![0.0; point.len()];
    for (index, derivative, residual) in coordinates.prior(point) {
        derivatives.fill(0.0);
        derivatives[index] = derivative;
        prior.push(&derivatives, residual);
    }
    prior.forget_rows();
    factors.into_iter().fold(prior, StreamingQr::merged).finish()
}

/// A model at a point of its coordinates.
pub(super) struct AtPoint<'a> {
    pub coordinates: &'a Coordinates,
    pub point: &'a [f64],
}

impl Differentiable for AtPoint<'_> {
    fn count(&self) -> usize {
        self.point.len()
    }

    fn parameters<const N: usize>(&self, range: Range<usize>) -> Parameters<Dual<N>> {
        let seed = |(index, value): (usize, &f64)| match range.contains(&index) {
            true => Dual::parameter(*value, index - range.start),
            false => Dual::from_f64(*value),
        };
        let seeded: Vec<Dual<N>> = self.point.iter().enumerate().map(seed).collect();
        self.coordinates.parameters(&seeded)
    }
}

impl Held for Option<InitialState> {
    fn torque<const N: usize>(
        &self,
        parameters: &Parameters<Dual<N>>,
        track: &Track,
    ) -> Option<Dual<N>> {
        self.as_ref().map(|start| start.held_by(parameters, track))
    }
}

/// Reduces all included rows of a track.
fn every_row(simulation: &Simulation, model: &AtPoint, start: Option<InitialState>) -> StreamingQr {
    let (track, count) = (simulation.track, model.count());
    let mut qr = StreamingQr::new(count);
    let mut first = StreamingQr::new(count + 1);
    let memory = start.as_ref().map_or(&[] as &[f64], |start| &start.memory);
    let mut derivative = vec![0.0; count];
    simulation.run(model, &start, |GradientRow { row, torque, gradient, .. }| {
        if !track.is_included(row) {
            return;
        }
        let root = track.weight(row).sqrt();
        derivative.iter_mut().zip(gradient).for_each(|(derivative, g)| *derivative = -root * g);
        let residual = root * (track.torque[row] - torque);
        match memory.get(row) {
            Some(memory) => first.push_with(-memory * root, &derivative, residual),
            None => qr.push(&derivative, residual),
        }
    });
    if start.is_some() { qr.merged(first.without_first()) } else { qr }
}

/// Simulates at the full rate and decimates the *residual* and its derivatives. The velocity itself must not be decimated,
/// because the law is not linear in it.
fn decimated(
    simulation: &Simulation,
    model: &AtPoint,
    held: &Option<InitialState>,
    factor: usize,
) -> StreamingQr {
    let (track, count) = (simulation.track, model.count());
    let mut columns = vec![Vec::with_capacity(track.len()); count + 1];
    simulation.run(model, held, |GradientRow { row, torque, gradient, .. }| {
        let root_weight = track.weight(row).sqrt();
        for (column, g) in columns[..count].iter_mut().zip(gradient) {
            column.push(-g * root_weight);
        }
        columns[count].push((track.torque[row] - torque) * root_weight);
    });
    let filter = AntiAlias::new(factor);
    let columns: Vec<Vec<f64>> = columns.into_iter().map(|column| filter.thin(column)).collect();
    let mut qr = StreamingQr::new(count);
    let mut derivatives = vec![0.0; count];
    for (row, residual) in columns[count].iter().enumerate() {
        for (derivative, column) in derivatives.iter_mut().zip(&columns) {
            *derivative = column[row];
        }
        qr.push(&derivatives, *residual);
    }
    qr
}

#[cfg(test)]
mod tests {
    use super::super::scales::Scales;
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id, Sample};

    const ROWS: usize = 600;

    /// Joint that starts at rest under the torque `at_rest`, Nm, and oscillates from row 60.
    fn track(at_rest: f64) -> Track {
        let at = |row: usize| row.saturating_sub(60) as f64 * 5e-3;
        let velocity = |row: usize| 0.4 * (6.0 * at(row)).sin();
        let sample = |row| Sample { velocity_rad_s: velocity(row), ..Sample::default() };
        let torque = |row| if row < 60 { at_rest } else { 1.6 * (30.0 * velocity(row)).tanh() };
        Track::even((0..ROWS).map(sample).collect(), (0..ROWS).map(torque).collect(), 5e-3)
    }

    #[test]
    fn reduce_with_any_initial_torque_has_gradient_of_squared_error() {
        let model = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.2)
            .with(Id::StaticTorque, 1.9)
            .with(Id::StribeckVelocity, 0.1)
            .with(Id::BristleStiffness, 60.0)
            .with(Id::BristleDamping, 0.5)
            .with(Id::ViscousFriction, 0.4);
        let free = LawKind::Lugre.parameters();
        // Below the level; above it, in the other direction; far above any torque that the law can hold at rest.
        for at_rest in [0.7, -2.4, 9.0] {
            let tracks = [track(at_rest)];
            let coordinates = Coordinates::new(&model, free, &Scales::of(&tracks));
            let point = coordinates.point(&model);
            let at = |point: &[f64]| {
                reduce(
                    &coordinates,
                    point,
                    Rows { tracks: &tracks, decimate: 1 },
                    Resolution::PLAIN,
                )
            };
            let (here, count) = (at(&point), point.len());
            for (index, id) in free.iter().enumerate() {
                let column = |row: usize| here.factor[row * count + index];
                let slope: f64 =
                    (0..=index).map(|row| 2.0 * here.residual[row] * column(row)).sum();
                let shifted = |by: f64| {
                    let mut point = point.clone();
                    point[index] += by;
                    at(&point).sum_of_squares()
                };
                let difference = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
                let size = here.sum_of_squares();
                let error = (slope - difference).abs();
                assert!(
                    error < 0.02 * size,
                    "{at_rest} Nm, {}: {slope} {difference} of {size}",
                    id.name()
                );
            }
        }
    }
}
