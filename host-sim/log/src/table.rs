//! Tables in memory as a source of rows: data frames, record batches, columns of arrays.
//!
//! Their rows pass the same validation as those of a file, so that the same log gives the same data however it is held.

use std::borrow::Cow;
use std::path::Path;

use super::clean::{Cleaner, FileData};
use super::clock::format_stamp;
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header};
use super::header::layout;
use super::options::ReadOptions;
use super::row::LogRow;
use crate::work::checkpoint_at;

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

    fn number(&self, row: usize) -> Option<f64> {
        match self {
            Self::Numbers(cells) => cells.get(row).copied(),
            Self::Integers(cells) => cells.get(row).map(|cell| cell.map_or(f64::NAN, |n| n as f64)),
            Self::Texts(cells) => fast_float2::parse(cells.get(row)?.trim().as_bytes()).ok(),
            Self::Stamps(_) | Self::Unreadable { .. } => None,
        }
    }

    fn text(&self, row: usize) -> Cow<'_, [u8]> {
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
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Its name in messages and results, in the place of a file's name.
    pub name: String,
    /// Names and cells of the columns, which all have the same number of rows.
    pub columns: Vec<(String, Cells)>,
}

struct TableRow<'a> {
    columns: &'a [(String, Cells)],
    row: usize,
}

impl LogRow for TableRow<'_> {
    fn number(&self, column: usize) -> Option<f64> {
        self.columns[column].1.number(self.row)
    }

    fn text(&self, column: usize) -> Cow<'_, [u8]> {
        self.columns[column].1.text(self.row)
    }
}

/// Validates a table. Row numbers are those of the same table as a CSV file, whose header is row 1.
///
/// # Errors
/// As for a file, and if the columns differ in length.
pub(super) fn read_table(table: &Table, options: &ReadOptions) -> Result<FileData, DataError> {
    let path = Path::new(&table.name);
    let columns = &table.columns;
    let rows = columns.first().map_or(0, |(_, cells)| cells.len());
    if let Some((name, cells)) = columns.iter().find(|(_, cells)| cells.len() != rows) {
        return Err(DataError::File {
            file: path.into(),
            found: format!("{} rows in column {name}", cells.len()),
            expected: format!("{rows} as in column {}", columns[0].0),
        });
    }
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    let mut layout = layout(path, names, options)?;
    let kind = |at: usize| match &columns[at].1 {
        Cells::Unreadable { kind, .. } => Some(kind.clone()),
        _ => None,
    };
    let required = layout.required.iter().map(|reading| reading.index).chain(layout.run);
    for at in required {
        if let Some(kind) = kind(at) {
            return Err(at_header(
                path,
                &columns[at].0,
                &kind,
                "a column of plain numbers or text",
            ));
        }
    }
    layout.optional.retain(|column| {
        let why = kind(column.reading.index).map(|kind| format!("it is {kind}"));
        let name = columns[column.reading.index].0.clone();
        layout.left_out.extend(why.clone().map(|why| LeftOutColumn { name, why }));
        why.is_none()
    });
    let mut cleaner = Cleaner::new(path, layout);
    for row in 0..rows {
        checkpoint_at(row);
        cleaner.add_row(row as u64 + 2, &TableRow { columns, row })?;
    }
    cleaner.finish()
}
