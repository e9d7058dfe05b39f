//! Tables as named columns of cells: data frames, Parquet files, Arrow files.
//!
//! A table is in memory, or its rows come in batches ([`TableHeader`]). They pass the same validation as those of a text, so
//! that the same log gives the same data however it is held.

use std::borrow::{Borrow, Cow};
#[cfg(any(feature = "arrow", feature = "parquet"))]
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use super::clean::{Cleaner, FileData};
use super::clock::format_stamp;
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header};
use super::header::layout;
use super::options::ReadOptions;
use super::row::LogRow;
#[cfg(any(feature = "arrow", feature = "parquet"))]
use crate::work::Cancelled;
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Its name in messages and results, in the place of a file's name.
    pub name: String,
    /// Names and cells of the columns, which all have the same number of rows.
    pub columns: Vec<(String, Cells)>,
}

/// One row of columns.
struct TableRow<'a, C> {
    columns: &'a [C],
    row: usize,
}

impl<C: Borrow<Cells>> LogRow for TableRow<'_, C> {
    fn number(&self, column: usize) -> Option<f64> {
        self.columns[column].borrow().number(self.row)
    }

    fn text(&self, column: usize) -> Cow<'_, [u8]> {
        self.columns[column].borrow().text(self.row)
    }
}

/// Validates a table in memory.
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
    let unreadable = |(_, cells): &(String, Cells)| match cells {
        Cells::Unreadable { kind, .. } => Some(kind.clone()),
        _ => None,
    };
    let header = TableHeader {
        names: columns.iter().map(|(name, _)| name.clone()).collect(),
        unreadable: columns.iter().map(unreadable).collect(),
    };
    let cells: Vec<&Cells> = columns.iter().map(|(_, cells)| cells).collect();
    header.read(path, options, |_| Ok(std::iter::once(Ok(cells))))
}

/// The columns of a table whose rows follow in batches.
pub(super) struct TableHeader {
    pub names: Vec<String>,
    /// Why each column cannot be read, as the end of "it is ..".
    pub unreadable: Vec<Option<String>>,
}

impl TableHeader {
    /// Validates the batches that `open` returns. It gets whether each column is needed; the cells of another column may be of
    /// any kind and number. Row numbers are those of the same table as a CSV file, whose header is row 1.
    ///
    /// # Errors
    /// As for a file.
    pub fn read<C: Borrow<Cells>, B: Iterator<Item = Result<Vec<C>, DataError>>>(
        self,
        path: &Path,
        options: &ReadOptions,
        open: impl FnOnce(Vec<bool>) -> Result<B, DataError>,
    ) -> Result<FileData, DataError> {
        let unreadable = self.unreadable;
        let mut layout = layout(path, self.names, options)?;
        let required = layout.required.iter().map(|reading| reading.index).chain(layout.run);
        for at in required.filter(|_| !layout.is_survey && !layout.collects) {
            if let Some(kind) = &unreadable[at] {
                let expected = "a column of plain numbers or text";
                return Err(at_header(path, &layout.names[at], kind, expected));
            }
        }
        layout.optional.retain(|column| {
            let name = layout.names[column.reading.index].clone();
            let why = unreadable[column.reading.index].as_ref().map(|kind| format!("it is {kind}"));
            layout.left_out.extend(why.clone().map(|why| LeftOutColumn { name, why }));
            why.is_none()
        });
        let mut is_needed = vec![false; unreadable.len()];
        layout.needed().filter(|at| unreadable[*at].is_none()).for_each(|at| is_needed[at] = true);
        let mut cleaner = Cleaner::new(path, layout);
        let mut number = 1;
        for columns in open(is_needed)? {
            let columns = columns?;
            let rows = columns.iter().map(|cells| cells.borrow().len()).max();
            for row in 0..rows.unwrap_or_default() {
                checkpoint_at(row);
                number += 1;
                cleaner.add_row(number, &TableRow { columns: &columns, row })?;
            }
        }
        cleaner.finish()
    }
}

/// Calls `read`, which uses a library that reports a few damaged files with a panic, for example a page that refers to a missing
/// dictionary. A damaged file must not look like a defect of this program, so a panic becomes an error.
#[cfg(any(feature = "arrow", feature = "parquet"))]
pub(super) fn read_damaged<T>(
    path: &Path,
    expected: &str,
    read: impl FnOnce() -> Result<T, DataError>,
) -> Result<T, DataError> {
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|panic| {
        if panic.is::<Cancelled>() {
            resume_unwind(panic);
        }
        Err(DataError::File {
            file: path.into(),
            found: "damaged data".into(),
            expected: expected.into(),
        })
    })
}
