//! What is read of a log: decided by its header, before its rows are read.

use super::column_names::ColumnNames;
use super::columns::is_missing_value;
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header};
use super::header::{Layout, layout};
use super::long_table::LongTable;
use super::mixed_cells::Need;
use super::options::ReadOptions;
use super::row_clock::Timing;
use super::unit;
use std::mem::take;
use std::path::Path;

/// Number of rows that a survey looks at.
pub const SURVEY_ROWS: usize = 1000;

/// What a log is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Its data.
    Data,
    /// The description of its columns.
    Survey,
    /// All cells, which are joined with those of other files.
    Join,
}

/// A log that is to be read.
#[derive(Clone, Copy)]
pub(super) struct Request<'a> {
    /// Its name in messages.
    pub path: &'a Path,
    pub options: &'a ReadOptions,
    pub purpose: Purpose,
    /// True if the table is known to have a column for each quantity.
    pub is_wide: bool,
    /// Called with the number of bytes read so far.
    pub progress: &'a dyn Fn(u64),
}

/// How the rows of a log are read.
#[derive(Debug)]
pub(super) enum Reading {
    /// As the data of a joint.
    Data(Box<Layout>),
    /// As a table with a line for each value, which is made one with a column for each name.
    Long(Box<LongTable>),
    /// Without a meaning of the columns.
    Cells,
    /// As [`Self::Cells`], only the first rows.
    Survey,
}

/// What is read of a log.
#[derive(Debug)]
pub(super) struct Plan {
    pub names: ColumnNames,
    pub needs: Vec<Need>,
    pub reading: Reading,
}

impl Request<'_> {
    /// Decides what is read of a table with these columns.
    ///
    /// # Errors
    /// If the header is ambiguous or lacks a required column.
    pub fn plan(&self, names: ColumnNames) -> Result<Plan, DataError> {
        let reading = match self.purpose {
            Purpose::Join => Reading::Cells,
            Purpose::Data | Purpose::Survey => {
                let layout = layout(self.path, names.clone(), self.options);
                let is_open = layout.is_err() && !self.is_wide;
                match is_open.then(|| LongTable::find(&names.names, self.options)).flatten() {
                    Some(long) => Reading::Long(Box::new(long)),
                    None if self.purpose == Purpose::Survey => Reading::Survey,
                    None => Reading::Data(Box::new(layout?)),
                }
            }
        };
        Ok(Plan::new(names, reading))
    }

    /// As [`Self::plan`]. `unreadable` is why each column cannot be read, as the end of "it is ..".
    ///
    /// # Errors
    /// As [`Self::plan`], and if a required column cannot be read.
    pub fn plan_columns(
        &self,
        names: Vec<String>,
        unreadable: Vec<Option<String>>,
    ) -> Result<Plan, DataError> {
        let mut plan = self.plan(names.into())?;
        if let Reading::Data(layout) = &mut plan.reading {
            let layout = &mut **layout;
            let required = layout.required.iter().map(|reading| reading.index).chain(layout.run);
            for at in required {
                if let Some(kind) = &unreadable[at] {
                    let expected = "a column of plain numbers or text";
                    return Err(at_header(self.path, &layout.names[at], kind, expected));
                }
            }
            layout.optional.retain(|column| {
                let kind = unreadable[column.reading.index].as_ref();
                let name = &layout.names[column.reading.index];
                layout.left_out.extend(kind.map(|kind| LeftOutColumn {
                    name: name.clone(),
                    why: format!("it is {kind}"),
                }));
                kind.is_none()
            });
            plan = Plan::new(plan.names, plan.reading);
        }
        let unreadable = plan.needs.iter_mut().zip(unreadable).filter(|(_, of)| of.is_some());
        unreadable.for_each(|(need, _)| *need = Need::Skip);
        Ok(plan)
    }

    /// As [`Self::plan`], for a log whose rows have different columns. Of its data, only the columns are read that the contract or
    /// `--columns` names. `added` is the number of columns that the file itself does not have.
    ///
    /// # Errors
    /// As [`Self::plan`].
    pub fn plan_named(&self, names: Vec<String>, added: usize) -> Result<Plan, DataError> {
        let mut plan = self.plan(names.into())?;
        if let Reading::Data(layout) = &mut plan.reading {
            layout.keep_named_columns(self.path, added);
        }
        Ok(Plan::new(plan.names, plan.reading))
    }
}

