//! Description of a file's columns: names and sample values.

use super::clock::is_date;
use super::clock_fault::is_step_column;
use super::column_guess::guesses;
use super::columns::is_missing_value;
use super::error::one_line;
use super::log_table::LogTable;
use super::plan::SURVEY_ROWS;
use super::preset::Preset;
use super::table::Cells;

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

/// Describes the columns of a table by its first rows. Columns without names in the file are suggested by their values.
pub(super) fn survey(table: &LogTable) -> Survey {
    let names = &table.plan.names;
    let rows = table.lines.len().min(SURVEY_ROWS);
    let mut survey = Survey { preset: Preset::recognise(names), ..Survey::default() };
    for (at, (name, cells)) in names.names.iter().zip(&table.columns).enumerate() {
        let values: Vec<f64> = (0..rows).map(|row| cells.number(row).unwrap_or(f64::NAN)).collect();
        let mut column = summary(name, cells, rows);
        column.is_step = is_step_column(&values);
        column.unit = names.units.get(at).filter(|unit| !unit.is_empty()).cloned();
        survey.columns.push(column);
        survey.values.push(values);
    }
    let guesses = if names.is_numbered { guesses(&survey.values) } else { Vec::new() };
    for (column, guesses) in survey.columns.iter_mut().zip(guesses) {
        let mut pairs = guesses.into_iter().map(|guess| format!("{}={guess}", column.name));
        column.suggestion = pairs.next();
        column.alternatives = pairs.collect();
    }
    survey
}

/// Returns the sample values of a column.
fn summary(name: &str, cells: &Cells, rows: usize) -> ColumnSummary {
    let mut column = ColumnSummary { name: name.to_owned(), ..ColumnSummary::default() };
    for row in 0..rows {
        let text = cells.text(row);
        if is_missing_value(&text) {
            continue;
        }
        match cells.number(row) {
            Some(_) => column.numbers += 1,
            None => {
                column.is_date |= column.texts == 0 && is_date(&text);
                column.texts += 1;
            }
        }
        if column.samples.len() < SAMPLES {
            let text: String = String::from_utf8_lossy(&text).chars().take(SAMPLE_CHARS).collect();
            let text = one_line(&text);
            if !column.samples.contains(&text) {
                column.samples.push(text);
            }
        }
    }
    column
}
