//! Result of a stochastic extension: the paper's Table III for this log.
//!
//! `cv` is each parameter's permitted coefficient of variation with the others constant, and ranks the parameters.
//! `cv_together` is the certified result, `P0 <= rho` with all parameters varying: the same spreads times one share per
//! class. An unlimited coefficient is set to [`MAX_CV`] and means "not determined".

use super::draw::{ExclusionReason, coefficient_of_variation, spread_at};
use super::levels::{Counts, Levels};
use super::settings::{Form, Settings};
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters};
use serde_json::{Map, Value, json};

/// Largest coefficient of variation. Its central 95 % reach from a fifth to five times the fitted value; a parameter with
/// such a spread is not determined. (A normal distribution, as in the paper, has negative values within its central
/// 95 % from a coefficient of 0.51, which is impossible for a stiffness.)
pub const MAX_CV: f64 = 1.0;

/// Order of parameters with equal coefficients, as in eq. 9.
const ORDER: [Id; 6] = [
    Id::BristleStiffness,
    Id::BristleDamping,
    Id::ViscousFriction,
    Id::CoulombTorque,
    Id::StaticTorque,
    Id::StribeckVelocity,
];

/// A parameter that is not in the certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExcludedParameter {
    /// The parameter.
    pub parameter: ParameterId,
    /// Reason for the exclusion.
    pub why: ExclusionReason,
}

/// Result of a speed class.
#[derive(Clone, Debug)]
pub(super) struct Class {
    pub name: String,
    /// Standard deviation of each parameter's logarithm, alone.
    pub spreads: Vec<f64>,
    /// Common share of these spreads if all parameters vary.
    pub share: f64,
    /// Violation probability of each sampled vector, ascending.
    pub violations: Vec<f64>,
    pub violation_at_fit: f64,
}

/// Permitted variation of a model's parameters.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// Speed classes, slowest first.
    pub classes: Vec<String>,
    /// The certified parameters.
    pub parameters: Vec<ParameterId>,
    /// Permitted coefficient of variation of each parameter alone, `[parameter][class]`, in the requested form.
    pub cv: Vec<Vec<f64>>,
    /// Permitted coefficient of variation with all parameters varying.
    pub cv_together: Vec<Vec<f64>>,
    /// Standard deviation of each parameter's logarithm alone, `[parameter][class]`, from which `cv` follows.
    pub spread: Vec<Vec<f64>>,
    /// Common share of the spreads if all parameters vary, per class.
    pub share_together: Vec<f64>,
    /// The paper's "cumulative randomness" per class: the sum of `cv` over the parameters.
    pub sum_cv_by_class: Vec<f64>,
    /// Mean of `sum_cv_by_class`.
    pub sum_cv: f64,
    /// The parameter with the largest mean `cv` over the classes, which the paper's rule would improve. Without certified
    /// parameters, the first requested one.
    pub verdict: ParameterId,
    /// `P0` per class, all parameters varying: the (1 - alpha) quantile of the violation probability.
    pub violation: Vec<f64>,
    /// Largest violation probability of any sampled vector, per class. It bounds the true quantile with probability
    /// 1 - delta/2 (eq. 6).
    pub largest_violation: Vec<f64>,
    /// Violation probability of the fitted parameters themselves. Above `rho` no variance could be certified, and the class'
    /// range is centred on the fit.
    pub violation_at_fit: Vec<f64>,
    /// Requested parameters that are not certified.
    pub left_out: Vec<ExcludedParameter>,
    /// Parameters whose spread alone is unlimited in at least one class.
    pub unlimited: Vec<ParameterId>,
    /// Confidence and accuracy.
    pub levels: Levels,
    /// Numbers of samples.
    pub counts: Counts,
    /// The form of `cv` and `cv_together`.
    pub form: Form,
    /// Number of simulated trials, complete or in part. It varies slightly between runs, because threads stop early when the
    /// result is known; the results do not vary.
    pub simulations: usize,
}

