//! What the words and numbers of the page mean, and how they came about.

use super::View;
use compensator_core::{LawKind, TermKind};
use friction_identification::diagnose::cause;
use friction_identification::fit::Resolution;
use friction_identification::spec::rigid_body_effect;

/// Definitions of the metrics.
pub(in crate::results) fn metrics(view: &View) -> Vec<String> {
    let unit = view.unit();
    [
        &format!("e is the logged minus the simulated {}, y the logged one, n the number of rows.",
            view.torque()),
        &format!("RMSE = √(Σe² / n), in {unit}: how far off a typical row is."),
        &format!("SSE = Σe², in {unit}²: compares models on the same rows only."),
        "NRMSE of std = RMSE / standard deviation of y: 100 % is no better than predicting the mean.",
        "NRMSE of range = RMSE / (max y − min y). Both kinds are called NRMSE in papers; state which.",
        "Relative error = 100 ‖e‖ / ‖y‖: 100 % is no better than predicting zero.",
        "BIC = n ln(SSE / n) + k ln n on the rows fitted to, k the number of fitted parameters; \
         smaller is better. It takes rows as independent, which makes its differences too large \
         wherever the residual is not noise.",
        "Time of fit: wall clock on the computer that made this page.",
    ]
    .map(str::to_owned)
    .to_vec()
}

/// How the fits were made.
pub(in crate::results) fn methods(view: &View) -> Vec<String> {
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
        [] => "here one step per row was enough".to_owned(),
        some => format!("steps per row here: {}; one for any other", some.join(", ")),
    };
    vec![
        "A model is simulated by the step that runs on the joint driver, here in double precision: \
         there is no second implementation."
            .into(),
        "Its free parameters are fitted to the sum of squared residuals by Levenberg-Marquardt with \
         exact derivatives (dual numbers through the same step), from several starts; the best end \
         wins. Bounds are kept by coordinates that cannot leave them."
            .into(),
        "A weak prior, worth one row per parameter with a width of a decade, holds what the data do \
         not determine near its start; what they do determine it does not move."
            .into(),
        format!(
            "Where a log's period is coarse for the bristles, a row takes several sub-steps, or two \
             simulations of different fineness are extrapolated, until a finer one would no longer \
             move the parameters; {resolutions}."
        ),
        format!(
            "Every unbroken stretch of a run is simulated on its own. Where one begins at rest, the \
             {0} its bristles hold is unknown: it is solved for from that stretch, held-out ones \
             included, and the standard errors allow for it. It fades with the first motion.",
            view.torque()
        ),
        "Standard errors are those of least squares, times the root of the residual's \
         autocorrelation time on the rows fitted to (how many neighbouring rows count as one \
         observation; 1 for white noise)."
            .into(),
        "Held-out rows are whole runs or whole stretches, never shuffled rows. The best model was \
         chosen by its error on them, so that error flatters it a little: the more models are tried, \
         the more."
            .into(),
        "Two models are told apart where the mean difference of their squared held-out residuals is \
         more than two of its own standard errors, which allow for autocorrelation but not for what \
         differs from run to run."
            .into(),
        format!("Made by host-sim {}.", env!("CARGO_PKG_VERSION")),
    ]
}

/// The laws and terms on the page, a line each.
pub(in crate::results) fn models(view: &View) -> Vec<String> {
    let mut laws: Vec<LawKind> = view.study.fits.iter().map(|fit| fit.spec.law).collect();
    laws.sort_unstable();
    laws.dedup();
    let specs = view.study.fits.iter().map(|fit| &fit.spec);
    let mut terms: Vec<TermKind> =
        specs.flat_map(|spec| spec.terms.iter().chain(&spec.rigid_body)).copied().collect();
    terms.sort_unstable();
    terms.dedup();
    let mut lines = vec![
        "v is the velocity, F_C the Coulomb level (coulomb_torque), F_S the static one \
         (static_torque), v_s the Stribeck velocity, σ₂ the viscous coefficient \
         (viscous_friction); g(v) = F_C + (F_S − F_C) exp(−(v/v_s)²)."
            .to_owned(),
    ];
    lines.extend(laws.into_iter().map(|kind| format!("{}: {}", kind.name(), law(kind))));
    // A term is there for a cause, or for a part of the rigid body.
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
        LawKind::Stribeck => "g(v) sgn v + σ₂ v, LuGre in steady sliding.",
        LawKind::Dahl => "bristles that bend and slip, with F_S = F_C and no bristle damping.",
        LawKind::Lugre => {
            "bristles with deflection z: z' = v − σ₀ |v| z / g(v), torque σ₀ z + σ₁ z' + σ₂ v \
             (σ₀ bristle_stiffness, σ₁ bristle_damping)."
        }
        LawKind::LugreAsymmetric => "LuGre with levels of its own for each direction.",
        LawKind::ImprovedLugre => {
            "LuGre whose levels rise with side load and pressure, and whose bristles are bent by a \
             changing side load."
        }
    }
}
