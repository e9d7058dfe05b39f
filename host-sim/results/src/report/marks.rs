//! The series of a chart as SVG elements.
//!
//! Coordinates are whole numbers from 0 to [`LENGTH`] along both axes. The style sheet stretches them to the place of the
//! chart, while lines and dots keep their size. A dot is therefore a line of length zero with round ends. Steps between
//! points are relative, which makes a page about a third smaller.

use super::chart::{Chart, Series, Style};
use super::scale::{Direction, LENGTH, Scale, error_of};
use super::thin::thin_series;
use maud::{Markup, html};
use std::fmt::Write as _;

/// Number of dots above which they are drawn smaller.
const SMALL_DOT_COUNT: usize = 400;
/// Number of points of a curve above which it is drawn thinner.
const THIN_LINE_COUNT: usize = 1500;
/// Largest number of points of a curve. A chart has about 800 pixels, and each needs a minimum and a maximum; the rest is for
/// a zoom. Longer curves are thinned by [`thin_series`], which keeps the minimum and maximum of each segment.
const MAX_CURVE_POINTS: usize = 4000;
/// Share of the distance of two names that the bars of one name fill.
const BAR_SHARE: f64 = 0.8;

/// Both scales of a chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scales {
    pub x: Scale,
    pub y: Scale,
}

impl Scales {
    /// Returns the scales of a chart; `None` if it has no finite value to draw.
    pub fn of(chart: &Chart) -> Option<Self> {
        let is_drawn = |series: &Series| {
            series.x.iter().zip(&series.y).any(|(x, y)| x.is_finite() && y.is_finite())
        };
        if !chart.series.iter().any(is_drawn) {
            return None;
        }
        Some(Self { x: Scale::of(chart, Direction::X)?, y: Scale::of(chart, Direction::Y)? })
    }

    fn place(&self, x: f64, y: f64) -> Option<(i64, i64)> {
        Some((self.x.place(x)?, self.y.place(y)?))
    }
}

/// Commands of an SVG path.
#[derive(Default)]
struct PathData {
    text: String,
    at: Option<(i64, i64)>,
}

impl PathData {
    /// Starts at a place without drawing.
    fn start(&mut self, to: (i64, i64)) {
        match self.at {
            None => self.push('M', &[to.0, to.1]),
            Some(at) => self.push('m', &[to.0 - at.0, to.1 - at.1]),
        }
        self.at = Some(to);
    }

    /// Draws a line to a place.
    fn draw(&mut self, to: (i64, i64)) {
        let Some(at) = self.at else { return self.start(to) };
        self.push('l', &[to.0 - at.0, to.1 - at.1]);
        self.at = Some(to);
    }

    /// Draws a dot at a place.
    fn dot(&mut self, to: (i64, i64)) {
        self.start(to);
        self.push('h', &[0]);
    }

    fn push(&mut self, command: char, numbers: &[i64]) {
        self.text.push(command);
        for (index, number) in numbers.iter().enumerate() {
            // A minus sign separates two numbers.
            let space = if index > 0 && *number >= 0 { " " } else { "" };
            let _ = write!(self.text, "{space}{number}");
        }
    }
}

/// Renders a series as a group of elements. `classes` are those of its colour.
pub(super) fn series(
    series: &Series,
    index: usize,
    classes: &str,
    chart: &Chart,
    scales: &Scales,
) -> Markup {
    let mut classes = format!("series {classes}");
    let on_names = !(chart.x.categories.is_empty() && chart.y.categories.is_empty());
    let count = series.x.len();
    classes += match series.style {
        Style::Points if on_names => " big",
        Style::Points if count > SMALL_DOT_COUNT => " small",
        Style::Line if count > THIN_LINE_COUNT => " thin",
        _ => "",
    };
    html! {
        g class=(classes) data-name=(series.name) data-style=(style_name(&series.style)) {
            @match &series.style {
                Style::Points => {
                    (errors(series, scales))
                    path.dots d=(dots(series, scales)) {}
                }
                Style::Line if series.error.is_some() => {
                    (errors(series, scales))
                    path.line d=(line(series, scales)) {}
                    path.dots d=(dots(series, scales)) {}
                }
                Style::Line => path.line d=(line(series, scales)) {},
                Style::Band { upper } => path.band d=(band(series, upper, scales)) {},
                Style::Bars => (bars(series, index, chart, scales)),
            }
        }
    }
}

/// Returns the name of a style for the script and the style sheet.
pub(super) fn style_name(style: &Style) -> &'static str {
    match style {
        Style::Points => "points",
        Style::Line => "line",
        Style::Bars => "bars",
        Style::Band { .. } => "band",
    }
}

fn dots(series: &Series, scales: &Scales) -> String {
    let mut path = PathData::default();
    let places = series.x.iter().zip(&series.y);
    places.filter_map(|(x, y)| scales.place(*x, *y)).for_each(|place| path.dot(place));
    path.text
}

