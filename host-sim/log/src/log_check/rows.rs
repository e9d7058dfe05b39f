//! Rows that a check marks: how they are named, and left out.

use crate::clean::retain;
use crate::dataset::{Dataset, Place, Run};
use crate::number::figure;
use std::collections::BTreeSet;

/// Rows of a log.
pub type Rows = BTreeSet<Place>;

impl Place {
    /// Names the row for a message.
    pub(super) fn in_words(self, data: &Dataset) -> String {
        let run = &data.runs[self.run];
        format!("run {} at {} s", run.name, figure(run.time_s[self.row]))
    }
}

/// Names the first of some rows for a message; an empty text for none.
pub fn first_in_words(rows: &Rows, data: &Dataset) -> String {
    rows.first().map(|place| place.in_words(data)).unwrap_or_default()
}

/// Leaves rows out. A velocity that was derived from the position stays.
pub fn leave_out(data: &mut Dataset, rows: &Rows) {
    for (run, of) in data.runs.iter_mut().enumerate() {
        let mut keep = vec![true; of.len()];
        let bad = rows.range(Place { run, row: 0 }..Place { run: run + 1, row: 0 });
        bad.for_each(|place| keep[place.row] = false);
        if keep.contains(&false) {
            *of = of.with_columns(|column| {
                let mut kept = column.clone();
                retain(&mut kept, &keep);
                kept
            });
        }
    }
    data.bad_rows.count += rows.len();
    data.runs.retain(|run| !run.is_empty());
    data.rows = data.runs.iter().map(Run::len).sum();
}
