//! Cogging, gear mesh: a torque of the angle in several orders, whichever way the joint turns.
//!
//! What a magnet does to a slot or a tooth to a tooth is no share of the friction: it does not change its sign
//! with the direction (as a [`super::position_ripple`] does, which the same spectrum weighed with the level
//! finds), and it is there at rest. Once a turn of the joint is left to the imbalance of what it carries
//! ([`super::gravity_imbalance`]), which is the same torque and simpler.

use super::definition::{Cause, Remedy};
use crate::data::JointKind;
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Regressor, row};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::{Extended, Size};
use crate::diagnose::harmonics::strongest;
use crate::diagnose::order::most;
use crate::number::{figure, significant};
use crate::params::unit;
use compensator_core::term::{TORQUE_RIPPLE_PARAMETERS, TORQUE_RIPPLES};
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct TorqueRipple;

impl Cause for TorqueRipple {
    fn name(&self) -> &'static str {
        "torque-ripple"
    }

    fn meaning(&self) -> &'static str {
        "a torque follows the shaft angle, whichever way it turns (cogging, gear mesh)"
    }

    fn effect(&self) -> &'static str {
        "sines and cosines of several orders of the position, whichever way it moves."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::TorqueRipple)
    }

    /// An order a little off is a wave that runs out of step, and underrated.
    fn is_underrated(&self) -> bool {
        true
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        let log = beside.log;
        let name = log.position_name();
        if !log.varies(name) {
            return Vec::new();
        }
        let is_revolute = log.train.joint == JointKind::Revolute;
        let most = most(log);
        let is_gravitys = is_revolute && log.aligned_order.is_none();
        let once_a_turn: &[f64] = if is_gravitys { &[1.0] } else { &[] };
        let Some(found) = strongest(log, beside.at, most, TORQUE_RIPPLES, once_a_turn, is_revolute)
        else {
            return Vec::new();
        };
        // The strongest alone, and all of them.
        let mut sizes = vec![1, found.orders.len()];
        sizes.dedup();
        let orders = |count: usize| &found.orders[..count];
        sizes.into_iter().map(|count| candidate(name, orders(count), found.independent)).collect()
    }

    fn size(&self, extended: &Extended) -> Size {
        let [_, sine, cosine] = waves(extended)[0];
        extended.amplitude(sine, cosine)
    }

    fn order(&self, extended: &Extended) -> Option<(f64, f64)> {
        let [order, ..] = waves(extended)[0];
        Some((extended.value(order), extended.error(order)))
    }

    fn in_words(&self, size: &Size, extended: &Extended) -> String {
        let waves = waves(extended);
        let of = |id: Id| unit(id.info(), extended.joint());
        let [first, ..] = waves[0];
        let mut text = format!(
            "{}: {}, of order {} ± {} {}",
            self.meaning(),
            size.in_words(),
            figure(extended.value(first)),
            figure(2.0 * extended.error(first)),
            of(first)
        );
        for [order, sine, cosine] in &waves[1..] {
            let size = extended.amplitude(*sine, *cosine);
            let order = significant(extended.value(*order), 4);
            text += &format!("; {} {} of order {order}", figure(size.value), of(*sine));
        }
        text
    }

    fn evidence(&self, _: &[String], extended: &Extended) -> Option<Evidence> {
        let [order, ..] = waves(extended)[0];
        let order = extended.value(order);
        Plane::new(
            "The position, folded by the order",
            Over::Folded(order),
            Seen::Plain,
            format!(
                "The position times {} per {}, all waves laid over each other, the torque with its own sign. A \
                 ripple of that order is one wave here whichever way the joint moves; multiples of it bend the \
                 wave, other orders average out.",
                significant(order, 4),
                extended.joint().position_unit()
            ),
        )
        .into()
    }

    fn next_experiment(&self, _: &[String]) -> Option<String> {
        Some(
            "Turn slowly and evenly through several whole turns both ways: there the ripple is most of the torque, and \
             its orders and phases are measured best."
                .into(),
        )
    }
}

/// A candidate of these orders.
fn candidate(position: &str, orders: &[f64], independent: f64) -> Candidate {
    let mut regressors: Vec<Regressor> = Vec::new();
    let (mut guesses, mut fixed) = (Vec::new(), Vec::new());
    for (place, ids) in TORQUE_RIPPLE_PARAMETERS.into_iter().enumerate() {
        let Some(n) = orders.get(place).copied() else {
            // A place that is not taken.
            guesses.extend(ids.map(|id| (id, InitialGuess::At(0.0))));
            fixed.extend(ids);
            continue;
        };
        let column = regressors.len();
        regressors.push(row(move |r| (n * r.sample.position_rad).sin()));
        regressors.push(row(move |r| (n * r.sample.position_rad).cos()));
        let [order, sine, cosine] = ids;
        if n.fract() == 0.0 {
            // What is fixed to the shaft has a whole order: a fit would only move it by its noise, and out of step.
            fixed.push(order);
        }
        guesses.extend([
            (order, InitialGuess::At(n)),
            (sine, InitialGuess::Times(column, 1.0)),
            (cosine, InitialGuess::Times(column + 1, 1.0)),
        ]);
    }
    Candidate::new(TermKind::TorqueRipple, &[position], regressors)
        .starting_at(&guesses)
        .keeping(&fixed)
        // Each was chosen from all, beside those before it.
        .of_order(orders[0], independent * orders.len() as f64)
}

/// The orders in use, the strongest first.
fn waves(extended: &Extended) -> Vec<[Id; 3]> {
    let size = |[_, sine, cosine]: &[Id; 3]| extended.value(*sine).hypot(extended.value(*cosine));
    let mut waves = TORQUE_RIPPLE_PARAMETERS.to_vec();
    waves.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let used = waves.iter().take_while(|wave| size(wave) > 0.0).count();
    waves.truncate(used.max(1));
    waves
}
