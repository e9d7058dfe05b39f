//! Backlash: after a reversal there is travel with little stiffness.
//!
//! The backlash is crossed right after the reversal, or when a wound-up drive has unwound and its
//! flanks separate (`backlash_unloaded`). The contest finds the backlash travel, and the stiffness
//! beside it: a base law may describe a few millimetres of backlash by soft bristles.

use super::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::contest::{Detail, Gap, SimulatedGap};
use crate::evidence::{Plane, PlaneAxis, ResidualView};
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

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

/// Settings of a candidate.
struct Play {
    /// Backlash travel, rad or m.
    travel: f64,
    /// 1 if it is crossed at zero torque, 0 if right after the reversal.
    unloaded: f64,
    /// Stiffness of the bristles, Nm/rad or N/m.
    stiffness: f64,
}

impl Play {
    fn candidate(self, columns: &[&str]) -> Candidate {
        let settings = [
            (Id::BacklashTravel, self.travel),
            (Id::BacklashUnloaded, self.unloaded),
            (Id::BristleStiffness, self.stiffness),
        ];
        let kind = TermKind::Backlash;
        let by = Exact { kind, settings: settings.into(), derivative: None };
        Candidate::single(kind, columns, Regressor::Exact(by))
            .starting_at(&settings.map(|(id, value)| (id, InitialGuess::At(value))))
            .keeping(&[Id::BacklashStiffnessRatio, Id::BacklashUnloaded])
    }
}

/// Returns the candidates of the gap that the contest has found. A gap in a law of shapes does not tell where it is crossed.
fn candidates(context: &FitContext) -> Vec<Candidate> {
    if !context.spec.law.has_bristles() {
        return Vec::new();
    }
    let columns = [context.log.velocity_name()];
    let parameters = &context.at.parameters;
    let stiffness = parameters.get(Id::BristleStiffness);
    match context.found {
        Detail::Gap(Gap { gap, travel }) => {
            let level = parameters.get(Id::StaticTorque).max(parameters.get(Id::CoulombTorque));
            let stiffness = level / travel.max(1e-12);
            let play = |unloaded| Play { travel: *gap, unloaded, stiffness }.candidate(&columns);
            [0.0, 1.0].map(play).into()
        }
        Detail::SimulatedGap(SimulatedGap { gap, is_unloaded, stiffness_ratio }) => {
            let unloaded = f64::from(u8::from(*is_unloaded));
            let stiffness = stiffness_ratio * stiffness;
            vec![Play { travel: *gap, unloaded, stiffness }.candidate(&columns)]
        }
        _ => Vec::new(),
    }
}
