//! Play: after a reversal there is travel with little stiffness.
//!
//! Either right after the reversal, or where a drive that was wound up has unwound and its flanks part
//! (`backlash_unloaded`); a log says which. How long a play is nobody says: it is sought in multiples of the
//! travel the bristles take up their load over, and as a share of the log's own strokes, for a base law may have
//! made a few millimetres of play into bristles of its own.

use super::definition::{Cause, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Regressor};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen};
use crate::diagnose::extended::{Extended, Size};
use crate::diagnose::sensitivities::Exact;
use compensator_core::{ParameterId as Id, Parameters, TermKind};

/// Plays that are tried, over the travel of the bristles, where they are crossed right after a reversal.
const PRESLIDING: [f64; 4] = [0.5, 2.0, 6.0, 20.0];

/// And where they are crossed at zero torque: a law without the play takes part of it for bristles, which are
/// then too soft by as much.
const PRESLIDING_UNLOADED: [f64; 3] = [0.3, 1.0, 3.0];

/// A play that is tried, over the way from one reversal to the next.
const OF_STROKE: f64 = 0.08;

/// And with bristles so much stiffer than the model's own: a base law that has no play takes the whole of a large one for
/// bristles, and neither of the two can be told from where that fit ended. On the damper's twelve measured tests half of it
/// gains 45 %, this 47 %, twice as much 33 %: there the play is not found.
const STIFFER: f64 = 3.0;

/// Bristles that are so much stiffer, and so much softer, stand beside the model's own as a foil.
const OTHER_STIFFNESS: f64 = 4.0;

/// See the module.
pub struct Backlash;

/// Friction whose bristles are not all of one stiffness, as of every real seal, gives way after a reversal in a way
/// that a play can be bent into. It is no play.
fn several_stiffnesses(columns: &[&str], stiffness: f64) -> Candidate {
    let bristles = |times: f64| {
        let settings = vec![(Id::BacklashTravel, 0.0), (Id::BristleStiffness, times * stiffness)];
        Regressor::Exact(Exact { kind: TermKind::Backlash, settings, derivative: None })
    };
    let both = vec![bristles(OTHER_STIFFNESS), bristles(1.0 / OTHER_STIFFNESS)];
    Candidate::new(TermKind::Backlash, columns, both).as_foil()
}

/// The way from one reversal to the next, rad: half of all way is in longer strokes; 0 without a reversal.
fn stroke(beside: &Beside) -> f64 {
    let mut strokes = Vec::new();
    for track in &beside.log.train_tracks {
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

    fn is_nonlinear(&self) -> bool {
        true
    }

    fn is_imitated(&self) -> bool {
        true
    }

    /// Little stiffness over a travel in which the bristles take up the whole level all the same is no play: it is friction
    /// that changes after a reversal in a way bristles of one stiffness cannot follow. On drawn joints of slip elements the
    /// soft bristles would hold 13 and 4 times the level at the end of such a play; on the measured dampers, which have one, 0.04
    /// and 0.02 of it.
    fn contradicted(&self, fitted: &Parameters<f64>) -> Option<&'static str> {
        let stiffness = fitted.get(Id::BacklashStiffnessRatio) * fitted.get(Id::BristleStiffness);
        let level = fitted.get(Id::StaticTorque).max(fitted.get(Id::CoulombTorque));
        (stiffness * fitted.get(Id::BacklashTravel) > level)
            .then_some("the friction is back long before its play ends")
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        if !beside.spec.law.has_bristles() {
            return Vec::new();
        }
        let columns = [beside.log.velocity_name()];
        let parameters = &beside.at.parameters;
        let presliding = parameters.get(Id::StaticTorque).max(parameters.get(Id::CoulombTorque))
            / parameters.get(Id::BristleStiffness).max(1e-9);
        let stroke = OF_STROKE * stroke(beside);
        let kept = PRESLIDING.map(|times| (times * presliding, 0.0));
        let unloaded = PRESLIDING_UNLOADED.map(|times| (times * presliding, 1.0));
        let by_stroke = [(stroke, 0.0), (stroke, 1.0)].into_iter().filter(|_| stroke > 0.0);
        let stiffness = parameters.get(Id::BristleStiffness);
        let stiffer = [(0.5 * presliding, 0.0), (0.5 * presliding, 1.0)];
        let stiffer = stiffer.map(|(travel, unloaded)| (travel, unloaded, STIFFER * stiffness));
        kept.into_iter()
            .chain(unloaded)
            .chain(by_stroke)
            .map(|(travel, unloaded)| (travel, unloaded, stiffness))
            .chain(stiffer)
            .map(|(travel, unloaded, stiffness)| {
                let settings = vec![
                    (Id::BacklashTravel, travel),
                    (Id::BacklashUnloaded, unloaded),
                    (Id::BristleStiffness, stiffness),
                ];
                let by = Exact { kind: TermKind::Backlash, settings, derivative: None };
                let by = vec![Regressor::Exact(by)];
                Candidate::new(TermKind::Backlash, &columns, by)
                    .starting_at(&[
                        (Id::BacklashTravel, InitialGuess::At(travel)),
                        (Id::BacklashUnloaded, InitialGuess::At(unloaded)),
                        (Id::BristleStiffness, InitialGuess::At(stiffness)),
                    ])
                    .keeping(&[Id::BacklashStiffnessRatio, Id::BacklashUnloaded])
            })
            .chain([several_stiffnesses(&columns, parameters.get(Id::BristleStiffness))])
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
            Over::SinceReversal(8.0 * extended.value(Id::BacklashTravel)),
            Seen::Along,
            "Where there is play, the joint resists less than a bristle model until the play is crossed.",
        )
        .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::Spec;
    use compensator_core::LawKind;

    #[test]
    fn a_travel_in_which_the_friction_is_back_is_no_play() {
        let mut spec = Spec::law(LawKind::Dahl);
        spec.terms.push(TermKind::Backlash);
        let mut fitted = spec.parameters().expect("a law with a play");
        fitted.set(Id::CoulombTorque, 5.0);
        fitted.set(Id::BristleStiffness, 6.0e5);
        fitted.set(Id::BacklashStiffnessRatio, 0.02);
        for (travel, is_play) in [(4e-4, true), (4.3e-4, false), (5.3e-3, false)] {
            fitted.set(Id::BacklashTravel, travel);
            assert_eq!(Backlash.contradicted(&fitted).is_none(), is_play, "{travel}");
        }
    }
}
