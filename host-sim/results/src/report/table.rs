//! Tables of numbers.
//!
//! Numbers in a column are aligned at their decimal points. Values with standard errors mostly have different units and
//! are aligned like text. Numbers have four significant digits by default. [`Table::best`] marks the smallest
//! number of a column: in bold type, which also prints in black and white, and with a word for screen readers.

use maud::{Markup, html};

use joint_log::number::{count, significant, with_error};

/// Classes of a table whose rows are paragraphs on narrow screens.
pub(super) const RECORDS: &str = "table records";

/// Significant digits of a [`Cell::Number`].
const DIGITS: usize = 4;

/// Content of a table cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text.
    Text(String),
    /// A number, shown with four significant digits.
    Number(f64),
    /// A number with this many significant digits.
    ShortNumber(f64, usize),
    /// A count, shown with all digits.
    Count(u64),
    /// A value and its standard error, in the same unit.
    Estimate {
        /// The value.
        value: f64,
        /// The standard error; NaN or not positive if unknown.
        std_error: f64,
    },
    /// A text that links to another file beside the page.
    Link {
        /// The text.
        text: String,
        /// Relative path of the file.
        target: String,
    },
    /// Unknown or not applicable; shown as a dash.
    Empty,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<Option<f64>> for Cell {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::Empty, Self::Number)
    }
}

impl Cell {
    /// Returns the text of the cell.
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) | Self::Link { text, .. } => text.clone(),
            Self::Number(value) => significant(*value, DIGITS),
            Self::ShortNumber(value, digits) => significant(*value, *digits),
            Self::Count(things) => count(*things),
            Self::Estimate { value, std_error } => with_error(*value, *std_error),
            Self::Empty => "–".to_owned(),
        }
    }

    /// Returns the number for comparisons; `None` for text and empty cells.
    fn value(&self) -> Option<f64> {
        match *self {
            Self::Number(value) | Self::ShortNumber(value, _) | Self::Estimate { value, .. } => {
                Some(value)
            }
            Self::Count(things) => Some(things as f64),
            Self::Text(_) | Self::Link { .. } | Self::Empty => None,
        }
    }
}

/// A table.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Caption above the table.
    pub caption: String,
    /// Name of each column, with its unit.
    pub header: Vec<String>,
    /// Rows with one cell for each column; missing cells are empty, surplus cells are not shown.
    pub rows: Vec<Vec<Cell>>,
    /// Columns, counted from 0, whose smallest number is marked: errors, durations.
    pub best: Vec<usize>,
}

/// Layout of a table column.
struct ColumnLayout {
    numeric: bool,
    /// Width of the widest part from the decimal point on, in characters.
    behind_point: usize,
    /// The number to mark.
    best: Option<f64>,
}

impl Table {
    /// Creates a table without marked numbers. In `header`, `|` separates the names of the columns.
    pub fn new(
        caption: impl Into<String>,
        header: &str,
        rows: impl IntoIterator<Item = Vec<Cell>>,
    ) -> Self {
        let header = header.split('|').map(str::to_owned).collect();
        Self { caption: caption.into(), header, rows: rows.into_iter().collect(), best: Vec::new() }
    }

    pub(super) fn render(&self) -> Markup {
        self.render_as("table", &vec![None; self.header.len()])
    }

    /// Renders the table as [`super::page::Block::Records`]: each cell has the name of its column for the style sheet.
    pub(super) fn render_records(&self) -> Markup {
        let labels: Vec<Option<&str>> =
            self.header.iter().map(|name| Some(name.as_str())).collect();
        self.render_as(RECORDS, &labels)
    }

    fn render_as(&self, classes: &str, labels: &[Option<&str>]) -> Markup {
        let columns: Vec<ColumnLayout> = (0..self.header.len()).map(|i| self.column(i)).collect();
        html! {
            div class=(classes) { table {
                @if !self.caption.is_empty() { caption { (self.caption) } }
                thead { tr {
                    @for (name, column) in self.header.iter().zip(&columns) {
                        th.num[column.numeric] scope="col" { (name) }
                    }
                } }
                tbody {
                    @for row in &self.rows { tr {
                        @for (index, (column, name)) in columns.iter().zip(labels).enumerate() {
                            (column.cell(row.get(index).unwrap_or(&Cell::Empty), *name))
                        }
                    } }
                }
            } }
        }
    }

    fn column(&self, index: usize) -> ColumnLayout {
        let cells = || self.rows.iter().filter_map(|row| row.get(index));
        let values = || cells().filter_map(Cell::value).filter(|value| value.is_finite());
        ColumnLayout {
            numeric: cells().any(|cell| cell.value().is_some())
                && !cells().any(|cell| {
                    matches!(cell, Cell::Text(_) | Cell::Link { .. } | Cell::Estimate { .. })
                }),
            behind_point: cells()
                .map(|cell| at_point(&cell.text()).1.chars().count())
                .max()
                .unwrap_or(0),
            best: values().reduce(f64::min).filter(|_| self.best.contains(&index)),
        }
    }
}

impl ColumnLayout {
    fn cell(&self, cell: &Cell, label: Option<&str>) -> Markup {
        let text = cell.text();
        let is_best = self.best.is_some() && cell.value() == self.best;
        let (before, behind) = if self.numeric { at_point(&text) } else { (text.as_str(), "") };
        html! {
            td.num[self.numeric].best[is_best] data-label=[label] {
                @if let Cell::Link { target, .. } = cell { a href=(target) { (before) } }
                @else { (before) }
                @if self.numeric && self.behind_point > 0 {
                    span.behind style={ "min-width:" (self.behind_point) "ch" } { (behind) }
                }
                @if is_best { span.unseen { " (best)" } }
            }
        }
    }
}

/// Splits a number before its decimal point, or after its integer part.
fn at_point(text: &str) -> (&str, &str) {
    text.split_at(text.find(['.', ' ']).unwrap_or(text.len()))
}
