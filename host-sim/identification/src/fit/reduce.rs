//! Residual and derivatives of a model on its rows, reduced to a small triangular factor.
//!
//! Values and derivatives come from one simulation in dual numbers. Each simulated row goes into a streaming QR
//! ([`super::streaming_qr`]), so that the tall Jacobian is never stored.

use super::coordinates::Coordinates;
use super::initial_state::initial_state;
use super::simulate::{Resolution, simulate};
use super::streaming_qr::{Reduced, StreamingQr};
use super::track::{Rows, Track};
use crate::data::AntiAlias;
use crate::dual::Dual;
use compensator_core::Parameters;
use rayon::prelude::*;

/// Returns the reduced residual and derivatives at a point.
pub fn reduce(
    coordinates: &Coordinates,
    point: &[f64],
    rows: Rows,
    resolution: Resolution,
) -> Reduced {
    // The number of derivatives is part of a dual number's type. A few sizes are enough: every law and term is compiled for
    // each of them.
    match point.len() {
        0..=4 => reduce_with::<4>(coordinates, point, rows, resolution),
        5..=6 => reduce_with::<6>(coordinates, point, rows, resolution),
        7..=8 => reduce_with::<8>(coordinates, point, rows, resolution),
        9..=12 => reduce_with::<12>(coordinates, point, rows, resolution),
        13..=20 => reduce_with::<20>(coordinates, point, rows, resolution),
        _ => reduce_with::<40>(coordinates, point, rows, resolution),
    }
}

fn reduce_with<const N: usize>(
    coordinates: &Coordinates,
    point: &[f64],
    rows: Rows,
    resolution: Resolution,
) -> Reduced {
    let count = point.len();
    let seeded: Vec<Dual<N>> =
        point.iter().enumerate().map(|(index, u)| Dual::parameter(*u, index)).collect();
    let parameters = coordinates.parameters(&seeded);
    let plain: Parameters<f64> = coordinates.parameters(point);
    let reduce_track = |track: &Track| {
        let start = initial_state(&plain, track, resolution);
        let held = start.as_ref().map(|start| start.held_by(&parameters, track));
        let mut qr = StreamingQr::new(count);
        if rows.decimate > 1 {
            let simulation = TrackSimulation { parameters: &parameters, track, held, resolution };
            push_decimated(&mut qr, &simulation, rows.decimate, count);
            return qr;
        }
        let mut beginning = start.map(|start| (StreamingQr::new(count + 1), start.memory));
        simulate(&parameters, track, held, resolution, |row, torque, _| {
            if !track.is_included(row) {
                return true;
            }
            let root = track.weight(row).sqrt();
            let mut derivative = torque.gradient;
            derivative.iter_mut().for_each(|g| *g *= -root);
            let residual = root * (track.torque[row] - torque.value);
            match &mut beginning {
                Some((first, memory)) if row < memory.len() => {
                    first.push_with(-memory[row] * root, &derivative[..count], residual);
                }
                _ => qr.push(&derivative[..count], residual),
            }
            true
        });
        match beginning {
            Some((first, _)) => qr.merged(first.without_first()),
            None => qr,
        }
    };
    // All factors are collected before they are merged, so that the sum does not depend on the order of the threads.
    let factors: Vec<StreamingQr> = rows.tracks.par_iter().map(reduce_track).collect();
    let mut prior = StreamingQr::new(count);
    let mut derivatives = vec![0.0; count];
    for (index, derivative, residual) in coordinates.prior(point) {
        derivatives.fill(0.0);
        derivatives[index] = derivative;
        prior.push(&derivatives, residual);
    }
    prior.forget_rows();
    factors.into_iter().fold(prior, StreamingQr::merged).finish()
}

/// Arguments of a simulation of one track.
struct TrackSimulation<'a, const N: usize> {
    parameters: &'a Parameters<Dual<N>>,
    track: &'a Track,
    held: Option<Dual<N>>,
    resolution: Resolution,
}

/// Simulates at the full rate and decimates the *residual* and its derivatives. The velocity itself must not be decimated,
/// because the law is not linear in it.
fn push_decimated<const N: usize>(
    qr: &mut StreamingQr,
    simulation: &TrackSimulation<N>,
    factor: usize,
    count: usize,
) {
    let TrackSimulation { parameters, track, held, resolution } = *simulation;
    let mut columns = vec![Vec::with_capacity(track.len()); count + 1];
    simulate(parameters, track, held, resolution, |row, torque, _| {
        let root_weight = track.weight(row).sqrt();
        for (column, g) in columns[..count].iter_mut().zip(&torque.gradient) {
            column.push(-g * root_weight);
        }
        columns[count].push((track.torque[row] - torque.value) * root_weight);
        true
    });
    let filter = AntiAlias::new(factor);
    let columns: Vec<Vec<f64>> = columns.into_iter().map(|column| filter.thin(column)).collect();
    let mut derivatives = vec![0.0; count];
    for (row, residual) in columns[count].iter().enumerate() {
        for (derivative, column) in derivatives.iter_mut().zip(&columns) {
            *derivative = column[row];
        }
        qr.push(&derivatives, *residual);
    }
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
