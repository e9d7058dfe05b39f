//! Waves of the position: a friction level that follows it, and a torque that does.
//!
//! A friction level follows the position for an eccentric seal, a gear mesh or a scratch, and changes sign with the direction. The
//! torque of a magnet on a slot (cogging) or of a tooth on a tooth is not a share of the friction: it does not change sign, and it
//! also acts at rest. One period per turn of the joint belongs to the gravity imbalance, a simpler term.
//!
//! The contest estimates the orders. The size is the amplitude of one order, and others may hold the effect, so that no size
//! tells that there is none.

use super::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, InitialGuess, Regressor, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::{Extended, WaveOrder};
use compensator_core::term::{TORQUE_RIPPLE_ORDERS, TORQUE_RIPPLE_PARAMETERS};
use compensator_core::{ParameterId as Id, TermKind};
use joint_log::number::{figure, significant};

/// The friction level follows the position.
pub(super) const POSITION_RIPPLE: Cause = Cause {
    meaning: "friction follows the position in waves",
    effect: "levels follow the position, n periods per unit.",
    acts_on: LEVELS,
    no_effect_size: f64::NAN,
    candidates: |context| {
        let position = context.log.position_name();
        context.found.orders().iter().map(|order| level_wave(position, *order)).collect()
    },
    size: Some(|extended| extended.amplitude(Id::RippleSine, Id::RippleCosine)),
    order: |extended| order_of(extended, Id::RippleOrder),
    words: |meaning, size, extended| {
        format!("{meaning}: {}, {}", size.in_words(), order_in_words(extended, Id::RippleOrder))
    },
    evidence: |_, extended| {
        folded(
            extended,
            Id::RippleOrder,
            ResidualView::Along,
            "A ripple of that order is one wave here, and anything of another order averages out.",
        )
    },
    ..Cause::new("position-ripple", Remedy::Term(TermKind::PositionRipple))
};

/// A torque of several orders of the angle, independent of the direction.
pub(super) const TORQUE_RIPPLE: Cause = Cause {
    meaning: "a torque follows the position in both directions alike (cogging, gear mesh)",
    effect: "sines and cosines of several orders of the position, in both directions alike.",
    no_effect_size: f64::NAN,
    candidates: |context| {
        let orders = context.found.orders();
        let most = &orders[..orders.len().min(TORQUE_RIPPLE_ORDERS)];
        match most {
            [] => Vec::new(),
            _ => vec![torque_waves(context.log.position_name(), most)],
        }
    },
    size: Some(|extended| {
        let [_, sine, cosine] = waves(extended)[0];
        extended.amplitude(sine, cosine)
    }),
    order: |extended| order_of(extended, waves(extended)[0][0]),
    words: |meaning, size, extended| {
        let waves = waves(extended);
        let mut text =
            format!("{meaning}: {}, {}", size.in_words(), order_in_words(extended, waves[0][0]));
        for [order, sine, cosine] in &waves[1..] {
            let size = extended.amplitude(*sine, *cosine);
            let order = significant(extended.value(*order), 4);
            text += &format!("; {} {} of order {order}", figure(size.value), extended.unit(*sine));
        }
        text
    },
    evidence: |_, extended| {
        folded(
            extended,
            waves(extended)[0][0],
            ResidualView::Plain,
            "A ripple of that order is one wave here whichever way the joint moves; multiples of it bend the wave, other orders \
             average out.",
        )
    },
    next_experiment: |_| {
        Some(
            "Turn slowly and evenly through several whole turns in both directions: there the ripple is the largest part of the \
             torque, and its orders and phases are measured best."
                .into(),
        )
    },
    ..Cause::new("torque-ripple", Remedy::Term(TermKind::TorqueRipple))
};

fn order_of(extended: &Extended, order: Id) -> Option<WaveOrder> {
    Some(WaveOrder { value: extended.value(order), std_error: extended.error(order) })
}

fn order_in_words(extended: &Extended, order: Id) -> String {
    let (value, error) = (figure(extended.value(order)), figure(2.0 * extended.error(order)));
    format!("of order {value} ± {error} {}", extended.unit(order))
}

/// Returns the plane of the position, folded by an order.
fn folded(extended: &Extended, order: Id, view: ResidualView, shape: &str) -> Option<Evidence> {
    let order = extended.value(order);
    let sign = if view == ResidualView::Plain { ", the torque with its own sign" } else { "" };
    Plane::new(
        "The position, folded by the order",
        PlaneAxis::Folded(order),
        view,
        format!(
            "The position times {} per {}, all waves laid over each other{sign}. {shape}",
            significant(order, 4),
            extended.joint().position_unit()
        ),
    )
    .into()
}

/// Returns the candidate of a friction level with an order.
fn level_wave(position: &str, n: f64) -> Candidate {
    let by = vec![
        row(move |r| r.level * (n * r.sample.position_rad).sin()),
        row(move |r| r.level * (n * r.sample.position_rad).cos()),
    ];
    Candidate::new(TermKind::PositionRipple, &[position], by).starting_at(&[
        (Id::RippleOrder, InitialGuess::At(n)),
        (Id::RippleSine, InitialGuess::first_times(1.0)),
        (Id::RippleCosine, InitialGuess::Times { regressor: 1, factor: 1.0 }),
    ])
}

/// Returns the candidate of a torque with these orders.
fn torque_waves(position: &str, orders: &[f64]) -> Candidate {
    let mut regressors: Vec<Regressor> = Vec::new();
    let (mut guesses, mut fixed) = (Vec::new(), Vec::new());
    for (place, ids) in TORQUE_RIPPLE_PARAMETERS.into_iter().enumerate() {
        let Some(n) = orders.get(place).copied() else {
            // An unused order has the size 0.
            guesses.extend(ids.map(|id| (id, InitialGuess::At(0.0))));
            fixed.extend(ids);
            continue;
        };
        let column = regressors.len();
        regressors.push(row(move |r| (n * r.sample.position_rad).sin()));
        regressors.push(row(move |r| (n * r.sample.position_rad).cos()));
        let [order, sine, cosine] = ids;
        if n.fract() == 0.0 {
            // A ripple of the shaft has a whole order. A fitted order would contain noise and cause
            // a phase error.
            fixed.push(order);
        }
        guesses.extend([
            (order, InitialGuess::At(n)),
            (sine, InitialGuess::Times { regressor: column, factor: 1.0 }),
            (cosine, InitialGuess::Times { regressor: column + 1, factor: 1.0 }),
        ]);
    }
    Candidate::new(TermKind::TorqueRipple, &[position], regressors)
        .starting_at(&guesses)
        .keeping(&fixed)
}

/// Returns the parameters of the orders in use, the strongest first.
fn waves(extended: &Extended) -> Vec<[Id; 3]> {
    let size = |[_, sine, cosine]: &[Id; 3]| extended.value(*sine).hypot(extended.value(*cosine));
    let mut waves = TORQUE_RIPPLE_PARAMETERS.to_vec();
    waves.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let used = waves.iter().take_while(|wave| size(wave) > 0.0).count();
    waves.truncate(used.max(1));
    waves
}
