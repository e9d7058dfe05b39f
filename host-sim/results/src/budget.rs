//! The error budget of a diagnosis: which step takes how much of the error, from plain friction to the noise.

use friction_diagnose::{Diagnosis, cause};
use joint_log::number::significant;

/// A step of the budget.
pub struct BudgetStep<'a> {
    /// `plain`, a law, a cause, `ceiling` or `noise`.
    pub name: &'a str,
    /// Held-out RMS error with this step and those before it, Nm or N.
    pub rmse: f64,
    /// True if a driver has a term for it.
    pub deployable: bool,
    /// True for what limits any model.
    pub is_limit: bool,
}

/// Returns the steps: plain friction, the law, each cause in the order in which they take most, the ceiling and the noise.
pub fn budget(found: &Diagnosis) -> Vec<BudgetStep<'_>> {
    let model = |name, rmse, deployable| BudgetStep { name, rmse, deployable, is_limit: false };
    let limit = |name, rmse| BudgetStep { name, rmse, deployable: false, is_limit: true };
    let has_term =
        |name: &str| cause::named(name).is_some_and(|cause| cause.remedy().term().is_some());
    let mut steps = vec![model("plain", found.hand_over.plain.held_out.metrics.rmse, true)];
    let causes = found.hand_over.steps.iter();
    steps.extend(causes.map(|step| model(step.added, step.rmse, has_term(step.added))));
    steps.extend([limit("ceiling", found.ceiling.rmse), limit("noise", found.noise_floor)]);
    steps
}

/// Returns the share of the squared error that a model could remove which a model with an error of `rmse` removes: from
/// plain friction to the ceiling, 0 to 1. `None` if plain friction is at the ceiling.
pub fn removed_share(plain: f64, rmse: f64, ceiling: f64) -> Option<f64> {
    let removable = plain.powi(2) - ceiling.powi(2);
    let share = (plain.powi(2) - rmse.powi(2)) / removable;
    (removable > 0.0 && share.is_finite()).then(|| share.clamp(0.0, 1.0))
}

/// States that share of the model of a diagnosis in a sentence.
pub fn removed_in_words(found: &Diagnosis) -> String {
    let plain = found.hand_over.plain.held_out.metrics.rmse;
    match removed_share(plain, found.after.metrics.rmse, found.ceiling.rmse) {
        Some(share) => format!(
            "Of the squared error that a model could remove, {}\u{a0}% is removed.",
            significant(100.0 * share, 2)
        ),
        None => "Boosted trees leave no less error than plain friction, so what a model could remove is not known."
            .to_owned(),
    }
}
