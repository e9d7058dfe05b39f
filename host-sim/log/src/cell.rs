//! Access to the numbers of a column, in the unit of the contract.
//!
//! A cell usually holds one number. It may be in another unit ([`Conversion`]), or hold a list, as ROS writes arrays
//! into CSV (`[0.1 0.2]`, `"[0.1, 0.2]"`, `array('d', [0.1, 0.2])`). `velocity[1]` selects one element of a list.

use super::table::Row;
use super::unit::Conversion;

/// Reads the numbers of one column.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct CellReader {
    /// The column in the file.
    pub index: usize,
    /// The element of the list in each cell, from 0; `None` if a cell is one number.
    pub element: Option<usize>,
    /// The unit conversion; `None` if the numbers are in the contract's unit.
    pub conversion: Option<Conversion>,
}

impl CellReader {
    /// Returns the reader of a column without list or conversion.
    pub fn plain(index: usize) -> Self {
        Self { index, ..Self::default() }
    }

    /// Returns the number as in the file.
    #[inline]
    pub fn raw(&self, row: &Row) -> Option<f64> {
        match self.element {
            None => row.number(self.index),
            Some(element) => element_of(&row.text(self.index), element),
        }
    }

    /// Returns the number in the contract's unit.
    #[inline]
    pub fn value(&self, row: &Row) -> Option<f64> {
        let raw = self.raw(row)?;
        Some(self.conversion.map_or(raw, |conversion| conversion.apply(raw)))
    }
}

/// Parses an element of a list.
fn element_of(cell: &[u8], element: usize) -> Option<f64> {
    let inside = match cell.iter().rposition(|byte| matches!(byte, b'[' | b'(')) {
        // The innermost list: the text before it names its type.
        Some(open) => {
            let rest = &cell[open + 1..];
            let close = rest.iter().position(|byte| matches!(byte, b']' | b')'));
            &rest[..close.unwrap_or(rest.len())]
        }
        None => cell,
    };
    let is_between = |byte: &u8| matches!(byte, b',' | b';' | b'|') || byte.is_ascii_whitespace();
    let mut numbers = inside.split(is_between).filter(|number| !number.is_empty());
    fast_float2::parse(numbers.nth(element)?).ok()
}

/// Returns true if a cell looks like a list.
pub(super) fn is_list(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    cell.first().is_some_and(|byte| matches!(byte, b'[' | b'(')) || cell.starts_with(b"array(")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn element_of_with_common_list_notations_returns_element() {
        for list in ["[0.1 0.2 -3]", "[0.1, 0.2, -3]", "(0.1;0.2;-3)", "array('d', [0.1, 0.2, -3])"]
        {
            assert_eq!(element_of(list.as_bytes(), 0), Some(0.1), "{list}");
            assert_eq!(element_of(list.as_bytes(), 2), Some(-3.0), "{list}");
            assert_eq!(element_of(list.as_bytes(), 3), None, "{list}");
        }
        assert_eq!(element_of(b"[a b]", 0), None);
        assert!(is_list(b" [1 2]") && !is_list(b"1.5"));
    }
}
