//! A supplied law along a track, in plain numbers: what a driver would do.

use super::input::Supplied;
use crate::fit::Track;
use compensator_core::network::{Factors, NetworkState, Stroke};

/// A supplied law on its way along a track, row by row.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Torque, Nm or N.
    pub torque: Vec<f64>,
    /// The factors in force.
    pub factors: Vec<Factors<f64>>,
    /// Whether the last evaluation was outside the ranges.
    pub is_outside: Vec<bool>,
    /// How much the network has to say, 0 (the constants) to 1: outside the ranges it falls, inside it comes back.
    pub share: Vec<f64>,
    /// Evaluations outside the ranges.
    pub outside_count: u32,
}

/// Simulates a supplied law along a track.
pub fn predict<const INPUTS: usize>(supplied: &Supplied<INPUTS>, track: &Track) -> Run {
    let law = supplied.law::<f64>(track);
    let mut held = supplied.held_at_start(track);
    let mut state = NetworkState::default();
    let mut run = Run::default();
    let mut stroke = Stroke::default();
    for row in 0..track.len() {
        if row % supplied.every == 0 {
            let velocity = track.samples[row].velocity_rad_s;
            let is_known =
                supplied.strokes.as_ref().is_none_or(|range| stroke.is_known(velocity, range));
            let inputs = supplied.read(track, row, held);
            supplied.network.evaluate_where(&mut state, &inputs, is_known);
        }
        let mut torque = 0.0;
        for step in 0..supplied.substeps {
            torque = law.step(&mut held, supplied.velocity(track, row, step), &state.factors);
        }
        run.torque.push(torque);
        run.factors.push(state.factors);
        run.is_outside.push(state.is_outside);
        run.share.push(state.share);
    }
    run.outside_count = state.outside_count;
    run
}
