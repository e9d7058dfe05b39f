//! The first screen: cause, size, gain, next steps, and a chart of the error above the noise floor.
//!
//! Noise that no model can predict is most of the error of a good log. A right diagnosis may therefore reduce the total
//! error by only one percent, although it removes nearly all of the predictable part. Errors add up as squares, so the
//! part above the floor is `sqrt(rmse^2 - floor^2)`.

use super::Scene;
use super::figures::{AFTER, BEFORE};
use super::words;
use crate::page::words::quantity;
use crate::report::{Axis, Chart, Series};
use compensator_core::Quantity;
use friction_diagnose::cause::Remedy;
use friction_diagnose::summary::{self, above_floor};
use friction_diagnose::{Finding, hand_over, probability_in_words};
use joint_log::number::significant;
use maud::html;

/// Returns name and text of each fact.
pub(super) fn facts(scene: &Scene) -> Vec<(String, String)> {
    let found = scene.about.found;
    let mut facts: Vec<(&str, String)> = Vec::new();
    facts.extend(summary::warning(found).map(|warning| ("Warning", warning)));
    match found.findings.split_first() {
        None => facts.push(("Cause", format!("{}.", words::none_named(found)))),
        Some((first, others)) => {
            facts.push(("Cause", cause(first)));
            let joint = scene.about.data.joint;
            facts.push(("Size", first.with_order(joint, &size(scene, first))));
            if !others.is_empty() {
                let names: Vec<String> = others.iter().map(cause).collect();
                facts.push(("Further causes", names.join("; ")));
            }
        }
    }
    let [before, after] = errors(scene);
    let unit = scene.unit();
    let gain = if !scene.is_extended() {
        format!(
            "No extension is proposed. The error above the noise floor is {}.",
            quantity(before, unit)
        )
    } else if before > 0.0 {
        format!(
            "The error above the noise floor falls from {} to {} (by {}\u{a0}%); the total error falls by {}\u{a0}% (95\u{a0}% interval {} to {}\u{a0}%).{}",
            quantity(before, unit),
            quantity(after, unit),
            significant(100.0 * (1.0 - after / before), 2),
            significant(100.0 * found.gain.value, 2),
            significant(100.0 * found.gain.ci95[0], 2),
            significant(100.0 * found.gain.ci95[1], 2),
            two_percentages(found.before.metrics.rmse, found.noise_floor, unit)
        )
    } else {
        "The error of the base model is already at the noise floor.".into()
    };
    facts.push(("Gain on held-out rows", gain));
    facts.push(("Handed over", hand_over::in_words(found)));
    facts.push(("Remaining error", summary::remaining_error(found)));
    facts.extend(next_step(scene).map(|how| ("Next step", how)));
    facts.push(("Next experiment", summary::next_experiment(found)));
    facts.into_iter().map(|(name, text)| (name.to_owned(), text)).collect()
}

