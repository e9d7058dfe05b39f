//! Simulation of a fitted model on any rows.

use super::initial_state::initial_state;
use super::metrics::{Metrics, WeighedRow};
use super::simulate::{Resolution, simulate};
use super::track::Rows;
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters};
use joint_log::AntiAlias;

/// Simulated rows compared with the measurement.
#[derive(Clone, Debug)]
pub struct Predicted {
    /// Simulated torque, track by track, at the full rate.
    pub torque: Vec<Vec<f64>>,
    /// Measured minus simulated torque times the square root of the row's weight, track by track, decimated as requested.
    /// A row with a spike has the residual of a row nearby, so that the sequence keeps its noise and its autocorrelation.
    pub residuals: Vec<Vec<f64>>,
    /// Errors over all rows.
    pub metrics: Metrics,
    /// Largest bristle torque, as a share of the level; 0 for a law without bristles.
    pub saturation: f64,
    /// Share of the rows in which the bristles are neither relaxed nor fully slipping.
    pub presliding: f64,
}

/// Rows between a spike and the row whose residual it gets. A direct neighbour would repeat its noise.
const SPIKE_DONOR_ROWS: usize = 3;

/// Gives each row with a spike the residual of the closest measured row at least [`SPIKE_DONOR_ROWS`] before it, or else
/// after it.
fn bridge_spikes(residual: &mut [f64], is_spike: &[bool]) {
    for row in (0..is_spike.len()).filter(|row| is_spike[*row]) {
        let mut before = (0..(row + 1).saturating_sub(SPIKE_DONOR_ROWS)).rev();
        let mut after = row + SPIKE_DONOR_ROWS..is_spike.len();
        let is_measured = |at: &usize| !is_spike[*at];
        let donor = before.find(is_measured).or_else(|| after.find(is_measured));
        residual[row] = donor.map_or(0.0, |at| residual[at]);
    }
}

/// Simulates a model along rows.
pub fn predict(parameters: &Parameters<f64>, rows: Rows, resolution: Resolution) -> Predicted {
    let (mut torques, mut saturation, mut between, mut count) =
        (Vec::new(), 0.0f64, 0usize, 0usize);
    let level = parameters.get(Id::CoulombTorque);
    for track in rows.tracks {
        let mut torque = Vec::with_capacity(track.len());
        let held = initial_state(parameters, track, resolution).map(|start| start.held);
        simulate(parameters, track, held, resolution, |_, simulated, bristle| {
            torque.push(simulated);
            let share = bristle.abs() / level;
            saturation = saturation.max(share);
            between += usize::from((0.02..0.95).contains(&share));
            count += 1;
            true
        });
        torques.push(torque);
    }
    let bristles = parameters.law.has_bristles();
    Predicted {
        saturation: if bristles { saturation } else { 0.0 },
        presliding: if bristles { between as f64 / count.max(1) as f64 } else { 0.0 },
        ..Predicted::of_torque(rows, torques)
    }
}

impl Predicted {
    /// Compares torques, track by track at the full rate, with the measured ones.
    pub fn of_torque(rows: Rows, torques: Vec<Vec<f64>>) -> Self {
        let (mut residuals, mut compared_rows) = (Vec::new(), Vec::new());
        for (track, torque) in rows.tracks.iter().zip(&torques) {
            let error = |row: usize| track.weight(row).sqrt() * (track.torque[row] - torque[row]);
            let mut residual: Vec<f64> = (0..track.len()).map(error).collect();
            bridge_spikes(&mut residual, &track.torque_spikes);
            if rows.decimate > 1 {
                let filter = AntiAlias::new(rows.decimate);
                residual = filter.thin(residual);
                let measured = filter.thin(track.torque.clone());
                let compared = |(y, e): (&f64, &f64)| WeighedRow {
                    measured: *y,
                    simulated: y - e,
                    weight: 1.0,
                };
                compared_rows.extend(measured.iter().zip(&residual).map(compared));
            } else {
                let rows = (0..track.len()).filter(|row| track.is_included(*row));
                compared_rows.extend(rows.map(|row| track.compared(row, torque[row])));
            }
            residuals.push(residual);
        }
        let metrics = Metrics::of(compared_rows.into_iter());
        Self { torque: torques, residuals, metrics, saturation: 0.0, presliding: 0.0 }
    }
}
