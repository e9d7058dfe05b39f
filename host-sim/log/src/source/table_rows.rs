//! Rows of a table: data frames, Parquet files, Arrow files.
//!
//! A table is in memory, or its rows come in batches ([`TableHeader`]). They pass the same validation as those of a text, so
//! that the same log gives the same data however it is held.

use std::borrow::{Borrow, Cow};
#[cfg(any(feature = "arrow", feature = "parquet"))]
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use crate::clean::{Cleaner, FileData};
use crate::dataset::LeftOutColumn;
use crate::error::{DataError, at_header};
use crate::header::layout;
use crate::options::ReadOptions;
use crate::row::LogRow;
use crate::table::{Cells, Table};
#[cfg(any(feature = "arrow", feature = "parquet"))]
use crate::work::Cancelled;
use crate::work::checkpoint_at;

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
pub(crate) fn read_table(table: &Table, options: &ReadOptions) -> Result<FileData, DataError> {
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
