//! The squared error along a track and its exact derivative by every weight (adjoint method).
//!
//! The forward pass simulates as [`super::predict()`] does and stores the intermediate values. The backward pass goes from
//! the last row to the first. It includes the loop that exists if the law's own state is an input. Evaluations outside
//! the network's ranges are differentiated as if they were inside, because training tracks define the ranges.

use super::file::CELLS;
use super::input::{NetworkInput, NetworkLaw};
use compensator_core::Real;
use compensator_core::network::{
    CELL_LIMIT, FACTOR_COUNT, Factors, GATES, LstmState, NetworkState, NetworkTrace, sigmoid,
    squash, squash_slope,
};
use friction_fit::Dual;
use friction_fit::Track;

/// Number of derivatives of a step of the law: by the held torque and by the factors.
const LAW_DERIVATIVES: usize = 1 + FACTOR_COUNT;

/// Derivatives of a step of the law: of the bristle torque after it, and of the torque.
struct LawStep {
    held: [f64; LAW_DERIVATIVES],
    torque: [f64; LAW_DERIVATIVES],
}

/// Intermediate values of an evaluation of the network.
struct Evaluation<const INPUTS: usize> {
    trace: NetworkTrace<f64, INPUTS, CELLS>,
    /// True for each input that was limited to its range.
    is_limited: [bool; INPUTS],
    before: LstmState<f64, CELLS>,
    after: LstmState<f64, CELLS>,
    /// True if the static factor was raised to the Coulomb factor.
    is_raised: bool,
    /// True for each factor whose change was limited.
    is_slewed: [bool; FACTOR_COUNT],
}

/// Returns half the mean squared error of a track, in units of `scale` (Nm or N), and adds its derivative by every weight to
/// `gradient`.
pub(super) fn loss<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    track: &Track,
    scale: f64,
    gradient: &mut [f64],
) -> f64 {
    let (steps, evaluations, errors) = forward(law, track, scale);
    backward(law, &steps, &evaluations, &errors, gradient);
    let rows = track.len().max(1) as f64;
    // Each error is the derivative of the loss by the torque of its row.
    errors.iter().map(|error| 0.5 * error * error).sum::<f64>() * scale * scale * rows
}

type ForwardPass<const INPUTS: usize> = (Vec<LawStep>, Vec<Evaluation<INPUTS>>, Vec<f64>);

fn forward<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    track: &Track,
    scale: f64,
) -> ForwardPass<INPUTS> {
    let lugre = law.lugre::<Dual<LAW_DERIVATIVES>>(track);
    let mut held = law.held_at_start(track);
    let mut state = NetworkState::<f64, CELLS>::default();
    let (mut steps, mut evaluations, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    let per_row = 1.0 / (scale * scale * track.len().max(1) as f64);
    let mut factors = dual_factors(&state.factors);
    for row in 0..track.len() {
        if row % law.rows_per_evaluation == 0 {
            evaluations.push(evaluate(law, &mut state, &law.read(track, row, held)));
            factors = dual_factors(&state.factors);
        }
        let mut torque = Dual::default();
        for step in 0..law.substeps {
            let mut bristle = Dual::parameter(held, 0);
            let velocity = Dual::from_f64(law.velocity(track, row, step));
            torque = lugre.step(&mut bristle, velocity, &factors);
            steps.push(LawStep { held: bristle.gradient, torque: torque.gradient });
            held = bristle.value;
        }
        errors.push((torque.value - track.torque[row]) * per_row);
    }
    (steps, evaluations, errors)
}

fn dual_factors(factors: &Factors<f64>) -> Factors<Dual<LAW_DERIVATIVES>> {
    Factors {
        coulomb: Dual::parameter(factors.coulomb, 1),
        static_level: Dual::parameter(factors.static_level, 2),
        stiffness: Dual::parameter(factors.stiffness, 3),
    }
}

/// Evaluates the core's network and records the intermediate values.
fn evaluate<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    state: &mut NetworkState<f64, CELLS>,
    inputs: &[f64; INPUTS],
) -> Evaluation<INPUTS> {
    let network = &law.network;
    let (before, from) = (state.hidden, state.factors.to_array());
    let trace = network.evaluate_traced(state, inputs, true);
    let targets = trace.targets.to_array();
    let [coulomb, static_level, _] = targets;
    let far = |factor: usize| (targets[factor] - from[factor]).abs() > network.slew;
    Evaluation {
        is_limited: trace.scaled.map(|value| value.abs() >= 1.0),
        before,
        after: state.hidden,
        trace,
        is_raised: static_level <= coulomb,
        is_slewed: std::array::from_fn(far),
    }
}

