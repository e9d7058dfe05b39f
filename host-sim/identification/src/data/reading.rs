//! Where a column's numbers are in a file, and how they become the contract's.
//!
//! Mostly a cell is the number. It may be in another unit ([`Conversion`]), or hold a whole list, as ROS writes arrays
//! into CSV (`[0.1 0.2]`, `"[0.1, 0.2]"`, `array('d', [0.1, 0.2])`), of which `velocity[1]` names one element.

use super::clean::Row;
use super::unit::Conversion;

/// Where and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reading {
    /// The column of the file.
    pub index: usize,
    /// Which element of the list in each cell, from 0.
    pub element: Option<usize>,
    /// What is done to the numbers; `None` where they are in the contract's unit.
    pub conversion: Option<Conversion>,
}

impl Reading {
    /// Of a column as it stands.
    pub fn plain(index: usize) -> Self {
        Self { index, element: None, conversion: None }
    }

    /// The number as it stands in the file.
    #[inline]
    pub fn raw(&self, row: &impl Row) -> Option<f64> {
        match self.element {
            None => row.number(self.index),
            Some(element) => element_of(&row.text(self.index), element),
        }
    }

    /// The number in the contract's unit.
    #[inline]
    pub fn value(&self, row: &impl Row) -> Option<f64> {
        let raw = self.raw(row)?;
        Some(self.conversion.map_or(raw, |conversion| conversion.apply(raw)))
    }
}

/// An element of a list as text.
fn element_of(cell: &[u8], element: usize) -> Option<f64> {
    let inside = match cell.iter().rposition(|byte| matches!(byte, b'[' | b'(')) {
        // The innermost list: what stands before names its type.
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

/// Whether a cell looks like a list.
pub(super) fn is_list(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    cell.first().is_some_and(|byte| matches!(byte, b'[' | b'(')) || cell.starts_with(b"array(")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_of_lists_however_they_are_written() {
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
