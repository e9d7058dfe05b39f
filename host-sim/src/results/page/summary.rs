//! What the fits come to, in five sentences.
//!
//! A sentence here is a decision on a number, with the number in it, so that a reader can decide
//! otherwise. Nothing is said that the figures do not carry: two models closer than chance are
//! called equal, a parameter that is not determined is named, a residual that hangs together is not
//! called noise, and a column that might explain it is called untried, not the cause.

use super::figures::neighbours;
use super::words::{listed, quantity};
use super::{View, fitted};
use compensator_core::{ParameterId as Id, TermKind};
use friction_identification::data::contract;
use friction_identification::diagnose::cause;
use friction_identification::fit::{Outcome, State};
use friction_identification::number::significant;

/// Errors on held-out rows within this factor of those on the training rows are the same.
const AS_WELL: f64 = 1.25;

/// A model whose errors grow by this much more than others' does not carry over.
const CARRIES: f64 = 1.5;

/// More neighbouring rows than this hanging together are no noise.
const NOISE: f64 = 3.0;

/// The answer first; then whether it carries over, its parameters, its residual, what next.
pub(super) fn summary(view: &View) -> [String; 5] {
    [which(view), carries_over(view), determined(view), noise(view), next(view)]
}

/// Which model is best, and by how much.
fn which(view: &View) -> String {
    let (best, simplest) = (view.best(), view.simplest);
    let (name, unit) = (view.name(best), view.unit());
    let error = |fit: usize| quantity(view.fit(fit).test.rmse, unit);
    let Some(&second) = view.ranking.get(1) else {
        let test = &view.fit(best).test;
        return format!(
            "On rows it has not seen, {name} is {} RMS away from the logged {}, which is {} of its \
             standard deviation (100\u{a0}% would be no better than the mean).",
            error(best),
            view.torque(),
            quantity(100.0 * test.nrmse_std, "%")
        );
    };
    let against = if best == simplest {
        format!(
            "{name}, the simplest model here, predicts held-out rows best (RMSE {})",
            error(best)
        )
    } else {
        let percent = |share: f64| format!("{share:.*}\u{a0}%", usize::from(share < 10.0));
        let gain = 100.0 * (1.0 - view.fit(best).test.rmse / view.fit(simplest).test.rmse);
        format!(
            "{name} predicts held-out rows best: its RMSE of {} is {} below the {} of {}, the \
             simplest model here",
            error(best),
            percent(gain),
            error(simplest),
            view.name(simplest)
        )
    };
    let gain = |other: usize| {
        let gain = view.held_out.gain(best, other);
        // A hundredth of a percent is as good as nothing.
        let percent = |share: f64| match 100.0 * share {
            small if small.abs() < 0.1 => format!("{small:.2}").replace('-', "−"),
            other => significant(other, 2),
        };
        format!(
            "by {}\u{a0}% (95\u{a0}% interval {} to {}\u{a0}%)",
            percent(gain.value),
            percent(gain.ci95[0]),
            percent(gain.ci95[1])
        )
    };
    let equals = view.equals();
    if equals.is_empty() {
        return format!(
            "{against}; it is ahead of the next, {}, {}.",
            view.name(second),
            gain(second)
        );
    }
    let each: Vec<String> =
        equals.iter().map(|&fit| format!("{} {}", view.name(fit), gain(fit))).collect();
    let chosen = view.chosen();
    let that = if chosen == best {
        "so these rows do not tell them apart".to_owned()
    } else {
        format!("so these rows do not show that more than {} is needed", view.name(chosen))
    };
    let may = if equals.len() == 1 { "a lead" } else { "leads" };
    format!("{against}; it is ahead of {}, {may} that may be chance, {that}.", listed(&each, 8))
}

/// How much larger the error is on rows it has not seen.
fn growth(fit: &Outcome) -> f64 {
    fit.test.rmse / fit.train.rmse
}

/// What held-out rows beside fitted ones tell.
fn carries_over(view: &View) -> String {
    let best = view.fit(view.best());
    let mut growths: Vec<f64> = view.study.fits.iter().map(growth).collect();
    growths.sort_by(f64::total_cmp);
    let usual = growths[growths.len() / 2];
    let unit = view.unit();
    let both =
        format!("{} against {}", quantity(best.test.rmse, unit), quantity(best.train.rmse, unit));
    let own = match growth(best) {
        // All its neighbours are as far off: it is the rows, not the model.
        grown if grown > AS_WELL && grown < CARRIES * usual && view.study.fits.len() > 2 => {
            format!(
                "Its error is larger on held-out rows than on those it was fitted to ({both}), as that \
             of most models is, so the held-out rows are the harder ones"
            )
        }
        grown if grown > AS_WELL => format!(
            "Its error is larger on held-out rows than on those it was fitted to ({both}): what it \
             learnt carries over only in part"
        ),
        grown if grown < 1.0 / AS_WELL => format!(
            "Its error is even smaller on held-out rows than on those it was fitted to ({both}): the \
             held-out rows are the easier ones, so compare models with each other only"
        ),
        _ => format!("On held-out rows it does as well as on those it was fitted to ({both})"),
    };
    let lost = |&&fit: &&usize| fit != view.best() && growth(view.fit(fit)) > CARRIES * usual;
    let lost: Vec<String> = view.ranking.iter().filter(lost).map(|&fit| view.name(fit)).collect();
    if lost.is_empty() {
        return format!("{own}.");
    }
    format!("{own}; not so {}, whose errors grow far more than the others'.", listed(&lost, 8))
}

