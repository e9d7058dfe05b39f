//! The first screen of a session as an HTML fragment without scripts and style sheets, for a cell of a notebook.

use super::page::{facts, is_shown};
use super::{TuneReport, words};
use maud::html;

impl TuneReport {
    /// Returns the outcome, the changes with their intervals, the cause, and what was not learnt, as an HTML fragment.
    pub fn first_screen(&self) -> String {
        let gains: Vec<_> = self.gains.iter().filter(|gain| is_shown(gain)).collect();
        html! {
            div style="max-width: 60em" {
                p style="font-weight: 600" { (words::title(self)) }
                p { (words::headline(self)) }
                @if !gains.is_empty() {
                    table {
                        thead { tr { th { "quantity" } th { "change" } th { "95 % interval" } th { "means" } } }
                        tbody {
                            @for gain in gains {
                                tr {
                                    td { (words::name(gain.quantity)) }
                                    td { (words::change(gain)) }
                                    td { (words::interval(gain)) }
                                    td { (words::means(gain)) }
                                }
                            }
                        }
                    }
                }
                dl {
                    @for (name, text) in facts(self) {
                        @if !name.is_empty() { dt style="font-weight: 600" { (name) } }
                        dd style="margin: 0 0 .4em 1.2em" { (text) }
                    }
                }
            }
        }
        .into_string()
    }
}
