//! Position ripple: the friction level follows the position, as for an eccentric seal, a gear mesh
//! or a scratch.
//!
//! Its order is estimated from the residual, without prior knowledge.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::{Extended, Size};
use crate::order::{Point, most, peaks};
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::params::unit;
use joint_log::JointKind;
use joint_log::number::{figure, significant};

/// Number of orders that become candidates.
const ORDERS: usize = 3;

/// Position ripple as a cause; see the module documentation.
pub struct PositionRipple;

impl Cause for PositionRipple {
    fn name(&self) -> &'static str {
        "position-ripple"
    }

    fn meaning(&self) -> &'static str {
        "friction follows the shaft angle"
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

    /// A wave of a slightly wrong order loses its phase, so that a linear fit underestimates it.
    fn is_poorly_linearised(&self) -> bool {
        true
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let log = context.log;
        let name = log.position_name();
        if !log.varies(name) {
            return Vec::new();
        }
        if !context.found.orders.is_empty() {
            let orders = context.found.orders.iter();
            return orders.map(|order| candidate(name, *order, 1.0)).collect();
        }
        let points: Vec<Point> = log
            .train_tracks
            .iter()
            .zip(&context.at.tracks)
            .flat_map(|(track, at)| {
                track.samples.iter().zip(&at.level).zip(&at.residual).map(
                    |((s, level), residual)| Point {
                        position: s.position_rad,
                        weighed: level * residual,
                    },
                )
            })
            .collect();
        let is_revolute = log.train.joint == JointKind::Revolute;
        let most = most(log);
        let of_peak = |peak: &crate::order::Peak| {
            let (n, comparisons) =
                if is_revolute { peak.whole(most) } else { (peak.order, peak.independent) };
            candidate(name, n, comparisons)
        };
        peaks(&points, most, ORDERS).iter().map(of_peak).collect()
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

/// Returns the candidate of an order, which was chosen from this number of others.
fn candidate(position: &str, n: f64, comparisons: f64) -> Candidate {
    let by = vec![
        row(move |r| r.level * (n * r.sample.position_rad).sin()),
        row(move |r| r.level * (n * r.sample.position_rad).cos()),
    ];
    Candidate::new(TermKind::PositionRipple, &[position], by)
        .starting_at(&[
            (Id::RippleOrder, InitialGuess::At(n)),
            (Id::RippleSine, InitialGuess::Times(0, 1.0)),
            (Id::RippleCosine, InitialGuess::Times(1, 1.0)),
        ])
        .of_order(n, comparisons)
}
