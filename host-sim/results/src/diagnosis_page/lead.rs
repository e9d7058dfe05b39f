//! The first screen: the answers, further facts, and a chart of the error that a model could remove.
//!
//! Noise that no model can predict is most of the error of a good log. A right diagnosis may therefore reduce the total
//! error by only one percent, although it removes nearly all of the predictable part. Answers and chart
//! are therefore about the error that a model could remove: beyond that of boosted trees ([`crate::budget`]). Errors add up
//! as squares, so this part is `sqrt(rmse^2 - ceiling^2)`.

use super::Scene;
use super::figures::{AFTER, BEFORE};
use super::words;
use crate::budget::removed_in_words;
use crate::page::words::{capitalised, counted, quantity};
use crate::report::{Answers, Axis, Benefit, Chart, Series};
use compensator_core::Quantity;
use friction_diagnose::cause::Remedy;
use friction_diagnose::summary::above_floor;
use friction_diagnose::{Diagnosis, Finding, hand_over, probability_in_words, summary};
use joint_log::number::significant;

/// Returns the answers of the page.
pub(super) fn answers(scene: &Scene) -> Answers {
    let found = scene.about.found;
    let what = match found.findings.first() {
        Some(first) => format!(
            "{} ({}).",
            capitalised(first.cause.meaning_of(first.size.value)),
            first.cause.name()
        ),
        None => format!("{}.", words::none_named(found)),
    };
    let next = next_step(scene).unwrap_or_else(|| summary::next_experiment(found));
    Answers { what, certainty: certainty(found), benefit: Benefit::Gain(gain(scene)), next }
}

/// Returns the probability of the first cause, or of the most likely candidate.
fn certainty(found: &Diagnosis) -> String {
    let tested = counted(found.candidates.len(), "candidate");
    let most = found.candidates.iter().max_by(|a, b| a.probability.total_cmp(&b.probability));
    match (found.findings.first(), most) {
        (Some(first), _) => format!(
            "The probability that this is real is {}. Compared on held-out rows: {tested}.",
            probability_in_words(first.probability)
        ),
        (None, Some(most)) => format!(
            "{} has the highest probability of {tested}: {}.",
            capitalised(most.cause.name()),
            probability_in_words(most.probability)
        ),
        (None, None) => {
            "No candidate was in the best hypothesis or won in a resampled log.".to_owned()
        }
    }
}

/// Returns what the extension gains on held-out rows.
fn gain(scene: &Scene) -> String {
    let found = scene.about.found;
    let removed = removed_in_words(found);
    if !scene.is_extended() {
        return format!("No extension is proposed. {removed}");
    }
    let [before, after] = [&found.before, &found.after].map(|model| model.metrics.rmse);
    let percent = |share: f64| significant(100.0 * share, 2);
    let [low, high] = found.gain.ci95.map(percent);
    format!(
        "The held-out error falls from {} to {}, by {}\u{a0}% (95\u{a0}% interval {low} to {high}\u{a0}%). {removed}{}",
        quantity(before, scene.unit()),
        quantity(after, scene.unit()),
        percent(found.gain.value),
        share_of_noise(before, found.noise_floor, scene.unit())
    )
}

/// Returns name and text of each fact below the answers.
pub(super) fn facts(scene: &Scene) -> Vec<(String, String)> {
    let found = scene.about.found;
    let mut facts: Vec<(&str, String)> = Vec::new();
    facts.extend(summary::warning(found).map(|warning| ("Warning", warning)));
    if let Some((first, others)) = found.findings.split_first() {
        facts.push(("Size", first.with_order(scene.about.input.data.joint, &size(scene, first))));
        if !others.is_empty() {
            let names: Vec<String> = others.iter().map(cause).collect();
            facts.push(("Further causes", names.join("; ")));
        }
    }
    facts.push(("Handed over", hand_over::in_words(found)));
    facts.push(("Remaining error", summary::remaining_error(found)));
    // Without a next step, the answers have the experiment.
    if next_step(scene).is_some() {
        facts.push(("Next experiment", summary::next_experiment(found)));
    }
    facts.into_iter().map(|(name, text)| (name.to_owned(), text)).collect()
}

/// Returns what to do with the result. A driver that compensated an error of the sensor would make the joint worse.
fn next_step(scene: &Scene) -> Option<String> {
    let found = scene.about.found;
    let named = |is_wanted: fn(&Finding) -> bool| -> Vec<&str> {
        let findings = found.findings.iter().filter(|finding| is_wanted(finding));
        findings.map(|finding| finding.cause.name()).collect()
    };
    let of_sensor = named(|finding| matches!(finding.cause.remedy(), Remedy::CorrectColumn(_)));
    if !of_sensor.is_empty() {
        return Some(format!(
            "{}: this lies in the sensor or the logger, so no parameter of the driver compensates it. Correct it at its \
             source and diagnose a new log before params.toml is written to the driver.",
            of_sensor.join(", ")
        ));
    }
    let outside = named(|finding| matches!(finding.cause.remedy(), Remedy::RigidBody(None)));
    if !outside.is_empty() && !scene.is_extended() {
        return Some(format!(
            "{}: this is the rigid body, so no parameter of the driver's friction compensates it.",
            outside.join(", ")
        ));
    }
    scene.is_extended().then(|| {
        format!(
            "params.toml contains the model {}. Write it to the driver: `host-sim params set params.toml --bus can0` Or \
             export it: `host-sim export params.toml --to c`",
            found.transferable_model().spec
        )
    })
}

