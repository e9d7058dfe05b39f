//! The choice of what is handed over, among the models of a diagnosis.

use super::Models;
use super::corrected_rows::CorrectedRows;
use super::search::{Chosen, Search};
use crate::contest::LinearAnswer;
use crate::finalist::fitted;
use crate::hand_over::{HandOver, HandOverStep, HandedOver, Judged, linear_on, simplest_of_best};
use crate::train_test::TrainTest;
use compensator_core::{LawKind, TermKind};
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{Outcome, Predicted, Track};
use joint_log::log_check::LogFindingKind;

impl Search<'_> {
    /// Chooses what is handed over. A model that was asked for is not replaced by another one, so it needs not be possible.
    pub(super) fn hand_over(
        &self,
        chosen: &Chosen,
        original: &TrainTest,
        models: &Models,
    ) -> Result<HandOver, SpecError> {
        let judged = &chosen.corrected.judged;
        let on_rows = |answer: &LinearAnswer| Judged {
            held_out: linear_on(judged, original, answer),
            model: answer.clone(),
        };
        let plain = on_rows(&self.outcome.plain);
        let linear = self.outcome.linear.as_ref().filter(|linear| self.is_as_asked(linear));
        let linear = linear.map(on_rows);
        // The phase of a ripple that differs from run to run is unknown on another log.
        let is_known = judged.aligned_order.is_none();
        let competing = Competing {
            base: models.base(judged),
            extended: models.extended(judged).filter(|_| is_known),
            plain: &plain.held_out,
            linear: linear.as_ref().map(|linear| &linear.held_out),
        };
        let tracks = judged.judged_rows().tracks;
        let on_pc = competing.on_pc(tracks, self.is_law_free());
        let in_driver = competing.in_driver(tracks, self.is_law_free(), on_pc);
        let held_out_of_driver = competing.of_driver(in_driver).metrics;
        let driver_plain = match in_driver {
            HandedOver::Plain => Some(self.driver_plain()?),
            _ => None,
        };
        let steps = self.outcome.linear.iter().flat_map(|linear| &linear.steps);
        let steps = steps.map(|step| HandOverStep {
            added: step.added,
            rmse: on_rows(&step.answer).held_out.metrics.rmse,
        });
        let measurement = chosen.corrected.measurement(self.rows.is_reversed);
        Ok(HandOver {
            on_pc,
            in_driver,
            plain,
            driver_plain,
            linear,
            measurement,
            held_out_of_driver,
            linear_extends: false,
            steps: steps.collect(),
        })
    }

    /// Returns true if a model has none of the corrections that were excluded.
    fn is_as_asked(&self, answer: &LinearAnswer) -> bool {
        let measurement = &answer.measurement;
        let corrections = [
            (measurement.torque_delay_s < -self.rows.step_s, LogFindingKind::VelocityLag),
            (measurement.torque_low_pass.time_s > 0.0, LogFindingKind::TorqueLag),
            (!measurement.channel_gains.is_empty(), LogFindingKind::ChannelGain),
        ];
        let is_excluded = |kind| self.options.as_logged.contains(&kind);
        !corrections.into_iter().any(|(has, kind)| has && is_excluded(kind))
    }

    /// Returns the plain model as a driver's law.
    fn driver_plain(&self) -> Result<Outcome, SpecError> {
        let mut spec = Spec::law(LawKind::Linear).on(&self.log.rigid_body);
        if spec.rigid_body.is_empty() {
            spec = spec.on(&[TermKind::TorqueOffset]);
        }
        let log = self.log.of_motion();
        let start = fitted(&log, &spec, None, &[], None)?;
        Ok(CorrectedRows::uncorrected(&log).identify(&start))
    }
}

/// A model with the driver's law.
#[derive(Clone, Copy)]
pub(super) struct DriverModel<'o> {
    /// The model on held-out rows.
    pub(super) held_out: &'o Predicted,
    /// True if its law is physically possible.
    pub(super) is_possible: bool,
}

/// The models that compete, on held-out rows.
struct Competing<'o> {
    base: DriverModel<'o>,
    extended: Option<DriverModel<'o>>,
    plain: &'o Predicted,
    linear: Option<&'o Predicted>,
}

impl<'o> Competing<'o> {
    /// Chooses for a PC. `is_free` is true if no model was asked for.
    fn on_pc(&self, tracks: &[Track], is_free: bool) -> HandedOver {
        let possible =
            |model: DriverModel<'o>| (model.is_possible || !is_free).then_some(model.held_out);
        let models = [
            (HandedOver::Plain, is_free.then_some(self.plain)),
            (HandedOver::Baseline, possible(self.base)),
            (HandedOver::Extended, self.extended.and_then(possible)),
            (HandedOver::Linear, self.linear.filter(|_| is_free)),
        ];
        choose(tracks, models)
    }

    /// Chooses for a driver. Where a PC takes the driver's law, both have the same one. Else a driver has plain friction only if
    /// that errs clearly less, because the sign of a noisy velocity lets a joint swing at rest, and bristles do not. A trial on the
    /// joint judges what is possible there.
    fn in_driver(&self, tracks: &[Track], is_free: bool, on_pc: HandedOver) -> HandedOver {
        let models = [
            (HandedOver::Baseline, Some(self.base.held_out)),
            (HandedOver::Extended, self.extended.map(|model| model.held_out)),
            (HandedOver::Plain, is_free.then_some(self.plain)),
        ];
        match on_pc {
            HandedOver::Baseline | HandedOver::Extended => on_pc,
            HandedOver::Plain | HandedOver::Linear => choose(tracks, models),
        }
    }

    /// Returns the driver's model on held-out rows.
    fn of_driver(&self, in_driver: HandedOver) -> &'o Predicted {
        match in_driver {
            HandedOver::Plain => self.plain,
            HandedOver::Baseline => self.base.held_out,
            HandedOver::Extended | HandedOver::Linear => {
                self.extended.map_or(self.plain, |model| model.held_out)
            }
        }
    }
}

/// Chooses among the models that there are, the simplest first.
fn choose<const N: usize>(
    tracks: &[Track],
    models: [(HandedOver, Option<&Predicted>); N],
) -> HandedOver {
    let there = models.into_iter().filter_map(|(what, held_out)| Some((what, held_out?)));
    simplest_of_best(tracks, &there.collect::<Vec<_>>())
}
