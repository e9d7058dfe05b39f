//! Logs as tables: what each format is read to, and what is validated, described and joined.

use super::dataset::LeftOutColumn;
use super::error::{BadCell, BadRows, DataError};
use super::mixed_cells::{MixedCells, Need};
use super::plan::{Plan, Reading, Request};
use super::table::{Cells, Table};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// A log as a format reads it.
pub(super) struct LogTable<'a> {
    pub file: PathBuf,
    /// What is read of it, by its header.
    pub plan: Plan,
    /// The columns, of which those that are not needed have no cells.
    pub columns: Vec<Cow<'a, Cells>>,
    /// The number of each row, as defined by [`BadCell::row`].
    pub lines: Vec<u64>,
    /// Rows that are left out.
    pub bad: BadRows,
    /// Lines that are left out and are no rows of the table.
    pub bad_lines: BadRows,
    pub left_out: Vec<LeftOutColumn>,
    pub notes: Vec<String>,
    /// What to do about an error of this log.
    pub hint: Option<String>,
}

impl<'a> LogTable<'a> {
    /// Creates a table of columns whose rows have the numbers of the same table as a CSV file, whose header is row 1.
    pub fn of_columns(
        request: &Request,
        plan: Plan,
        columns: impl IntoIterator<Item = Cow<'a, Cells>>,
    ) -> Self {
        let columns: Vec<Cow<Cells>> = columns.into_iter().collect();
        let rows = columns.iter().map(|cells| cells.len()).max().unwrap_or_default();
        Self::new(request.path.into(), plan, columns, (2..).take(rows).collect())
    }

    fn new(file: PathBuf, plan: Plan, columns: Vec<Cow<'a, Cells>>, lines: Vec<u64>) -> Self {
        let (bad, bad_lines) = (BadRows::default(), BadRows::default());
        let (left_out, notes) = (Vec::new(), Vec::new());
        Self { file, plan, columns, lines, bad, bad_lines, left_out, notes, hint: None }
    }