fn backward<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    steps: &[LawStep],
    evaluations: &[Evaluation<INPUTS>],
    errors: &[f64],
    gradient: &mut [f64],
) {
    let mut by_held = 0.0;
    let mut by_factors = [0.0; FACTOR_COUNT];
    let mut by_output = [0.0; CELLS];
    let mut by_cell = [0.0; CELLS];
    for row in (0..errors.len()).rev() {
        for step in (0..law.substeps).rev() {
            let at = &steps[row * law.substeps + step];
            let error = if step + 1 == law.substeps { errors[row] } else { 0.0 };
            for (factor, by) in by_factors.iter_mut().enumerate() {
                *by += error * at.torque[1 + factor] + by_held * at.held[1 + factor];
            }
            by_held = error * at.torque[0] + by_held * at.held[0];
        }
        if row % law.rows_per_evaluation == 0 {
            let at = &evaluations[row / law.rows_per_evaluation];
            let by_sums = back_through_factors(law, at, &mut by_factors);
            back_through_readout(law, at, &by_sums, &mut by_output, gradient);
            let by_inputs = back_through_lstm(law, at, &mut by_output, &mut by_cell, gradient);
            for (index, input) in law.inputs.iter().enumerate() {
                if *input == NetworkInput::Held && !at.is_limited[index] {
                    by_held += by_inputs[index] * law.network.inputs[index].per_unit;
                }
            }
        }
    }
}

/// Propagates derivatives from the active factors to the readout's sums. The remainder in `by_factors` belongs to the previous
/// factors.
fn back_through_factors<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    at: &Evaluation<INPUTS>,
    by_factors: &mut [f64; FACTOR_COUNT],
) -> [f64; FACTOR_COUNT] {
    let mut by_targets = [0.0; FACTOR_COUNT];
    for factor in 0..FACTOR_COUNT {
        if !at.is_slewed[factor] {
            by_targets[factor] = std::mem::take(&mut by_factors[factor]);
        }
    }
    if at.is_raised {
        by_targets[0] += std::mem::take(&mut by_targets[1]);
    }
    std::array::from_fn(|factor| {
        let bounds = &law.network.bounds[factor];
        by_targets[factor] * (bounds.most - bounds.least) * sigmoid_slope(at.trace.sums[factor])
    })
}

fn back_through_readout<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    at: &Evaluation<INPUTS>,
    by_sums: &[f64; FACTOR_COUNT],
    by_output: &mut [f64; CELLS],
    gradient: &mut [f64],
) {
    let begin = CELLS * GATES * (1 + INPUTS + CELLS);
    let rows = gradient[begin..].chunks_exact_mut(1 + CELLS);
    let weights = &law.network.readout.weights;
    for ((row, by_sum), weights) in rows.zip(by_sums).zip(weights) {
        row[0] += by_sum;
        for cell in 0..CELLS {
            row[1 + cell] += by_sum * at.after.output[cell];
            by_output[cell] += by_sum * weights[cell];
        }
    }
}

/// Propagates derivatives from outputs and cells after an evaluation to those before it. Returns the derivatives by the scaled
/// inputs.
fn back_through_lstm<const INPUTS: usize>(
    law: &NetworkLaw<INPUTS>,
    at: &Evaluation<INPUTS>,
    by_output: &mut [f64; CELLS],
    by_cell: &mut [f64; CELLS],
    gradient: &mut [f64],
) -> [f64; INPUTS] {
    let mut by_inputs = [0.0; INPUTS];
    let mut by_output_before = [0.0; CELLS];
    let mut cells = gradient.chunks_exact_mut(GATES * (1 + INPUTS + CELLS));
    for cell in 0..CELLS {
        let [forget, input, output, candidate] = at.trace.activations.sums[cell];
        let (after, before) = (at.after.cell[cell], at.before.cell[cell]);
        let by = by_output[cell];
        let by_limited = by_cell[cell] + by * sigmoid(output) * squash_slope(after);
        let inside = at.trace.activations.cell[cell].abs() <= CELL_LIMIT;
        let by_state = if inside { by_limited } else { 0.0 };
        by_cell[cell] = by_state * sigmoid(forget);
        let by_gates = [
            by_state * before * sigmoid_slope(forget),
            by_state * squash(candidate) * sigmoid_slope(input),
            by * squash(after) * sigmoid_slope(output),
            by_state * sigmoid(input) * squash_slope(candidate),
        ];
        let weights = &law.network.lstm.cells[cell];
        let Some(gradient) = cells.next() else { continue };
        let (of_inputs, others) = gradient.split_at_mut(GATES * (1 + INPUTS));
        for gate in 0..GATES {
            of_inputs[gate] += by_gates[gate];
            for index in 0..INPUTS {
                of_inputs[GATES * (1 + index) + gate] += by_gates[gate] * at.trace.scaled[index];
                by_inputs[index] += by_gates[gate] * weights.input[index][gate];
            }
            for other in 0..CELLS {
                others[GATES * other + gate] += by_gates[gate] * at.before.output[other];
                by_output_before[other] += by_gates[gate] * weights.recurrent[other][gate];
            }
        }
    }
    *by_output = by_output_before;
    by_inputs
}

