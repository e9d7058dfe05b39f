//! Fit of bristles to a plant with several elements: the best result of a law with one state on a joint with many.
//!
//! Levenberg-Marquardt method over the logarithms of six parameters. It uses the noise-free torque along the true
//! motion. The hidden effect stays in the joint at its true size. No friction law with one state avoids the remaining
//! error, so it is part of the error floor.

use super::campaign::Campaign;
use super::mechanism::Mechanism;
use super::plant::Machine;
use super::visible::{Rows, difference};
use simulated_machines::friction::Seal;
use simulated_machines::imposed::Trajectory;
use simulated_machines::joint::Joint;

/// Iterations of the fit. Further ones change the errors by less than one percent.
const ITERATIONS: usize = 8;
/// Initial stiffnesses relative to the elements' mean. Elements are stiffer before the first slip.
const INITIAL_STIFFNESS_RATIOS: [f64; 2] = [0.8, 4.0];
const PARAMETERS: usize = 6;

/// Returns the logarithms of a seal's parameters. The static level is expressed by its excess over Coulomb.
fn logarithms(seal: &Seal) -> [f64; PARAMETERS] {
    let excess = (seal.static_nm - seal.coulomb_nm).max(1e-3 * seal.coulomb_nm);
    let damping = seal.k1.max(1e-6 * seal.k0);
    [seal.coulomb_nm, excess, seal.stribeck_rad_s, seal.k0, seal.k2, damping].map(f64::ln)
}

/// Returns the seal with these logarithmic parameters. The remaining parameters are those of `like`.
fn seal(logarithms: &[f64; PARAMETERS], like: &Seal) -> Seal {
    let [coulomb_nm, excess, stribeck_rad_s, k0, k2, k1] = logarithms.map(f64::exp);
    Seal { coulomb_nm, static_nm: coulomb_nm + excess, stribeck_rad_s, k0, k2, k1, ..*like }
}

/// Fits the bristles of a seal to a torque. `mechanism` holds the hidden effects and the initial seal.
pub(super) fn fit(
    campaign: &Campaign,
    mechanism: &Mechanism,
    trajectories: &[Trajectory],
    torque: &Rows,
) -> Seal {
    let every = campaign.runs.len().div_ceil(campaign.family.model_effort().fitted_runs);
    let runs: Vec<usize> = (0..campaign.runs.len()).step_by(every).collect();
    let target: Rows = runs.iter().map(|run| torque[*run].clone()).collect();
    let errors = |at: &[f64; PARAMETERS]| {
        let joint = Joint { seal: seal(at, &mechanism.joint.seal), ..mechanism.joint.clone() };
        let tried = Mechanism { joint, ..mechanism.clone() };
        let inputs = runs.iter().map(|run| campaign.runs[*run].input(&trajectories[*run]));
        let simulated = Machine::bristles(&tried).torques(inputs);
        let read = simulated.iter().zip(&runs).map(|(torque, run)| {
            campaign.sensing.torque_channel(&campaign.runs[*run].run.times, torque)
        });
        difference(&target, &read.collect())
    };
    let fits = INITIAL_STIFFNESS_RATIOS.map(|ratio| {
        let start = Seal { k0: ratio * mechanism.joint.seal.k0, ..mechanism.joint.seal };
        descend(logarithms(&start), &errors)
    });
    let best = fits.into_iter().min_by(|(_, a), (_, b)| a.total_cmp(b));
    best.map_or(campaign.seal, |(at, _)| seal(&at, &campaign.seal))
}

/// Logarithmic parameters.
type Point = [f64; PARAMETERS];

/// Returns the minimum reached from `at`, and its sum of squared errors.
fn descend(mut at: Point, errors: &impl Fn(&Point) -> Rows) -> (Point, f64) {
    let square = |rows: &Rows| rows.iter().flatten().map(|e| e * e).sum::<f64>();
    let mut left = errors(&at);
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS {
        const STEP: f64 = 0.02;
        let slopes: Vec<Rows> = (0..PARAMETERS)
            .map(|parameter| {
                let mut moved = at;
                moved[parameter] += STEP;
                difference(&left, &errors(&moved))
            })
            .collect();
        let dot = |a: &Rows, b: &Rows| {
            a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum::<f64>()
        };
        let mut normal = [[0.0; PARAMETERS + 1]; PARAMETERS];
        for row in 0..PARAMETERS {
            for column in 0..PARAMETERS {
                normal[row][column] = dot(&slopes[row], &slopes[column]) / (STEP * STEP);
            }
            normal[row][PARAMETERS] = dot(&slopes[row], &left) / STEP;
        }
        for _ in 0..4 {
            let step = solve(normal, damping);
            let mut moved = at;
            // One step changes a parameter by at most a factor of e.
            moved.iter_mut().zip(step).for_each(|(x, d)| *x += d.clamp(-1.0, 1.0));
            let tried = errors(&moved);
            if square(&tried) < square(&left) {
                (at, left) = (moved, tried);
                damping *= 0.1;
                break;
            }
            damping *= 10.0;
        }
    }
    (at, square(&left))
}

/// Solves a damped normal equation by Gaussian elimination with pivots on the diagonal.
///
/// The last column is the right-hand side.
fn solve(mut normal: [[f64; PARAMETERS + 1]; PARAMETERS], damping: f64) -> [f64; PARAMETERS] {
    for (at, row) in normal.iter_mut().enumerate() {
        row[at] = row[at] * (1.0 + damping) + f64::MIN_POSITIVE;
    }
    for pivot in 0..PARAMETERS {
        let pivot_row = normal[pivot];
        for (at, row) in normal.iter_mut().enumerate() {
            if at != pivot && pivot_row[pivot] != 0.0 {
                let share = row[pivot] / pivot_row[pivot];
                row.iter_mut().zip(pivot_row).for_each(|(x, p)| *x -= share * p);
            }
        }
    }
    std::array::from_fn(|at| {
        let step = normal[at][PARAMETERS] / normal[at][at];
        if step.is_finite() { step } else { 0.0 }
    })
}
