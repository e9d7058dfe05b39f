//! Converts a chart into Plotly JSON: traces, layout and configuration.
//!
//! Three details need care. Plotly interprets some HTML in every text (`<b>`, `<a href>`), so texts are escaped for it in
//! addition to the escaping of the page. JSON has no NaN: it is written as `null`, which Plotly draws as a gap. JSON
//! inside an HTML page ends at the first `</script`, even within quotes, so it must not contain `<`.
//!
//! All charts are SVG, not WebGL: SVG prints sharply, and browsers limit a page to sixteen WebGL contexts.

use plotly::common::{
    Anchor, DashType, Fill, Font, HoverInfo, Line, LineShape, Marker, Mode, Orientation, Title,
};
use plotly::configuration::{DisplayModeBar, ModeBarButtonName};
use plotly::layout::{
    Axis as PlotlyAxis, AxisType, BarMode, HoverMode, ItemSizing, Legend, Margin, TicksDirection,
};
use plotly::{Bar, Configuration, Layout, Scatter};
use serde_json::{Value, json};

use super::chart::{Axis, Chart, Series, Style};
use super::palette::{Look, Palette};

/// Number of dots above which they are drawn smaller.
const SMALL_DOT_COUNT: usize = 400;
/// Number of points of a curve above which it is drawn thinner.
const THIN_LINE_COUNT: usize = 1500;

/// A chart as Plotly JSON.
pub(super) struct Figure {
    /// JSON for the script of the page; `None` if there is no finite value to draw.
    pub json: Option<String>,
    /// Height, pixels.
    pub height: usize,
}

pub(super) fn figure(chart: &Chart, palette: &mut Palette, small: bool) -> Figure {
    let height = height(chart, small);
    let traces: Vec<Value> = chart
        .series
        .iter()
        .map(|series| {
            let look = match &series.colour_of {
                _ if series.muted => Palette::muted(),
                other => palette.look(other.as_ref().unwrap_or(&series.name)),
            };
            with_error(trace(series, &look, chart), series, chart)
        })
        .collect();
    let something = chart
        .series
        .iter()
        .any(|series| series.x.iter().zip(&series.y).any(|(x, y)| x.is_finite() && y.is_finite()));
    if !something {
        return Figure { json: None, height: 0 };
    }
    let configuration = Configuration::new()
        .responsive(true)
        .display_logo(false)
        .display_mode_bar(DisplayModeBar::Hover)
        .mode_bar_buttons_to_remove(vec![
            ModeBarButtonName::Select2d,
            ModeBarButtonName::Lasso2d,
            ModeBarButtonName::AutoScale2d,
            // Dragging and double-clicking do the same, and the buttons would need space beside the title.
            ModeBarButtonName::ZoomIn2d,
            ModeBarButtonName::ZoomOut2d,
        ]);
    let figure = json!({ "data": traces, "layout": layout(chart), "config": configuration });
    Figure { json: Some(figure.to_string().replace('<', "\\u003c")), height }
}

/// Escapes the tags and entities that Plotly interprets in texts.
fn plain(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace(['\n', '\r'], " ")
}

fn height(chart: &Chart, small: bool) -> usize {
    let names = chart.y.categories.len();
    match (names, small) {
        (0, false) => 420,
        (0, true) => 340,
        _ => 110 + 34 * names,
    }
}

fn trace(series: &Series, look: &Look, chart: &Chart) -> Value {
    let (x, y) = (series.x.clone(), series.y.clone());
    let name = plain(&series.name);
    let line = Line::new()
        .color(look.colour)
        .dash(look.dash.clone())
        .width(if x.len() > THIN_LINE_COUNT { 1.0 } else { 2.0 });
    match &series.style {
        Style::Points => {
            let many = x.len() > SMALL_DOT_COUNT;
            let on_names = !(chart.x.categories.is_empty() && chart.y.categories.is_empty());
            let size = if on_names {
                11
            } else if many {
                4
            } else {
                7
            };
            let marker = Marker::new().color(look.colour).symbol(look.symbol.clone()).size(size);
            let opacity = if many { 0.6 } else { 0.9 };
            json!(Scatter::new(x, y).mode(Mode::Markers).name(name).marker(marker).opacity(opacity))
        }
        Style::Line if series.error.is_some() => {
            let marker = Marker::new().color(look.colour).symbol(look.symbol.clone()).size(5);
            let scatter = Scatter::new(x, y).mode(Mode::LinesMarkers).name(name);
            json!(scatter.line(line).marker(marker))
        }
        Style::Line => json!(Scatter::new(x, y).mode(Mode::Lines).name(name).line(line)),
        Style::Steps => {
            let line = line.shape(LineShape::Hv);
            json!(Scatter::new(x, y).mode(Mode::Lines).name(name).line(line))
        }
        Style::Bars => {
            let lying = !chart.y.categories.is_empty();
            let orientation = if lying { Orientation::Horizontal } else { Orientation::Vertical };
            let marker = Marker::new().color(look.colour);
            let mut bars = json!(Bar::new(x, y).name(name).marker(marker).orientation(orientation));
            if one_bar_a_name(chart) {
                // By default, Plotly derives the width from the spacing within one series.
                bars["width"] = json!(0.8);
            }
            bars
        }
        Style::Band { upper } => {
            let (x, y) = outline(&series.x, &series.y, upper);
            let line = Line::new().color(look.colour).width(0.7).dash(DashType::Solid);
            let band = Scatter::new(x, y).mode(Mode::Lines).name(name).line(line);
            let band = band.fill(Fill::ToSelf).fill_color(faint(look.colour));
            json!(band.hover_info(HoverInfo::Skip))
        }
    }
}

