//! Time drift: friction changes over the campaign by run-in or wear.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::{Extended, Size};
use compensator_core::{ParameterId as Id, TermKind};

/// Time drift as a cause; see the module documentation.
pub struct TimeDrift;

impl Cause for TimeDrift {
    fn name(&self) -> &'static str {
        "time-drift"
    }

    fn meaning(&self) -> &'static str {
        "friction changes over the campaign (run-in or wear)"
    }

    fn meaning_of(&self, size: f64) -> &'static str {
        if size < 0.0 {
            "friction falls over the campaign (run-in)"
        } else {
            "friction rises over the campaign (wear)"
        }
    }

    fn effect(&self) -> &'static str {
        "levels change over the campaign: run-in and wear."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::TimeDrift)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        if !context.log.has_campaign_clock() {
            return Vec::new();
        }
        let candidate = |by| Candidate::new(TermKind::TimeDrift, &["time_s"], vec![by]);
        let mut all = vec![
            candidate(row(|r| r.level * r.sample.campaign_time_h))
                .starting_at(&[
                    (Id::DriftRate, InitialGuess::Times(0, 1.0 / 3600.0)),
                    (Id::DriftAmplitude, InitialGuess::At(0.0)),
                ])
                .keeping(&[Id::DriftAmplitude, Id::DriftTime]),
        ];
        let campaign_h = context.log.campaign_s() / 3600.0;
        for share in [0.1, 0.3] {
            let time_h = share * campaign_h;
            let by = row(move |r| r.level * (-r.sample.campaign_time_h / time_h).exp());
            all.push(
                candidate(by)
                    .starting_at(&[
                        (Id::DriftTime, InitialGuess::At((time_h * 3600.0).max(1.0))),
                        (Id::DriftAmplitude, InitialGuess::Times(0, 1.0)),
                        (Id::DriftRate, InitialGuess::At(0.0)),
                    ])
                    .keeping(&[Id::DriftRate]),
            );
        }
        all
    }

    /// Returns the relative change of the level from the beginning of the campaign to its end.
    fn size(&self, extended: &Extended) -> Size {
        let amplitude = extended.value(Id::DriftAmplitude);
        let (time, rate) = (extended.value(Id::DriftTime), extended.value(Id::DriftRate));
        let end = extended.log.campaign_s();
        let at = |t: f64, a: f64, r: f64| 1.0 + a * (-t / time).exp() + r * t;
        let change = |a: f64, r: f64| at(end, a, r) / at(0.0, a, r) - 1.0;
        let value = change(amplitude, rate);
        let by_amplitude = change(amplitude + extended.error(Id::DriftAmplitude), rate) - value;
        let by_rate = change(amplitude, rate + extended.error(Id::DriftRate)) - value;
        Size::new(value, by_amplitude.hypot(by_rate), "1")
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Friction over the campaign",
            PlaneAxis::CampaignTime,
            ResidualView::Along,
            "One point for each run, or stretch of a single one. Where friction runs in or wears, they drift over the campaign.",
        )
        .spaced(Spacing::Runs)
        .into()
    }
}
