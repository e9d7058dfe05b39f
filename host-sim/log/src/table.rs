//! Tables as named columns of cells: data frames, and what each format is read to (`log_table`).

use super::date::format_stamp;
use super::mixed_cells::MixedCells;
use std::borrow::Cow;

/// The cells of a column, one for each row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Numbers; NaN is a missing value.
    Numbers(Vec<f64>),
    /// Whole numbers, of which an `f64` would lose digits above 2^53, such as stamps in nanoseconds.
    Integers(Vec<Option<i64>>),
    /// Texts; an empty text is a missing value.
    Texts(Vec<String>),
    /// Points in time, ns since 1970 (UTC).
    Stamps(Vec<Option<i64>>),
    /// Numbers and texts, as in a file of text.
    Mixed(MixedCells),
    /// Cells of a type that is no measurement.
    Unreadable {
        /// Number of rows.
        rows: usize,
        /// The type, as the end of "it is ..", for example "a list".
        kind: String,
    },
}

impl Cells {
    /// The cells of a file's column that is not needed.
    pub(super) const NOT_READ: Self = Self::Unreadable { rows: 0, kind: String::new() };

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Integers(cells) | Self::Stamps(cells) => cells.len(),
            Self::Texts(cells) => cells.len(),
            Self::Mixed(cells) => cells.len(),
            Self::Unreadable { rows, .. } => *rows,
        }
    }

    /// Returns true if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds the cells of the next rows of the same column.
    #[cfg(any(feature = "arrow", feature = "parquet"))]
    pub(super) fn append(&mut self, next: Self) {
        match (self, next) {
            (Self::Numbers(cells), Self::Numbers(next)) => cells.extend(next),
            (Self::Texts(cells), Self::Texts(next)) => cells.extend(next),
            (Self::Integers(cells), Self::Integers(next))
            | (Self::Stamps(cells), Self::Stamps(next)) => cells.extend(next),
            (cells @ Self::Unreadable { rows: 0, .. }, next) => *cells = next,
            (cells, next) => unreachable!("{next:?} after {cells:?} of the same column"),
        }
    }

    /// Returns a cell as text; empty if there is none.
    pub fn text_of(&self, row: usize) -> String {
        String::from_utf8_lossy(&self.text(row)).into_owned()
    }

    /// Returns a cell as a number, which may be infinite. Returns `None` if it is no number.
    #[inline]
    pub(super) fn number(&self, row: usize) -> Option<f64> {
        let number = match self {
            Self::Numbers(cells) => *cells.get(row)?,
            Self::Integers(cells) => (*cells.get(row)?)? as f64,
            Self::Texts(cells) => fast_float2::parse(cells.get(row)?.trim()).ok()?,
            Self::Mixed(cells) => cells.number(row),
            Self::Stamps(_) | Self::Unreadable { .. } => return None,
        };
        (!number.is_nan()).then_some(number)
    }

    /// Returns a cell as text without surrounding blanks.
    pub(super) fn text(&self, row: usize) -> Cow<'_, [u8]> {
        let integer = |cells: &[Option<i64>]| cells.get(row).copied().flatten();
        let text = match self {
            Self::Texts(cells) => {
                return cells.get(row).map_or(&[][..], |cell| cell.trim().as_bytes()).into();
            }
            Self::Integers(cells) => integer(cells).map(|cell| cell.to_string()),
            Self::Stamps(cells) => integer(cells).and_then(|stamp| format_stamp(stamp.into())),
            Self::Mixed(cells) if let Some(text) = cells.text(row) => return text.into(),
            Self::Numbers(_) | Self::Mixed(_) => self.number(row).map(|number| number.to_string()),
            Self::Unreadable { .. } => None,
        };
        text.unwrap_or_default().into_bytes().into()
    }

    /// Returns the cells of some rows; a missing value where there is no row.
    ///
    /// # Panics
    /// If a row is outside of the column.
    pub fn select(&self, rows: impl Iterator<Item = Option<usize>>) -> Self {
        match self {
            Self::Numbers(cells) => {
                Self::Numbers(rows.map(|row| row.map_or(f64::NAN, |row| cells[row])).collect())
            }
            Self::Integers(cells) => Self::Integers(rows.map(|row| cells[row?]).collect()),
            Self::Stamps(cells) => Self::Stamps(rows.map(|row| cells[row?]).collect()),
            Self::Texts(cells) => Self::Texts(
                rows.map(|row| row.map_or_else(String::new, |row| cells[row].clone())).collect(),
            ),
            Self::Mixed(cells) => Self::Mixed(cells.select(rows)),
            Self::Unreadable { kind, .. } => {
                Self::Unreadable { rows: rows.count(), kind: kind.clone() }
            }
        }
    }
}

/// A log as named columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Its name in messages and results, in the place of a file's name.
    pub name: String,
    /// Names and cells of the columns, which all have the same number of rows.
    pub columns: Vec<(String, Cells)>,
}

impl Table {
    /// Returns the columns as those of a log's table, which may borrow them.
    pub(super) fn into_columns<'a>(self) -> impl Iterator<Item = (String, Cow<'a, Cells>)> {
        self.columns.into_iter().map(|(name, cells)| (name, Cow::Owned(cells)))
    }
}

/// One row of columns.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    pub columns: &'a [&'a Cells],
    pub row: usize,
}

impl<'a> Row<'a> {
    /// Returns the cell as a number, which may be infinite. Returns `None` if it is not a number.
    #[inline]
    pub fn number(&self, column: usize) -> Option<f64> {
        self.columns[column].number(self.row)
    }

    /// Returns the cell as text without surrounding blanks.
    pub fn text(&self, column: usize) -> Cow<'a, [u8]> {
        self.columns[column].text(self.row)
    }
}

/// Calls `read` with each row of a table of texts.
#[cfg(test)]
pub(super) fn each_text_row<T>(rows: &[&[&str]], mut read: impl FnMut(&Row) -> T) -> Vec<T> {
    let cells = |at: usize| Cells::Texts(rows.iter().map(|row| row[at].to_owned()).collect());
    let columns: Vec<Cells> = (0..rows[0].len()).map(cells).collect();
    let columns: Vec<&Cells> = columns.iter().collect();
    (0..rows.len()).map(|row| Row { columns: &columns, row }).map(|row| read(&row)).collect()
}
