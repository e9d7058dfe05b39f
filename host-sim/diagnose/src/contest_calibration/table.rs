//! The table of a calibration, in TOML.

use super::{ContestCalibration, FIGURES, Group, GroupWeights};
use std::fmt::Write;
use thiserror::Error;
use toml_edit::{DocumentMut, Item, Value};

/// Invalid table of a calibration.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrationError {
    /// The text is not TOML.
    #[error("calibration: {0}")]
    Syntax(String),
    /// A number is missing.
    #[error("calibration: expected a number for `{0}`")]
    Missing(String),
}

impl ContestCalibration {
    /// Parses a table.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML or a number is missing.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let table: DocumentMut = text
            .parse()
            .map_err(|e: toml_edit::TomlError| CalibrationError::Syntax(e.to_string()))?;
        let name = table.get("name").and_then(Item::as_str).unwrap_or("calibration");
        let offsets = table.get("offsets").and_then(Item::as_table);
        let offset = |(name, item): (&str, &Item)| {
            Ok((name.to_owned(), number(Some(item), &format!("offsets.{name}"))?))
        };
        let offsets = offsets.into_iter().flat_map(|own| own.iter()).map(offset);
        let steps = table.get("steps").and_then(Item::as_array);
        let pair = |value: &Value| {
            let pair = value.as_array()?;
            Some((pair.get(0)?.as_float()?, pair.get(1)?.as_float()?))
        };
        let steps: Option<Vec<(f64, f64)>> =
            steps.into_iter().flat_map(toml_edit::Array::iter).map(pair).collect();
        Ok(Self {
            name: name.to_owned(),
            groups: Group::ALL
                .iter()
                .map(|group| group_weights(&table, *group))
                .collect::<Result<_, _>>()?,
            offsets: offsets.collect::<Result<_, _>>()?,
            steps: steps.ok_or_else(|| CalibrationError::Missing("steps".into()))?,
        })
    }

    /// Emits the table.
    pub fn emit(&self) -> String {
        let steps: Vec<String> =
            self.steps.iter().map(|(odds, p)| format!("[{odds:.4}, {p:.4}]")).collect();
        let mut text = format!(
            "# Weights of the evidence for a cause. Made by\n#   cargo run --release -p friction-grading --example calibrate_contest\n\n\
             name = \"{}\"\nsteps = [{}]\n\n[offsets]\n",
            self.name,
            steps.join(", ")
        );
        for (cause, offset) in &self.offsets {
            let _ = writeln!(text, "{cause} = {offset:.4}");
        }
        for (group, own) in Group::ALL.iter().zip(&self.groups) {
            let _ = write!(text, "\n[{}]\nintercept = {:.4}\n", group.name(), own.intercept);
            for (figure, weight) in FIGURES.iter().zip(&own.weights) {
                let _ = writeln!(text, "{} = {weight:.4}", figure.name);
            }
        }
        text
    }
}

fn group_weights(table: &DocumentMut, group: Group) -> Result<GroupWeights, CalibrationError> {
    let name = group.name();
    let own = table.get(name).ok_or_else(|| CalibrationError::Missing(name.to_owned()))?;
    let read = |key: &str| number(own.get(key), &format!("{name}.{key}"));
    let weights = FIGURES.iter().map(|figure| read(figure.name));
    Ok(GroupWeights { intercept: read("intercept")?, weights: weights.collect::<Result<_, _>>()? })
}

fn number(item: Option<&Item>, name: &str) -> Result<f64, CalibrationError> {
    let value = item.and_then(|item| item.as_float().or(item.as_integer().map(|i| i as f64)));
    value.ok_or_else(|| CalibrationError::Missing(name.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_emitted_table_returns_the_same_calibration() {
        let group = |at: usize| GroupWeights {
            intercept: -1.5 + at as f64,
            weights: (0..FIGURES.len()).map(|figure| 0.25 * (figure + at) as f64).collect(),
        };
        let own = ContestCalibration {
            name: "test".into(),
            groups: (0..Group::ALL.len()).map(group).collect(),
            offsets: vec![("backlash".into(), -0.5)],
            steps: vec![(-2.0, 0.125), (1.5, 0.875)],
        };
        assert_eq!(ContestCalibration::parse(&own.emit()), Ok(own));
    }

    #[test]
    fn parse_of_table_without_a_weight_names_it() {
        let text = "steps = []\n[covariate]\nintercept = 0.0\n";
        let missing = CalibrationError::Missing(format!("covariate.{}", FIGURES[0].name));
        assert_eq!(ContestCalibration::parse(text), Err(missing));
    }
}
