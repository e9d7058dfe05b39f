//! Decision which optional columns of a file are kept.
//!
//! A header does not distinguish a covariate from a column of comments, and the file is read only once. So every
//! optional column is read as numbers, with NaN for other cells, and evaluated at the end of the file. A column without
//! a single number is text or empty and is left out. Text that is constant in each run is kept as a label of the run.
//! A column with numbers is kept, and its missing values are filled (`fill`): a thermometer that is read once a second
//! is no reason to lose the other rows. Memory for a column is allocated only at its first number.

use std::path::Path;

use super::error::{BadCell, NAMED_BAD_ROWS, quoted};

/// Counts of the cells of one optional column.
#[derive(Debug, Default)]
pub(super) struct ColumnTally {
    pub numbers: usize,
    /// Numbers in rows that hold neither velocity nor torque.
    pub covariate_only: usize,
    pub texts: usize,
    empties: usize,
    /// The first cells that are not numbers.
    pub first_bad: Vec<BadCell>,
    /// The first of them with a text that is no word for a missing value.
    pub first_text: Option<BadCell>,
}

/// How an optional column is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ColumnUse {
    /// It is a covariate.
    Numeric,
    /// It is text.
    Text,
    /// It holds no values.
    Empty,
}

impl ColumnTally {
    /// Counts any other cell.
    pub fn add_other(&mut self, file: &Path, row: u64, column: &str, cell: &[u8], expected: &str) {
        let bad = || {
            let (column, expected) = (column.into(), expected.into());
            BadCell { file: file.into(), row, column, found: quoted(cell), expected }
        };
        if is_missing_value(cell) {
            self.empties += 1;
        } else {
            self.texts += 1;
            self.first_text.get_or_insert_with(bad);
        }
        if self.first_bad.len() < NAMED_BAD_ROWS {
            self.first_bad.push(bad());
        }
    }

    /// Decides how the column is used. A few words among numbers are bad cells. With more words than numbers, the
    /// column is text in which some words look like numbers, such as part codes.
    pub fn column_use(&self) -> ColumnUse {
        if self.texts > self.numbers {
            ColumnUse::Text
        } else if self.numbers > 0 {
            ColumnUse::Numeric
        } else {
            ColumnUse::Empty
        }
    }
}

/// The expected content of a numeric cell.
pub(super) const FINITE: &str = "a finite number";

/// Words for a value that is missing, in lower case. The longer ones are those of historians and spreadsheets.
const MISSING_VALUES: &str = "|nan|na|n/a|null|none|-|inf|-inf|#n/a|#nv|no data|nodata|bad|bad input|i/o timeout|timeout|\
                              not available|missing";

/// Returns true if the cell states in one of the usual ways that there is no value.
pub(super) fn is_missing_value(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    MISSING_VALUES.split('|').any(|word| cell.eq_ignore_ascii_case(word.as_bytes()))
}

/// Sets the number of a row in a column. Earlier rows without a number become NaN.
#[inline]
pub(super) fn set_number(column: &mut Vec<f64>, row: usize, value: f64) {
    column.resize(row, f64::NAN);
    column.push(value);
}

/// The text of an optional column, if it is constant throughout a run.
#[derive(Debug, Default)]
pub(super) struct RunLabel {
    text: Option<Box<[u8]>>,
    rows: usize,
    varies: bool,
}

impl RunLabel {
    /// Adds a cell.
    pub fn add(&mut self, cell: &[u8]) {
        self.rows += 1;
        match &self.text {
            _ if self.varies => {}
            None => self.text = Some(cell.into()),
            Some(text) if **text == *cell => {}
            Some(_) => {
                self.varies = true;
                self.text = None;
            }
        }
    }

    /// Returns the text if each of `rows` rows holds it.
    pub fn text(&self, rows: usize) -> Option<String> {
        let text =
            self.text.as_ref().filter(|text| self.rows == rows && !is_missing_value(text))?;
        Some(String::from_utf8_lossy(text).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column_use(cells: &[&str]) -> ColumnUse {
        let mut tally = ColumnTally::default();
        for cell in cells {
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => tally.numbers += 1,
                _ => tally.add_other(Path::new("f"), 2, "c", cell.as_bytes(), FINITE),
            }
        }
        tally.column_use()
    }

    #[test]
    fn first_text_is_found_after_many_missing_values() {
        let mut tally = ColumnTally::default();
        for (row, cell) in ["", "nan", "", "-", "", "", "on", "off"].into_iter().enumerate() {
            tally.add_other(Path::new("f"), row as u64, "c", cell.as_bytes(), FINITE);
        }
        let text = tally.first_text.expect("a text");
        assert_eq!((text.row, &*text.found, tally.first_bad.len()), (6, "\"on\"", NAMED_BAD_ROWS));
    }

    #[test]
    fn column_use_with_mixed_cells_follows_the_majority() {
        assert_eq!(column_use(&["1", "x", "2", ""]), ColumnUse::Numeric);
        assert_eq!(column_use(&["sine", "step"]), ColumnUse::Text);
        assert_eq!(column_use(&["7", "7b", "c"]), ColumnUse::Text);
        assert_eq!(column_use(&["", "NaN", "inf", "null"]), ColumnUse::Empty);
        assert_eq!(
            column_use(&["", "", "", "1"]),
            ColumnUse::Numeric,
            "then three rows are filled"
        );
        assert_eq!(column_use(&[]), ColumnUse::Empty);
    }

    #[test]
    fn set_number_with_skipped_rows_fills_them_with_nan() {
        let mut column = Vec::new();
        set_number(&mut column, 2, 5.0);
        assert!(column[0].is_nan() && column[1].is_nan());
        assert_eq!(column[2..], [5.0]);
    }

    #[test]
    fn run_label_with_constant_text_returns_it() {
        let close = |cells: &[&str], rows| {
            let mut label = RunLabel::default();
            cells.iter().for_each(|cell| label.add(cell.as_bytes()));
            label.text(rows)
        };
        assert_eq!(close(&["a", "a"], 2).as_deref(), Some("a"));
        assert_eq!(close(&["a", "b", "a"], 3), None);
        assert_eq!(close(&["a"], 2), None);
        assert_eq!(close(&["", ""], 2), None);
    }
}
