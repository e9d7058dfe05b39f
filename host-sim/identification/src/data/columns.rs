//! Which optional columns may stay.
//!
//! Nothing in a header tells a covariate from a column of remarks, and the file is read only
//! once. So every optional column is read as numbers, NaN standing for what is none, and judged
//! when the file is over: a column without a single number is text or empty and is left out (text
//! that is the same throughout each run lives on as a label of the run); a column with numbers
//! stays, and the rows in which it has none are filled (`fill`): a thermometer that is read once a second is
//! no reason to lose the other rows. Memory for a column is taken only once its first number has been seen.

use std::path::Path;

use super::error::{BadCell, NAMED_BAD_ROWS, quoted};

/// What has been seen of one optional column.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub numbers: usize,
    /// Numbers in rows that hold neither velocity nor torque.
    pub apart: usize,
    pub texts: usize,
    empties: usize,
    /// The first cells that are no numbers.
    pub first_bad: Vec<BadCell>,
}

/// What becomes of an optional column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    /// It is a covariate.
    Numeric,
    /// It is text.
    Text,
    /// It holds nothing.
    Empty,
}

impl Tally {
    /// Counts a finite number.
    pub fn number(&mut self) {
        self.numbers += 1;
    }

    /// Counts anything else.
    pub fn no_number(&mut self, file: &Path, row: u64, column: &str, cell: &[u8], expected: &str) {
        if is_nothing(cell) {
            self.empties += 1;
        } else {
            self.texts += 1;
        }
        if self.first_bad.len() < NAMED_BAD_ROWS {
            self.first_bad.push(BadCell {
                file: file.into(),
                row,
                column: column.into(),
                found: quoted(cell),
                expected: expected.into(),
            });
        }
    }

    /// Judges the column. A few stray words make bad rows; more words than numbers make it text
    /// in which some words happen to look like numbers (part codes, say).
    pub fn fate(&self) -> Fate {
        if self.texts > self.numbers {
            Fate::Text
        } else if self.numbers > 0 {
            Fate::Numeric
        } else {
            Fate::Empty
        }
    }
}

/// What a numeric cell should hold.
pub(super) const FINITE: &str = "a finite number";

/// Whether the cell says that there is no value, in one of the usual ways.
pub(super) fn is_nothing(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    ["", "nan", "na", "n/a", "null", "none", "-", "inf", "-inf"]
        .iter()
        .any(|word| cell.eq_ignore_ascii_case(word.as_bytes()))
}

/// Numbers of one optional column of one run, aligned with the run's rows once it is closed.
#[derive(Debug, Default)]
pub(super) struct Column {
    pub values: Vec<f64>,
}

impl Column {
    /// Puts a number at `row`; rows before it without one are NaN.
    pub fn put(&mut self, row: usize, value: f64) {
        if self.values.len() < row {
            self.values.resize(row, f64::NAN);
        }
        self.values.push(value);
    }
}

/// The text an optional column holds throughout a run, as far as one has been seen.
#[derive(Debug, Default)]
pub(super) struct Label {
    text: Option<Box<[u8]>>,
    rows: usize,
    varies: bool,
}

impl Label {
    /// Takes note of the cell.
    pub fn see(&mut self, cell: &[u8]) {
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

    /// The text, if every one of `rows` rows holds it.
    pub fn text(&self, rows: usize) -> Option<String> {
        let text = self.text.as_ref().filter(|text| self.rows == rows && !is_nothing(text))?;
        Some(String::from_utf8_lossy(text).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fate(cells: &[&str]) -> Fate {
        let mut tally = Tally::default();
        for cell in cells {
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => tally.number(),
                _ => tally.no_number(Path::new("f"), 2, "c", cell.as_bytes(), FINITE),
            }
        }
        tally.fate()
    }

    #[test]
    fn a_column_is_judged_by_all_its_cells() {
        assert_eq!(fate(&["1", "x", "2", ""]), Fate::Numeric);
        assert_eq!(fate(&["sine", "step"]), Fate::Text);
        assert_eq!(fate(&["7", "7b", "c"]), Fate::Text);
        assert_eq!(fate(&["", "NaN", "inf", "null"]), Fate::Empty);
        assert_eq!(fate(&["", "", "", "1"]), Fate::Numeric, "then three rows are filled");
        assert_eq!(fate(&[]), Fate::Empty);
    }

    #[test]
    fn a_column_is_filled_up_with_nan() {
        let mut column = Column::default();
        column.put(2, 5.0);
        assert!(column.values[0].is_nan() && column.values[1].is_nan());
        assert_eq!(column.values[2..], [5.0]);
    }

    #[test]
    fn a_label_is_one_text_in_every_row() {
        let close = |cells: &[&str], rows| {
            let mut label = Label::default();
            cells.iter().for_each(|cell| label.see(cell.as_bytes()));
            label.text(rows)
        };
        assert_eq!(close(&["a", "a"], 2).as_deref(), Some("a"));
        assert_eq!(close(&["a", "b", "a"], 3), None);
        assert_eq!(close(&["a"], 2), None);
        assert_eq!(close(&["", ""], 2), None);
    }
}
