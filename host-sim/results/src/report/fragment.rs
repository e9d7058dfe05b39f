//! The first screen of a page as an HTML fragment without scripts and style sheets, for a cell of a notebook.

use super::answers::with_code;
use super::page::{Block, Page};
use super::{Chart, Style, Tile};
use joint_log::number::significant;
use maud::{Markup, html};

/// Length of the longest bar, px: a third of a notebook's cell on a small screen.
const BAR_PX: f64 = 240.0;

const NAME: &str = "font-weight: 600";
const TEXT: &str = "margin: 0 0 .4em 1.2em";

impl Page {
    /// Renders title, answers, facts, figures and lists of the page. Of its charts, those of bars are kept.
    pub fn fragment(&self) -> String {
        html! {
            div style="max-width: 60em" {
                p style=(NAME) { (self.title) }
                @if !self.subtitle.is_empty() { p { (self.subtitle) } }
                @if let Some(answers) = &self.answers { (named(answers.each().into_iter())) }
                @for block in &self.blocks { (part(block)) }
            }
        }
        .into_string()
    }
}

fn part(block: &Block) -> Markup {
    match block {
        Block::Tiles(tiles) => html! { table { tbody { @for tile in tiles { (figures(tile)) } } } },
        Block::Lead { facts, charts } => html! {
            (named(facts.iter().map(|(name, text)| (name.as_str(), text.as_str()))))
            @for chart in charts { (bars(chart)) }
        },
        Block::List(entries) => html! { ol { @for entry in entries { li { (entry) } } } },
        Block::Paragraph(text) => html! { p { (text) } },
        _ => Markup::default(),
    }
}

fn named<'a>(facts: impl Iterator<Item = (&'a str, &'a str)>) -> Markup {
    html! { dl { @for (name, text) in facts {
        @if !name.is_empty() { dt style=(NAME) { (name) } }
        dd style=(TEXT) { (with_code(text)) }
    } } }
}

fn figures(tile: &Tile) -> Markup {
    html! { tr { td { (tile.name) } td { (tile.figure) } @for note in &tile.notes { td { (note) } } } }
}

/// Renders the bars of a chart with their values; nothing for a chart of another style.
fn bars(chart: &Chart) -> Markup {
    let longest = chart.series.iter().flat_map(|series| &series.x).copied().fold(0.0, f64::max);
    html! { @if chart.series.iter().all(|series| series.style == Style::Bars) {
        dl { dt style=(NAME) { (chart.title) ": " (chart.x.label) }
        @for series in &chart.series { @for value in &series.x {
            dd style=(TEXT) {
                span style={
                    "display: inline-block; height: .8em; background: #0072b2; width: "
                    (format!("{:.0}", BAR_PX * value / longest.max(f64::MIN_POSITIVE))) "px"
                } {}
                " " (series.name) ": " (significant(*value, 3))
            }
        } } }
    } }
}
