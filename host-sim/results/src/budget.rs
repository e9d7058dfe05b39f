//! The error budget of a diagnosis: which step takes how much of the error, from plain friction to the noise.

use friction_diagnose::{Diagnosis, cause};

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
    let own = found.hand_over.steps.iter();
    steps.extend(own.map(|(name, rmse)| model(*name, *rmse, has_term(name))));
    steps.extend([limit("ceiling", found.ceiling.rmse), limit("noise", found.noise_floor)]);
    steps
}
