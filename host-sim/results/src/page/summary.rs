//! The result of the fits in five sentences.
//!
//! Each sentence states a conclusion and the number it is based on. Two models without a significant difference are
//! called equal. Parameters that are not determined are named. A residual with autocorrelation is not called noise. A
//! column that the recommended model does not use is left to the diagnosis: its correlation with the residual on training
//! rows does not show that a term for it reduces the held-out error, so no term is suggested here.

use super::figures::neighbours;
use super::words::{listed, quantity};
use super::{View, fitted};
use compensator_core::{ParameterId as Id, TermKind};
use friction_diagnose::{Gain, cause};
use friction_fit::{Outcome, State};
use joint_log::contract;
use joint_log::number::significant;

/// Maximum ratio of held-out to training error at which both count as equal.
const EQUAL_ERROR_RATIO: f64 = 1.25;

/// Ratio of a model's error growth to the usual growth above which the model does not generalise.
const POOR_GENERALISATION_RATIO: f64 = 1.5;

/// Maximum autocorrelation time of a residual that counts as noise, in rows.
const MAX_NOISE_AUTOCORRELATION_ROWS: f64 = 3.0;

/// Returns five sentences: best model, generalisation, parameters, residual, next steps.
pub(super) fn summary(view: &View) -> [String; 5] {
    [
        best_model(view),
        generalisation(view),
        parameter_states(view),
        residual_noise(view),
        next_steps(view),
    ]
}

/// States which model is best, and by how much.
fn best_model(view: &View) -> String {
    let (best, simplest) = (view.best(), view.simplest);
    let (name, unit) = (view.name(best), view.unit());
    let error = |fit: usize| quantity(view.fit(fit).test.rmse, unit);
    let Some(&second) = view.ranking.get(1) else {
        let test = &view.fit(best).test;
        return format!(
            "The RMSE of {name} on held-out rows is {}, or {} of the standard deviation of the logged {} (100\u{a0}% is no \
             better than predicting the mean).",
            error(best),
            quantity(100.0 * test.nrmse_std, "%"),
            view.torque()
        );
    };
    let against = if best == simplest {
        format!(
            "{name}, the simplest model, has the smallest held-out error (RMSE {})",
            error(best)
        )
    } else {
        let percent = |share: f64| format!("{share:.*}\u{a0}%", usize::from(share < 10.0));
        let gain = 100.0 * (1.0 - view.fit(best).test.rmse / view.fit(simplest).test.rmse);
        format!(
            "{name} has the smallest held-out error: its RMSE of {} is {} below the {} of {}, the simplest model",
            error(best),
            percent(gain),
            error(simplest),
            view.name(simplest)
        )
    };
    let gain = |other: usize| gain_in_words(&view.held_out.gain(best, other));
    let equals = view.equals();
    if equals.is_empty() {
        return format!(
            "{against}; its error is smaller than that of the second best, {}, {}.",
            view.name(second),
            gain(second)
        );
    }
    let each: Vec<String> =
        equals.iter().map(|&fit| format!("{} {}", view.name(fit), gain(fit))).collect();
    let chosen = view.chosen();
    let that = if chosen == best {
        "so these models are equivalent on this data".to_owned()
    } else {
        format!("so {} is sufficient for this data", view.name(chosen))
    };
    let verb = if equals.len() == 1 { "is" } else { "are" };
    format!("{against}; the difference to {} {verb} not significant, {that}.", listed(&each, 8))
}

/// Returns a gain with its interval.
fn gain_in_words(gain: &Gain) -> String {
    // Small gains are shown with two decimals only.
    let percent = |share: f64| match 100.0 * share {
        small if small.abs() < 0.1 => format!("{small:.2}").replace('-', "−"),
        other => significant(other, 2),
    };
    let [low, high] = gain.ci95.map(percent);
    format!("by {}\u{a0}% (95\u{a0}% interval {low} to {high}\u{a0}%)", percent(gain.value))
}

/// Returns the ratio of held-out to training error.
fn growth(fit: &Outcome) -> f64 {
    fit.test.rmse / fit.train.rmse
}

/// Compares the errors on held-out and training rows.
fn generalisation(view: &View) -> String {
    let best = view.fit(view.best());
    let mut growths: Vec<f64> = view.study.fits.iter().map(growth).collect();
    growths.sort_by(f64::total_cmp);
    let usual = growths[growths.len() / 2];
    let unit = view.unit();
    let both =
        format!("{} and {}", quantity(best.test.rmse, unit), quantity(best.train.rmse, unit));
    let comparison = match growth(best) {
        // If most models have the same growth, the held-out rows are the reason.
        grown
            if grown > EQUAL_ERROR_RATIO
                && grown < POOR_GENERALISATION_RATIO * usual
                && view.study.fits.len() > 2 =>
        {
            format!(
                "Its error is larger on held-out rows than on training rows ({both}), as for most models, so the held-out \
                 rows are more difficult to predict"
            )
        }
        grown if grown > EQUAL_ERROR_RATIO => format!(
            "Its error is larger on held-out rows than on training rows ({both}), so the model generalises only partly"
        ),
        grown if grown < 1.0 / EQUAL_ERROR_RATIO => format!(
            "Its error is smaller on held-out rows than on training rows ({both}), so the held-out rows are easier to \
             predict; use the errors only to compare models"
        ),
        _ => format!("Its errors on held-out and training rows are similar ({both})"),
    };
    let lost = |&&fit: &&usize| {
        fit != view.best() && growth(view.fit(fit)) > POOR_GENERALISATION_RATIO * usual
    };
    let lost: Vec<String> = view.ranking.iter().filter(lost).map(|&fit| view.name(fit)).collect();
    if lost.is_empty() {
        return format!("{comparison}.");
    }
    format!(
        "{comparison}; the errors of {} grow much more on held-out rows than those of the other models.",
        listed(&lost, 8)
    )
}

