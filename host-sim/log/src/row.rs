//! The interface of a row, which every log format implements.

use std::borrow::Cow;

/// One row of a log.
pub(super) trait LogRow {
    /// Returns the cell as a number, which may be NaN or infinite. Returns `None` if it is not a number.
    fn number(&self, column: usize) -> Option<f64>;
    /// Returns the cell as text without surrounding blanks.
    fn text(&self, column: usize) -> Cow<'_, [u8]>;
}
