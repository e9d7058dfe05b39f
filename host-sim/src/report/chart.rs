//! A chart as its maker thinks of it: named series over two axes with units.
//!
//! A [`Chart`] says *what* is shown; colours, fonts, legends and hover texts follow from that and
//! are the same all over a page. Two rules make a good one: every axis label carries its unit,
//! and the caption is a sentence that says what to see, for it is also what a reader who cannot
//! see the chart is told. Values that are not finite are holes, never errors: a curve breaks, a
//! point is left out.

/// One axis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    /// What it counts, with the unit: `velocity (rad/s)`.
    pub label: String,
    /// Logarithmic; values that are not positive are left out.
    pub log: bool,
    /// Names in place of numbers: value 0 is the first name, 1 the second. On `y`, bars lie and
    /// the first name is on top, the better choice for long names.
    pub categories: Vec<String>,
    /// Lower and upper end as first shown, in the axis's unit; without it, the data decides.
    /// Give charts that are to be compared the same.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// A linear axis. The label carries the unit.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// An axis of names in place of numbers.
    pub fn of_names<S: Into<String>>(
        label: impl Into<String>,
        names: impl IntoIterator<Item = S>,
    ) -> Self {
        let categories = names.into_iter().map(Into::into).collect();
        Self { categories, ..Self::new(label) }
    }
}

/// How a series is drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Style {
    /// A dot per value; on an axis of names, the choice where zero means nothing (log axes).
    Points,
    /// A curve through the values, in their order.
    Line,
    /// A curve that holds each value until the next one: commands, states, flags.
    Steps,
    /// A bar from zero to each value, on a linear axis.
    Bars,
    /// The area between `y` and this upper edge, `upper[i]` above `x[i]`.
    Band {
        /// The upper edge.
        upper: Vec<f64>,
    },
}

/// Values that belong together under one name.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// What the legend calls it. A name has the same colour in every chart of a page.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// Positions along the horizontal axis, in its unit. If `x` and `y` differ in length, the
    /// shorter one counts.
    pub x: Vec<f64>,
    /// Positions along the vertical axis, in its unit; of a band the lower edge.
    pub y: Vec<f64>,
    /// Drawn in grey: measured data, which everything else is held against.
    pub muted: bool,
    /// The name of the series whose colour it shares: a model's band that of the model's curve.
    pub colour_of: Option<String>,
    /// How far each value may be off, either way, in its unit; a line then shows its points. Values
    /// that are not positive numbers have no error bar.
    pub error: Option<Vec<f64>>,
}

impl Series {
    fn new(name: impl Into<String>, style: Style, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { name: name.into(), style, x, y, muted: false, colour_of: None, error: None }
    }

    /// A dot per value.
    pub fn points(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Points, x, y)
    }

    /// A curve.
    pub fn line(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Line, x, y)
    }

    /// A curve in steps.
    pub fn steps(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Steps, x, y)
    }

    /// A bar per value.
    pub fn bars(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self::new(name, Style::Bars, x, y)
    }

    /// The area between two curves.
    pub fn band(name: impl Into<String>, x: Vec<f64>, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        Self::new(name, Style::Band { upper }, x, lower)
    }

    /// The same in the colour of the series of this name.
    #[must_use]
    pub fn coloured_as(mut self, name: impl Into<String>) -> Self {
        self.colour_of = Some(name.into());
        self
    }

    /// The same with error bars: along the bars, upright for all else.
    #[must_use]
    pub fn with_error(mut self, error: Vec<f64>) -> Self {
        self.error = Some(error);
        self
    }

    /// The same in grey.
    #[must_use]
    pub fn muted(mut self) -> Self {
        self.muted = true;
        self
    }
}

/// A chart with its title above and its caption below.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// What is shown, in a few words.
    pub title: String,
    /// One or two sentences on what to see in it.
    pub caption: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Drawn in this order, later ones on top.
    pub series: Vec<Series>,
}
