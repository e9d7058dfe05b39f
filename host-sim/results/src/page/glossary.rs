//! Definitions of the metrics and models on the page, and the description of the method.

use super::View;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use friction_diagnose::cause;
use friction_fit::Resolution;
use friction_fit::spec::rigid_body_effect;
use std::collections::BTreeSet;

/// Returns the definitions of the metrics.
pub(crate) fn metrics(view: &View) -> Vec<String> {
    let unit = view.unit();
    [
        &format!("e is the logged minus the simulated {0}, y the logged {0}, n the number of rows.",
            view.torque()),
        &format!("RMSE = √(Σe² / n), in {unit}: the typical error of a row."),
        &format!("SSE = Σe², in {unit}²: comparable only between models on the same rows."),
        "NRMSE of std = RMSE / standard deviation of y: 100 % is no better than predicting the mean.",
        "NRMSE of range = RMSE / (max y − min y). Papers use the name NRMSE for both definitions.",
        "Relative error = 100 ‖e‖ / ‖y‖: 100 % is no better than predicting zero.",
        "BIC = n ln(SSE / n) + k ln n on the training rows, where k is the number of fitted parameters; smaller is better. \
         It assumes independent rows, so its differences are too large if the residual is not white noise.",
        "Time of fit: wall-clock time on the computer that created this page.",
    ]
    .map(str::to_owned)
    .to_vec()
}

/// Describes how the fits were made.
pub(crate) fn methods(view: &View) -> Vec<String> {
    let resolutions: Vec<String> = view
        .ranking
        .iter()
        .map(|&fit| (view.name(fit), view.fit(fit).resolution))
        .filter(|(_, resolution)| resolution.substeps > 1 || resolution.extrapolated)
        .map(|(name, resolution)| match resolution {
            Resolution { substeps, extrapolated: false } => format!("{substeps} for {name}"),
            Resolution { substeps, .. } => format!("{substeps} and {} for {name}", 2 * substeps),
        })
        .collect();
    let resolutions = match resolutions.as_slice() {
        [] => "one step per row was sufficient".to_owned(),
        some => format!("steps per row: {}; one for all other models", some.join(", ")),
    };
    vec![
        "Models are simulated with the integration step of the joint driver, here in double precision."
            .into(),
        "The free parameters minimise the sum of squared residuals, or Huber's loss where the verdicts name it \
         (Levenberg-Marquardt with exact derivatives by dual numbers), from several starting points; the best result is kept. \
         Bounds are enforced by a change of coordinates."
            .into(),
        "A weak prior (weight of a tenth of an observation per parameter) holds parameters on a logarithmic scale that the \
         data do not determine. Its centre is the middle of the searched range (the start value without a range) or a typical \
         size; its width is one decade. F_S has the centre F_C and a width up to 1.8 F_C. Determined parameters do not change."
            .into(),
        format!(
            "If the sample period of the log is long for the bristles, each row is simulated with several sub-steps, or two \
             simulations with different steps are extrapolated, until smaller steps do not change the parameters; \
             {resolutions}."
        ),
        format!(
            "Each continuous segment of a run is simulated separately. If a segment starts at rest, the initial {0} of the \
             bristles is unknown. It is estimated from that segment, also for held-out segments, and included in the standard \
             errors. Its effect vanishes with the first motion.",
            view.torque()
        ),
        "Standard errors are those of least squares, multiplied by the square root of the residual's autocorrelation time on \
         the training rows (number of neighbouring rows that count as one observation; 1 for white noise)."
            .into(),
        "Held-out rows are whole runs or whole segments, not random rows. The best model was selected by its held-out error, \
         so this error is slightly too low for it, the more so the more models are compared."
            .into(),
        "Two models differ significantly if the 95 % interval of the ratio of their held-out RMSE excludes 1. The interval is \
         from resampled blocks of held-out rows. It includes autocorrelation, but not differences between runs."
            .into(),
        format!("Created by host-sim {}.", env!("CARGO_PKG_VERSION")),
    ]
}

