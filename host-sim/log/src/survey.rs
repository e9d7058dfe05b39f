//! Description of a file's columns: names and sample values.

use super::clock::is_date;
use super::clock_fault::is_step_column;
use super::column_pair::ColumnPair;
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
    /// Notes for the user, one sentence each. A front end words the settings in them ([`worded`](super::setting::worded)).
    pub notes: Vec<String>,
    /// True if suggestions have units by the sizes of the values.
    pub has_units_by_size: bool,
}

/// A column of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColumnSummary {
    /// Its name in the file.
    pub name: String,
    /// The first distinct values, as text.
    pub samples: Vec<String>,
    /// Number of numeric cells among the first [`SURVEY_ROWS`] rows.
    pub numbers: usize,
    /// Number of cells with other text among these rows.
    pub texts: usize,
    /// True if the first of these texts is a date or time.
    pub is_date: bool,
    /// The unit at the end of its name, or the one that the file states.
    pub unit: Option<String>,
    /// The pair that may read it.
    pub suggestion: Option<ColumnPair>,
    /// Pairs that may read it instead: the sizes of the values do not show its unit.
    pub alternatives: Vec<ColumnPair>,
    /// True if its values may be the steps between rows.
    pub is_step: bool,
}

impl ColumnSummary {
    /// Returns true if most of the cells with a value are numbers.
    pub fn is_numeric(&self) -> bool {
        self.numbers > self.texts
    }
}

/// A column with the values by which its quantity is guessed.
pub(super) struct SurveyedColumn {
    pub summary: ColumnSummary,
    /// The numbers among the first rows; NaN for other cells.
    pub values: Vec<f64>,
}

/// Describes the columns of a table by its first rows.
pub(super) fn surveyed_columns(table: &LogTable) -> Vec<SurveyedColumn> {
    let names = &table.plan.names;
    let rows = table.lines.len().min(SURVEY_ROWS);
    let column = |(index, name): (usize, &String)| {
        let cells = &table.columns[index];
        let values: Vec<f64> = (0..rows).map(|row| cells.number(row).unwrap_or(f64::NAN)).collect();
        let mut summary = summary(name, cells, rows);
        summary.is_step = is_step_column(&values);
        summary.unit = names.units.get(index).filter(|unit| !unit.is_empty()).cloned();
        SurveyedColumn { summary, values }
    };
    names.names.iter().enumerate().map(column).collect()
}

/// Summarises the first `rows` cells of a column.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_of_cells_returns_samples_counts_and_date() {
        let long = "twenty characters are shown";
        let summarised = |cells: &[&str]| {
            let cells = Cells::Texts(cells.iter().map(|cell| (*cell).to_owned()).collect());
            let column = summary("column", &cells, cells.len());
            (column.samples.join("|"), column.numbers, column.texts, column.is_date)
        };
        for (cells, samples, numbers, texts, is_date) in [
            (&["1", "1", "2", "1", "3", "4"][..], "1|2|3", 6, 0, false),
            (&["", "nan", "5", "-"], "5", 1, 0, false),
            (&[long, long, "on"], "twenty characters ar|on", 0, 3, false),
            (&["2026-11-25 10:00:00", "on", "1"], "2026-11-25 10:00:00|on|1", 1, 2, true),
            (&["on", "2026-11-25 10:00:00"], "on|2026-11-25 10:00:00", 0, 2, false),
            (&["1", "2026-11-25 10:00:00"], "1|2026-11-25 10:00:00", 1, 1, true),
            (&[], "", 0, 0, false),
        ] {
            let expected = (samples.to_owned(), numbers, texts, is_date);
            assert_eq!(summarised(cells), expected, "{cells:?}");
        }
        let cells = Cells::Numbers(vec![1.0, 2.0, 3.0]);
        assert_eq!(summary("column", &cells, 2).samples, ["1", "2"], "of the first rows only");
    }
}
