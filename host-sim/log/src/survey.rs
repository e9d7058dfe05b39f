//! Description of a file's columns: sample values, and the quantity that each may hold.
//!
//! It answers `--columns help`, and names the likely columns in the error for a file with many columns.

use super::clock::is_date;
use super::column_names::ColumnNames;
use super::columns::is_missing_value;
use super::error::{DataError, listed, one_line};
use super::options::ReadOptions;
use super::other_unit::other_unit;
use super::preset::Preset;
use super::row::LogRow;
use super::source::read_file;
use super::{guess, unit};
use crate::setting::{Setting, shell_word};
use std::path::Path;

/// Number of rows that are looked at.
const SURVEY_ROWS: usize = 1000;

/// Number of sample values of a column.
const SAMPLES: usize = 3;

/// Maximum length of a sample value, characters.
const SAMPLE_CHARS: usize = 20;

/// Number of columns above which an error names only the likely ones. It is the number that a list shows.
const MANY_COLUMNS: usize = 30;

/// Number of likely columns that an error names for each quantity.
const LIKELY_COLUMNS: usize = 5;

/// The quantities that a log must have, as contract names.
const REQUIRED: [&str; 3] = ["time_s", "velocity_rad_s", "torque_nm"];

/// The columns of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Survey {
    /// In the order of the file.
    pub columns: Vec<ColumnSummary>,
    /// The tool that probably wrote the file.
    pub preset: Option<Preset>,
}

/// A column of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColumnSummary {
    /// Its name in the file.
    pub name: String,
    /// The first distinct values, as text.
    pub samples: Vec<String>,
    /// Number of numeric cells among the first thousand rows.
    pub numbers: usize,
    /// Number of cells with other text among these rows.
    pub texts: usize,
    /// True if the first of these texts is a date or time.
    pub is_date: bool,
    /// The unit at the end of its name, or the one that the file states.
    pub unit: Option<String>,
    /// The pair of `--columns` that may read it.
    pub suggestion: Option<String>,
}

impl ColumnSummary {
    /// Returns true if most of the cells with a value are numbers.
    pub fn is_numeric(&self) -> bool {
        self.numbers > self.texts
    }
}

/// Sample values of all columns, collected row by row.
#[derive(Debug, Default)]
pub(super) struct ColumnSamples {
    columns: Vec<ColumnSummary>,
    rows: usize,
}

impl ColumnSamples {
    pub fn add_row(&mut self, names: &[String], row: &impl LogRow) {
        if self.columns.is_empty() {
            let named =
                |name: &String| ColumnSummary { name: name.clone(), ..ColumnSummary::default() };
            self.columns = names.iter().map(named).collect();
        }
        if self.rows == SURVEY_ROWS {
            return;
        }
        self.rows += 1;
        for (index, column) in self.columns.iter_mut().enumerate() {
            let text = row.text(index);
            if is_missing_value(&text) {
                continue;
            }
            match row.number(index) {
                Some(_) => column.numbers += 1,
                None => {
                    column.is_date |= column.texts == 0 && is_date(&text);
                    column.texts += 1;
                }
            }
            if column.samples.len() < SAMPLES {
                let text: String =
                    String::from_utf8_lossy(&text).chars().take(SAMPLE_CHARS).collect();
                let text = one_line(&text);
                if !column.samples.contains(&text) {
                    column.samples.push(text);
                }
            }
        }
    }

    /// Returns the columns. Without a row, they have only names.
    pub fn finish(mut self, names: Vec<String>, units: Vec<String>) -> Vec<ColumnSummary> {
        if self.columns.is_empty() {
            let named = |name| ColumnSummary { name, ..ColumnSummary::default() };
            self.columns = names.into_iter().map(named).collect();
        }
        for (column, unit) in self.columns.iter_mut().zip(units) {
            column.unit = Some(unit).filter(|unit| !unit.is_empty());
        }
        self.columns
    }
}

