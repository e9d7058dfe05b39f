//! Simulation of a law with a network along a track, in `f64`, as a driver does.

use super::input::NetworkLaw;
use compensator_core::network::{Factors, NetworkState, StrokeTracker};
use friction_fit::Track;

/// Simulated law with a network along a track, one value per row.
#[derive(Clone, Debug, Default)]
pub struct NetworkRun {
    /// Torque, Nm or N.
    pub torque: Vec<f64>,
    /// Bristle torque at the end of the row, Nm or N.
    pub bristle_torque: Vec<f64>,
    /// Active factors.
    pub factors: Vec<Factors<f64>>,
    /// True if the inputs of the last evaluation were outside the trained ranges.
    pub is_outside: Vec<bool>,
    /// Weight of the network, from 0 (constant parameters) to 1. It decreases outside the trained ranges and recovers inside.
    pub share: Vec<f64>,
    /// Number of evaluations outside the ranges.
    pub outside_count: u32,
}

/// Simulates a law with a network along a track.
pub fn predict<const INPUTS: usize>(law: &NetworkLaw<INPUTS>, track: &Track) -> NetworkRun {
    let lugre = law.lugre::<f64>(track);
    let mut held = law.held_at_start(track);
    let mut state = NetworkState::default();
    let mut run = NetworkRun::default();
    let mut stroke = StrokeTracker::default();
    for row in 0..track.len() {
        if row % law.rows_per_evaluation == 0 {
            let velocity = track.samples[row].velocity_rad_s;
            let is_known =
                law.strokes.as_ref().is_none_or(|range| stroke.is_known(velocity, range));
            let inputs = law.read(track, row, held);
            law.network.evaluate_guarded(&mut state, &inputs, is_known);
        }
        let mut torque = 0.0;
        for step in 0..law.substeps {
            torque = lugre.step(&mut held, law.velocity(track, row, step), &state.factors);
        }
        run.torque.push(torque);
        run.bristle_torque.push(held);
        run.factors.push(state.factors);
        run.is_outside.push(state.is_outside);
        run.share.push(state.share);
    }
    run.outside_count = state.outside_count;
    run
}
