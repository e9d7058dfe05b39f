//! Tables of numbers that can be read down a column.
//!
//! Digits are of equal width and numbers are set so that their decimal points stand under each
//! other, which makes the larger number the longer one; values with their errors, mostly of
//! different units, are set like words. Each number keeps four significant
//! digits unless told otherwise. A column of which the smallest or the largest is the best is
//! marked so in [`Table::best`]; the mark is bold type, so that it survives a black-and-white
//! printer, and a word for those who listen to the page.

use maud::{Markup, html};

use friction_identification::number::{count, significant, with_error};

/// Significant digits of a [`Cell::Number`].
const DIGITS: usize = 4;

/// What stands in one place of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A measured or computed number, shown with four significant digits.
    Number(f64),
    /// A number with this many significant digits.
    Digits(f64, usize),
    /// How many there are of something; all its digits are shown.
    Count(u64),
    /// A value and its standard error, in the same unit.
    Estimate {
        /// The value.
        value: f64,
        /// Its standard error; not a positive number when it is unknown.
        std_error: f64,
    },
    /// Nothing is known or it does not apply; shown as a dash.
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
    fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value) => significant(*value, DIGITS),
            Self::Digits(value, digits) => significant(*value, *digits),
            Self::Count(things) => count(*things),
            Self::Estimate { value, std_error } => with_error(*value, *std_error),
            Self::Empty => "–".to_owned(),
        }
    }

    /// What a comparison goes by.
    fn value(&self) -> Option<f64> {
        match *self {
            Self::Number(value) | Self::Digits(value, _) | Self::Estimate { value, .. } => {
                Some(value)
            }
            Self::Count(things) => Some(things as f64),
            Self::Text(_) | Self::Empty => None,
        }
    }
}

/// Which number of a column is to be pointed out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Best {
    /// The smallest: errors, durations.
    Smallest,
    /// The largest: gains, shares explained.
    Largest,
}

/// A table.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// What the table shows, above it.
    pub caption: String,
    /// One name per column, with the unit where the column has one.
    pub header: Vec<String>,
    /// Rows of one cell per column; missing ones are empty, surplus ones are not shown.
    pub rows: Vec<Vec<Cell>>,
    /// Columns, counted from 0, whose best number is pointed out.
    pub best: Vec<(usize, Best)>,
}

/// How a column is set.
struct Column {
    numeric: bool,
    /// The widest part from the decimal point on, in characters.
    behind_point: usize,
    /// The value to point out.
    best: Option<f64>,
}

impl Table {
    pub(super) fn render(&self) -> Markup {
        let columns: Vec<Column> = (0..self.header.len()).map(|i| self.column(i)).collect();
        html! {
            div.table { table {
                @if !self.caption.is_empty() { caption { (self.caption) } }
                thead { tr {
                    @for (name, column) in self.header.iter().zip(&columns) {
                        th.num[column.numeric] scope="col" { (name) }
                    }
                } }
                tbody {
                    @for row in &self.rows { tr {
                        @for (index, column) in columns.iter().enumerate() {
                            (column.cell(row.get(index).unwrap_or(&Cell::Empty)))
                        }
                    } }
                }
            } }
        }
    }

    /// The table as Markdown, ended by a line break; its caption above it.
    pub(crate) fn markdown(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = String>| {
            let cells: Vec<String> = cells.map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let caption = match self.caption.as_str() {
            "" => String::new(),
            caption => format!("**{caption}**\n\n"),
        };
        let rule = format!("|{}\n", "---|".repeat(self.header.len()));
        let mut text = caption + &line(&mut self.header.iter().cloned()) + &rule;
        for row in &self.rows {
            let cell = |index| row.get(index).map_or_else(|| Cell::Empty.text(), Cell::text);
            text += &line(&mut (0..self.header.len()).map(cell));
        }
        text
    }

    fn column(&self, index: usize) -> Column {
        let cells = || self.rows.iter().filter_map(|row| row.get(index));
        let values = || cells().filter_map(Cell::value).filter(|value| value.is_finite());
        let best = self.best.iter().find(|(column, _)| *column == index).map(|(_, best)| best);
        Column {
            numeric: cells().any(|cell| cell.value().is_some())
                && !cells().any(|cell| matches!(cell, Cell::Text(_) | Cell::Estimate { .. })),
            behind_point: cells()
                .map(|cell| at_point(&cell.text()).1.chars().count())
                .max()
                .unwrap_or(0),
            best: best.and_then(|best| match best {
                Best::Smallest => values().reduce(f64::min),
                Best::Largest => values().reduce(f64::max),
            }),
        }
    }
}

impl Column {
    fn cell(&self, cell: &Cell) -> Markup {
        let text = cell.text();
        let is_best = self.best.is_some() && cell.value() == self.best;
        let (before, behind) = if self.numeric { at_point(&text) } else { (text.as_str(), "") };
        html! {
            td.num[self.numeric].best[is_best] {
                (before)
                @if self.numeric && self.behind_point > 0 {
                    span.behind style={ "min-width:" (self.behind_point) "ch" } { (behind) }
                }
                @if is_best { span.unseen { " (best)" } }
            }
        }
    }
}

/// Cuts a number in front of its decimal point, or of what else follows its whole part.
fn at_point(text: &str) -> (&str, &str) {
    text.split_at(text.find(['.', ' ']).unwrap_or(text.len()))
}