/// Describes the columns of a file, with the quantity that each numeric column may hold by its name.
///
/// # Errors
/// If the file cannot be read as a table.
pub fn survey(file: &Path, options: &ReadOptions) -> Result<Survey, DataError> {
    let size =
        std::fs::metadata(file).map_err(|source| DataError::Io { file: file.into(), source })?;
    if size.is_dir() {
        return Err(DataError::File {
            file: file.into(),
            found: "a directory".into(),
            expected: "a CSV or Parquet file".into(),
        });
    }
    let options = ReadOptions { is_survey: true, ..options.clone() };
    let mut survey = read_file(file, size.len(), &options, &|_| {})?.survey;
    let is_time = |name: &str| guess::quantity(name) == Some("time_s");
    let times = survey.columns.iter().filter(|column| is_time(&column.name)).count();
    for column in &mut survey.columns {
        let is_torque = times > 1 && column.name == guess::TORQUE_SYMBOL;
        let quantity = if is_torque { Some("torque_nm") } else { guess::quantity(&column.name) };
        let of_file = column.unit.take();
        let stated = quantity
            .and_then(|quantity| unit::stated(quantity, &column.name))
            .or_else(|| guess::any_unit(&column.name));
        column.unit = stated.map(str::to_owned).or(of_file.clone());
        let is_own = quantity == Some(&*column.name);
        if let Some(quantity) = quantity.filter(|_| {
            (column.is_numeric() || quantity == Some("time_s") && column.is_date) && !is_own
        }) {
            let fitting = of_file.filter(|unit| unit::conversion(quantity, unit).is_ok());
            let unit = unit::in_name(quantity, &column.name).map(str::to_owned).or(fitting);
            let other = || other_unit(&column.name).map(|other| other.suggestion().to_owned());
            let unit = unit.or_else(other);
            let unit = unit.map(|unit| format!(":{unit}"));
            let pair = format!("{quantity}={}{}", column.name, unit.unwrap_or_default());
            column.suggestion = Some(shell_word(&pair));
        }
    }
    suggest_preset(file, &options, &mut survey);
    Ok(survey)
}

/// Replaces suggestions by those of the preset that the names suggest: it knows the units.
fn suggest_preset(file: &Path, options: &ReadOptions, survey: &mut Survey) {
    let Survey { columns, preset } = survey;
    let names = ColumnNames {
        names: columns.iter().map(|column| column.name.clone()).collect(),
        units: columns.iter().map(|column| column.unit.clone().unwrap_or_default()).collect(),
        is_twincat_scope: *preset == Some(Preset::TwinCatScope),
    };
    let found = preset.and_then(|preset| preset.columns(file, &names, options).ok());
    for (ours, theirs) in found.into_iter().flat_map(|found| found.pairs) {
        let is_it = |name: &str| {
            theirs.strip_prefix(name).is_some_and(|unit| unit.is_empty() || unit.starts_with(':'))
        };
        if let Some(column) = columns.iter_mut().find(|column| is_it(&column.name)) {
            column.suggestion = Some(shell_word(&format!("{ours}={theirs}")));
        }
    }
}

/// Replaces the list of all columns in an error by the likely ones, if there are many.
pub(super) fn with_likely_columns(error: DataError, options: &ReadOptions) -> DataError {
    let DataError::MissingColumns { file, mut found, mut expected, missing, count } = error else {
        return error;
    };
    if count > MANY_COLUMNS
        && let Ok(Survey { columns, .. }) = survey(&file, options)
    {
        let likely: Vec<&str> = REQUIRED
            .iter()
            .filter(|wanted| missing.iter().any(|of| guess::is_same_quantity(of, wanted)))
            .flat_map(|wanted| likely(wanted, &columns))
            .collect();
        found = match likely.is_empty() {
            true => format!("{count} columns and none with a usual name"),
            false => format!("{count} columns, likely {}", listed(&likely)),
        };
        expected += &format!("; {} lists all", Setting::Columns.given("help"));
    }
    DataError::MissingColumns { file, found, expected, missing, count }
}

/// Returns the names of the numeric columns that probably hold a quantity, the most probable first.
fn likely<'a>(contract_name: &str, columns: &'a [ColumnSummary]) -> Vec<&'a str> {
    let scored = columns.iter().filter(|column| column.is_numeric());
    let scored = scored.map(|column| (guess::score(contract_name, &column.name), &*column.name));
    let mut scored: Vec<(u32, &str)> = scored.filter(|(score, _)| *score > 0).collect();
    scored.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    scored.into_iter().take(LIKELY_COLUMNS).map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn likely_with_many_columns_prefers_measured_numbers() {
        let column = |name: &str, numbers| ColumnSummary {
            name: name.into(),
            numbers,
            texts: 10,
            ..ColumnSummary::default()
        };
        let columns = [
            column("/arm/cmd/velocity_des", 100),
            column("/arm/state/velocity", 100),
            column("/arm/state/velocity_mode", 0),
            column("/camera/exposure", 100),
            column("/drive/ActVelo", 100),
        ];
        let expected = ["/arm/state/velocity", "/drive/ActVelo", "/arm/cmd/velocity_des"];
        assert_eq!(likely("velocity_rad_s", &columns), expected);
    }
}
