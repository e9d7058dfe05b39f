//! Position ripple: the friction level follows the position, as for an eccentric seal, a gear mesh
//! or a scratch.
//!
//! The contest estimates its order, without prior knowledge.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::{Extended, Size};
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::params::unit;
use joint_log::number::{figure, significant};

/// Position ripple as a cause; see the module documentation.
pub struct PositionRipple;

impl Cause for PositionRipple {
    fn name(&self) -> &'static str {
        "position-ripple"
    }

    fn meaning(&self) -> &'static str {
        "friction follows the position in waves"
    }

    fn effect(&self) -> &'static str {
        "levels follow the position, n periods per unit."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::PositionRipple)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let name = context.log.position_name();
        context.found.orders.iter().map(|order| candidate(name, *order)).collect()
    }

    /// None: the size is the amplitude of one order, and the others may hold the effect.
    fn no_effect_size(&self) -> f64 {
        f64::NAN
    }

    fn size(&self, extended: &Extended) -> Size {
        extended.amplitude(Id::RippleSine, Id::RippleCosine)
    }

    fn order(&self, extended: &Extended) -> Option<(f64, f64)> {
        Some((extended.value(Id::RippleOrder), extended.error(Id::RippleOrder)))
    }

    fn in_words(&self, size: &Size, extended: &Extended) -> String {
        let (order, error) = (extended.value(Id::RippleOrder), extended.error(Id::RippleOrder));
        format!(
            "{}: {}, of order {} ± {} {}",
            self.meaning(),
            size.in_words(),
            figure(order),
            figure(2.0 * error),
            unit(Id::RippleOrder, extended.joint())
        )
    }

    fn evidence(&self, _: &[String], extended: &Extended) -> Option<Evidence> {
        let order = extended.value(Id::RippleOrder);
        Plane::new(
            "The position, folded by the order",
            PlaneAxis::Folded(order),
            ResidualView::Along,
            format!(
                "The position times {} per {}, all waves laid over each other. A ripple of that order is one \
                 wave here, and anything of another order averages out.",
                significant(order, 4),
                extended.joint().position_unit()
            ),
        )
        .into()
    }
}

/// Returns the candidate of an order.
fn candidate(position: &str, n: f64) -> Candidate {
    let by = vec![
        row(move |r| r.level * (n * r.sample.position_rad).sin()),
        row(move |r| r.level * (n * r.sample.position_rad).cos()),
    ];
    Candidate::new(TermKind::PositionRipple, &[position], by).starting_at(&[
        (Id::RippleOrder, InitialGuess::At(n)),
        (Id::RippleSine, InitialGuess::Times(0, 1.0)),
        (Id::RippleCosine, InitialGuess::Times(1, 1.0)),
    ])
}
