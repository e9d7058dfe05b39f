//! The page: blocks in the order a reader should meet them.
//!
//! The HTML is written with `maud`, which escapes every text by itself; the only raw pieces are
//! our own style and script, Plotly.js, and chart data that `figure` has made safe. The content
//! security policy in the head is what makes "self-contained" a fact and not a promise: the
//! browser refuses to load anything, from anywhere, for this page.
//!
//! Plotly.js lies inside the `plotly` crate, so nothing is downloaded, neither by us nor by the
//! reader. It is put in only when the page has a chart: it weighs 4.7 MB.

use std::io;
use std::path::Path;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::Chart;
use super::drawing::Drawing;
use super::table::Table;
use super::write::write_atomically;

/// Nothing is loaded; `data:` and `blob:` are for saving a chart as an image.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                      img-src data: blob:; base-uri 'none'; form-action 'none'";
const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// One element of a page.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// The title of a section.
    Heading(String),
    /// Plain text. A first block of this kind is set larger: it is the summary.
    Paragraph(String),
    /// One point per entry. A first block of this kind is set larger too.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A chart over the whole width.
    Chart(Chart),
    /// What a reader takes along if they read no further: facts by name, and a picture beside them; on narrow
    /// screens below them.
    Lead {
        /// Name and text.
        facts: Vec<(String, String)>,
        /// The picture.
        chart: Chart,
    },
    /// The headings of the page, to jump to.
    Contents,
    /// Charts side by side; on narrow screens below each other.
    Row(Vec<Chart>),
    /// Blocks behind one line that opens them; printing opens all.
    Details {
        /// The line.
        summary: String,
        /// What it hides.
        blocks: Vec<Block>,
    },
}

/// A report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Page {
    /// Also the name of the browser's tab.
    pub title: String,
    /// One line below the title; none when empty.
    pub subtitle: String,
    /// In the order they are read.
    pub blocks: Vec<Block>,
}

impl Page {
    /// A page without blocks.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: subtitle.into(), blocks: Vec::new() }
    }

    /// Adds a block at the end.
    pub fn push(&mut self, block: Block) -> &mut Self {
        self.blocks.push(block);
        self
    }

    /// The page as one HTML document that needs nothing else.
    pub fn render(&self) -> String {
        let has_chart = self.blocks.iter().any(has_chart);
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
                }
                body {
                    main {
                        header {
                            h1 { (self.title) }
                            @if !self.subtitle.is_empty() { p.subtitle { (self.subtitle) } }
                        }
                        @if has_chart {
                            noscript { p.no-data { "The charts of this page need JavaScript." } }
                        }
                        @for block in &self.blocks {
                            @if *block == Block::Contents { (self.contents()) }
                            @else { (block.render(&mut drawing, false)) }
                        }
                    }
                    @if has_chart {
                        (PreEscaped(plotly_script()))
                        script { (PreEscaped(SCRIPT)) }
                    }
                }
            }
        }
        .into_string()
    }

    /// Links to the headings.
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

    /// Writes the page as the whole content of `file`, whose folder must be there.
    ///
    /// # Errors
    /// As [`write_atomically`]; what was at `file` before is then still there.
    pub fn write(&self, file: &Path) -> io::Result<()> {
        write_atomically(file, self.render().as_bytes())
    }
}

impl Block {
    fn render(&self, drawing: &mut Drawing, nested: bool) -> Markup {
        html! {
            @match self {
                Block::Heading(text) if nested => h3 { (text) },
                Block::Heading(text) => h2 id=(anchor(text)) { (text) },
                Block::Paragraph(text) => p { (text) },
                Block::List(entries) => ul { @for entry in entries { li { (entry) } } },
                Block::Table(table) => (table.render()),
                Block::Chart(chart) => (chart.render(drawing, 1)),
                Block::Lead { facts, chart } => div.lead {
                    dl { @for (name, text) in facts { dt { (name) } dd { (text) } } }
                    (chart.render(drawing, 2))
                },
                // Laid out by the page, which knows its headings.
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

fn has_chart(block: &Block) -> bool {
    match block {
        Block::Chart(_) | Block::Lead { .. } => true,
        Block::Row(charts) => !charts.is_empty(),
        Block::Details { blocks, .. } => blocks.iter().any(has_chart),
        Block::Heading(_)
        | Block::Paragraph(_)
        | Block::List(_)
        | Block::Table(_)
        | Block::Contents => false,
    }
}

/// What a heading is found by: its letters and digits.
fn anchor(heading: &str) -> String {
    let letters = heading.chars().map(|letter| match letter {
        letter if letter.is_alphanumeric() => letter.to_ascii_lowercase(),
        _ => '-',
    });
    letters.collect()
}

/// Plotly.js in its script element. The crate hands out MathJax behind it, two megabytes to set
/// formulas that no chart of ours has; that second element is left out.
fn plotly_script() -> String {
    const END: &str = "</script>";
    let mut scripts = plotly::Plot::offline_js_sources();
    if let Some(at) = scripts.find(END) {
        scripts.truncate(at + END.len());
    }
    scripts
}
