//! Reading of a long table, once all of its cells are collected.

use crate::clean::{Cleaner, FileData};
use crate::error::{BadCell, DataError};
use crate::long_table::LongTable;
use crate::source::read_table;

impl Cleaner<'_> {
    /// Reads the collected cells as a table with a column for each name.
    ///
    /// # Errors
    /// As for that table; as for the table itself, if it is not long.
    pub(super) fn read_long(mut self, long: &LongTable) -> Result<FileData, DataError> {
        let lines = std::mem::take(&mut self.collected.lines);
        let table = self.collected.finish(self.file, self.layout.names);
        let Some(wide) = long.widen(&table) else { return read_table(&table, &long.options) };
        let [name, value] = wide.columns.map(|at| table.columns[at].0.as_str());
        let note = format!(
            "the long table (one value a line: {name}, {value}) is read with a column for each name"
        );
        // The line in the file, not the row of the table that is made.
        let line = |cell: &mut BadCell| {
            let first = (cell.row as usize).checked_sub(2).and_then(|row| wide.first.get(row));
            cell.row = first.and_then(|first| lines.get(*first)).copied().unwrap_or(cell.row);
        };
        let mut data =
            read_table(&wide.table, &long.with_time(&table, &wide)).map_err(|mut error| {
                match &mut error {
                    DataError::Cell(cell) => line(cell),
                    DataError::TooManyBad { first, .. } => line(first),
                    _ => {}
                }
                error.with_hint(&note)
            })?;
        data.bad.first.iter_mut().for_each(line);
        data.bad.count += self.bad.count;
        data.bad.first.extend(self.bad.first);
        data.notes.push(format!("{}: {note}", table.name));
        Ok(data)
    }
}