/// Returns what to do with the result. A driver that compensated an error of the sensor would make the joint worse.
fn next_step(scene: &Scene) -> Option<String> {
    let found = scene.about.found;
    let named = |is_it: fn(&Finding) -> bool| -> Vec<&str> {
        found.findings.iter().filter(|own| is_it(own)).map(|own| own.cause.name()).collect()
    };
    let of_sensor = named(|own| matches!(own.cause.remedy(), Remedy::CorrectColumn(_)));
    if !of_sensor.is_empty() {
        return Some(format!(
            "{}: this lies in the sensor or the logger, so no parameter of the driver compensates it. Correct it at its \
             source and diagnose a new log before params.toml is written to the driver.",
            of_sensor.join(", ")
        ));
    }
    let outside = named(|own| matches!(own.cause.remedy(), Remedy::RigidBody(None)));
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

/// Width of the longest bar, px: a third of a notebook's cell on a small screen.
const BAR_PX: f64 = 240.0;

/// Returns the first screen as an HTML fragment.
pub(super) fn fragment(scene: &Scene) -> String {
    let errors = errors(scene);
    let names: &[&str] = if scene.is_extended() { &[BEFORE, AFTER] } else { &["base model"] };
    let longest = errors[0].max(errors[1]).max(f64::MIN_POSITIVE);
    let bars = names.iter().zip(errors);
    html! {
        div style="max-width: 60em" {
            dl {
                @for (name, text) in facts(scene) {
                    dt style="font-weight: 600" { (name) }
                    dd style="margin: 0 0 .4em 1.2em" { (text) }
                }
                dt style="font-weight: 600" { "Error above the noise floor" }
                @for (name, error) in bars {
                    dd style="margin: 0 0 .2em 1.2em" {
                        span style={
                            "display: inline-block; height: .8em; background: #0072b2; width: "
                            (format!("{:.0}", BAR_PX * error / longest)) "px"
                        } {}
                        " " (name) ": " (quantity(error, scene.unit()))
                    }
                }
            }
            ol { @for sentence in summary::summary(scene.about.found) { li { (sentence) } } }
        }
    }
    .into_string()
}

/// Share of the noise floor in the squared error above which the reduction of the total error is much smaller than that of
/// the error above the floor, so that the difference needs an explanation.
const DOMINANT_NOISE_SHARE: f64 = 0.5;

/// Explains why the total error falls much less than the error above the noise floor; empty if it does not.
fn two_percentages(rmse: f64, floor: f64, unit: &str) -> String {
    let share = (floor / rmse).powi(2);
    if share.is_nan() || share < DOMINANT_NOISE_SHARE {
        return String::new();
    }
    format!(
        " Both are true: errors add as squares, and the noise floor of {}, which no model can reduce, is {}\u{a0}% of the \
         squared error.",
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
    let data = scene.about.data;
    let values = data.runs.iter().filter_map(|run| data.column(run, column)).flatten().copied();
    let values = values.filter(|value: &f64| value.is_finite());
    let range = values.fold(None, |range: Option<[f64; 2]>, value| match range {
        None => Some([value, value]),
        Some([least, most]) => Some([value.min(least), value.max(most)]),
    });
    range.filter(|[least, most]| most > least)
}

/// Returns the errors above the noise floor of the base model and of the extended model.
fn errors(scene: &Scene) -> [f64; 2] {
    let found = scene.about.found;
    [&found.before, &found.after].map(|model| above_floor(model.metrics.rmse, found.noise_floor))
}

/// Returns the chart of the error above the noise floor, before and after.
pub(super) fn above_the_floor(scene: &Scene) -> Chart {
    let [before, after] = errors(scene);
    let is_extended = scene.is_extended();
    let (names, errors) = if is_extended {
        (vec![BEFORE.to_owned(), AFTER.to_owned()], vec![before, after])
    } else {
        (vec!["base model".to_owned()], vec![before])
    };
    let places: Vec<f64> = (0..names.len()).map(|place| place as f64).collect();
    let series = places.iter().zip(&errors).map(|(place, error)| {
        let name = names[*place as usize].clone();
        Series::bars(name, vec![*error], vec![*place])
    });
    let floor = scene.about.found.noise_floor;
    // Without a range, Plotly would label the axis of zero-length bars from -1 to 1.
    let is_at_floor = errors.iter().all(|error| *error <= 0.0);
    let range = (is_at_floor && floor > 0.0).then_some((0.0, floor));
    let none = if is_at_floor { " No error is above it." } else { "" };
    Chart {
        title: "Error above the noise floor".into(),
        caption: format!(
            "The part of the held-out error that a better model could remove, in {}. The noise floor is {}.{none}",
            scene.unit(),
            quantity(floor, scene.unit())
        ),
        x: Axis { range, ..Axis::new(format!("RMSE above the noise floor ({})", scene.unit())) },
        y: Axis::of_names("", names.clone()),
        series: series.collect(),
    }
}
