//! The choice of what is handed over, among the models of a diagnosis.

use super::{Chosen, CorrectedRows, Search};
use crate::contest::LinearAnswer;
use crate::finalist::fitted;
use crate::hand_over::{HandOver, HandedOver, Judged, linear_on, simplest_of_best, steps_on};
use crate::train_test::TrainTest;
use compensator_core::{LawKind, TermKind};
use friction_fit::Outcome;
use friction_fit::predict::Predicted;
use friction_fit::spec::{Spec, SpecError};

impl Search<'_> {
    /// Chooses what is handed over. A model that was asked for is not replaced by another one.
    pub(super) fn hand_over(
        &self,
        chosen: &Chosen,
        original: &TrainTest,
        own: [Option<&Predicted>; 2],
    ) -> Result<HandOver, SpecError> {
        let (corrected, rows) = (&chosen.corrected, chosen.corrected.judged.judged_rows());
        let on_rows = |answer: &LinearAnswer| Judged {
            held_out: linear_on(&corrected.judged, original, answer),
            model: answer.clone(),
        };
        let plain = on_rows(&self.outcome.plain);
        let linear = self.outcome.linear.as_ref().map(on_rows);
        let [base, extended] = own;
        // The phase of a ripple that differs from run to run is unknown on another log.
        let extended = extended.filter(|_| corrected.judged.aligned_order.is_none());
        let mut candidates: Vec<(HandedOver, &Predicted)> = Vec::new();
        if self.is_law_free() || (base.is_none() && extended.is_none()) {
            candidates.push((HandedOver::Plain, &plain.held_out));
        }
        candidates.extend(base.map(|own| (HandedOver::Baseline, own)));
        candidates.extend(extended.map(|own| (HandedOver::Extended, own)));
        let in_driver = simplest_of_best(rows.tracks, &candidates);
        if let Some(linear) = linear.as_ref().filter(|_| self.is_law_free()) {
            candidates.push((HandedOver::Linear, &linear.held_out));
        }
        let on_pc = simplest_of_best(rows.tracks, &candidates);
        let in_driver = if on_pc == HandedOver::Plain { on_pc } else { in_driver };
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
