//! Description of a file's columns: names and sample values, collected row by row.

use super::clock::is_date;
use super::clock_fault::is_step_column;
use super::column_guess::guesses;
use super::columns::is_missing_value;
use super::error::one_line;
use super::preset::Preset;
use super::row::LogRow;

/// Number of rows that are looked at.
const SURVEY_ROWS: usize = 1000;

/// Number of sample values of a column.
const SAMPLES: usize = 3;

/// Maximum length of a sample value, characters.
const SAMPLE_CHARS: usize = 20;

/// The columns of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Survey {
    /// In the order of the file.
    pub columns: Vec<ColumnSummary>,
    /// The tool that probably wrote the file.
    pub preset: Option<Preset>,
    /// What else to type, one sentence each. A front end words the settings in them ([`worded`](super::setting::worded)).
    pub notes: Vec<String>,
    /// The numbers of each column among the first rows; NaN for other cells.
    pub(super) values: Vec<Vec<f64>>,
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
    /// Pairs that may read it instead: the sizes of the values do not show its unit.
    pub alternatives: Vec<String>,
    /// True if its values may be the steps between rows.
    pub is_step: bool,
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
    /// Numbers of each column; NaN for other cells.
    values: Vec<Vec<f64>>,
    rows: usize,
}

impl ColumnSamples {
    pub fn add_row(&mut self, names: &[String], row: &impl LogRow) {
        if self.columns.is_empty() {
            let named =
                |name: &String| ColumnSummary { name: name.clone(), ..ColumnSummary::default() };
            self.columns = names.iter().map(named).collect();
            self.values = vec![Vec::new(); names.len()];
        }
        if self.rows == SURVEY_ROWS {
            return;
        }
        self.rows += 1;
        for (index, column) in self.columns.iter_mut().enumerate() {
            let text = row.text(index);
            self.values[index].push(row.number(index).unwrap_or(f64::NAN));
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

    /// Returns the columns. Without a row, they have only names. Columns without names in the file (`is_numbered`) are
    /// suggested by their values.
    pub fn finish(
        mut self,
        names: Vec<String>,
        units: Vec<String>,
        is_numbered: bool,
    ) -> (Vec<ColumnSummary>, Vec<Vec<f64>>) {
        if self.columns.is_empty() {
            let named = |name| ColumnSummary { name, ..ColumnSummary::default() };
            self.columns = names.into_iter().map(named).collect();
        }
        for (column, values) in self.columns.iter_mut().zip(&self.values) {
            column.is_step = is_step_column(values);
        }
        let guesses = if is_numbered { guesses(&self.values) } else { Vec::new() };
        for (column, guesses) in self.columns.iter_mut().zip(guesses) {
            let mut pairs = guesses.into_iter().map(|guess| format!("{}={guess}", column.name));
            column.suggestion = pairs.next();
            column.alternatives = pairs.collect();
        }
        for (column, unit) in self.columns.iter_mut().zip(units) {
            column.unit = Some(unit).filter(|unit| !unit.is_empty());
        }
        (self.columns, self.values)
    }
}