/// Lists parameter names.
fn names(estimates: &[Id]) -> String {
    listed(&estimates.iter().map(|id| id.name()).collect::<Vec<_>>(), 4)
}

fn in_state(fit: &Outcome, state: State) -> Vec<Id> {
    fitted(fit).filter(|estimate| estimate.state == state).map(|estimate| estimate.id).collect()
}

/// States which parameters the data determine.
fn parameter_states(view: &View) -> String {
    let best = view.fit(view.best());
    let name = view.name(view.best());
    let total = fitted(best).count();
    let loose = [in_state(best, State::NotDetermined), in_state(best, State::AtStart)].concat();
    let bound = in_state(best, State::AtBound);
    let bounds = match bound.len() {
        0 => String::new(),
        1 => format!("; {} is at a bound of its range", names(&bound)),
        _ => format!("; {} are at a bound of their ranges", names(&bound)),
    };
    if loose.is_empty() {
        let all = if bound.is_empty() { "All" } else { "All other" };
        let rest = total - bound.len();
        return format!(
            "{all} {rest} fitted parameters of {name} are determined by these data{bounds}."
        );
    }
    format!(
        "Of the {total} fitted parameters of {name}, {} not determined by these data ({}){bounds}. \
         The model can predict similar data, but these values do not describe the machine.",
        if loose.len() == 1 { "one is".to_owned() } else { format!("{} are", loose.len()) },
        names(&loose)
    )
}

/// States whether the residual is noise.
fn residual_noise(view: &View) -> String {
    let [train, test] = times(view);
    let [training, held_out] = [train, test].map(neighbours);
    if train.max(test) <= MAX_NOISE_AUTOCORRELATION_ROWS {
        return format!(
            "Its residual looks like noise: neighbouring residuals are nearly independent (autocorrelation time {training} \
             rows on training rows, {held_out} on held-out rows)."
        );
    }
    format!(
        "Its residual is not noise: the autocorrelation time is about {training} rows on training rows and {held_out} on \
         held-out rows (1 for white noise), so the model lacks a systematic effect."
    )
}

/// Returns the autocorrelation times of the best model's residual on training and held-out rows.
fn times(view: &View) -> [f64; 2] {
    let best = view.best();
    [view.fit(best).autocorrelation_time, view.held_out.autocorrelation_time(best)]
}

/// Returns the varying columns of the log that have a named cause whose term the recommended model does not use.
fn unused_columns(view: &View) -> Vec<&'static str> {
    let (data, used) = (&view.study.input.data, &view.fit(view.chosen()).spec);
    let columns = contract::covariates().map(|quantity| quantity.name(data.joint));
    let varies = |column: &str| {
        let values = || data.runs.iter().filter_map(|run| data.column(run, column)).flatten();
        values().next().is_some_and(|first| values().any(|value| value != first))
    };
    let is_unused = |term: &TermKind| !used.law.includes(*term) && !used.terms.contains(term);
    let has_unused_term = |column: &str| {
        let causes = cause::ALL.iter().filter(|cause| cause.covariate() == Some(column));
        causes.filter_map(|cause| cause.remedy().term()).any(|term| is_unused(&term))
    };
    columns.filter(|column| varies(column) && has_unused_term(column)).collect()
}

/// Returns an experiment that would determine the undetermined parameters.
fn experiment(loose: &[Id]) -> Option<&'static str> {
    let any = |ids: &[Id]| ids.iter().any(|id| loose.contains(id));
    if any(&[Id::BristleStiffness, Id::BristleDamping]) {
        return Some("slow reversals at the highest rate");
    }
    if any(&[Id::StribeckVelocity, Id::StaticTorque, Id::StaticTorqueNegative]) {
        return Some("slow sliding, from rest to the speed of minimum friction");
    }
    any(&[Id::ViscousFriction, Id::QuadraticFriction, Id::CubicFriction, Id::AtanSlope])
        .then_some("a wider range of steady speeds")
}

/// States the recommended next steps.
fn next_steps(view: &View) -> String {
    let best = view.fit(view.best());
    let mut things = Vec::new();
    if !best.converged {
        things.push(
            "repeat the fit with more starting points (--starts), because it did not converge"
                .to_owned(),
        );
    }
    if growth(best) > EQUAL_ERROR_RATIO {
        things.push("check what differs between the held-out and the training rows".to_owned());
    }
    let [train, test] = times(view);
    let is_noise = train.max(test) <= MAX_NOISE_AUTOCORRELATION_ROWS;
    let unused = unused_columns(view);
    if !is_noise && unused.is_empty() {
        things.push(
            "look for patterns of the residual in the charts below, or run diagnose".to_owned(),
        );
    } else if !is_noise {
        things.push(format!(
            "run diagnose on this log: it tests on held-out rows whether the residual follows a column that {} does not \
             use ({})",
            view.name(view.chosen()),
            listed(&unused, 4)
        ));
    }
    let loose = [in_state(best, State::NotDetermined), in_state(best, State::AtBound)].concat();
    if let Some(experiment) = experiment(&loose) {
        things.push(format!("if the parameter values are needed, record {experiment}"));
    }
    if best.parameters.choices.allow_active && best.driver_form.is_none() {
        things.push(
            "before using it on a driver, fit it without `--choices allow_active`, because its law may supply energy and so keep the joint moving"
                .to_owned(),
        );
    }
    if things.is_empty() {
        return "The model can be used for conditions similar to those of this data.".to_owned();
    }
    format!("Next steps: {}.", things.join("; "))
}
