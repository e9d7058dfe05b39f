//! The first screen: cause, size, gain and what to do next, and how much of what could be explained is.
//!
//! What counts is the error above the floor. Noise that no model can predict is most of the error of a good log, and a
//! right diagnosis moves the whole of it by a percent; of what lies above the noise it takes nearly all. Errors add up
//! as squares, so the part above the floor is `sqrt(rmse^2 - floor^2)`.

use super::Scene;
use super::figures::{AFTER, BEFORE};
use crate::report::{Axis, Chart, Series};
use crate::results::page::words::quantity;
use compensator_core::Quantity;
use friction_identification::diagnose::story::above_floor;
use friction_identification::diagnose::{Finding, story};
use friction_identification::number::significant;

/// Name and text of each fact.
pub(super) fn facts(scene: &Scene) -> Vec<(String, String)> {
    let found = scene.about.found;
    let mut facts: Vec<(&str, String)> = Vec::new();
    match found.findings.split_first() {
        None => facts.push(("Cause", "None is named: nothing that was tried passed.".into())),
        Some((first, others)) => {
            facts.push(("Cause", cause(first)));
            facts.push(("Size", size(scene, first)));
            if !others.is_empty() {
                let names: Vec<String> = others.iter().map(cause).collect();
                facts.push(("Besides", names.join("; ")));
            }
        }
    }
    let [before, after] = errors(scene);
    let unit = scene.unit();
    let gain = if !scene.is_extended() {
        format!("No extension is offered. {} is left above the floor.", quantity(before, unit))
    } else if before > 0.0 {
        format!(
            "{} of {} of error that is no noise goes ({}\u{a0}%); with the noise the error falls by {}\u{a0}% (95\u{a0}% interval {} to {}\u{a0}%)",
            quantity(before - after, unit),
            quantity(before, unit),
            significant(100.0 * (1.0 - after / before), 2),
            significant(100.0 * found.gain.value, 2),
            significant(100.0 * found.gain.ci95[0], 2),
            significant(100.0 * found.gain.ci95[1], 2)
        )
    } else {
        "The error is at the floor already.".into()
    };
    facts.push(("Gain, on rows no fit has seen", gain));
    if scene.is_extended() {
        let how = format!(
            "Load params.toml, the model {}, into the driver (host-sim params set params.toml --bus can0) or take it \
             to another program (host-sim export params.toml --to c).",
            found.extended.spec
        );
        facts.push(("What to do", how));
    }
    facts.push(("What to measure next", story::next_experiment(found)));
    facts.into_iter().map(|(name, text)| (name.to_owned(), text)).collect()
}

/// What a finding means, and what it is called.
fn cause(finding: &Finding) -> String {
    format!("{} ({})", finding.cause.meaning(), finding.cause.name())
}

/// How large it is, as somebody with the joint in hand thinks of it: what it comes to over the log's own range.
fn size(scene: &Scene, finding: &Finding) -> String {
    let size = &finding.size;
    let unit = scene.unit();
    if size.unit == "1" {
        let [value, low, high] =
            [size.value, size.ci95[0], size.ci95[1]].map(|share| significant(100.0 * share, 3));
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
    // What a gauge says.
    let (shown, scale) = if per == "Pa" { ("bar", 1e-5) } else { (per, 1.0) };
    format!(
        "{}\u{a0}{unit} (95\u{a0}% interval {} to {}) from the lowest to the highest {} of this log, {} to \
         {}\u{a0}{shown}",
        over(size.value),
        over(size.ci95[0]),
        over(size.ci95[1]),
        label.unwrap_or(column),
        significant(scale * least, 3),
        significant(scale * most, 3),
    )
}

/// Least and most of a column.
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

/// Errors above the floor: of the base model and of the extended one.
fn errors(scene: &Scene) -> [f64; 2] {
    let found = scene.about.found;
    [&found.before, &found.after].map(|model| above_floor(model.metrics.rmse, found.noise_floor))
}

/// The picture: what could be explained, before and after.
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
    // Of bars that are not there Plotly would number the axis from -1 to 1.
    let is_at_floor = errors.iter().all(|error| *error <= 0.0);
    let range = (is_at_floor && floor > 0.0).then_some((0.0, floor));
    let none = if is_at_floor { " No error stands above it." } else { "" };
    Chart {
        title: "Error above the floor".into(),
        caption: format!(
            "On rows no fit has seen, in {}: the part of the error that a better model could take away. The floor, {}, is noise.{none}",
            scene.unit(),
            quantity(floor, scene.unit())
        ),
        x: Axis { range, ..Axis::new(format!("RMSE above the floor ({})", scene.unit())) },
        y: Axis::of_names("", names.clone()),
        series: series.collect(),
    }
}
