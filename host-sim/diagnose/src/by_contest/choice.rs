//! The choice of what is handed over, among the models of a diagnosis.

use super::{Chosen, CorrectedRows, Search};
use crate::contest::LinearAnswer;
use crate::finalist::fitted;
use crate::hand_over::{HandOver, HandedOver, Judged, linear_on, simplest_of_best};
use crate::late_channel::LateChannelKind;
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
        own: [Option<(&Predicted, bool)>; 2],
    ) -> Result<HandOver, SpecError> {
        let (corrected, rows) = (&chosen.corrected, chosen.corrected.judged.judged_rows());
        let on_rows = |answer: &LinearAnswer| Judged {
            held_out: linear_on(&corrected.judged, original, answer),
            model: answer.clone(),
        };
        let plain = on_rows(&self.outcome.plain);
        let linear = self.outcome.linear.as_ref().filter(|own| self.is_as_asked(own)).map(on_rows);
        // The phase of a ripple that differs from run to run is unknown on another log.
        let is_known = corrected.judged.aligned_order.is_none();
        let own = [own[0], own[1].filter(|_| is_known)];
        let others = [Some(&plain), linear.as_ref()].map(|own| own.map(|own| &own.held_out));
        let (on_pc, in_driver, of_driver) = choices(rows.tracks, own, others, self.is_law_free());
        let held_out_of_driver = of_driver.unwrap_or(&plain.held_out).metrics;
        let driver_plain = match in_driver {
            HandedOver::Plain => Some(self.driver_plain()?),
            _ => None,
        };
        let steps = self.outcome.linear.iter().flat_map(|own| &own.steps);
        let steps = steps.map(|(name, own)| (*name, on_rows(own).held_out.metrics.rmse)).collect();
        let measurement = corrected.measurement(self.rows.is_reversed);
        Ok(HandOver {
            on_pc,
            in_driver,
            plain,
            driver_plain,
            linear,
            measurement,
            held_out_of_driver,
            linear_extends: false,
            steps,
        })
    }

    /// Returns true if a model has none of the corrections that were excluded.
    fn is_as_asked(&self, answer: &LinearAnswer) -> bool {
        let measurement = &answer.measurement;
        let corrections = [
            (measurement.torque_delay_s < -self.rows.step_s, LateChannelKind::Velocity.kind()),
            (measurement.torque_low_pass.time_s > 0.0, LateChannelKind::LowPassedTorque.kind()),
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
        CorrectedRows::uncorrected(&log).identify(&start)
    }
}

/// Chooses for a PC and for a driver, and returns the driver's model on held-out rows, `None` for plain friction. The driver's
/// law without and with causes comes with whether it is possible; after it stand plain friction and the linear model.
fn choices<'o>(
    tracks: &[Track],
    [base, extended]: [Option<(&'o Predicted, bool)>; 2],
    others: [Option<&'o Predicted>; 2],
    is_free: bool,
) -> (HandedOver, HandedOver, Option<&'o Predicted>) {
    let of = |own: Option<(&'o Predicted, bool)>| own.map(|own| own.0);
    let possible = |own: Option<(&'o Predicted, bool)>| of(own.filter(|own| own.1 || !is_free));
    let [plain, linear] = others.map(|own| own.filter(|_| is_free));
    let on_pc = choose(
        tracks,
        [
            (HandedOver::Plain, plain),
            (HandedOver::Baseline, possible(base)),
            (HandedOver::Extended, possible(extended)),
            (HandedOver::Linear, linear),
        ],
    );
    // Where a PC takes the driver's law, both have the same one. Else a driver has plain friction only if that errs clearly less,
    // because the sign of a noisy velocity lets a joint swing at rest, and bristles do not. A trial on the joint judges what is
    // possible there.
    let in_driver = match on_pc {
        HandedOver::Baseline | HandedOver::Extended => on_pc,
        HandedOver::Plain | HandedOver::Linear => choose(
            tracks,
            [
                (HandedOver::Baseline, of(base)),
                (HandedOver::Extended, of(extended)),
                (HandedOver::Plain, plain),
            ],
        ),
    };
    let of_driver = match in_driver {
        HandedOver::Plain => None,
        HandedOver::Baseline => of(base),
        HandedOver::Extended | HandedOver::Linear => of(extended),
    };
    (on_pc, in_driver, of_driver)
}

/// Chooses among the models that there are, the simplest first.
fn choose<const N: usize>(
    tracks: &[Track],
    models: [(HandedOver, Option<&Predicted>); N],
) -> HandedOver {
    let there = models.into_iter().filter_map(|(what, own)| Some((what, own?)));
    simplest_of_best(tracks, &there.collect::<Vec<_>>())
}
