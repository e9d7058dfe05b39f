//! Torque ripple: cogging or gear mesh adds a torque of several orders of the angle, independent of
//! the direction.
//!
//! The torque of a magnet on a slot or of a tooth on a tooth is not a share of the friction. It
//! does not change sign with the direction, and it also acts at rest. A [`super::position_ripple`]
//! changes sign with the direction.
//!
//! One period per turn of the joint is excluded. It belongs to the gravity imbalance
//! ([`super::gravity_imbalance`]), which describes the same torque by a simpler term.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::{Extended, Size};
use compensator_core::term::{TORQUE_RIPPLE_ORDERS, TORQUE_RIPPLE_PARAMETERS};
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::params::unit;
use joint_log::number::{figure, significant};

/// Torque ripple as a cause; see the module documentation.
pub struct TorqueRipple;

impl Cause for TorqueRipple {
    fn name(&self) -> &'static str {
        "torque-ripple"
    }

    fn meaning(&self) -> &'static str {
        "a torque follows the position in both directions alike (cogging, gear mesh)"
    }

    fn effect(&self) -> &'static str {
        "sines and cosines of several orders of the position, in both directions alike."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::TorqueRipple)
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let orders = &context.found.orders;
        if orders.is_empty() {
            return Vec::new();
        }
        vec![candidate(
            context.log.position_name(),
            &orders[..orders.len().min(TORQUE_RIPPLE_ORDERS)],
        )]
    }

    /// None: the size is the amplitude of one order, and the others may hold the effect.
    fn no_effect_size(&self) -> f64 {
        f64::NAN
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
        let of = |id: Id| unit(id, extended.joint());
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
            PlaneAxis::Folded(order),
            ResidualView::Plain,
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
            "Turn slowly and evenly through several whole turns in both directions: there the ripple is the largest part of the \
             torque, and its orders and phases are measured best."
                .into(),
        )
    }
}

/// Returns a candidate with these orders.
fn candidate(position: &str, orders: &[f64]) -> Candidate {
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
            (sine, InitialGuess::Times(column, 1.0)),
            (cosine, InitialGuess::Times(column + 1, 1.0)),
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
