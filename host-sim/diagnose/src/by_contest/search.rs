//! The choice among the finalists of a contest: each is fitted with the driver's law to an excerpt of the log, and the least
//! held-out error wins.

use super::corrected_rows::CorrectedRows;
use crate::contest::{
    CauseKey, Correction, Detail, Finalist, FinalistCause, LawStart, Outcome as ContestOutcome,
    Rows, WaveKind,
};
use crate::finalist::{
    FittedFinalist, LawFit, excerpt, fit_finalist, fitted, law_kind, law_parameters, resolved,
};
use crate::left_out::one_step_left_out;
use crate::model::FittedModel;
use crate::naming::WeighedCause;
use crate::train_test::TrainTest;
use crate::{DiagnosisOptions, uncertain_motion, unknown_zero};
use compensator_core::LawKind;
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{Loss, Outcome, Predicted, autocorrelation_time, predict};

/// The hypothesis that was chosen, fitted to the excerpt.
pub(super) struct Chosen {
    /// The hypothesis.
    pub(super) hypothesis: Finalist,
    /// The log with its corrections.
    pub(super) corrected: CorrectedRows,
    /// A part of the corrected log.
    pub(super) excerpt: TrainTest,
    /// The base model.
    pub(super) base: FittedModel,
    /// The base law with the causes.
    pub(super) fitted: FittedFinalist,
}

impl Chosen {
    /// Returns the choice with the base model at the resolution that its rows need, and with the autocorrelation of its residual.
    fn resolved(self) -> Self {
        let residuals = self.fitted.held_out.residuals.iter().map(Vec::as_slice);
        let memory_rows = autocorrelation_time(residuals);
        let base = resolved(&self.excerpt, &self.base);
        Self { corrected: CorrectedRows { memory_rows, ..self.corrected }, base, ..self }
    }
}

/// What the choice among the finalists is made from.
pub(super) struct Search<'a> {
    pub(super) log: &'a TrainTest,
    pub(super) rows: &'a Rows,
    pub(super) outcome: &'a ContestOutcome,
    pub(super) options: &'a DiagnosisOptions,
}

