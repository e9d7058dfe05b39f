//! The page: a list of blocks, rendered as one HTML document.
//!
//! `maud` writes the HTML and escapes every text. Only the style, the scripts and the rows of a search table are inserted
//! without escaping. The content security policy in the head makes the browser reject every attempt to load something.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::answers::{Answers, with_code};
use super::chart::Chart;
use super::drawing::Drawing;
use super::finder::Finder;
use super::table::Table;
use super::tile::Tile;

/// Forbids all loading.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; \
                      base-uri 'none'; form-action 'none'";

const STYLE: &str = include_str!("report.css");
const TILE_STYLE: &str = include_str!("tile.css");
const CHART_SCRIPT: &str = include_str!("chart.js");
const FINDER_SCRIPT: &str = include_str!("finder.js");

/// One element of a page.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// Title of a section.
    Heading(String),
    /// Plain text.
    Paragraph(String),
    /// A list.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A table whose rows are read one by one. On narrow screens, each row is a paragraph that starts with its first cell.
    Records(Table),
    /// A table with a search field.
    Find(Finder),
    /// A chart over the whole width.
    Chart(Chart),
    /// The main result: named facts with charts beside them. A fact without a name continues the one above it. On narrow
    /// screens, the first chart follows the first fact, and the other charts follow the last one.
    Lead {
        /// Name and text of each fact. A part of a text between two backticks is shown as code.
        facts: Vec<(String, String)>,
        /// The charts, most important first.
        charts: Vec<Chart>,
    },
    /// Main figures side by side.
    Tiles(Vec<Tile>),
    /// Links to the headings of the page.
    Contents,
    /// Charts side by side, or below each other on narrow screens.
    Row(Vec<Chart>),
    /// A collapsed block that opens with a click; printing opens all of them.
    Details {
        /// The visible line.
        summary: String,
        /// The collapsed blocks.
        blocks: Vec<Block>,
    },
}

/// A report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Page {
    /// Title of the page and of the browser tab.
    pub title: String,
    /// Line below the title; may be empty.
    pub subtitle: String,
    /// The answers below them; `None` for a part of a page.
    pub answers: Option<Answers>,
    /// Blocks in their order on the page.
    pub blocks: Vec<Block>,
}

impl Page {
    /// Creates a page without blocks.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: subtitle.into(), ..Self::default() }
    }

    /// Sets the answers on top.
    #[must_use]
    pub fn answering(self, answers: Answers) -> Self {
        Self { answers: Some(answers), ..self }
    }

    /// Adds the blocks of a section.
    pub fn add(&mut self, section: impl IntoIterator<Item = Block>) -> &mut Self {
        self.blocks.extend(section);
        self
    }

    /// Adds a block at the end.
    pub fn push(&mut self, block: Block) -> &mut Self {
        self.blocks.push(block);
        self
    }

    /// Thins every curve and cloud of dots to at most `most` points, for a page of fewer bytes.
    pub fn limit_points(&mut self, most: usize) {
        self.for_each_chart(&mut |chart| chart.limit_points(most));
    }

    /// Says in the legends of all charts what the series of a name are.
    pub fn explain(&mut self, name: &str, meaning: &str) {
        self.for_each_chart(&mut |chart| chart.explain(name, meaning));
    }

    fn for_each_chart(&mut self, change: &mut dyn FnMut(&mut Chart)) {
        self.blocks.iter_mut().for_each(|block| block.for_each_chart(change));
    }

    /// Renders the page as a self-contained HTML document.
    pub fn render(&self) -> String {
        let holds = |is_meant| self.blocks.iter().any(|block| block.holds(is_meant));
        let mut drawing = Drawing::default();
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy" content=(POLICY);
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    link rel="icon" href="data:,";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                    @if holds(|block| matches!(block, Block::Tiles(_))) {
                        style { (PreEscaped(TILE_STYLE)) }
                    }
                }
                body {
                    main {
                        header {
                            h1 { (self.title) }
                            @if !self.subtitle.is_empty() { p.subtitle { (self.subtitle) } }
                        }
                        @if let Some(answers) = &self.answers { (answers.render()) }
                        @for block in &self.blocks {
                            @if *block == Block::Contents { (self.contents()) }
                            @else { (block.render(&mut drawing, false)) }
                        }
                    }
                    @if drawing.charts > 0 { script { (PreEscaped(CHART_SCRIPT)) } }
                    @if holds(|block| matches!(block, Block::Find(_))) {
                        script { (PreEscaped(FINDER_SCRIPT)) }
                    }
                }
            }
        }
        .into_string()
    }

    /// Renders links to the headings.
    fn contents(&self) -> Markup {
        let headings = self.blocks.iter().filter_map(|block| match block {
            Block::Heading(text) => Some(text),
            _ => None,
        });
        html! {
            nav.contents aria-label="Contents" {
                @for text in headings { a href={ "#" (anchor(text)) } { (text) } " " }
            }
        }
    }
}

