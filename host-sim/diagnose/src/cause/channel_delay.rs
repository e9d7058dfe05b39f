//! Torque and velocity are logged at different times.

use super::definition::{Cause, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::Extended;
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};

/// See the module.
pub struct ChannelDelay;

impl Cause for ChannelDelay {
    fn name(&self) -> &'static str {
        "channel-delay"
    }

    fn meaning(&self) -> &'static str {
        "torque and velocity are logged at different times; this is the logger, not friction"
    }

    fn effect(&self) -> &'static str {
        "a delayed velocity."
    }

    fn remedy(&self) -> Remedy {
        Remedy::CorrectColumn(Some(TermKind::ChannelDelay))
    }

    /// The rate of the torque stands for a delay within a sample; a longer one turns the torque elsewhere.
    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        let columns = [context.log.velocity_name()];
        let candidate = |by| Candidate::new(TermKind::ChannelDelay, &columns, vec![by]);
        let mut all = vec![
            candidate(row(|r| -r.slope))
                .starting_at(&[(Id::ChannelDelay, InitialGuess::Times(0, 1.0))]),
        ];
        let period = context.log.train_tracks.first().map_or(1e-3, |track| track.period_s);
        for samples in [1.0, 3.0, 9.0, 27.0] {
            let delay = samples * period;
            let settings = vec![(Id::ChannelDelay, delay)];
            let by = Exact { kind: TermKind::ChannelDelay, settings, derivative: None };
            all.push(
                candidate(Regressor::Exact(by))
                    .starting_at(&[(Id::ChannelDelay, InitialGuess::At(delay))]),
            );
        }
        all
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "The rate of the torque",
            PlaneAxis::TorqueRate,
            ResidualView::Plain,
            "Where the channels are logged at different times, the residual is the rate of the torque times the \
             delay: a line that falls.",
        )
        .spaced(Spacing::NarrowAtZero)
        .into()
    }
}
