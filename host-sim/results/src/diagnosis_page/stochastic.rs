//! The section of the stochastic extension.
//!
//! It uses the values of `diagnosis.json`, so that page and file always agree. The coefficient of variation states how far
//! a parameter may vary before the model leaves the range of the data. It is small if the data determine the parameter and
//! large if they hardly depend on it. Missing values are left out.

use super::figures::{AFTER, BEFORE};
use crate::report::{Axis, Block, Cell, Chart, Series, Table};
use joint_log::number::significant;
use serde_json::{Map, Value};
use stochastic_extension::MAX_CV;

/// Returns the section for the base model and the extended model; empty if neither has a certified parameter.
pub fn stochastic_section(before: &Value, after: &Value, reading: Option<&str>) -> Vec<Block> {
    let names = names(before, after);
    if names.is_empty() {
        return Vec::new();
    }
    let mut blocks =
        vec![Block::Heading("Stochastic extension".into()), Block::Paragraph(introduction(before))];
    blocks.extend(reading.map(|text| Block::Paragraph(text.into())));
    let made: Vec<(&str, &Value)> = [(BEFORE, before), (AFTER, after)]
        .into_iter()
        .filter(|(_, certificate)| cv(certificate).is_some_and(|cv| !cv.is_empty()))
        .collect();
    blocks.push(chart(&made, &names).into());
    blocks.push(sums(&made, &names).into());
    let kinds = [
        ("Each parameter varied alone", "cv_by_class"),
        ("All parameters varied together", "cv_together_by_class"),
    ];
    let classes = made.iter().flat_map(|(label, certificate)| {
        kinds.map(|(kind, key)| by_class(format!("{kind}, {label}"), certificate, key))
    });
    let classes: Vec<Block> = classes.flatten().map(Block::Table).collect();
    if !classes.is_empty() {
        blocks.push(Block::details("By speed class", classes));
    }
    blocks
}

fn cv(certificate: &Value) -> Option<&Map<String, Value>> {
    certificate.get("cv")?.as_object()
}

fn names(before: &Value, after: &Value) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in [before, after].into_iter().filter_map(cv).flat_map(Map::keys) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    names
}

fn number(value: Option<&Value>) -> Option<f64> {
    value.and_then(Value::as_f64).filter(|value| value.is_finite())
}

fn introduction(certificate: &Value) -> String {
    let mut text = format!(
        "This section shows how far each parameter may vary, with the others constant, before the model leaves the measured \
         range. The coefficient of variation is the permitted standard deviation divided by the mean. The search ends at {}; \
         a parameter that reaches this value is not determined by the data. A large value means that the data hardly depend \
         on the parameter.",
        significant(MAX_CV, 1)
    );
    let level = |name: &str| number(certificate.get("levels").and_then(|levels| levels.get(name)));
    if let (Some(alpha), Some(rho)) = (level("alpha"), level("rho")) {
        text += &format!(
            " A variation is permitted if the model is outside the range of the data for at most {} % of the time, for {} % of \
             the sampled parameter sets.",
            significant(100.0 * rho, 2),
            significant(100.0 * (1.0 - alpha), 2)
        );
    }
    text
}

fn chart(made: &[(&str, &Value)], names: &[String]) -> Chart {
    let points = |(label, certificate): &(&str, &Value)| {
        let of = |name: &String| number(cv(certificate).and_then(|cv| cv.get(name)));
        let known = names.iter().enumerate().filter_map(|(at, name)| Some((of(name)?, at as f64)));
        let (x, y) = known.unzip();
        Series::bars(*label, x, y)
    };
    Chart {
        title: "Permitted variation of each parameter".into(),
        caption: "A shorter bar means that the data determine the parameter more closely. A change from before to after means \
                  that the missing cause affected the parameter."
            .into(),
        x: Axis::new("coefficient of variation"),
        y: Axis::of_names("", names.iter().cloned()),
        series: made.iter().map(points).collect(),
    }
}

fn sums(made: &[(&str, &Value)], names: &[String]) -> Table {
    let digits =
        |value: Option<f64>| value.map_or(Cell::Empty, |value| Cell::ShortNumber(value, 3));
    let row = |name: &String| {
        let cell = |(_, certificate): &(&str, &Value)| {
            digits(number(cv(certificate).and_then(|cv| cv.get(name))))
        };
        std::iter::once(name.as_str().into()).chain(made.iter().map(cell)).collect()
    };
    let mut rows: Vec<Vec<Cell>> = names.iter().map(row).collect();
    let sum = |(_, certificate): &(&str, &Value)| digits(number(certificate.get("sum_cv")));
    rows.push(std::iter::once("sum".into()).chain(made.iter().map(sum)).collect());
    let labels = made.iter().map(|(label, _)| *label);
    Table {
        caption: "Permitted coefficient of variation, mean over the speed classes".into(),
        header: std::iter::once("parameter").chain(labels).map(str::to_owned).collect(),
        rows,
        best: Vec::new(),
    }
}

fn by_class(caption: String, certificate: &Value, key: &str) -> Option<Table> {
    let classes = certificate.get("classes")?.as_array()?;
    let by_class = certificate.get(key)?.as_object()?;
    let mut header = vec!["parameter".to_owned()];
    header.extend(classes.iter().map(|class| class.as_str().unwrap_or_default().to_owned()));
    let cells = |values: &Value| {
        let cell =
            |value: &Value| number(Some(value)).map_or(Cell::Empty, |cv| Cell::ShortNumber(cv, 3));
        values.as_array().into_iter().flatten().map(cell).collect::<Vec<_>>()
    };
    let row = |(name, values): (&String, &Value)| {
        std::iter::once(name.as_str().into()).chain(cells(values)).collect()
    };
    let rows: Vec<Vec<Cell>> = by_class.iter().map(row).collect();
    (!rows.is_empty()).then(|| Table { caption, header, rows, best: Vec::new() })
}
