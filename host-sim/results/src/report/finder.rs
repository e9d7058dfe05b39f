//! A table that a reader searches: of ten thousand rows, the page shows the few that contain what was typed.
//!
//! The rows are JSON inside the page, and its script builds the visible part. Without a script, the first rows are shown.

use super::table::RECORDS;
use maud::{Markup, PreEscaped, html};
use serde_json::json;

/// A table with a search field.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Finder {
    /// Name of each column.
    pub header: Vec<String>,
    /// Texts of each row.
    pub rows: Vec<Vec<String>>,
    /// Relative link of each row's first cell; empty for none.
    pub targets: Vec<String>,
    /// Largest number of visible rows.
    pub most: usize,
}

impl Finder {
    pub(super) fn render(&self) -> Markup {
        let data = json!({ "rows": self.rows, "targets": self.targets, "most": self.most });
        let data = data.to_string().replace('<', "\\u003c");
        html! {
            div.finder {
                label { "Search: " input type="search" autocomplete="off"; } " "
                span.found aria-live="polite" { (self.rows.len()) " rows" }
                div class=(RECORDS) { table {
                    thead { tr { @for name in &self.header { th scope="col" { (name) } } } }
                    tbody {
                        @for (row, target) in self.rows.iter().zip(&self.targets).take(self.most) {
                            tr { @for (at, text) in row.iter().enumerate() {
                                td data-label=(self.header[at]) {
                                    @if at == 0 && !target.is_empty() { a href=(target) { (text) } }
                                    @else { (text) }
                                }
                            } }
                        }
                    }
                } }
                script type="application/json" { (PreEscaped(data)) }
            }
        }
    }
}
