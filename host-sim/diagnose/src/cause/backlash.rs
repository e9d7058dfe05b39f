//! Backlash: after a reversal there is travel with little stiffness.
//!
//! The backlash is crossed right after the reversal, or when a wound-up drive has unwound and its
//! flanks separate (`backlash_unloaded`). The log determines which of the two. The backlash travel
//! is unknown. Its candidates are multiples of the travel in which the bristles take up their load,
//! and a share of the log's strokes. The second kind is needed because a base law may describe a
//! few millimetres of backlash by soft bristles.

use super::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::contest::Gap;
use crate::evidence::{Plane, PlaneAxis, ResidualView};
use crate::sensitivities::Exact;
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

/// Backlash as a cause. A play below the step of the encoder cannot be seen.
pub(super) const BACKLASH: Cause = Cause {
    meaning: "after a reversal there is travel with little stiffness",
    effect: "little stiffness while a play is crossed.",
    acts_on: &[Id::BristleStiffness, Id::BristleDamping],
    least_size: |log| Some(log.position_step()),
    candidates,
    words: |meaning, size, extended| {
        let where_crossed = match extended.value(Id::BacklashUnloaded) > 0.5 {
            true => "where the drive has unwound and holds nothing",
            false => "right after the reversal",
        };
        format!("{meaning}: {}, {where_crossed}", size.in_words())
    },
    evidence: |_, extended| {
        Plane::new(
            "Just after a reversal",
            PlaneAxis::SinceReversal(8.0 * extended.value(Id::BacklashTravel)),
            ResidualView::Along,
            "Where there is play, the joint resists less than a bristle model until the play is crossed.",
        )
        .into()
    },
    ..Cause::new("backlash", Remedy::Term(TermKind::Backlash))
};

/// Returns the typical travel between two reversals, rad; 0 without a reversal. Half of the total
/// travel belongs to longer strokes.
fn stroke(context: &FitContext) -> f64 {
    let mut strokes = Vec::new();
    for track in &context.log.train_tracks {
        let mut way = 0.0f64;
        for (row, sample) in track.samples.iter().enumerate() {
            let step = sample.velocity_rad_s * track.period_s * track.period_ratio_of(row);
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
    Candidate::single(TermKind::Backlash, columns, Regressor::Exact(by))
        .starting_at(&[
            (Id::BacklashTravel, InitialGuess::At(travel)),
            (Id::BacklashUnloaded, InitialGuess::At(unloaded)),
            (Id::BristleStiffness, InitialGuess::At(stiffness)),
        ])
        .keeping(&[Id::BacklashStiffnessRatio, Id::BacklashUnloaded])
}

/// Returns the candidates of both kinds, or those of the gap that the contest has found.
fn candidates(context: &FitContext) -> Vec<Candidate> {
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
    if let Some(Gap { gap, travel }) = context.found.gap {
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
