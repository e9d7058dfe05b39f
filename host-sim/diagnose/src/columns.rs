//! Columns of a fitted model and of regressors beside it, along one track.
//!
//! The columns are the derivatives of the simulated torque by each free parameter, then the regressors, then the residual. All
//! pass the filter of the torque channel, are weighted as their rows and decimated as the log. What the unknown torque at the
//! start of a track explains is taken out.

use super::candidate::{Candidate, Regressor, Row};
use super::sensitivities::{Sensitivities, TrackSensitivities, exact};
use super::train_test::TrainTest;
use friction_fit::{Track, filter_column};
use joint_log::AntiAlias;
use nalgebra::DMatrix;
use std::ops::Range;

/// Returns the columns of a model and of the regressors of candidates along a track, whose simulation is `at`.
pub fn columns(
    log: &TrainTest,
    model: &Sensitivities,
    track: &Track,
    at: &TrackSensitivities,
    candidates: &[&Candidate],
) -> Vec<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> = at.jacobian.clone();
    for candidate in candidates {
        let covariate = candidate.follows.as_ref().and_then(|follows| follows.covariate);
        let extra = covariate.map(|index| &track.covariates[index]);
        let column = |regressor: &Regressor| match regressor {
            Regressor::Exact(effect) => exact(model, track, at, effect),
            Regressor::Row(of) => {
                let row = |row: usize| {
                    of(&Row {
                        sample: &track.samples[row],
                        added: at.added[row],
                        level: at.level[row],
                        viscous: at.viscous[row],
                        extra: extra.map_or(0.0, |extra| extra[row]),
                    })
                };
                filter_column(track, (0..track.len()).map(row).collect())
            }
        };
        columns.extend(candidate.regressors.iter().map(column));
    }
    let mut memory = at.memory.clone();
    if !track.is_evenly_weighted() {
        for column in columns.iter_mut().chain([&mut memory]) {
            let weighed = column.iter_mut().enumerate();
            weighed.for_each(|(row, value)| *value *= track.weight(row).sqrt());
        }
    }
    columns.push(at.residual.clone());
    if log.decimate > 1 {
        let filter = AntiAlias::new(log.decimate);
        memory.resize(track.len(), 0.0);
        memory = filter.thin(memory);
        columns = columns.into_iter().map(|column| filter.thin(column)).collect();
    }
    forget_start(&mut columns, &memory);
    columns
}

/// Returns the products of columns with each other over some rows. Values that are not finite count as 0.
pub fn products(columns: &[Vec<f64>], rows: Range<usize>) -> DMatrix<f64> {
    let wide = DMatrix::from_fn(rows.len(), columns.len(), |row, column| {
        let value = columns[column][rows.start + row];
        if value.is_finite() { value } else { 0.0 }
    });
    wide.transpose() * &wide
}

/// Takes out of every column what the unknown torque held at the start of the track explains.
fn forget_start(columns: &mut [Vec<f64>], memory: &[f64]) {
    let power: f64 = memory.iter().map(|m| m * m).sum();
    if power <= 0.0 {
        return;
    }
    for column in columns {
        let share = column.iter().zip(memory).map(|(c, m)| c * m).sum::<f64>() / power;
        column.iter_mut().zip(memory).for_each(|(c, m)| *c -= share * m);
    }
}
