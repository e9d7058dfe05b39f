//! The HTML of a chart: title, legend, axes, SVG drawing, caption, and a description for screen readers.
//!
//! The drawing is SVG, stretched to the width of the page. Texts are HTML beside it, so that they keep their size and break
//! into lines on every width of screen and paper. `chart.js` adds values under the pointer, zooming and hiding of series.

use super::chart::{Axis, Chart, Series, Style};
use super::marks::{self, Scales, style_name};
use super::palette::Palette;
use super::scale::{LENGTH, Tick};
use maud::{Markup, html};

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

/// Number of ticks that a horizontal axis over the whole width has about, and one over half of it.
const X_TICKS: [usize; 2] = [9, 5];
/// Least and largest number of ticks that a vertical axis has about, and pixels for each.
const Y_TICKS: [usize; 2] = [3, 6];
const Y_TICK_PX: usize = 26;

impl Chart {
    /// Renders the chart. `beside` is the number of charts on the same line, including this one.
    pub(super) fn render(&self, drawing: &mut Drawing, beside: usize) -> Markup {
        drawing.charts += 1;
        let id = format!("chart-{}", drawing.charts);
        let classes: Vec<String> = self
            .series
            .iter()
            .map(|series| match &series.colour_of {
                _ if series.muted => Palette::muted(),
                other => drawing.palette.classes(other.as_ref().unwrap_or(&series.name)),
            })
            .collect();
        html! {
            figure aria-labelledby={ (id) "-title" } {
                p.chart-title id={ (id) "-title" } { (self.title) }
                @if let Some(scales) = Scales::of(self) {
                    @if self.needs_legend() { (legend(&self.series, &classes)) }
                    (self.plot(&classes, &scales, beside > 1))
                } @else {
                    p.no-data { "There is no finite value to draw." }
                }
                @if !self.caption.is_empty() { figcaption { (self.caption) } }
                @if drawing.charts == drawing.hint_after {
                    p.hint {
                        "All charts: point at a mark to read its value, drag to zoom, double-click to reset and \
                         again to show all values, click a name in the legend to hide or show it."
                    }
                }
            }
        }
    }

    fn plot(&self, classes: &[String], scales: &Scales, small: bool) -> Markup {
        let ticks = |axis: &Axis, of: &dyn Fn() -> Vec<Tick>| match axis.categories.is_empty() {
            true => of(),
            false => Vec::new(),
        };
        let x = ticks(&self.x, &|| scales.x.ticks(X_TICKS[usize::from(small)]));
        let y = ticks(&self.y, &|| {
            let [least, most] = Y_TICKS;
            scales.y.ticks((self.height(small) / Y_TICK_PX).clamp(least, most))
        });
        let grid = marks::grid(x.iter().map(|tick| tick.place), y.iter().map(|tick| tick.place));
        let zero = |axis: &Axis, of: &dyn Fn() -> i64| {
            let at = of();
            (!axis.log && axis.categories.is_empty() && (1..LENGTH as i64).contains(&at))
                .then_some(at)
        };
        html! {
            div.plot style={ "--height:" (self.height(small)) "px" }
                data-x=(scales.x.in_words()) data-y=(scales.y.in_words()) {
                div.y-label { (self.y.label) }
                (axis("y", &self.y, &y))
                svg.area viewBox={ "0 0 " (LENGTH) " " (LENGTH) } preserveAspectRatio="none"
                    role="img" aria-label=(self.in_words()) {
                    path.grid d=(grid) {}
                    @if let Some(at) = zero(&self.x, &|| scales.x.base()) {
                        path.zero d={ "M" (at) " 0V" (LENGTH) } {}
                    }
                    @if let Some(at) = zero(&self.y, &|| scales.y.base()) {
                        path.zero d={ "M0 " (at) "H" (LENGTH) } {}
                    }
                    @for (index, (series, classes)) in self.series.iter().zip(classes).enumerate() {
                        (marks::series(series, index, classes, self, scales))
                    }
                }
                (axis("x", &self.x, &x))
                div.x-label { (self.x.label) }
            }
        }
    }

    fn height(&self, small: bool) -> usize {
        match self.y.categories.len() {
            0 => self.y.height_px.unwrap_or(if small { 320 } else { 400 }),
            names => 80 + 34 * names,
        }
    }

    /// Returns false for a single series, and for series whose names are on an axis and say what they are.
    fn needs_legend(&self) -> bool {
        let mut names = self.x.categories.iter().chain(&self.y.categories);
        let is_named =
            |series: &Series| series.meaning.is_empty() && names.any(|name| *name == series.name);
        self.series.len() > 1 && !self.series.iter().all(is_named)
    }

    /// Describes the chart for screen readers.
    fn in_words(&self) -> String {
        let names: Vec<&str> = self.series.iter().map(|series| series.name.as_str()).collect();
        let Self { title, caption, x, y, .. } = self;
        format!("{title}. {} over {}: {}. {caption}", y.label, x.label, names.join(", "))
    }
}

/// Renders the names or the ticks of an axis.
fn axis(direction: &str, axis: &Axis, ticks: &[Tick]) -> Markup {
    let longest = ticks.iter().map(|tick| tick.label.chars().count()).max().unwrap_or(0);
    let side = if direction == "x" { "left" } else { "top" };
    html! {
        @if axis.categories.is_empty() {
            div class={ (direction) "-ticks" } style={ "--letters:" (longest) } aria-hidden="true" {
                @for Tick { place, label } in ticks {
                    span style={ (side) ":" (format!("{:.2}", 100.0 * place)) "%" } { (label) }
                }
            }
        } @else {
            div class={ (direction) "-names" } { @for name in &axis.categories { span { (name) } } }
        }
    }
}

/// Renders the names of the series with samples of their marks.
fn legend(series: &[Series], classes: &[String]) -> Markup {
    html! {
        div.legend {
            @for (series, classes) in series.iter().zip(classes) {
                button type="button" aria-pressed="true" {
                    svg class={ "sample " (classes) } viewBox="0 0 24 10" data-style=(style_name(&series.style)) aria-hidden="true" {
                        @match series.style {
                            Style::Points => path.dots d="M12 5h0" {},
                            Style::Line => path.line d="M1 5h22" {},
                            Style::Bars => rect x="2" width="20" height="10" {},
                            Style::Band { .. } => path.band d="M1 1h22v8h-22z" {},
                        }
                    }
                    (series.name) @if !series.meaning.is_empty() { ": " (series.meaning) }
                }
            }
        }
    }
}
