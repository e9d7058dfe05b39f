//! The choice of what is handed over, among the models of a diagnosis.

use super::{Chosen, CorrectedRows, Search};
use crate::contest::LinearAnswer;
use crate::finalist::fitted;
use crate::hand_over::{HandOver, HandedOver, Judged, linear_on, simplest_of_best, steps_on};
use crate::train_test::TrainTest;
use compensator_core::{LawKind, TermKind};
use friction_fit::predict::Predicted;
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{Outcome, Track};

impl Search<'_> {
    /// Chooses what is handed over. A model that was asked for is not replaced by another one.
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
        let linear = self.outcome.linear.as_ref().map(on_rows);
        // The phase of a ripple that differs from run to run is unknown on another log.
        let is_known = corrected.judged.aligned_order.is_none();
        let with_plain = self.is_law_free();
        let in_driver = in_driver(rows.tracks, own, is_known, &plain.held_out, with_plain);
        let [base, extended] = own.map(|own| own.filter(|(_, possible)| *possible));
        let (base, extended) = (base.map(|own| own.0), extended.map(|own| own.0));
        let extended = extended.filter(|_| is_known);
        let mut candidates: Vec<(HandedOver, &Predicted)> = Vec::new();
        if self.is_law_free() || (base.is_none() && extended.is_none()) {
            candidates.push((HandedOver::Plain, &plain.held_out));
        }
        candidates.extend(base.map(|own| (HandedOver::Baseline, own)));
        candidates.extend(extended.map(|own| (HandedOver::Extended, own)));
        if let Some(linear) = linear.as_ref().filter(|_| self.is_law_free()) {
            candidates.push((HandedOver::Linear, &linear.held_out));
        }
        let on_pc = simplest_of_best(rows.tracks, &candidates);
        // Where a PC takes the driver's law, both have the same one.
        let in_driver = match on_pc {
            HandedOver::Baseline | HandedOver::Extended => on_pc,
            HandedOver::Plain | HandedOver::Linear => in_driver,
        };
        let measurement = match (on_pc, &linear) {
            (HandedOver::Linear, Some(linear)) => linear.model.measurement.clone(),
            (HandedOver::Plain, _) => plain.model.measurement.clone(),
            _ => corrected.measurement(self.rows.is_reversed),
        };
        let driver_plain = match in_driver {
            HandedOver::Plain => Some(self.driver_plain()?),
            _ => None,
        };
        let steps = self.outcome.linear.as_ref();
        let steps = steps.map(|own| steps_on(&corrected.judged, original, own)).unwrap_or_default();
        Ok(HandOver { on_pc, in_driver, plain, driver_plain, linear, measurement, steps })
    }

    /// Returns the plain model as a driver's law.
    fn driver_plain(&self) -> Result<Outcome, SpecError> {
        let mut spec = Spec::law(LawKind::Linear).on(&self.log.rigid_body);
        if spec.rigid_body.is_empty() {
            spec = spec.on(&[TermKind::TorqueOffset]);
        }
        let start = fitted(self.log, &spec, None, &[], None)?;
        CorrectedRows::uncorrected(self.log).identify(&start)
    }
}

/// Chooses what a driver gets of its law without and with causes: plain friction only if that errs clearly less, because the sign
/// of a noisy velocity lets a joint swing at rest, and bristles do not. A trial on the joint judges what is possible there.
fn in_driver(
    tracks: &[Track],
    [base, extended]: [Option<(&Predicted, bool)>; 2],
    is_phase_known: bool,
    plain: &Predicted,
    with_plain: bool,
) -> HandedOver {
    let mut candidates: Vec<(HandedOver, &Predicted)> = Vec::new();
    candidates.extend(base.map(|own| (HandedOver::Baseline, own.0)));
    let extended = extended.filter(|_| is_phase_known);
    candidates.extend(extended.map(|own| (HandedOver::Extended, own.0)));
    if with_plain {
        candidates.push((HandedOver::Plain, plain));
    }
    simplest_of_best(tracks, &candidates)
}