/// Share of the noise floor in the squared error above which the total error falls little, so that this needs an explanation.
const DOMINANT_NOISE_SHARE: f64 = 0.5;

/// Explains why the total error falls little although much of what a model could remove is removed; empty if it does not.
fn share_of_noise(rmse: f64, floor: f64, unit: &str) -> String {
    let share = (floor / rmse).powi(2);
    if share.is_nan() || share < DOMINANT_NOISE_SHARE {
        return String::new();
    }
    format!(
        " The total falls by less: the noise floor of {}, which no model can reduce, is {}\u{a0}% of the squared error.",
        quantity(floor, unit),
        significant(100.0 * share, 2)
    )
}

/// Returns meaning, name and probability of a finding's cause.
fn cause(finding: &Finding) -> String {
    format!(
        "{} ({}), probability {}",
        finding.cause.meaning_of(finding.size.value),
        finding.cause.name(),
        probability_in_words(finding.probability)
    )
}

/// Describes the size of a finding. For a cause that depends on a column, the effect over the column's range in the log
/// is easier to judge than a coefficient.
fn size(scene: &Scene, finding: &Finding) -> String {
    let size = &finding.size;
    let unit = scene.unit();
    let Some([low, high]) = size.bounds() else { return size.in_words() };
    if size.unit == "1" {
        let [value, low, high] = [size.value, low, high].map(|share| significant(100.0 * share, 3));
        return format!(
            "{value}\u{a0}% of the friction (95\u{a0}% interval {low} to {high}\u{a0}%)"
        );
    }
    let per = size.unit.strip_prefix(unit).and_then(|rest| rest.strip_prefix('/'));
    let range = finding.columns.first().and_then(|column| range(scene, column));
    let (Some(per), Some([least, most])) = (per, range) else { return size.in_words() };
    let over = |of: f64| significant(of * (most - least), 3);
    let column = &finding.columns[0];
    let label = Quantity::parse(column).map(|(known, _)| known.info().label);
    // Pressure gauges show bar.
    let (shown, scale) = if per == "Pa" { ("bar", 1e-5) } else { (per, 1.0) };
    format!(
        "{}\u{a0}{unit} (95\u{a0}% interval {} to {}) from the lowest to the highest {} in this log ({} to \
         {}\u{a0}{shown})",
        over(size.value),
        over(low),
        over(high),
        label.unwrap_or(column),
        significant(scale * least, 3),
        significant(scale * most, 3),
    )
}

/// Returns minimum and maximum of a column; `None` if it is constant.
fn range(scene: &Scene, column: &str) -> Option<[f64; 2]> {
    let data = &scene.about.input.data;
    let values = data.runs.iter().filter_map(|run| data.column(run, column)).flatten().copied();
    let values = values.filter(|value: &f64| value.is_finite());
    let range = values.fold(None, |range: Option<[f64; 2]>, value| match range {
        None => Some([value, value]),
        Some([least, most]) => Some([value.min(least), value.max(most)]),
    });
    range.filter(|[least, most]| most > least)
}

/// Returns the errors of the base model and of the extended model beyond what no model could remove.
fn removable(scene: &Scene) -> [f64; 2] {
    let found = scene.about.found;
    [&found.before, &found.after].map(|model| above_floor(model.metrics.rmse, found.ceiling.rmse))
}

/// Returns the chart of the error that a model could remove, before and after.
pub(super) fn removable_error(scene: &Scene) -> Chart {
    let names: &[&str] = if scene.is_extended() { &[BEFORE, AFTER] } else { &[scene.base()] };
    let bars = names.iter().zip(removable(scene)).zip(0..);
    let bars =
        bars.map(|((name, error), place)| Series::bars(*name, vec![error], vec![f64::from(place)]));
    let ceiling = scene.about.found.ceiling.rmse;
    // Bars of length zero give no range.
    let is_none = removable(scene).iter().all(|error| *error <= 0.0);
    let range = (is_none && ceiling > 0.0).then_some((0.0, ceiling));
    let none = if is_none { " No error is beyond it." } else { "" };
    Chart {
        title: "Error that a model could remove".into(),
        caption: format!(
            "The held-out error beyond {}, which boosted trees with all logged columns leave.{none}",
            quantity(ceiling, scene.unit())
        ),
        x: Axis {
            range,
            ..Axis::new(format!("RMSE that a model could remove ({})", scene.unit()))
        },
        y: Axis::of_names("", names.iter().copied()),
        series: bars.collect(),
    }
}
