//! Bristles fitted to another plant: what a law with one state can do at best on a joint that has many.
//!
//! Levenberg and Marquardt's method over the logarithms of six parameters, on the torque without noise and along the
//! true motion; what is hidden stays in the joint at its true size. What is left is an error no friction law of one state
//! avoids, and so part of the floor.

use super::super::joint::Joint;
use super::campaign::Campaign;
use super::plant::{Machine, Way};
use super::visible::{Rows, difference};
use crate::friction::Seal;

/// Rounds of the fit; the errors change by less than a percent after them.
const ROUNDS: usize = 8;
/// Stiffnesses begun with, of the elements' mean: their first slips are stiffer.
const STIFFER: [f64; 2] = [0.8, 4.0];
/// Runs that are fitted: more of the same cost time alone.
const RUNS: usize = 6;
const PARAMETERS: usize = 6;

/// A seal's parameters as logarithms, the static level by its excess.
fn logarithms(seal: &Seal) -> [f64; PARAMETERS] {
    let excess = (seal.static_nm - seal.coulomb_nm).max(1e-3 * seal.coulomb_nm);
    let damping = seal.k1.max(1e-6 * seal.k0);
    [seal.coulomb_nm, excess, seal.stribeck_rad_s, seal.k0, seal.k2, damping].map(f64::ln)
}

fn seal(logarithms: &[f64; PARAMETERS], like: &Seal) -> Seal {
    let [coulomb_nm, excess, stribeck_rad_s, k0, k2, k1] = logarithms.map(f64::exp);
    Seal { coulomb_nm, static_nm: coulomb_nm + excess, stribeck_rad_s, k0, k2, k1, ..*like }
}

/// The seal whose bristles come nearest to a torque; `joint` has what is hidden, and a seal to begin with.
pub(super) fn fitted(campaign: &Campaign, joint: &Joint, ways: &[Way], torque: &Rows) -> Seal {
    let every = campaign.runs.len().div_ceil(RUNS);
    let runs: Vec<usize> = (0..campaign.runs.len()).step_by(every).collect();
    let wanted: Rows = runs.iter().map(|run| torque[*run].clone()).collect();
    let errors = |at: &[f64; PARAMETERS]| {
        let joint = Joint { seal: seal(at, &joint.seal), ..joint.clone() };
        let inputs = runs.iter().map(|run| {
            let plan = &campaign.runs[*run];
            (&plan.condition, &ways[*run], plan.held)
        });
        let made = Machine::bristles(&joint).torques(inputs);
        let read = made.iter().zip(&runs).map(|(torque, run)| {
            campaign.sensing.torque_channel(&campaign.runs[*run].times, torque)
        });
        difference(&wanted, &read.collect())
    };
    let fits = STIFFER.map(|stiffer| {
        let start = Seal { k0: stiffer * joint.seal.k0, ..joint.seal };
        descended(logarithms(&start), &errors)
    });
    let best = fits.into_iter().min_by(|(_, a), (_, b)| a.total_cmp(b));
    best.map_or(campaign.seal, |(at, _)| seal(&at, &campaign.seal))
}

type Point = [f64; PARAMETERS];

/// The bottom that is reached from a start, and its squared error.
fn descended(mut at: Point, errors: &impl Fn(&Point) -> Rows) -> (Point, f64) {
    let square = |rows: &Rows| rows.iter().flatten().map(|e| e * e).sum::<f64>();
    let mut left = errors(&at);
    let mut damping = 1e-3;
    for _ in 0..ROUNDS {
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
            let step = solved(normal, damping);
            let mut moved = at;
            // No parameter by more than a factor of e at once.
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

/// The step of a damped normal equation (its right side is the last column), by Gauss with pivots on the diagonal.
fn solved(mut normal: [[f64; PARAMETERS + 1]; PARAMETERS], damping: f64) -> [f64; PARAMETERS] {
    for (at, row) in normal.iter_mut().enumerate() {
        row[at] = row[at] * (1.0 + damping) + f64::MIN_POSITIVE;
    }
    for pivot in 0..PARAMETERS {
        let own = normal[pivot];
        for (at, row) in normal.iter_mut().enumerate() {
            if at != pivot && own[pivot] != 0.0 {
                let share = row[pivot] / own[pivot];
                row.iter_mut().zip(own).for_each(|(x, p)| *x -= share * p);
            }
        }
    }
    std::array::from_fn(|at| {
        let step = normal[at][PARAMETERS] / normal[at][at];
        if step.is_finite() { step } else { 0.0 }
    })
}
