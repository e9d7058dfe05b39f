//! A figure in large type.

use maud::{Markup, html};

/// Whether a figure is good news.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// It shows no difference.
    #[default]
    Neutral,
    /// An improvement.
    Good,
    /// A deterioration.
    Bad,
}

/// A figure with its name above it and a note below it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tile {
    /// Name of the quantity.
    pub name: String,
    /// The figure, a few letters.
    pub figure: String,
    /// What it rests on: interval, values.
    pub notes: Vec<String>,
    /// Colour of its edge. The notes must say the same in words.
    pub tone: Tone,
}

impl Tile {
    pub(super) fn render(&self) -> Markup {
        let tone = match self.tone {
            Tone::Neutral => "tile",
            Tone::Good => "tile good",
            Tone::Bad => "tile bad",
        };
        html! {
            div class=(tone) {
                p { (self.name) }
                p.figure { (self.figure) }
                @for note in &self.notes { p.note { (note) } }
            }
        }
    }
}
