//! Definitions of the metrics and models on the page, and the description of the method.

use super::View;
use compensator_core::{LawKind, TermKind};
use friction_diagnose::cause;
use friction_fit::Resolution;
use friction_fit::spec::rigid_body_effect;

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
        "The free parameters minimise the sum of squared residuals (Levenberg-Marquardt with exact derivatives by dual \
         numbers), from several starting points; the best result is kept. Bounds are enforced by a change of coordinates."
            .into(),
        "A weak prior (weight of a tenth of an observation per parameter, width of one decade) keeps parameters that the data do not determine \
         near their start values. It does not affect determined parameters."
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
        "Two models differ significantly if the mean difference of their squared held-out residuals exceeds two of its \
         standard errors. These include autocorrelation, but not differences between runs."
            .into(),
        format!("Created by host-sim {}.", env!("CARGO_PKG_VERSION")),
    ]
}

/// Describes each law and term on the page in one line.
pub(crate) fn models(view: &View) -> Vec<String> {
    let mut laws: Vec<LawKind> = view.study.fits.iter().map(|fit| fit.spec.law).collect();
    laws.sort_unstable();
    laws.dedup();
    let specs = view.study.fits.iter().map(|fit| &fit.spec);
    let mut terms: Vec<TermKind> =
        specs.flat_map(|spec| spec.terms.iter().chain(&spec.rigid_body)).copied().collect();
    terms.sort_unstable();
    terms.dedup();
    let mut lines = vec![
        "v is the velocity, F_C the Coulomb level (coulomb_torque), F_S the static level \
         (static_torque), v_s the Stribeck velocity, σ₂ the viscous coefficient \
         (viscous_friction); g(v) = F_C + (F_S − F_C) exp(−(v/v_s)²)."
            .to_owned(),
    ];
    lines.extend(laws.into_iter().map(|kind| format!("{}: {}", kind.name(), law(kind))));
    // A term belongs to a cause or to a rigid-body part.
    let effect = |kind: TermKind| {
        cause::of_term(kind).map(|cause| cause.effect()).or_else(|| rigid_body_effect(kind))
    };
    let line = |kind: TermKind| format!("+ {}: {}", kind.name(), effect(kind).unwrap_or_default());
    lines.extend(terms.into_iter().map(line));
    lines
}

fn law(kind: LawKind) -> &'static str {
    match kind {
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
    }
}
