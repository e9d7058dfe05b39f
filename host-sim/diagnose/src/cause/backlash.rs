//! Backlash: after a reversal there is travel with little stiffness.
//!
//! The backlash is crossed right after the reversal, or when a wound-up drive has unwound and its
//! flanks separate (`backlash_unloaded`). The log determines which of the two. The backlash travel
//! is unknown. Its candidates are multiples of the travel in which the bristles take up their load,
//! and a share of the log's strokes. The second kind is needed because a base law may describe a
//! few millimetres of backlash by soft bristles.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView};
use crate::extended::{Extended, Size};
use crate::sensitivities::Exact;
use crate::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};

/// Backlash travels that are crossed right after a reversal, as multiples of the presliding travel.
const PRESLIDING: [f64; 4] = [0.5, 2.0, 6.0, 20.0];

/// Backlash travels that are crossed at zero torque, as multiples of the presliding travel. A law
/// without backlash describes part of it by bristles that are too soft.
const PRESLIDING_UNLOADED: [f64; 3] = [0.3, 1.0, 3.0];

/// Backlash travel of two further candidates, as a share of the travel between reversals.
const OF_STROKE: f64 = 0.08;

/// Stiffness of two further candidates, as a multiple of the model's bristle stiffness. A base law
/// without backlash describes a large one by soft bristles only, and its stiffness is then far too
/// low.
const STIFFER: f64 = 3.0;

/// Backlash as a cause; see the module documentation.
pub struct Backlash;

/// Returns the typical travel between two reversals, rad; 0 without a reversal. Half of the total
/// travel belongs to longer strokes.
fn stroke(context: &FitContext) -> f64 {
    let mut strokes = Vec::new();
    for track in &context.log.train_tracks {
        let mut way = 0.0f64;
        for (row, sample) in track.samples.iter().enumerate() {
            let ratio = track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
            let step = sample.velocity_rad_s * track.period_s * ratio;
            if step * way < 0.0 {
                strokes.push(way.abs());
                way = 0.0;
            }
            way += step;
        }
    }
    strokes.sort_by(f64::total_cmp);
    let half = 0.5 * strokes.iter().sum::<f64>();
    let mut shorter = 0.0;
    let middle = strokes.into_iter().find(|stroke| {
        shorter += stroke;
        shorter >= half
    });
    middle.unwrap_or(0.0)
}

/// Returns the candidate of a travel, rad, of whether it is crossed at zero torque, and of a bristle stiffness, Nm/rad.
fn candidate(columns: &[&str], (travel, unloaded, stiffness): (f64, f64, f64)) -> Candidate {
    let settings = vec![
        (Id::BacklashTravel, travel),
        (Id::BacklashUnloaded, unloaded),
        (Id::BristleStiffness, stiffness),
    ];
    let by = Exact { kind: TermKind::Backlash, settings, derivative: None };
    Candidate::new(TermKind::Backlash, columns, vec![Regressor::Exact(by)])
        .starting_at(&[
            (Id::BacklashTravel, InitialGuess::At(travel)),
            (Id::BacklashUnloaded, InitialGuess::At(unloaded)),
            (Id::BristleStiffness, InitialGuess::At(stiffness)),
        ])
        .keeping(&[Id::BacklashStiffnessRatio, Id::BacklashUnloaded])
}

impl Cause for Backlash {
    fn name(&self) -> &'static str {
        "backlash"
    }

    fn meaning(&self) -> &'static str {
        "after a reversal there is travel with little stiffness"
    }

    fn effect(&self) -> &'static str {
        "little stiffness while a play is crossed."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::Backlash)
    }

    fn acts_on(&self) -> &'static [Id] {
        &[Id::BristleStiffness, Id::BristleDamping]
    }

    /// A play below the step of the encoder cannot be seen.
    fn least_size(&self, log: &TrainTest) -> Option<f64> {
        Some(log.position_step())
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.spec.law.has_bristles() {
            return Vec::new();
        }
        let columns = [context.log.velocity_name()];
        let parameters = &context.at.parameters;
        let presliding = parameters.get(Id::StaticTorque).max(parameters.get(Id::CoulombTorque))
            / parameters.get(Id::BristleStiffness).max(1e-9);
        let stroke = OF_STROKE * stroke(context);
        let kept = PRESLIDING.map(|times| (times * presliding, 0.0));
        let unloaded = PRESLIDING_UNLOADED.map(|times| (times * presliding, 1.0));
        let by_stroke = [(stroke, 0.0), (stroke, 1.0)].into_iter().filter(|_| stroke > 0.0);
        let stiffness = parameters.get(Id::BristleStiffness);
        if let Some((gap, travel)) = context.found.gap {
            let level = stiffness * presliding;
            let ways = [0.0, 1.0].map(|unloaded| (gap, unloaded, level / travel.max(1e-12)));
            return ways.map(|way| candidate(&columns, way)).into();
        }
        let stiffer = [(0.5 * presliding, 0.0), (0.5 * presliding, 1.0)];
        let stiffer = stiffer.map(|(travel, unloaded)| (travel, unloaded, STIFFER * stiffness));
        kept.into_iter()
            .chain(unloaded)
            .chain(by_stroke)
            .map(|(travel, unloaded)| (travel, unloaded, stiffness))
            .chain(stiffer)
            .map(|way| candidate(&columns, way))
            .collect()
    }

    fn in_words(&self, size: &Size, extended: &Extended) -> String {
        let where_crossed = if extended.value(Id::BacklashUnloaded) > 0.5 {
            "where the drive has unwound and holds nothing"
        } else {
            "right after the reversal"
        };
        format!("{}: {}, {where_crossed}", self.meaning(), size.in_words())
    }

    fn evidence(&self, _: &[String], extended: &Extended) -> Option<Evidence> {
        Plane::new(
            "Just after a reversal",
            PlaneAxis::SinceReversal(8.0 * extended.value(Id::BacklashTravel)),
            ResidualView::Along,
            "Where there is play, the joint resists less than a bristle model until the play is crossed.",
        )
        .into()
    }
}
