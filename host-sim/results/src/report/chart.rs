//! The content of a chart: named series over two axes with units.
//!
//! A [`Chart`] defines *what* is shown. Colours, fonts, legends and hover texts follow from it and are uniform on a page.
//! Every axis label must contain its unit. The caption should be a sentence that states what the chart shows, because
//! screen readers also use it. Values that are not finite are gaps: a curve is interrupted, a point is left out.

use super::thin::{rounded, thin_scatter, thin_series};

/// One axis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    /// Quantity with its unit: `velocity (rad/s)`.
    pub label: String,
    /// True for a logarithmic axis; values that are not positive are left out.
    pub log: bool,
    /// Names in place of numbers: value 0 is the first name, 1 the second. On `y`, bars are horizontal and the first name
    /// is on top, which suits long names.
    pub categories: Vec<String>,
    /// Initial lower and upper end, in the axis's unit; `None` if they follow from the data. Charts for comparison should
    /// have the same range.
    pub range: Option<(f64, f64)>,
    /// Height of the drawing with its horizontal axis, px, if this is the vertical axis; `None` for the usual height. With
    /// names, the height follows from their number.
    pub height_px: Option<usize>,
}

impl Axis {
    /// Creates a linear axis. The label must contain the unit.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// Creates an axis with names in place of numbers.
    pub fn of_names<S: Into<String>>(
        label: impl Into<String>,
        names: impl IntoIterator<Item = S>,
    ) -> Self {
        let categories = names.into_iter().map(Into::into).collect();
        Self { categories, ..Self::new(label) }
    }
}

/// Style of a series.
#[derive(Debug, Clone, PartialEq)]
pub enum Style {
    /// A dot for each value. On an axis of names, use it instead of bars if the other axis is logarithmic.
    Points,
    /// A curve through the values, in their order.
    Line,
    /// A bar from zero to each value, on a linear axis.
    Bars,
    /// The area between `y` and this upper edge, `upper[i]` above `x[i]`.
    Band {
        /// The upper edge.
        upper: Vec<f64>,
    },
}

/// Values with a common name.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend. A name has the same colour in every chart of a page.
    pub name: String,
    /// Style.
    pub style: Style,
    /// Horizontal positions, in the unit of the axis. If `x` and `y` differ in length, the shorter length applies.
    pub x: Vec<f64>,
    /// Vertical positions, in the unit of the axis; for a band, the lower edge.
    pub y: Vec<f64>,
    /// True if drawn in grey, as measured data are.
    pub muted: bool,
    /// Name of the series with the same colour, for example that of the curve of a band.
    pub colour_of: Option<String>,
    /// Half length of the error bar of each value, in its unit; a line then shows its points. Values that are not positive
    /// have no error bar.
    pub error: Option<Vec<f64>>,
    /// What the values are, for the legend; empty if the name says it.
    pub meaning: String,
}

impl Series {
    fn new(name: impl Into<String>, style: Style, x: Vec<f64>, y: Vec<f64>) -> Self {
        let (name, meaning) = (name.into(), String::new());
        Self { name, style, x, y, muted: false, colour_of: None, error: None, meaning }
    }

    /// Creates a series with a dot for each value.
    pub fn points(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Points, x, y)
    }

    /// Creates a curve.
    pub fn line(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Line, x, y)
    }

    /// Creates a curve of at most `most` points ([`thin_series`]) with the digits that a chart shows.
    pub fn thin_line(name: impl Into<String>, x: &[f64], y: &[f64], most: usize) -> Self {
        let (x, y) = thin_series(x, y, most);
        Self::line(name, rounded(&x), rounded(&y))
    }

    /// Creates a series of at most `most` dots ([`thin_scatter`]) with the digits that a chart shows.
    pub fn thin_points(name: impl Into<String>, x: &[f64], y: &[f64], most: usize) -> Self {
        let (x, y) = thin_scatter(x, y, most);
        Self::points(name, rounded(&x), rounded(&y))
    }

    /// Creates a series with a bar for each value.
    pub fn bars(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Bars, x, y)
    }

    /// Creates the area between two curves.
    pub fn band(name: impl Into<String>, x: Vec<f64>, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        Self::new(name, Style::Band { upper }, x, lower)
    }

    /// Sets the colour to that of the series with this name.
    #[must_use]
    pub fn coloured_as(mut self, name: impl Into<String>) -> Self {
        self.colour_of = Some(name.into());
        self
    }

    /// Adds error bars: along the bars, vertical for all other styles.
    #[must_use]
    pub fn with_error(mut self, error: Vec<f64>) -> Self {
        self.error = Some(error);
        self
    }

    /// Sets the colour to grey.
    #[must_use]
    pub fn muted(mut self) -> Self {
        self.muted = true;
        self
    }
}

impl Chart {
    /// Sets the meaning of the series with a name.
    pub(super) fn explain(&mut self, name: &str, meaning: &str) {
        let named = self.series.iter_mut().filter(|series| series.name == name);
        named.for_each(|series| meaning.clone_into(&mut series.meaning));
    }

    /// Thins every curve and cloud of dots to at most `most` points. Values with error bars keep all.
    pub(super) fn limit_points(&mut self, most: usize) {
        for series in self.series.iter_mut().filter(|series| series.error.is_none()) {
            let thin = match series.style {
                Style::Line => thin_series,
                Style::Points => thin_scatter,
                Style::Bars | Style::Band { .. } => continue,
            };
            (series.x, series.y) = thin(&series.x, &series.y, most);
        }
    }
}

/// A chart with its title above and its caption below.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// Title, a few words.
    pub title: String,
    /// Caption, one or two sentences that state what the chart shows.
    pub caption: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Drawn in this order, later ones on top.
    pub series: Vec<Series>,
}