/// Returns true if a spread reaches the largest value of the search.
pub fn is_unlimited(spread: f64) -> bool {
    spread > 0.999 * spread_at(MAX_CV)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

impl Certificate {
    pub(super) fn assemble(
        classes: Vec<Class>,
        certified: &[ParameterId],
        parameters: &Parameters<f64>,
        settings: &Settings,
        left_out: Vec<ExcludedParameter>,
    ) -> Self {
        let counts = settings.counts();
        let in_form = |id: ParameterId, spread: f64| {
            let cv = if is_unlimited(spread) { MAX_CV } else { coefficient_of_variation(spread) };
            settings.form.of(cv, parameters.get(id))
        };
        let table = |of: &dyn Fn(usize, &Class) -> f64| -> Vec<Vec<f64>> {
            let row = |index| classes.iter().map(|class| of(index, class)).collect();
            (0..certified.len()).map(row).collect()
        };
        let cv = table(&|i, class| in_form(certified[i], class.spreads[i]));
        let sum_cv_by_class: Vec<f64> =
            (0..classes.len()).map(|class| cv.iter().map(|row| row[class]).sum()).collect();
        let unlimited = |index: &usize| classes.iter().any(|c| is_unlimited(c.spreads[*index]));
        let quantile = settings.levels.required_passing_vectors(counts.sampled_vectors);
        let at =
            |class: &Class, rank: usize| class.violations.get(rank - 1).copied().unwrap_or(0.0);
        Self {
            cv_together: table(&|i, class| in_form(certified[i], class.share * class.spreads[i])),
            spread: table(&|i, class| class.spreads[i]),
            share_together: classes.iter().map(|class| class.share).collect(),
            sum_cv: mean(&sum_cv_by_class),
            sum_cv_by_class,
            verdict: verdict(certified, &cv, &left_out),
            cv,
            violation: classes.iter().map(|class| at(class, quantile)).collect(),
            largest_violation: classes.iter().map(|c| at(c, c.violations.len().max(1))).collect(),
            violation_at_fit: classes.iter().map(|class| class.violation_at_fit).collect(),
            left_out,
            unlimited: (0..certified.len()).filter(unlimited).map(|i| certified[i]).collect(),
            classes: classes.into_iter().map(|class| class.name).collect(),
            parameters: certified.to_vec(),
            levels: settings.levels,
            counts,
            form: settings.form,
            simulations: 0,
        }
    }

    /// Returns a parameter's mean coefficient of variation over the classes; `None` if it is not certified.
    pub fn mean_cv(&self, id: ParameterId) -> Option<f64> {
        let index = self.parameters.iter().position(|certified| *certified == id)?;
        self.cv.get(index).map(|row| mean(row))
    }

    /// Returns the speed classes in which the fit itself is outside the data's range too often, so that the range is centred on
    /// the fit.
    pub fn around_the_fit(&self) -> Vec<&str> {
        let off = |at_fit: &f64| *at_fit > self.levels.rho;
        let classes = self.classes.iter().zip(&self.violation_at_fit);
        classes.filter(|(_, at_fit)| off(at_fit)).map(|(name, _)| name.as_str()).collect()
    }

    /// Returns the certificate as in `diagnosis.json`. `cv` is each parameter's mean over the classes, so that `sum_cv` is
    /// both its sum and the mean of the classes' sums. The same log gives the same bytes.
    pub fn json(&self) -> Value {
        let by_name = |values: &dyn Fn(usize) -> Value| -> Value {
            let pair = |(i, id): (usize, &ParameterId)| (id.name().to_owned(), values(i));
            Value::Object(self.parameters.iter().enumerate().map(pair).collect::<Map<_, _>>())
        };
        let names = |ids: &[ParameterId]| ids.iter().map(|id| id.name()).collect::<Vec<_>>();
        let Levels { alpha, delta, epsilon, rho } = self.levels;
        let left_out = self.left_out.iter();
        let left_out =
            left_out.map(|out| (out.parameter.name().to_owned(), out.why.in_words().into()));
        json!({
            "cv": by_name(&|i| mean(&self.cv[i]).into()),
            "sum_cv": self.sum_cv,
            "form": self.form.name(),
            "classes": self.classes,
            "cv_by_class": by_name(&|i| self.cv[i].clone().into()),
            "cv_together_by_class": by_name(&|i| self.cv_together[i].clone().into()),
            "sum_cv_by_class": self.sum_cv_by_class,
            "share_together": self.share_together,
            "verdict": self.verdict.name(),
            "violation": self.violation,
            "largest_violation": self.largest_violation,
            "violation_at_fit": self.violation_at_fit,
            "around_the_fit": self.around_the_fit(),
            "unlimited": names(&self.unlimited),
            "left_out": left_out.collect::<Map<String, Value>>(),
            "levels": {"alpha": alpha, "delta": delta, "epsilon": epsilon, "rho": rho},
            "sampled_vectors": self.counts.sampled_vectors,
            "trials": self.counts.trials,
        })
    }
}

fn verdict(
    certified: &[ParameterId],
    cv: &[Vec<f64>],
    left_out: &[ExcludedParameter],
) -> ParameterId {
    let rank = |id: &ParameterId| ORDER.iter().position(|known| known == id).unwrap_or(ORDER.len());
    let ranked = certified.iter().zip(cv).map(|(id, row)| (mean(row), *id));
    let largest = ranked.max_by(|a, b| {
        // Coefficients that differ only by rounding are equal.
        let equal = (a.0 - b.0).abs() <= 1e-9 * (a.0 + b.0);
        if equal { rank(&b.1).cmp(&rank(&a.1)) } else { a.0.total_cmp(&b.0) }
    });
    let requested = left_out.first().map_or(Id::CoulombTorque, |out| out.parameter);
    largest.map_or(requested, |(_, id)| id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::LawKind;

    fn certificate(form: Form) -> Certificate {
        let parameters = Parameters::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 2.0)
            .with(Id::BristleStiffness, 1e4);
        let class = |name: &str, spreads: [f64; 2]| Class {
            name: name.to_owned(),
            spreads: spreads.to_vec(),
            share: 0.5,
            violations: vec![0.1, 0.1, 0.1, 0.2, 0.3, 0.34, 0.5, 0.9],
            violation_at_fit: 0.0,
        };
        let settings = Settings { form, ..Settings::default() };
        let classes = vec![class("35 rpm", [0.2, 0.8]), class("70 rpm", [0.4, 0.8])];
        let ids = [Id::CoulombTorque, Id::BristleStiffness];
        Certificate::assemble(classes, &ids, &parameters, &settings, Vec::new())
    }

    #[test]
    fn assemble_sums_over_parameters_and_averages_over_classes() {
        let certificate = certificate(Form::SigmaOverMean);
        assert_eq!(certificate.verdict, Id::BristleStiffness);
        assert!((certificate.cv[0][0] - 0.2).abs() < 5e-3);
        assert!((certificate.cv_together[0][0] - 0.1).abs() < 1e-3);
        let means: f64 =
            certificate.parameters.iter().filter_map(|id| certificate.mean_cv(*id)).sum();
        assert!((means - certificate.sum_cv).abs() < 1e-12);
        // The 6th of 8 is the 0.71 quantile.
        assert_eq!(certificate.violation, [0.34, 0.34]);
        assert_eq!(certificate.largest_violation, [0.9, 0.9]);
    }

    #[test]
    fn assemble_with_printed_form_depends_on_parameter_unit() {
        let (proper, printed) =
            (certificate(Form::SigmaOverMean), certificate(Form::PrintedVarianceOverMean));
        let expected = proper.cv[1][0].powi(2) * 1e4;
        assert!((printed.cv[1][0] / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn json_with_printed_form_has_finite_numbers() {
        let json = certificate(Form::PrintedVarianceOverMean).json();
        assert!(json["sum_cv"].is_f64());
        let cv = json["cv"].as_object().unwrap();
        assert!(cv.len() == 2 && cv.values().all(Value::is_f64));
        assert!(cv.contains_key("coulomb_torque"));
    }

    #[test]
    fn verdict_with_equal_cv_follows_order_of_paper() {
        let ids =
            [Id::StaticTorque, Id::StribeckVelocity, Id::BristleDamping, Id::BristleStiffness];
        let cv = vec![vec![3.0], vec![3.0], vec![3.0], vec![3.0]];
        assert_eq!(verdict(&ids, &cv, &[]), Id::BristleStiffness);
        assert_eq!(verdict(&[], &[], &[]), Id::CoulombTorque);
    }
}
