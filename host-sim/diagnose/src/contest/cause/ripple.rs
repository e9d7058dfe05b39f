//! Waves of the angle: torque ripple, friction ripple, and an encoder's error.
//!
//! A torque ripple is added whichever way the joint turns, a friction ripple (`position-ripple`) scales the friction level, an
//! encoder's error is a wave of the motion itself, once or a few times a turn, and shows in speed and acceleration.

use super::{Columns, Context, plain};
use crate::contest::detail::{Detail, WaveKind};
use crate::contest::orders::{MOST_WAVES, RippleOrders};
use friction_fit::linear::{Factor, Regressor};
use joint_log::JointKind;

/// Orders of an encoder's error: eccentricity, tilt and their harmonics.
const ENCODER_ORDERS: [f64; 4] = [1.0, 2.0, 3.0, 4.0];

fn waves_of(orders: &[f64]) -> Detail {
    Detail::waves(orders, WaveKind::Plain)
}

pub(super) fn torque_ripple(context: &Context) -> Vec<Columns> {
    let whole = |found: &RippleOrders| {
        let orders = &found.torque;
        let counts = [1, 3, MOST_WAVES].map(|count| count.min(orders.len()));
        let mut sets: Vec<&[f64]> = counts.iter().map(|count| &orders[..*count]).collect();
        sets.dedup();
        sets.retain(|set| !set.is_empty());
        let variant = |set: &&[f64]| plain(waves_of(set), regressors(set, &[]));
        sets.iter().map(variant).collect::<Vec<Columns>>()
    };
    let all = context.waves.orders.iter().flat_map(whole).chain(free_phase(context));
    all.chain(transmission_error(context)).collect()
}

/// A transmission error `e(q)` of a gear accelerates what is behind it: its ripple `J (e'' v^2 + e' a)` grows with the speed. The
/// few lowest orders are those of an encoder ([`encoder_error`]).
fn transmission_error(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.rigid_body.inertia || rows.joint != JointKind::Revolute {
        return Vec::new();
    }
    let highest = ENCODER_ORDERS.iter().copied().fold(0.0, f64::max);
    let orders = context.waves.orders.iter().filter_map(|found| found.torque.first());
    let orders = orders.filter(|order| **order > highest);
    orders
        .map(|order| plain(Detail::waves(&[*order], WaveKind::OfSpeed), of_motion(*order)))
        .collect()
}

/// Returns the waves of some orders, times factors.
fn regressors(orders: &[f64], times: &[Factor]) -> Vec<Regressor> {
    let pair = |order: &f64| {
        let order = *order;
        [Factor::Sine { order }, Factor::Cosine { order }]
            .map(|wave| times.iter().cloned().fold(Regressor::from([wave]), Regressor::times))
    };
    orders.iter().flat_map(pair).collect()
}

/// Returns a wave of the motion: in proportion to the squared speed and to the acceleration.
fn of_motion(order: f64) -> Vec<Regressor> {
    let mut waves = regressors(&[order], &[Factor::Velocity, Factor::Velocity]);
    waves.extend(regressors(&[order], &[Factor::Acceleration]));
    waves
}

/// The wave whose phase differs between the runs, and its first harmonic.
fn free_phase(context: &Context) -> Option<Columns> {
    let found = context.waves.orders.first()?.free_phase.as_ref()?;
    let waves = [1.0, 2.0].map(|multiple| {
        let order = multiple * found.order;
        let phases: Vec<f64> = found.phases_rad.iter().map(|phase| multiple * phase).collect();
        let sine = Factor::SineByRun { order, phases: phases.clone() };
        [sine, Factor::CosineByRun { order, phases }].map(|wave| Regressor::from([wave]))
    });
    let orders = [found.order, 2.0 * found.order];
    Some(plain(Detail::waves(&orders, WaveKind::FreePhase), waves.concat()))
}

pub(super) fn position_ripple(context: &Context) -> Vec<Columns> {
    let orders = context.waves.orders.iter().flat_map(|found| found.level.iter().take(2));
    let variant = |order: &f64| plain(waves_of(&[*order]), regressors(&[*order], &[Factor::Level]));
    orders.map(variant).collect()
}

/// An error `e(q)` of the encoder makes `e' v` of the speed and `e'' v^2 + e' a` of the acceleration.
pub(super) fn encoder_error(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.rigid_body.inertia || !rows.has_position || rows.joint != JointKind::Revolute {
        return Vec::new();
    }
    let variant = |order: &f64| plain(waves_of(&[*order]), of_motion(*order));
    ENCODER_ORDERS.iter().map(variant).collect()
}
