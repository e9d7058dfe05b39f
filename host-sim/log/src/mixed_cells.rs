//! The cells of a column that holds numbers and texts.
//!
//! Each cell is a number, NaN if it is none. A text is kept where it holds more than the number: words, dates, and long integers.

use super::columns::is_missing_value;
use std::borrow::Cow;
use std::ops::Range;

/// Numbers of at least this size keep their text. It is below 2^53, above which an `f64` loses digits, and not above the largest
/// measured value, so that an error quotes the text of a larger one.
const MIN_LONG: f64 = 1e15;

/// What is kept of the cells of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    /// Nothing.
    Skip,
    /// The numbers, and the texts that are none.
    Numbers,
    /// The numbers, and the words that are no missing values.
    Words,
    /// The texts.
    Texts,
    /// The numbers and all texts.
    Both,
}

/// The cells of a column of numbers and texts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MixedCells {
    /// NaN for a cell that is no number.
    numbers: Vec<f64>,
    /// The rows whose texts are kept.
    rows: Vec<usize>,
    /// The text of each, as a part of `bytes`.
    spans: Vec<Range<usize>>,
    bytes: Vec<u8>,
}

impl MixedCells {
    /// Adds a cell, of which `number` and `text` return the number and the text.
    #[inline]
    pub(super) fn push<'a>(
        &mut self,
        need: Need,
        number: impl FnOnce() -> Option<f64>,
        text: impl FnOnce() -> Cow<'a, [u8]>,
    ) {
        let number = if need == Need::Texts { None } else { number() }.unwrap_or(f64::NAN);
        let is_plain = number.abs() < MIN_LONG;
        if !is_plain || matches!(need, Need::Texts | Need::Both) {
            self.push_text(&text(), need == Need::Words);
        }
        self.numbers.push(number);
    }

    fn push_text(&mut self, text: &[u8], is_word: bool) {
        if text.is_empty() || is_word && is_missing_value(text) {
            return;
        }
        // The names of runs and joints repeat.
        let span = match self.spans.last().filter(|span| self.bytes[(*span).clone()] == *text) {
            Some(last) => last.clone(),
            None => {
                let start = self.bytes.len();
                self.bytes.extend(text);
                start..self.bytes.len()
            }
        };
        self.rows.push(self.numbers.len());
        self.spans.push(span);
    }

    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    pub(super) fn number(&self, row: usize) -> f64 {
        self.numbers.get(row).copied().unwrap_or(f64::NAN)
    }

    /// Returns the text of a cell; `None` if it is that of its number.
    pub(super) fn text(&self, row: usize) -> Option<&[u8]> {
        // A column of texts has one in each row.
        let at = match self.rows.get(row) {
            Some(of) if *of == row => row,
            _ => self.rows.binary_search(&row).ok()?,
        };
        Some(&self.bytes[self.spans[at].clone()])
    }

    /// Returns the cells of some rows; a missing value where there is no row.
    pub(super) fn select(&self, rows: impl Iterator<Item = Option<usize>>) -> Self {
        let mut selected = Self::default();
        for row in rows {
            let text = || row.and_then(|row| self.text(row)).unwrap_or_default();
            selected.push(Need::Both, || row.map(|row| self.number(row)), || text().into());
        }
        selected
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(need: Need, cells: &[&str]) -> MixedCells {
        let mut column = MixedCells::default();
        for cell in cells {
            column.push(need, || cell.parse().ok(), || cell.as_bytes().into());
        }
        column
    }

    #[test]
    fn push_keeps_texts_that_hold_more_than_their_number() {
        let cells = ["1.50", "1700000000000000001", "on", "on", "", "nan", "2"];
        let texts = |need| {
            let column = column(need, &cells);
            assert_eq!((column.len(), column.number(6).is_nan()), (7, need == Need::Texts));
            let text =
                |row| column.text(row).map(|text| String::from_utf8_lossy(text).into_owned());
            (0..7).map(|row| text(row).unwrap_or_default()).collect::<Vec<_>>()
        };
        assert_eq!(texts(Need::Numbers), ["", "1700000000000000001", "on", "on", "", "nan", ""]);
        assert_eq!(texts(Need::Words)[5], "");
        assert_eq!(texts(Need::Texts), cells);
        assert_eq!(texts(Need::Both), cells);
        let all = column(Need::Both, &cells);
        assert_eq!(all.spans[2], all.spans[3], "equal texts are kept once");
        assert_eq!(all.select([Some(3), None].into_iter()).text(0), Some(&b"on"[..]));
    }
}
