//! The four answers on top of a page: what it is, how sure, what was gained, and what to do.

use maud::{Markup, html};

/// What the work behind a page was good for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Benefit {
    /// What was gained, or that nothing was.
    Gain(String),
    /// What the page is for, if nothing could be gained.
    Purpose(String),
}

/// One or two sentences for each question of a reader who has a minute. A part of a text between two backticks is shown as
/// code.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answers {
    /// What was found, or what the page shows.
    pub what: String,
    /// How sure that is: a probability, an interval, or what it was tested on.
    pub certainty: String,
    /// What it gained.
    pub benefit: Benefit,
    /// What to do now.
    pub next: String,
}

impl Answers {
    /// Returns the questions with their answers, in the order of the page.
    pub fn each(&self) -> [(&'static str, &str); 4] {
        let benefit = match &self.benefit {
            Benefit::Gain(text) => ("What did it gain?", text.as_str()),
            Benefit::Purpose(text) => ("What is it for?", text.as_str()),
        };
        [
            ("What is it?", &self.what),
            ("How sure?", &self.certainty),
            benefit,
            ("What now?", &self.next),
        ]
    }

    pub(super) fn render(&self) -> Markup {
        html! {
            dl.answers {
                @for (question, answer) in self.each() {
                    div { dt { (question) } dd { (with_code(answer)) } }
                }
            }
        }
    }
}

/// Renders a text in which parts between backticks are code. A line may break between the words of a command, but not
/// inside an option such as `--bus`.
pub(super) fn with_code(text: &str) -> Markup {
    html! {
        @for (place, part) in text.split('`').enumerate() {
            @if place % 2 == 0 { (part) }
            @else { code { @for (word, text) in part.split(' ').enumerate() {
                @if word > 0 { " " } span { (text) }
            } } }
        }
    }
}