/// Parameters in a sentence.
fn names(estimates: &[Id]) -> String {
    listed(&estimates.iter().map(|id| id.name()).collect::<Vec<_>>(), 4)
}

fn in_state(fit: &Outcome, state: State) -> Vec<Id> {
    fitted(fit).filter(|estimate| estimate.state == state).map(|estimate| estimate.id).collect()
}

/// Whether the parameters mean anything.
fn determined(view: &View) -> String {
    let best = view.fit(view.best());
    let name = view.name(view.best());
    let total = fitted(best).count();
    let loose = [in_state(best, State::NotDetermined), in_state(best, State::AtStart)].concat();
    let bound = in_state(best, State::AtBound);
    let bounds = match bound.len() {
        0 => String::new(),
        1 => format!("; {} lies at the edge of its range", names(&bound)),
        _ => format!("; {} lie at the edge of their ranges", names(&bound)),
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
         The model predicts where such data were taken, but these numbers say nothing of the machine.",
        if loose.len() == 1 { "one is".to_owned() } else { format!("{} are", loose.len()) },
        names(&loose)
    )
}

/// Whether anything is left to explain.
fn noise(view: &View) -> String {
    let [train, test] = times(view);
    let [where_fitted, held_out] = [train, test].map(neighbours);
    if train.max(test) <= NOISE {
        return format!(
            "What it leaves over looks like noise: neighbouring residuals are all but independent \
             (autocorrelation time {where_fitted} rows where it was fitted, {held_out} where held \
             out)."
        );
    }
    format!(
        "What it leaves over is not noise: residuals go together over about {where_fitted} \
         neighbouring rows where it was fitted and {held_out} where held out (1 for noise), so \
         something systematic is missing."
    )
}

/// Autocorrelation times of the best model's residual, on rows fitted to and held out.
fn times(view: &View) -> [f64; 2] {
    let best = view.best();
    [view.fit(best).autocorrelation_time, view.held_out.autocorrelation_time(best)]
}

/// Terms that would use a logged column the best model does not use, with the column.
fn untried(view: &View) -> Vec<String> {
    let (data, tried) = (view.study.data, &view.fit(view.best()).spec);
    let columns = contract::covariates().map(|quantity| quantity.name(data.joint));
    let varies = |column: &str| {
        let values = || data.runs.iter().filter_map(|run| data.column(run, column)).flatten();
        values().next().is_some_and(|first| values().any(|value| value != first))
    };
    let is_new = |term: &TermKind| !tried.law.includes(*term) && !tried.terms.contains(term);
    let mut untried = Vec::new();
    for column in columns.filter(|column| varies(column)) {
        let causes = cause::ALL.iter().filter(|cause| cause.covariate() == Some(column));
        let terms = causes.filter_map(|cause| cause.remedy().term()).filter(is_new);
        untried.extend(terms.map(|term| format!("+{} ({column})", term.name())));
    }
    untried
}

/// An experiment that would determine what is not.
fn experiment(loose: &[Id]) -> Option<&'static str> {
    let any = |ids: &[Id]| ids.iter().any(|id| loose.contains(id));
    if any(&[Id::BristleStiffness, Id::BristleDamping]) {
        return Some("slow reversals at the highest rate");
    }
    if any(&[Id::StribeckVelocity, Id::StaticTorque, Id::StaticTorqueNegative]) {
        return Some("slow sliding, from rest up to where friction stops falling");
    }
    any(&[Id::ViscousFriction, Id::QuadraticFriction, Id::CubicFriction, Id::AtanSlope])
        .then_some("a wider range of steady speeds")
}

/// What to do about it.
fn next(view: &View) -> String {
    let best = view.fit(view.best());
    let mut things = Vec::new();
    if !best.converged {
        things
            .push("fit it again with more starts, since it stopped before it converged".to_owned());
    }
    if growth(best) > AS_WELL {
        things.push("find what is different about the held-out rows".to_owned());
    }
    let [train, test] = times(view);
    let is_noise = train.max(test) <= NOISE;
    let untried = untried(view);
    if !is_noise && untried.is_empty() {
        things.push("look in the charts below for what the residual follows".to_owned());
    } else if !is_noise {
        things.push(format!(
            "see whether a logged column that this model does not use lowers the held-out error: {}",
            listed(&untried, 4)
        ));
    }
    let loose = [in_state(best, State::NotDetermined), in_state(best, State::AtBound)].concat();
    if let Some(experiment) = experiment(&loose) {
        things.push(format!(
            "if the parameters matter and not the prediction alone, log {experiment}"
        ));
    }
    if best.parameters.choices.allow_active {
        things.push(
            "fit it without `--choices allow_active` before a driver runs it, since as it is it can give out energy"
                .to_owned(),
        );
    }
    if things.is_empty() {
        return "No verdict stands against using it where these data were taken.".to_owned();
    }
    format!("Next: {}.", things.join("; "))
}