fn line(series: &Series, scales: &Scales) -> String {
    // Points with error bars are few, and their lines must meet them.
    let (x, y) = match series.error {
        Some(_) => (series.x.clone(), series.y.clone()),
        None => thin_series(&series.x, &series.y, MAX_CURVE_POINTS),
    };
    let mut path = PathData::default();
    let mut is_open = false;
    for (x, y) in x.iter().zip(&y) {
        match scales.place(*x, *y) {
            None => is_open = false,
            Some(place) if !is_open => {
                path.start(place);
                is_open = true;
            }
            Some(place) => path.draw(place),
        }
    }
    path.text
}

/// Returns the closed outline of a band: along the lower edge and back along the upper edge. A gap in either edge ends an
/// outline and starts the next.
fn band(series: &Series, upper: &[f64], scales: &Scales) -> String {
    let edges: Vec<Option<[(i64, i64); 2]>> = series
        .x
        .iter()
        .zip(&series.y)
        .zip(upper)
        .map(|((&x, &low), &high)| Some([scales.place(x, low)?, scales.place(x, high)?]))
        .collect();
    let mut path = PathData::default();
    for part in edges.split(Option::is_none).filter(|part| !part.is_empty()) {
        let part: Vec<[(i64, i64); 2]> = part.iter().copied().flatten().collect();
        path.start(part[0][0]);
        part[1..].iter().for_each(|[low, _]| path.draw(*low));
        part.iter().rev().for_each(|[_, high]| path.draw(*high));
        path.text.push('z');
        path.at = Some(part[0][0]);
    }
    path.text
}

/// Renders the error bars of points, which are vertical.
fn errors(series: &Series, scales: &Scales) -> Markup {
    let mut path = PathData::default();
    for (index, (x, y)) in series.x.iter().zip(&series.y).enumerate() {
        let Some(error) = error_of(series, index) else { continue };
        let ends = (scales.place(*x, y - error), scales.place(*x, y + error));
        if let (Some(low), Some(high)) = ends {
            path.start(low);
            path.draw(high);
        }
    }
    html! { @if !path.text.is_empty() { path.error d=(path.text) {} } }
}

/// Renders bars from zero to each value. Bars with the same position are side by side.
fn bars(series: &Series, index: usize, chart: &Chart, scales: &Scales) -> Markup {
    let lies = !chart.y.categories.is_empty();
    let (along, across) = if lies { (scales.x, scales.y) } else { (scales.y, scales.x) };
    let (values, places) = if lies { (&series.x, &series.y) } else { (&series.y, &series.x) };
    let is_bars = |series: &&Series| series.style == Style::Bars;
    let (order, count) = match one_bar_a_name(chart) {
        true => (0, 1),
        false => (
            chart.series[..index].iter().filter(is_bars).count(),
            chart.series.iter().filter(is_bars).count(),
        ),
    };
    let width = BAR_SHARE * spacing(chart, lies) / count as f64;
    let rectangle = |(row, (value, place)): (usize, (&f64, &f64))| {
        let from = place + width * (order as f64 - 0.5 * count as f64);
        let (end, base) = (along.place(*value)?, along.base());
        let (side, other) = (across.place(from)?, across.place(from + width)?);
        let middle = across.place(from + 0.5 * width)?;
        let error = error_of(series, row)
            .and_then(|error| Some((along.place(value - error)?, along.place(value + error)?)));
        let [x, y, wide, high] = match lies {
            true => [end.min(base), side.min(other), (end - base).abs(), (side - other).abs()],
            false => [side.min(other), end.min(base), (side - other).abs(), (end - base).abs()],
        };
        Some(html! {
            rect x=(x) y=(y) width=(wide) height=(high) data-value=(value) data-place=(place) {}
            @if let Some((low, high)) = error {
                @if lies { path.error d={ "M" (low) " " (middle) "H" (high) } {} }
                @else { path.error d={ "M" (middle) " " (low) "V" (high) } {} }
            }
        })
    };
    html! { @for bar in values.iter().zip(places).enumerate().filter_map(rectangle) { (bar) } }
}

/// Returns the distance of two positions of bars: 1 between names.
fn spacing(chart: &Chart, lies: bool) -> f64 {
    if !(chart.x.categories.is_empty() && chart.y.categories.is_empty()) {
        return 1.0;
    }
    let bars = chart.series.iter().filter(|series| series.style == Style::Bars);
    let mut places: Vec<f64> =
        bars.flat_map(|series| if lies { &series.y } else { &series.x }).copied().collect();
    places.sort_by(f64::total_cmp);
    let gaps = places.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
    gaps.reduce(f64::min).unwrap_or(1.0)
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

/// Returns the path of the grid lines at shares of an axis.
pub(super) fn grid(x: impl Iterator<Item = f64>, y: impl Iterator<Item = f64>) -> String {
    let at = |place: f64| (LENGTH * place).round();
    let upright = x.map(|place| format!("M{} 0V{LENGTH}", at(place)));
    let level = y.map(|place| format!("M0 {}H{LENGTH}", at(place)));
    upright.chain(level).collect()
}
