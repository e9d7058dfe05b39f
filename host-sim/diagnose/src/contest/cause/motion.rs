//! Causes of the motion and the time alone: asymmetry, offset, drag, inertia, gravity, dwell, drift, warm-up, shape.

use super::{Columns, Context, form, of_level, plain};
use crate::contest::detail::Detail;
use crate::contest::rows::Rows;
use friction_fit::linear::{Factor, Regressor, heat, mean_growth};
use joint_log::JointKind;
use joint_log::statistics::{extent, quantile_by_count};

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

/// Speed from which a row shows a direction of motion, as a share of the usual high speed.
const MOVING_SPEED: f64 = 0.02;

/// Fewest moving rows of the rarer direction, as a share of all moving rows.
const MIN_REVERSE: f64 = 0.01;

/// Returns true if the log moves in both directions. In one direction, a constant and a level that differs by direction are
/// the friction level itself.
fn moves_both_ways(rows: &Rows) -> bool {
    let least = MOVING_SPEED * rows.top_speed;
    let count = |sign: f64| rows.velocity.iter().filter(|v| sign * **v > least).count() as f64;
    let (forward, reverse) = (count(1.0), count(-1.0));
    forward.min(reverse) > MIN_REVERSE * (forward + reverse)
}

/// Returns a variant of one factor.
fn single(factor: Factor) -> Vec<Columns> {
    vec![plain(Detail::Only, vec![Regressor::from([factor])])]
}

pub(super) fn direction_asymmetry(context: &Context) -> Vec<Columns> {
    if !moves_both_ways(context.rows) {
        return Vec::new();
    }
    let [level, viscous] =
        [Factor::LevelMagnitude, Factor::Speed].map(|factor| Regressor::from([factor]));
    vec![
        plain(form("level"), vec![level.clone()]),
        plain(form("level and viscous"), vec![level, viscous]),
    ]
}

pub(super) fn torque_offset(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if rows.rigid_body.offset || !moves_both_ways(rows) { Vec::new() } else { single(Factor::One) }
}

pub(super) fn quadratic_drag(_: &Context) -> Vec<Columns> {
    vec![plain(Detail::Only, vec![Regressor::from([Factor::Velocity, Factor::Speed])])]
}

pub(super) fn unmodelled_inertia(context: &Context) -> Vec<Columns> {
    if context.rows.rigid_body.inertia { Vec::new() } else { single(Factor::Acceleration) }
}

pub(super) fn gravity_imbalance(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if rows.rigid_body.gravity || !rows.has_position || rows.joint != JointKind::Revolute {
        return Vec::new();
    }
    let order = 1.0;
    let pair = [Factor::Sine { order }, Factor::Cosine { order }];
    vec![plain(Detail::Only, pair.map(|factor| Regressor::from([factor])).into())]
}

pub(super) fn dwell_time_static(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let travel = context.travel();
    let step = (2.0 * rows.least_step).max(REST_TRAVEL * travel);
    let variant = |paths: f64| {
        let path = paths * travel;
        let factor = Factor::Dwell { step, path, mean: mean_growth(&rows.motion, step, path) };
        plain(form(format!("over {paths} travels")), vec![of_level(factor)])
    };
    BREAKAWAY_PATHS.map(variant).into()
}

pub(super) fn time_drift(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.has_campaign_clock {
        return Vec::new();
    }
    let [from_s, to_s] = extent(rows.time_s.iter().copied());
    let mut found = vec![plain(form("linear"), vec![of_level(Factor::Passed { from_s, to_s })])];
    for constant in DRIFTS {
        let factor = Factor::RunIn { from_s, to_s, constant };
        found.push(plain(
            form(format!("run-in over {constant} of the campaign")),
            vec![of_level(factor)],
        ));
    }
    found
}

pub(super) fn warm_up(context: &Context) -> Vec<Columns> {
    let mut found = Vec::new();
    for cooling_s in COOLING_S {
        let heat = heat(&context.rows.motion, context.level, cooling_s);
        let large = quantile_by_count(heat, 0.9).unwrap_or_default() + 1e-12;
        for share in HEATS {
            let factor = Factor::Warmth { scale: share * large, cooling_s };
            found.push(plain(
                form(format!("heat {share}, cooling {cooling_s} s")),
                vec![of_level(factor)],
            ));
        }
    }
    found
}