    /// Creates a table of named columns.
    ///
    /// # Errors
    /// As for the header of a file, and if the columns differ in length.
    pub fn of_table(
        request: &Request,
        columns: impl IntoIterator<Item = (String, Cow<'a, Cells>)>,
    ) -> Result<Self, DataError> {
        let columns: Vec<(String, Cow<Cells>)> = columns.into_iter().collect();
        let rows = columns.first().map_or(0, |(_, cells)| cells.len());
        if let Some((name, cells)) = columns.iter().find(|(_, cells)| cells.len() != rows) {
            return Err(DataError::file(
                request.path,
                format!("{} rows in column {name}", cells.len()),
                format!("{rows} as in column {}", columns[0].0),
            ));
        }
        let unreadable = |(_, cells): &(String, Cow<Cells>)| match &**cells {
            Cells::Unreadable { kind, .. } => Some(kind.clone()),
            _ => None,
        };
        let unreadable = columns.iter().map(unreadable).collect();
        let (names, columns): (Vec<String>, Vec<Cow<Cells>>) = columns.into_iter().unzip();
        Ok(Self::of_columns(request, request.plan_columns(names, unreadable)?, columns))
    }

    /// Reads a long table as one with a column for each name. Leaves any other table as it is.
    ///
    /// # Errors
    /// As for the table with a column for each name; as for the table itself, if it is not long.
    pub fn widen(self, request: Request) -> Result<Self, DataError> {
        let Reading::Long(long) = &self.plan.reading else { return Ok(self) };
        let long = long.clone();
        let (bad_lines, mut notes) = (self.bad.clone(), self.notes.clone());
        let rows = self.lines.len() + bad_lines.count;
        bad_lines.check(rows, request.options.max_bad_share)?;
        let (table, lines) = self.into_table();
        let request = Request { is_wide: true, ..request };
        let Some(wide) = long.widen(&table) else {
            let table = Self::of_table(&request, table.into_columns())?;
            return Ok(Self { lines, bad_lines, notes, ..table });
        };
        let [name, value] = wide.columns.map(|at| table.columns[at].0.as_str());
        let note = format!(
            "the long table (one value a line: {name}, {value}) is read with a column for each name"
        );
        let options = &long.with_time(&table, &wide);
        let lines = wide.first.iter().map(|row| lines[*row]).collect();
        let wide = Self::of_table(&Request { options, ..request }, wide.table.into_columns());
        let wide = wide.map_err(|error| error.with_hint(&note))?;
        notes.insert(0, format!("{}: {note}", table.name));
        Ok(Self { lines, bad_lines, notes, hint: Some(note), ..wide })
    }

    /// Returns the named columns, whose units are added to the names, and the number of each row.
    pub fn into_table(self) -> (Table, Vec<u64>) {
        let Self { file, plan, columns, lines, .. } = self;
        let units = plan.names.units.iter().map(String::as_str).chain(std::iter::repeat(""));
        let named = plan.names.names.iter().zip(columns).zip(units);
        let named = named.map(|((name, cells), unit)| {
            let cells = match cells.into_owned() {
                Cells::Unreadable { kind, .. } => Cells::Unreadable { rows: lines.len(), kind },
                cells => cells,
            };
            let name = if unit.is_empty() { name.clone() } else { format!("{name} [{unit}]") };
            (name, cells)
        });
        let table = Table { name: file.display().to_string(), columns: named.collect() };
        (table, lines)
    }
}

/// A table of a format that is read row by row.
pub(super) struct TableRows {
    pub plan: Plan,
    columns: Vec<(usize, Need, MixedCells)>,
    lines: Vec<u64>,
    file: PathBuf,
    pub bad: BadRows,
}

impl TableRows {
    pub fn new(file: &Path, plan: Plan) -> Self {
        let needed = plan.needs.iter().copied().enumerate();
        let needed = needed.filter(|(_, need)| *need != Need::Skip);
        let columns = needed.map(|(at, need)| (at, need, MixedCells::default())).collect();
        let (file, bad) = (file.into(), BadRows::default());
        Self { plan, columns, lines: Vec::new(), file, bad }
    }

    /// Returns true if no more rows are needed.
    pub fn is_full(&self) -> bool {
        self.lines.len() >= self.plan.max_rows()
    }

    /// Adds a row with its number as defined by [`BadCell::row`]. `number` and `text` return the cell of a column.
    #[inline]
    pub fn add_row<'t>(
        &mut self,
        line: u64,
        number: impl Fn(usize) -> Option<f64>,
        text: impl Fn(usize) -> Cow<'t, [u8]>,
    ) {
        if self.is_full() {
            return;
        }
        self.lines.push(line);
        for (at, need, cells) in &mut self.columns {
            cells.push(*need, || number(*at), || text(*at));
        }
    }

    /// Adds a row of numbers. `number` returns that of a column; `None` for an empty cell.
    pub fn add_numbers(&mut self, line: u64, number: impl Fn(usize) -> Option<f64>) {
        let text = |at| number(at).map(|number| number.to_string()).unwrap_or_default();
        self.add_row(line, &number, |at| text(at).into_bytes().into());
    }

    /// Leaves a row out and counts it. `column` is `None` if no single cell is the cause.
    pub fn reject_row(&mut self, row: u64, column: Option<usize>, found: String, expected: &str) {
        self.bad.add(|| {
            let column = column.map_or("(all)", |at| &*self.plan.names.names[at]).into();
            let (file, expected) = (self.file.clone(), expected.into());
            BadCell { file, row, column, found, expected }
        });
    }

    pub fn finish(self) -> LogTable<'static> {
        let mut columns = vec![Cow::Owned(Cells::NOT_READ); self.plan.needs.len()];
        for (at, _, cells) in self.columns {
            columns[at] = Cow::Owned(Cells::Mixed(cells));
        }
        LogTable { bad: self.bad, ..LogTable::new(self.file, self.plan, columns, self.lines) }
    }
}
