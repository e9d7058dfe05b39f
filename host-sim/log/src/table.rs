//! Tables as named columns of cells: data frames, Parquet files, Arrow files.
//!
//! `source::table_rows` validates them.

use super::clock::format_stamp;
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
    #[cfg(any(feature = "arrow", feature = "parquet"))]
    pub(super) const NOT_READ: Self = Self::Unreadable { rows: 0, kind: String::new() };

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Integers(cells) | Self::Stamps(cells) => cells.len(),
            Self::Texts(cells) => cells.len(),
            Self::Unreadable { rows, .. } => *rows,
        }
    }

    /// Returns true if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds the cells of the next rows of the same column.
    #[cfg(feature = "parquet")]
    pub(super) fn append(&mut self, next: Self) {
        match (self, next) {
            (Self::Numbers(cells), Self::Numbers(next)) => cells.extend(next),
            (Self::Texts(cells), Self::Texts(next)) => cells.extend(next),
            (cells, next) => *cells = next,
        }
    }

    /// Returns a cell as text; empty if there is none.
    pub fn text_of(&self, row: usize) -> String {
        String::from_utf8_lossy(&self.text(row)).into_owned()
    }

    pub(super) fn number(&self, row: usize) -> Option<f64> {
        match self {
            Self::Numbers(cells) => cells.get(row).copied(),
            Self::Integers(cells) => cells.get(row).map(|cell| cell.map_or(f64::NAN, |n| n as f64)),
            Self::Texts(cells) => fast_float2::parse(cells.get(row)?.trim().as_bytes()).ok(),
            Self::Stamps(_) | Self::Unreadable { .. } => None,
        }
    }

    pub(super) fn text(&self, row: usize) -> Cow<'_, [u8]> {
        let text = match self {
            Self::Texts(cells) => {
                return cells.get(row).map_or(&[][..], |cell| cell.trim().as_bytes()).into();
            }
            Self::Numbers(cells) => {
                cells.get(row).filter(|cell| !cell.is_nan()).map(f64::to_string)
            }
            Self::Integers(cells) => cells.get(row).copied().flatten().map(|cell| cell.to_string()),
            Self::Stamps(cells) => {
                cells.get(row).copied().flatten().and_then(|stamp| format_stamp(i128::from(stamp)))
            }
            Self::Unreadable { .. } => None,
        };
        text.unwrap_or_default().into_bytes().into()
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
