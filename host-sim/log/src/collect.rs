//! Collection of a file's cells as a table, without a meaning of its columns.

use super::columns::is_missing_value;
use super::row::LogRow;
use super::table::{Cells, Table};
use std::collections::HashMap;
use std::path::Path;

/// Limit below which an `f64` represents every whole number exactly: 2^53.
const MAX_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// The cells of one column.
#[derive(Debug, Default)]
struct CollectedColumn {
    /// NaN for a cell that is no number.
    numbers: Vec<f64>,
    /// Cells whose text holds more than their number: words, dates and long integers.
    texts: HashMap<usize, String>,
}

/// The cells of a file, column by column.
#[derive(Debug, Default)]
pub(super) struct CollectedCells {
    columns: Vec<CollectedColumn>,
    /// The line of each row.
    pub lines: Vec<u64>,
}

impl CollectedCells {
    pub fn add_row(&mut self, number: u64, columns: usize, row: &impl LogRow) {
        self.lines.push(number);
        self.columns.resize_with(columns, CollectedColumn::default);
        for (at, column) in self.columns.iter_mut().enumerate() {
            let number = row.number(at);
            if number.is_none_or(|number| number.abs() >= MAX_EXACT_INTEGER) {
                let text = row.text(at);
                if !is_missing_value(&text) {
                    let text = String::from_utf8_lossy(&text).into_owned();
                    column.texts.insert(column.numbers.len(), text);
                }
            }
            column.numbers.push(number.unwrap_or(f64::NAN));
        }
    }

    /// Returns the columns as a table. A first row of words without a number holds units, which are added to the names.
    pub fn finish(mut self, file: &Path, names: Vec<String>) -> Table {
        let is_word = |column: &CollectedColumn| {
            column.numbers.first().is_some_and(|number| number.is_nan()) && column.texts.len() == 1
        };
        let has_units = self.columns.iter().any(|column| column.texts.contains_key(&0))
            && self.columns.iter().all(|column| is_word(column) || column.texts.is_empty())
            && self.columns.iter().all(|column| column.numbers.first().is_none_or(|n| n.is_nan()));
        let mut named = Vec::new();
        self.columns.resize_with(names.len(), CollectedColumn::default);
        for (mut name, mut column) in names.into_iter().zip(self.columns) {
            if has_units {
                if let Some(unit) = column.texts.remove(&0) {
                    name = format!("{name} [{}]", unit.trim_matches(['[', ']', '(', ')', ' ']));
                }
                column.numbers.remove(0);
            }
            named.push((name, column.cells()));
        }
        Table { name: file.display().to_string(), columns: named }
    }
}

impl CollectedColumn {
    fn cells(self) -> Cells {
        if self.texts.is_empty() {
            return Cells::Numbers(self.numbers);
        }
        let is_integer = |(row, number): (usize, &f64)| match self.texts.get(&row) {
            Some(text) => text.trim().parse::<i64>().ok().map(Some),
            None if number.is_nan() => Some(None),
            None => (number.fract() == 0.0).then_some(Some(*number as i64)),
        };
        let integers: Option<Vec<Option<i64>>> =
            self.numbers.iter().enumerate().map(is_integer).collect();
        integers.map(Cells::Integers).unwrap_or_else(|| {
            let text = |(row, number): (usize, &f64)| match self.texts.get(&row) {
                Some(text) => text.clone(),
                None if number.is_nan() => String::new(),
                None => number.to_string(),
            };
            Cells::Texts(self.numbers.iter().enumerate().map(text).collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::borrow::Cow;

    struct Row<'a>(&'a [&'a str]);

    impl LogRow for Row<'_> {
        fn number(&self, column: usize) -> Option<f64> {
            self.0[column].parse().ok()
        }

        fn text(&self, column: usize) -> Cow<'_, [u8]> {
            Cow::Borrowed(self.0[column].as_bytes())
        }
    }

    #[test]
    fn finish_keeps_numbers_long_integers_words_and_units() {
        let mut cells = CollectedCells::default();
        let rows: [&[&str]; 3] =
            [&["s", "deg", "-"], &["1700000000000000001", "0.5", ""], &["2", "1", "x"]];
        rows[1..].iter().for_each(|row| cells.add_row(2, 3, &Row(row)));
        let names = || ["t", "q", "note"].map(str::to_owned).to_vec();
        let table = cells.finish(Path::new("f.csv"), names());
        assert_eq!(
            table.columns[0].1,
            Cells::Integers(vec![Some(1_700_000_000_000_000_001), Some(2)])
        );
        assert_eq!(table.columns[1].1, Cells::Numbers(vec![0.5, 1.0]));
        assert_eq!(table.columns[2].1, Cells::Texts(vec![String::new(), "x".into()]));
        let mut cells = CollectedCells::default();
        rows[..1].iter().for_each(|row| cells.add_row(2, 3, &Row(row)));
        cells.add_row(2, 3, &Row(&["0.1", "2", "3"]));
        let table = cells.finish(Path::new("f.csv"), names());
        assert_eq!(table.columns[1], ("q [deg]".to_owned(), Cells::Numbers(vec![2.0])));
    }
}
