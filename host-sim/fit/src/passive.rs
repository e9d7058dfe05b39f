//! The passive form of a law: what a joint driver runs, and what it costs.
//!
//! The rows alone may determine a law that can give out energy, for example a LuGre law with much bristle damping. A driver
//! must not run it, but its parameters are what the log says. So the passive form is fitted as well, and both are compared
//! on the held-out rows:
//!
//! - If the passive form is clearly worse, the outcome has the parameters of the rows alone, and the passive form beside them
//!   ([`Outcome::driver_form`]).
//! - Otherwise the outcome is the passive form. A parameter that the form moved is "not determined".

use super::legal::fit_legal;
use super::outcome::{DriverForm, Estimate, Outcome, State};
use super::predict::Predicted;
use super::solve::{COMPARISON_TOLERANCE, FitOptions, Solution};
use super::statistics::autocorrelation_time;
use super::track::Rows;
use crate::spec::Spec;
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters};
use joint_log::number::significant;

/// Logarithm of the likelihood ratio of the held-out rows above which the passive form is clearly worse: 150 to 1.
const CLEAR_LOG_RATIO: f64 = 5.0;

/// Difference of a parameter above which the passive form moved it, standard errors of the fit to the rows alone.
const MOVED_ERRORS: f64 = 2.0;

/// Share of the passive bound to use in each step: the bound falls as the other parameters adapt.
const BOUND_SHARES: [f64; 5] = [0.95, 0.95, 0.8, 0.5, 0.2];

/// A passive fit.
pub(super) struct PassiveFit {
    pub solution: Solution,
    pub parameters: Parameters<f64>,
    pub changes: Vec<PassivityChange>,
}

/// A fit with its errors on the held-out rows.
pub(super) struct EvaluatedFit {
    pub outcome: Outcome,
    pub held_out: Predicted,
}

/// A change that made a law passive.
pub(super) struct PassivityChange {
    /// The parameter that was moved to its bound, if any.
    id: Option<Id>,
    /// Note for the user.
    note: String,
}

/// Makes a law passive in small steps, after each of which the other parameters are fitted again. Returns `None` if the law
/// is passive, or need not be.
pub(super) fn passive_fit(
    spec: &Spec,
    parameters: &Parameters<f64>,
    solution: &Solution,
    [train, test]: [Rows; 2],
    options: &FitOptions,
) -> Option<PassiveFit> {
    let resolution = Some(solution.resolution);
    // A passive form is another law than that of the rows: its own optimum need not be known better than to a third of an error.
    let tolerance = options.tolerance.max(COMPARISON_TOLERANCE);
    let mut options = FitOptions { starts: 1, resolution, tolerance, ..options.clone() };
    let mut parameters = parameters.clone();
    let mut found: Option<PassiveFit> = None;
    for inside in BOUND_SHARES {
        let Some(change) = towards_passivity(&mut parameters, &mut options, inside) else { break };
        options.start = Some(parameters.clone());
        let (solution, fitted) = fit_legal(spec, &parameters, [train, test], &options);
        parameters = fitted.clone();
        let mut changes = found.map_or_else(Vec::new, |found| found.changes);
        // The unconstrained value of a parameter is reported once.
        if changes.iter().all(|earlier: &PassivityChange| earlier.id != change.id) {
            changes.push(change);
        }
        found = Some(PassiveFit { solution, parameters: fitted, changes });
    }
    found
}

/// Changes a law that is not passive in one step towards passivity. Returns `None` if it is passive. The first step lets the
/// damping fade with speed, as a film separates the asperities: the rows still determine its size, and the law is passive
/// except for very large values. Further steps move values that are too large to the share `inside` of their bound.
fn towards_passivity(
    parameters: &mut Parameters<f64>,
    options: &mut FitOptions,
    inside: f64,
) -> Option<PassivityChange> {
    if parameters.choices.allow_active {
        return None;
    }
    let largest = f64::from(parameters.active_damping()?);
    let damping = significant(parameters.get(Id::BristleDamping), 3);
    if !parameters.choices.damping_fades && !options.fixed.contains(&Id::BristleDamping) {
        parameters.choices.damping_fades = true;
        let note = format!(
            "the bristle damping fades with speed (damping_fades): a constant damping, {damping} on these rows, can supply \
             energy, and so keep the joint moving; the largest value that cannot is {}",
            significant(largest, 3)
        );
        return Some(PassivityChange { id: None, note });
    }
    parameters.set(Id::BristleDamping, inside * largest);
    if !options.fixed.contains(&Id::BristleDamping) {
        options.fixed.push(Id::BristleDamping);
    }
    let note = format!(
        "bristle_damping: at its bound: the rows alone give {damping}, and more than {} can supply energy",
        significant(largest, 3)
    );
    Some(PassivityChange { id: Some(Id::BristleDamping), note })
}

