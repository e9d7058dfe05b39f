//! The table of a calibration, in TOML.

use super::trees::Tree;
use super::{CalibrationError, ContestCalibration};
use toml_edit::{Array, DocumentMut, Item, Value};

impl ContestCalibration {
    /// Parses a table.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML, a key is missing or a tree is wrong.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let table: DocumentMut = text
            .parse()
            .map_err(|e: toml_edit::TomlError| CalibrationError::Syntax(e.to_string()))?;
        let missing = |key: &str| CalibrationError::Missing(key.to_owned());
        let list = |key: &str| table.get(key).and_then(Item::as_array).ok_or_else(|| missing(key));
        let pair = |value: &Value| {
            let pair = value.as_array()?;
            Some((pair.get(0)?.as_float()?, pair.get(1)?.as_float()?))
        };
        let steps: Option<Vec<(f64, f64)>> = list("steps")?.iter().map(pair).collect();
        let tree = |value: &Value| Tree::parse(value.as_str().ok_or_else(|| missing("trees"))?);
        Ok(Self {
            start: table.get("start").and_then(Item::as_float).ok_or_else(|| missing("start"))?,
            trees: Array::iter(list("trees")?).map(tree).collect::<Result<_, _>>()?,
            steps: steps.ok_or_else(|| missing("steps"))?,
            name: table
                .get("name")
                .and_then(Item::as_str)
                .ok_or_else(|| missing("name"))?
                .to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_table_without_trees_names_them() {
        let missing = CalibrationError::Missing("trees".into());
        assert_eq!(ContestCalibration::parse("start = 0.0\nsteps = []\n"), Err(missing));
    }

    #[test]
    fn parse_of_table_without_name_names_it() {
        let missing = CalibrationError::Missing("name".into());
        let text = "start = 0.0\nsteps = []\ntrees = []\n";
        assert_eq!(ContestCalibration::parse(text), Err(missing));
    }
}