impl From<Chart> for Block {
    fn from(chart: Chart) -> Self {
        Self::Chart(chart)
    }
}

impl From<Table> for Block {
    fn from(table: Table) -> Self {
        Self::Table(table)
    }
}

impl Block {
    /// Creates a collapsed block.
    pub fn details(summary: impl Into<String>, blocks: Vec<Self>) -> Self {
        Self::Details { summary: summary.into(), blocks }
    }

    /// Arranges charts in rows of two; with an odd number, the first row has three.
    pub fn rows(mut charts: Vec<Chart>) -> Vec<Self> {
        if charts.len() == 1 {
            return charts.into_iter().map(Self::Chart).collect();
        }
        let mut rows = Vec::new();
        while !charts.is_empty() {
            let rest = charts.split_off(if charts.len() % 2 == 1 { 3 } else { 2 });
            rows.push(Self::Row(charts));
            charts = rest;
        }
        rows
    }

    fn render(&self, drawing: &mut Drawing, nested: bool) -> Markup {
        html! {
            @match self {
                Block::Heading(text) if nested => h3 { (text) },
                Block::Heading(text) => h2 id=(anchor(text)) { (text) },
                Block::Paragraph(text) => p { (text) },
                Block::List(entries) => ul { @for entry in entries { li { (entry) } } },
                Block::Table(table) => (table.render()),
                Block::Records(table) => (table.render_records()),
                Block::Find(finder) => (finder.render()),
                Block::Chart(chart) => (chart.render(drawing, 1)),
                Block::Lead { facts, charts } => (lead(facts, charts, drawing)),
                Block::Tiles(tiles) => div.tiles { @for tile in tiles { (tile.render()) } },
                // The page renders this block, because it has the headings.
                Block::Contents => "",
                Block::Row(charts) => div.row {
                    @for chart in charts { (chart.render(drawing, charts.len())) }
                },
                Block::Details { summary, blocks } => details {
                    summary { (summary) }
                    @for block in blocks { (block.render(drawing, true)) }
                },
            }
        }
    }
}

/// Renders a lead block. The style sheet places its four parts.
fn lead(facts: &[(String, String)], charts: &[Chart], drawing: &mut Drawing) -> Markup {
    if drawing.charts == 0 {
        drawing.hint_after = charts.len();
    }
    let (first, rest) = facts.split_at(facts.len().min(1));
    let (main, below) = charts.split_at(charts.len().min(1));
    let listed = |facts: &[(String, String)]| {
        html! { @for (name, text) in facts {
            @if !name.is_empty() { dt { (name) } }
            dd { (with_code(text)) }
        } }
    };
    html! {
        div.lead {
            dl.lead-first { (listed(first)) }
            div.lead-main { @for chart in main { (chart.render(drawing, 2)) } }
            dl.lead-rest { (listed(rest)) }
            div.lead-below { @for chart in below { (chart.render(drawing, 2)) } }
        }
    }
}

impl Block {
    /// Returns true if this block or one inside of it is meant.
    fn holds(&self, is_meant: fn(&Self) -> bool) -> bool {
        let inside = match self {
            Self::Details { blocks, .. } => blocks.as_slice(),
            _ => &[],
        };
        is_meant(self) || inside.iter().any(|block| block.holds(is_meant))
    }

    fn for_each_chart(&mut self, change: &mut dyn FnMut(&mut Chart)) {
        match self {
            Self::Chart(chart) => change(chart),
            Self::Row(charts) | Self::Lead { charts, .. } => charts.iter_mut().for_each(change),
            Self::Details { blocks, .. } => {
                blocks.iter_mut().for_each(|block| block.for_each_chart(change));
            }
            _ => {}
        }
    }
}

/// Returns the anchor of a heading: its letters and digits.
fn anchor(heading: &str) -> String {
    let letters = heading.chars().map(|letter| match letter {
        letter if letter.is_alphanumeric() => letter.to_ascii_lowercase(),
        _ => '-',
    });
    letters.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn render_of_collapsed_blocks_has_their_style_and_script() {
        let blocks = vec![Block::Tiles(vec![Tile::default()]), Block::Find(Finder::default())];
        let mut page = Page::new("title", "");
        assert!(!page.render().contains(TILE_STYLE) && !page.render().contains(FINDER_SCRIPT));
        page.push(Block::details("more", blocks));
        assert!(page.render().contains(TILE_STYLE));
        assert!(page.render().contains(FINDER_SCRIPT));
    }
}
