//! The HTML of a chart: title, figure, caption, and a description for screen readers.

use super::chart::Chart;
use super::figure::{self, Figure};
use super::palette::Palette;
use maud::{Markup, PreEscaped, html};

/// State shared by the charts of a page.
#[derive(Debug)]
pub(super) struct Drawing {
    palette: Palette,
    /// Number of charts so far.
    pub charts: usize,
    /// Number of the chart below which the hint for all charts is.
    pub hint_after: usize,
}

impl Default for Drawing {
    fn default() -> Self {
        Self { palette: Palette::default(), charts: 0, hint_after: 1 }
    }
}

/// Widths of a chart on paper in CSS pixels, over the whole line and over half of it. They fit A4 and Letter with the
/// margins of the style sheet.
const PRINTED_WIDTH: [u32; 2] = [680, 330];

impl Chart {
    /// Renders the chart. `beside` is the number of charts on the same line, including this one.
    pub(super) fn render(&self, drawing: &mut Drawing, beside: usize) -> Markup {
        drawing.charts += 1;
        let id = format!("chart-{}", drawing.charts);
        let Figure { json, height } = figure::figure(self, &mut drawing.palette, beside > 1);
        html! {
            figure aria-labelledby={ (id) "-title" } {
                p.chart-title id={ (id) "-title" } { (self.title) }
                @if let Some(json) = json {
                    div.plot id=(id) role="img" aria-label=(self.in_words())
                        style={ "height:" (height) "px" } data-height=(height)
                        data-print-width=(PRINTED_WIDTH[usize::from(beside > 1)]) {}
                    script type="application/json" id={ (id) "-data" } { (PreEscaped(json)) }
                } @else {
                    p.no-data { "There is no finite value to draw." }
                }
                @if !self.caption.is_empty() { figcaption { (self.caption) } }
                @if drawing.charts == drawing.hint_after {
                    p.hint {
                        "All charts: drag to zoom, double-click to reset, click a name in the \
                         legend to hide or show it."
                    }
                }
            }
        }
    }

    /// Describes the chart for screen readers.
    fn in_words(&self) -> String {
        let names: Vec<&str> = self.series.iter().map(|series| series.name.as_str()).collect();
        let Self { title, caption, x, y, .. } = self;
        format!("{title}. {} over {}: {}. {caption}", y.label, x.label, names.join(", "))
    }
}