fn sigmoid_slope(x: f64) -> f64 {
    0.25 * squash_slope(0.5 * x)
}

#[cfg(test)]
mod tests {
    use super::super::train::{TrainOptions, untrained};
    use super::*;
    use compensator_core::{LawKind, ParameterId as Id, Parameters, Sample};

    fn track() -> Track {
        let at = |row: usize| row as f64 / 128.0;
        let velocity = |row| 0.1 * (3.0 * at(row)).sin() + 0.03 * (11.0 * at(row)).cos();
        let samples = |row| Sample { velocity_rad_s: velocity(row), ..Sample::default() };
        let mut track = Track::even(
            (0..400).map(samples).collect(),
            (0..400)
                .map(|row| 9.0 * velocity(row - row.min(9)).signum() + (row % 7) as f64)
                .collect(),
            1.0 / 128.0,
        );
        track.covariates = vec![(0..400).map(|row| (row as f64 / 60.0).sin()).collect()].into();
        track
    }

    #[test]
    fn loss_gradient_matches_finite_differences() {
        let base = Parameters::new(LawKind::LugreAsymmetric)
            .with(Id::CoulombTorque, 9.0)
            .with(Id::StaticTorque, 10.0)
            .with(Id::CoulombTorqueNegative, 7.0)
            .with(Id::StaticTorqueNegative, 9.0)
            .with(Id::StribeckVelocity, 0.04)
            .with(Id::BristleStiffness, 2000.0)
            .with(Id::BristleDamping, 4.0)
            .with(Id::ViscousFriction, 2.0);
        let track = track();
        let options = TrainOptions { seed: 3, ..TrainOptions::default() };
        let inputs = [NetworkInput::Covariate(0), NetworkInput::Velocity, NetworkInput::Held];
        let mut law = untrained(&base, inputs, std::slice::from_ref(&track), &options);
        let mut weights = Vec::new();
        law.network.for_each_weight(|weight| weights.push(weight));
        // The weights are larger than those at the start of training, so that every path has an effect.
        weights.iter_mut().enumerate().for_each(|(i, w)| *w += 0.4 * (i as f64 * 1.7).sin());
        assert!(law.network.set_weights(weights.iter().copied()));
        let mut gradient = vec![0.0; weights.len()];
        let value = loss(&law, &track, 5.0, &mut gradient);
        let plain = super::super::predict(&law, &track).torque;
        let squares: f64 = plain.iter().zip(&track.torque).map(|(s, m)| (s - m).powi(2)).sum();
        assert!((value - 0.5 * squares / 400.0 / 25.0).abs() < 1e-12 * value);
        let count = gradient.len();
        let mut shifted = |index: usize, by: f64| {
            let mut weights = weights.clone();
            weights[index] += by;
            law.network.set_weights(weights.into_iter());
            loss(&law, &track, 5.0, &mut vec![0.0; count])
        };
        let mut wrong = 0;
        for (index, derivative) in gradient.iter().enumerate() {
            let slope = (shifted(index, 1e-6) - shifted(index, -1e-6)) / 2e-6;
            let error = (slope - derivative).abs();
            wrong += usize::from(error > 1e-6 + 1e-4 * slope.abs());
        }
        let largest = gradient.iter().fold(0.0f64, |most, g| most.max(g.abs()));
        assert!(largest > 1e-2, "the gradient is almost 0: {largest}");
        // Limits that become active within the step of a difference may affect single derivatives.
        assert!(wrong <= 2, "{wrong} of {} wrong", gradient.len());
    }
}