/// Describes each law and term on the page in one line.
pub(crate) fn models(view: &View) -> Vec<String> {
    let fits = view.study.fits;
    let laws: BTreeSet<(LawKind, String)> =
        fits.iter().map(|fit| (fit.spec.law, equation(&fit.parameters))).collect();
    let specs = fits.iter().map(|fit| &fit.spec);
    let terms: BTreeSet<TermKind> =
        specs.flat_map(|spec| spec.terms.iter().chain(&spec.rigid_body)).copied().collect();
    let mut lines = vec![
        "v is the velocity, F_C the Coulomb level (coulomb_torque), F_S the static level \
         (static_torque), v_s the Stribeck velocity, σ₂ the viscous coefficient \
         (viscous_friction); g(v) = F_C + (F_S − F_C) exp(−(v/v_s)²)."
            .to_owned(),
    ];
    lines.extend(laws.into_iter().map(|(kind, equation)| format!("{}: {equation}", kind.name())));
    let line = |kind: TermKind| Some(format!("+ {}: {}", kind.name(), effect(kind)?));
    lines.extend(terms.into_iter().filter_map(line));
    lines
}

/// Returns the effect of a term on the torque. A term belongs to a cause or to a rigid-body part.
fn effect(kind: TermKind) -> Option<&'static str> {
    cause::of_term(kind).map(|cause| cause.effect()).or_else(|| rigid_body_effect(kind))
}

/// Returns the equation of a law with its choices.
fn equation(Parameters { law, choices, .. }: &Parameters<f64>) -> String {
    let equation = match law {
        LawKind::Extended if choices.printed_extended => "F_C sgn v + σ₂ v + f₁ |v| + f₂ v³.",
        LawKind::Linear => "F_C sgn v + σ₂ v.",
        LawKind::Extended => "F_C sgn v + σ₂ v + f₁ v |v| + f₂ v³.",
        LawKind::Atan => "f₀ + F_C sgn v + σ₂ v + f_a atan(f_b v).",
        LawKind::Stribeck => "g(v) sgn v + σ₂ v, equal to LuGre in steady sliding.",
        LawKind::Dahl => "bristles as in LuGre, with F_S = F_C and without bristle damping.",
        LawKind::Lugre => {
            "bristles with deflection z: z' = v − σ₀ |v| z / g(v), torque σ₀ z + σ₁ z' + σ₂ v \
             (σ₀ bristle_stiffness, σ₁ bristle_damping)."
        }
        LawKind::LugreAsymmetric => "LuGre with separate levels for each direction.",
        LawKind::ImprovedLugre => {
            "LuGre with levels that increase with side load and pressure, and bristles that are deflected by a changing side \
             load."
        }
    };
    let fades = choices.damping_fades && law.parameters().contains(&ParameterId::BristleDamping);
    let damping = if fades { " The bristle damping is σ₁ exp(−(v/v_s)²)." } else { "" };
    equation.to_owned() + damping
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_with_choices_is_that_of_the_fit() {
        let chosen = |law: LawKind| {
            let mut parameters = Parameters::<f64>::new(law);
            parameters.choices.printed_extended = true;
            parameters.choices.damping_fades = true;
            equation(&parameters)
        };
        let plain = |law: LawKind| equation(&Parameters::<f64>::new(law));
        assert!(plain(LawKind::Extended).contains("+ f₁ v |v| +"));
        assert!(chosen(LawKind::Extended).contains("+ f₁ |v| +"));
        let has_choice = |law: &LawKind| chosen(*law) != plain(*law);
        let changed: Vec<LawKind> = LawKind::ALL.iter().copied().filter(has_choice).collect();
        let fading = [LawKind::Lugre, LawKind::LugreAsymmetric, LawKind::ImprovedLugre];
        assert_eq!(changed, [&[LawKind::Extended], &fading[..]].concat());
    }

    #[test]
    fn effect_is_known_of_every_term() {
        for kind in TermKind::ALL {
            assert!(effect(*kind).is_some_and(|effect| !effect.is_empty()), "{}", kind.name());
        }
    }
}
