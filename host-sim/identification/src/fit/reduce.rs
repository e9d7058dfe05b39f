//! Residual and derivatives of a model along its rows, reduced to a small triangle.
//!
//! Value and derivative come from one simulation in dual numbers. Rows go into a streaming QR
//! ([`super::streaming_qr`]) as they are simulated, so that the tall Jacobian is never there.

use super::coordinates::Coordinates;
use super::initial_state::initial_state;
use super::simulate::{Resolution, simulate};
use super::streaming_qr::{Reduced, StreamingQr};
use super::track::{Rows, Track};
use crate::data::AntiAlias;
use crate::dual::Dual;
use compensator_core::{Parameters, Real};
use rayon::prelude::*;

/// Residual and derivatives at a point, reduced.
pub fn reduce(
    coordinates: &Coordinates,
    point: &[f64],
    rows: Rows,
    resolution: Resolution,
) -> Reduced {
    // The number of derivatives is part of a dual number's type; a few sizes serve all, for each has every law and term
    // compiled for it.
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
    let one = |track: &Track| {
        let start = initial_state(&plain, track, resolution);
        let held = start.as_ref().map(|start| Dual::from_f64(start.held));
        let mut qr = StreamingQr::new(count);
        if rows.decimate > 1 {
            let along = Along { parameters: &parameters, track, held, resolution };
            push_decimated(&mut qr, &along, rows.decimate, count);
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
    // Collected before it is merged: the same sum in the same order, whatever the threads did.
    let factors: Vec<StreamingQr> = rows.tracks.par_iter().map(one).collect();
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

/// A model on its way along a track.
struct Along<'a, const N: usize> {
    parameters: &'a Parameters<Dual<N>>,
    track: &'a Track,
    held: Option<Dual<N>>,
    resolution: Resolution,
}

/// Simulates at the full rate and thins out the *residual* (and its derivatives): a law that is not
/// linear in velocity must see the velocity as it was.
fn push_decimated<const N: usize>(
    qr: &mut StreamingQr,
    along: &Along<N>,
    factor: usize,
    count: usize,
) {
    let Along { parameters, track, held, resolution } = *along;
    let mut columns = vec![Vec::with_capacity(track.len()); count + 1];
    simulate(parameters, track, held, resolution, |row, torque, _| {
        let judged = track.weight(row).sqrt();
        for (column, g) in columns[..count].iter_mut().zip(&torque.gradient) {
            column.push(-g * judged);
        }
        columns[count].push((track.torque[row] - torque.value) * judged);
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