impl Search<'_> {
    /// Returns the base law and the terms that a hypothesis is fitted with.
    fn spec(&self, law: LawKind) -> Spec {
        let given = self.options.given.as_ref().map(|(spec, _)| spec);
        let asked = given.or(self.options.model.as_ref()).cloned();
        asked.unwrap_or_else(|| Spec::law(law)).on(&self.log.rigid_body)
    }

    pub(super) fn is_law_free(&self) -> bool {
        self.options.given.is_none() && self.options.model.is_none()
    }

    /// Returns the finalist with the least held-out error on an excerpt of the log.
    pub(super) fn best(&self, weighed: &[WeighedCause]) -> Result<Chosen, SpecError> {
        let fallback = [Finalist::without_cause()];
        let finalists = match self.outcome.finalists.as_slice() {
            [] => &fallback[..],
            finalists => finalists,
        };
        let mut best: Option<Chosen> = None;
        let mut tried: Vec<(Correction, Vec<&CauseKey>)> = Vec::new();
        for finalist in finalists {
            let named = finalist.causes.iter().filter(|cause| is_named(weighed, cause));
            let attempt = (finalist.correction, named.map(|cause| &cause.key).collect());
            if !tried.contains(&attempt) {
                tried.push(attempt);
                let next = self.fitted(finalist, weighed)?;
                let error = |chosen: &Chosen| chosen.fitted.held_out.metrics.rmse;
                if best.as_ref().is_none_or(|best| error(&next) < error(best)) {
                    best = Some(next);
                }
            }
        }
        let Some(best) = best else { unreachable!("there is always a finalist") };
        Ok(best.resolved())
    }

    /// Returns a finalist fitted to an excerpt of the log, with its law, or with that of the base model if it is another one.
    fn fitted(&self, finalist: &Finalist, weighed: &[WeighedCause]) -> Result<Chosen, SpecError> {
        let corrected = CorrectedRows::new(self.log, self.rows, finalist, self.options);
        let is_meant = |cause: &FinalistCause| is_named(weighed, cause);
        let causes: Vec<FinalistCause> =
            finalist.causes.iter().filter(|cause| is_meant(cause)).cloned().collect();
        let law = law_kind(&finalist.law, &causes);
        let base = self.base(&excerpt(&corrected.fitted), &finalist.law, law)?;
        let corrected = self.weighed_beside(&base, corrected, free_phase_order(&causes));
        let excerpt = excerpt(&corrected.fitted);
        let fit = |law: LawKind| {
            let law = LawFit { base: &base, spec: &self.spec(law), delay_s: corrected.delay_s };
            fit_finalist(&excerpt, finalist, law, &is_meant)
        };
        let mut fitted = fit(law)?;
        if base.spec.law != law {
            let of_base_law = fit(base.spec.law)?;
            if of_base_law.held_out.metrics.rmse < fitted.held_out.metrics.rmse {
                fitted = of_base_law;
            }
        }
        Ok(Chosen { hypothesis: finalist.clone(), corrected, excerpt, base, fitted })
    }

    /// Returns the log with the positions and the weights that a base model shows to be right.
    fn weighed_beside(
        &self,
        base: &FittedModel,
        corrected: CorrectedRows,
        free_phase_order: Option<f64>,
    ) -> CorrectedRows {
        let aligned = free_phase_order
            .and_then(|order| unknown_zero::aligned(&corrected.judged, base, order));
        let corrected = match aligned {
            Some(aligned) => corrected.aligned(&aligned),
            None => corrected,
        };
        let corrected = match self.options.loss {
            Loss::Huber => corrected.weighed_robustly(base),
            Loss::Squares => corrected,
        };
        let corrected = match uncertain_motion::weighed(&corrected.judged, base) {
            Some(weighed) => CorrectedRows { judged: weighed.with_floor(), ..corrected },
            None => corrected,
        };
        corrected.without_rest(base)
    }

    /// Returns the chosen hypothesis with the causes that are still named.
    pub(super) fn again(
        &self,
        chosen: Chosen,
        weighed: &[WeighedCause],
    ) -> Result<Chosen, SpecError> {
        let is_meant = |cause: &FinalistCause| is_named(weighed, cause);
        let spec = &self.spec(chosen.fitted.model.spec.law);
        let law = LawFit { base: &chosen.base, spec, delay_s: chosen.corrected.delay_s };
        let fitted = fit_finalist(&chosen.excerpt, &chosen.hypothesis, law, &is_meant)?;
        Ok(Chosen { fitted, ..chosen })
    }

    /// Returns the base model: the law, or the linear law if that has the smaller held-out error.
    fn base(
        &self,
        excerpt: &TrainTest,
        start: &LawStart,
        law: LawKind,
    ) -> Result<FittedModel, SpecError> {
        let fit =
            |law: LawKind, start: Option<&LawStart>| -> Result<(f64, FittedModel), SpecError> {
                let spec = self.spec(law);
                let from = match (&self.options.given, start) {
                    (Some((_, parameters)), _) => Some(parameters.clone()),
                    (None, Some(start)) => Some(law_parameters(&spec, start, &[], excerpt)?),
                    (None, None) => None,
                };
                let model = fitted(excerpt, &spec, from.as_ref(), &[], None)?;
                Ok((one_step_left_out(excerpt, excerpt, &model).metrics.rmse, model))
            };
        let (error, model) = fit(law, Some(start))?;
        if !self.is_law_free() || law == LawKind::Linear {
            return Ok(model);
        }
        let (linear_error, linear) = fit(LawKind::Linear, Some(start))?;
        if error <= linear_error {
            return Ok(model);
        }
        let (error, model) = fit(law, None)?;
        Ok(if error <= linear_error { model } else { linear })
    }

    /// Returns the base model fitted to all rows. Of a given model, the values stay.
    pub(super) fn baseline(&self, chosen: &Chosen) -> Outcome {
        let base = match &self.options.given {
            Some((spec, parameters)) => &FittedModel {
                spec: spec.clone(),
                parameters: parameters.clone(),
                fixed: parameters.active().collect(),
                ..chosen.base.clone()
            },
            None => &chosen.base,
        };
        chosen.corrected.identify(base)
    }

    /// Returns the base model on held-out rows.
    pub(super) fn before(&self, chosen: &Chosen, baseline: &Outcome) -> Predicted {
        let corrected = &chosen.corrected;
        match &self.options.given {
            Some((_, parameters)) => {
                predict(parameters, corrected.judged.test_rows(), baseline.resolution)
            }
            None => corrected.held_out(&FittedModel::of(baseline, &chosen.base)),
        }
    }
}

/// Returns the order of a ripple with another phase in each run.
fn free_phase_order(causes: &[FinalistCause]) -> Option<f64> {
    causes.iter().find_map(|cause| match &cause.detail {
        Detail::Waves { orders, kind: WaveKind::FreePhase } => orders.first().copied(),
        _ => None,
    })
}

/// Returns true if a cause of a finalist is named.
fn is_named(weighed: &[WeighedCause], cause: &FinalistCause) -> bool {
    weighed.iter().any(|weighed| weighed.figures.key == cause.key && weighed.is_named())
}