impl Plan {
    /// Returns the plan to read all numbers of a table, and the texts that are none.
    pub fn cells(names: ColumnNames) -> Self {
        let needs = vec![Need::Numbers; names.names.len()];
        Self { names, needs, reading: Reading::Cells }
    }

    fn new(names: ColumnNames, reading: Reading) -> Self {
        let all = match reading {
            Reading::Data(_) => Need::Skip,
            Reading::Survey => Need::Both,
            Reading::Long(_) | Reading::Cells => Need::Words,
        };
        let mut needs = vec![all; names.names.len()];
        if let Reading::Data(layout) = &reading {
            let optional = layout.optional.iter().map(|column| &column.reading);
            for reading in layout.required.iter().chain(optional) {
                let is_list = reading.element.is_some() || needs[reading.index] == Need::Both;
                let is_text = is_list || layout.timing == Timing::Steps;
                needs[reading.index] = if is_text { Need::Both } else { Need::Numbers };
            }
            let names = layout.joint_names.iter().map(|column| column.index);
            let texts = names.chain(layout.run).chain(layout.dates);
            for at in texts.chain(layout.only.iter().map(|only| only.index)) {
                let is_read = !matches!(needs[at], Need::Skip | Need::Texts);
                needs[at] = if is_read { Need::Both } else { Need::Texts };
            }
        }
        Self { names, needs, reading }
    }

    /// Returns the maximum number of rows that are read.
    pub fn max_rows(&self) -> usize {
        if matches!(self.reading, Reading::Survey) { SURVEY_ROWS } else { usize::MAX }
    }

    /// Returns for each column whether it is a measurement, and not the time or a name.
    pub fn measured(&self) -> Vec<bool> {
        let Reading::Data(layout) = &self.reading else { return vec![true; self.needs.len()] };
        let mut is_measured = vec![false; self.needs.len()];
        let required = layout.required[1..].iter().map(|reading| reading.index);
        let optional = layout.optional.iter().map(|column| column.reading.index);
        required.chain(optional).for_each(|at| is_measured[at] = true);
        is_measured
    }

    /// Reads units from the cells of a line `place` (above or below) the header and returns true, if they are units.
    ///
    /// # Errors
    /// As [`Layout::take_units`].
    pub fn take_units(
        &mut self,
        file: &Path,
        cells: &[&[u8]],
        place: &str,
    ) -> Result<bool, DataError> {
        match &mut self.reading {
            Reading::Data(layout) => layout.take_units(file, cells, place),
            _ => {
                let units = units(cells);
                let has_units = units.is_some();
                self.names.units = units.unwrap_or_else(|| take(&mut self.names.units));
                Ok(has_units)
            }
        }
    }
}

/// Minimum number of units in a row of units. One may be a word that means something else.
const MIN_UNITS: usize = 2;

/// Returns the units in a row of units, empty where there is none; `None` for a row of values.
fn units(cells: &[&[u8]]) -> Option<Vec<String>> {
    let unit = |cell: &&[u8]| match unit::in_cell(cell) {
        missing if is_missing_value(missing.as_bytes()) => String::new(),
        unit => unit,
    };
    let units: Vec<String> = cells.iter().map(unit).collect();
    let has_number = cells.iter().any(|cell| fast_float2::parse::<f64, _>(cell).is_ok());
    let known = units.iter().filter(|unit| unit::is_symbol(unit)).count();
    (known >= MIN_UNITS && !has_number).then_some(units)
}
