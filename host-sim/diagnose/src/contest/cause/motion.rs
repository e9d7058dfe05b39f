//! Causes of the motion and the time alone: asymmetry, offset, drag, inertia, gravity, dwell, drift, warm-up, shape.

use super::{Columns, Context, plain};
use crate::contest::law::product;
use crate::contest::operator::rests;
use crate::contest::rows::quantile;
use joint_log::JointKind;

/// Dwell time below which the static friction does not grow, s.
const DWELL_START_S: f64 = 0.02;

/// Displacement within which a joint rests, as a share of the travel.
const REST_TRAVEL: f64 = 0.02;

/// Lengths of the path over which a breakaway decays, in travels.
const BREAKAWAY_PATHS: [f64; 3] = [1.0, 4.0, 15.0];

/// Heat at which the level has fallen by 63 %, as shares of a large heat of the log.
const HEATS: [f64; 2] = [0.3, 1.0];

/// Time constants of cooling, s; infinite for none.
const COOLING_S: [f64; 3] = [f64::INFINITY, 300.0, 30.0];

/// Time constants of a run-in, as shares of the campaign.
const DRIFTS: [f64; 2] = [0.15, 0.4];

pub(super) fn direction_asymmetry(context: &Context) -> Vec<Columns> {
    let level: Vec<f64> = context.level.iter().map(|level| level.abs()).collect();
    let viscous: Vec<f64> = context.rows.smooth_velocity.iter().map(|v| v.abs()).collect();
    vec![plain("level", vec![level.clone()]), plain("level and viscous", vec![level, viscous])]
}

pub(super) fn torque_offset(context: &Context) -> Vec<Columns> {
    if context.rows.rigid_body.offset {
        return Vec::new();
    }
    vec![plain("", vec![vec![1.0; context.rows.len()]])]
}

pub(super) fn quadratic_drag(context: &Context) -> Vec<Columns> {
    let v = &context.rows.smooth_velocity;
    vec![plain("", vec![v.iter().map(|v| v * v.abs()).collect()])]
}

pub(super) fn unmodelled_inertia(context: &Context) -> Vec<Columns> {
    if context.rows.rigid_body.inertia {
        return Vec::new();
    }
    vec![plain("", vec![context.rows.acceleration.clone()])]
}

pub(super) fn gravity_imbalance(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if rows.rigid_body.gravity || !rows.has_position || rows.joint != JointKind::Revolute {
        return Vec::new();
    }
    let sine = rows.position.iter().map(|q| q.sin()).collect();
    let cosine = rows.position.iter().map(|q| q.cos()).collect();
    vec![plain("", vec![sine, cosine])]
}

pub(super) fn dwell_time_static(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let travel = context.shapes.travels[context.travel];
    let step = (2.0 * rows.least_step).max(REST_TRAVEL * travel);
    let found = rests(&rows.position, &rows.time_s, &rows.runs, step);
    let growth = |row: usize| (found.dwell_s[row] / DWELL_START_S).ln_1p();
    let column = |paths: f64| {
        let decay = |row: usize| (-found.path[row] / (paths * travel)).exp();
        // The mean growth is a shape of the breakaway and no effect of the time.
        let sums = (0..rows.len()).fold((0.0, 1e-12), |(sum, count), row| {
            (sum + growth(row) * decay(row), count + decay(row))
        });
        context.with_level(|row| (growth(row) - sums.0 / sums.1) * decay(row))
    };
    let variant = |paths: f64| plain(&format!("over {paths} travels"), vec![column(paths)]);
    BREAKAWAY_PATHS.map(variant).into()
}

pub(super) fn time_drift(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.has_campaign_clock {
        return Vec::new();
    }
    let ends = rows
        .time_s
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
    let share = rows.map(|row| (rows.time_s[row] - ends.0) / (ends.1 - ends.0).max(1e-9));
    let mut found = vec![plain("linear", vec![product(context.level, &share)])];
    for constant in DRIFTS {
        let column = context.with_level(|row| (-share[row] / constant).exp());
        found.push(plain(&format!("run-in over {constant} of the campaign"), vec![column]));
    }
    found
}

pub(super) fn warm_up(context: &Context) -> Vec<Columns> {
    let mut found = Vec::new();
    for cooling_s in COOLING_S {
        let heat = heat(context, cooling_s);
        let large = quantile(heat.clone(), 0.9) + 1e-12;
        for share in HEATS {
            let column = context.with_level(|row| 1.0 - (-heat[row] / (share * large)).exp());
            found.push(plain(&format!("heat {share}, cooling {cooling_s} s"), vec![column]));
        }
    }
    found
}

/// Returns the heat of rubbing that a joint holds, in level times path. On a campaign's clock it cools between the runs and is
/// kept from run to run; else each run begins cold.
fn heat(context: &Context, cooling_s: f64) -> Vec<f64> {
    let rows = context.rows;
    let mut heat = vec![0.0; rows.len()];
    let mut last = (0.0, 0.0);
    for run in &rows.runs {
        if !rows.has_campaign_clock || cooling_s.is_infinite() {
            last = (0.0, rows.time_s[run.start]);
        }
        for row in run.clone() {
            let seconds = (rows.time_s[row] - last.1).max(0.0);
            let moving = if row > run.start { seconds } else { 0.0 };
            let power = context.level[row].abs() * rows.velocity[row].abs();
            last = (last.0 * (-seconds / cooling_s).exp() + power * moving, rows.time_s[row]);
            heat[row] = last.0;
        }
    }
    heat
}