/// Compares a fit to the rows alone with its passive form, and returns the one to report with what the form costs.
pub(super) fn reported(
    alone: EvaluatedFit,
    passive: EvaluatedFit,
    changes: Vec<PassivityChange>,
) -> Outcome {
    let is_worse = is_clearly_worse(&passive.held_out, &alone.held_out);
    let (alone, mut passive) = (alone.outcome, passive.outcome);
    let moved = mark_moved(&mut passive.estimates, &alone.estimates, &changes);
    let cost = cost_in_words(&alone, &passive);
    let mut notes: Vec<String> = changes.into_iter().map(|change| change.note).collect();
    notes.push(cost);
    let mut outcome = if is_worse {
        notes.push(
            "the parameters are those of the rows alone, which give a law that can supply energy; params.toml has the closest law \
             that only dissipates it, which a driver needs (with --choices allow_active it has these)"
                .to_owned(),
        );
        let Outcome { parameters, estimates, train, test, .. } = passive;
        let form = DriverForm { parameters, estimates, train, test };
        Outcome { driver_form: Some(Box::new(form)), ..alone }
    } else {
        passive
    };
    if !is_worse && !moved.is_empty() {
        let moved = moved.join(", ");
        notes.push(format!(
            "to only dissipate energy, the law has other parameters; the rows alone give {moved}"
        ));
    }
    outcome.verdicts.extend(notes);
    outcome
}

/// Returns what the passive form costs.
fn cost_in_words(alone: &Outcome, passive: &Outcome) -> String {
    let part = |rows: &str, alone: f64, passive: f64| {
        let percent = 100.0 * (passive / alone.max(f64::MIN_POSITIVE) - 1.0);
        format!(
            "{rows} RMSE {} instead of {} ({percent:+.1} %)",
            significant(passive, 4),
            significant(alone, 4)
        )
    };
    format!(
        "a law that only dissipates energy, as a driver needs, costs: {}, {}",
        part("held-out", alone.test.rmse, passive.test.rmse),
        part("training", alone.train.rmse, passive.train.rmse)
    )
}

/// Marks the parameters that the passive form moved, and returns them with the values of the rows alone.
fn mark_moved(
    passive: &mut [Estimate],
    alone: &[Estimate],
    changes: &[PassivityChange],
) -> Vec<String> {
    let mut moved = Vec::new();
    for (passive, free) in passive.iter_mut().zip(alone) {
        let Some(error) = free.std_error else { continue };
        if changes.iter().any(|change| change.id == Some(passive.id)) {
            // Fixed in the last fit, at the bound.
            passive.state = State::AtBound;
        } else if free.state == State::Determined
            && (passive.value - free.value).abs() > MOVED_ERRORS * error
        {
            if passive.state == State::Determined {
                passive.state = State::NotDetermined;
            }
            moved.push(format!(
                "{} {} ± {}",
                passive.id.name(),
                significant(free.value, 4),
                significant(error, 2)
            ));
        }
    }
    moved
}

/// Returns true if the held-out rows clearly favour the fit to the rows alone: by the logarithm of the likelihood ratio of normal
/// errors, where the rows of an autocorrelation time count as one.
fn is_clearly_worse(passive: &Predicted, alone: &Predicted) -> bool {
    let time = autocorrelation_time(alone.residuals.iter().map(Vec::as_slice));
    let observations = alone.metrics.rows as f64 / time;
    let ratio = passive.metrics.rmse / alone.metrics.rmse.max(f64::MIN_POSITIVE);
    observations * ratio.ln() > CLEAR_LOG_RATIO
}