/// Adds error bars to a trace; for horizontal bars they are horizontal.
fn with_error(mut trace: Value, series: &Series, chart: &Chart) -> Value {
    if let Some(error) = &series.error {
        // Plotly draws a cap for `null`, as for an error of 0, but nothing for a text.
        let known = |error: &f64| match error.is_finite() && *error > 0.0 {
            true => json!(error),
            false => json!("none"),
        };
        let sizes: Vec<Value> = error.iter().map(known).collect();
        let lying = series.style == Style::Bars && !chart.y.categories.is_empty();
        let mut bars = json!({ "type": "data", "array": sizes, "thickness": 1.2, "width": 3 });
        if series.style == Style::Bars {
            // In the bar's own colour, the half on the bar would be invisible.
            bars["color"] = "#444444".into();
        }
        trace[if lying { "error_x" } else { "error_y" }] = bars;
    }
    trace
}

/// Returns a colour `#RRGGBB` with an opacity of 20 %.
fn faint(colour: &str) -> String {
    format!("{colour}33")
}

/// Returns the closed outline of a band: along the lower edge and back along the upper edge. A gap in either edge ends an
/// outline and starts the next.
fn outline(x: &[f64], lower: &[f64], upper: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let edges: Vec<[f64; 3]> =
        x.iter().zip(lower).zip(upper).map(|((&x, &low), &high)| [x, low, high]).collect();
    let is_whole = |edge: &[f64; 3]| edge.iter().all(|value| value.is_finite());
    let mut corners: Vec<(f64, f64)> = Vec::new();
    for part in edges.split(|edge| !is_whole(edge)).filter(|part| !part.is_empty()) {
        if !corners.is_empty() {
            corners.push((f64::NAN, f64::NAN));
        }
        corners.extend(part.iter().map(|&[x, low, _]| (x, low)));
        corners.extend(part.iter().rev().map(|&[x, _, high]| (x, high)));
    }
    corners.into_iter().unzip()
}

fn layout(chart: &Chart) -> Layout {
    let font = Font::new().family("system-ui, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif");
    let legend = Legend::new()
        .orientation(Orientation::Horizontal)
        .item_sizing(ItemSizing::Constant)
        .x(0.0)
        .x_anchor(Anchor::Left)
        .y(1.02)
        .y_anchor(Anchor::Bottom);
    Layout::new()
        .auto_size(true)
        .font(font.size(13).color("#222222"))
        .margin(Margin::new().left(64).right(16).top(24).bottom(52))
        .show_legend(needs_legend(chart))
        .legend(legend)
        .hover_mode(HoverMode::Closest)
        .bar_mode(bar_mode(chart))
        .paper_background_color("#FFFFFF")
        .plot_background_color("#FFFFFF")
        .x_axis(axis(&chart.x, false))
        .y_axis(axis(&chart.y, true))
}

/// Bars with the same position are side by side; if every name has only one bar, it uses the full width.
fn bar_mode(chart: &Chart) -> BarMode {
    if one_bar_a_name(chart) { BarMode::Overlay } else { BarMode::Group }
}

/// Returns true if the axis of the bars has names and each name has at most one bar.
fn one_bar_a_name(chart: &Chart) -> bool {
    let upright = chart.y.categories.is_empty();
    let bars = chart.series.iter().filter(|series| series.style == Style::Bars);
    let places = bars.flat_map(|series| if upright { &series.x } else { &series.y });
    let mut places: Vec<f64> = places.copied().collect();
    places.sort_by(f64::total_cmp);
    let has_names = !(upright && chart.x.categories.is_empty());
    has_names && places.windows(2).all(|pair| pair[0] != pair[1])
}

/// A single series needs no legend, and neither do series whose names are on an axis.
fn needs_legend(chart: &Chart) -> bool {
    let mut names = chart.x.categories.iter().chain(&chart.y.categories);
    let is_named = |series: &Series| names.any(|name| *name == series.name);
    chart.series.len() > 1 && !chart.series.iter().all(is_named)
}

fn axis(axis: &Axis, upright: bool) -> PlotlyAxis {
    let drawn = PlotlyAxis::new()
        .title(Title::with_text(plain(&axis.label)).font(Font::new().size(13)))
        .auto_margin(true)
        .show_line(true)
        .line_color("#444444")
        .grid_color("#E6E6E6")
        .zero_line(!axis.log && axis.categories.is_empty())
        .zero_line_color("#AAAAAA")
        .hover_format(".5~g")
        .type_(if axis.log { AxisType::Log } else { AxisType::Linear });
    // Without this limit, Plotly labels 2, 3, ..., 9 of every decade on a logarithmic axis.
    let drawn = if axis.log { drawn.n_ticks(6) } else { drawn };
    if !axis.categories.is_empty() {
        let count = axis.categories.len();
        let (first, last) = (-0.5, count as f64 - 0.5);
        return drawn
            .tick_values((0..count).map(|index| index as f64).collect())
            .tick_text(axis.categories.iter().map(|name| plain(name)).collect())
            .show_grid(false)
            .ticks(TicksDirection::Outside)
            .tick_color("#FFFFFF")
            .range(if upright { vec![last, first] } else { vec![first, last] });
    }
    match axis.range {
        Some((low, high)) if axis.log && low > 0.0 && high > low && high.is_finite() => {
            drawn.range(vec![low.log10(), high.log10()])
        }
        Some((low, high)) if !axis.log && low.is_finite() && high.is_finite() => {
            drawn.range(vec![low, high])
        }
        _ => drawn,
    }
}
