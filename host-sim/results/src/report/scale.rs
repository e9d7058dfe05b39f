//! The scale of an axis: its range, the place of a value, and the ticks.

use super::chart::{Axis, Chart, Series, Style};
use joint_log::number::{fixed, raised};

/// Length of both axes in the coordinates of a drawing. The grid is finer than the pixels of a screen and allows a zoom to a
/// tenth without visible steps.
pub(super) const LENGTH: f64 = 10_000.0;

/// Largest coordinate, for values far outside a given range.
const FARTHEST: f64 = 1e8;

/// Share of the range that stays empty beside the outermost value.
const MARGIN: f64 = 0.04;

/// Shares of a decade at which an axis of few decades has ticks.
const PARTS_OF_DECADE: [f64; 3] = [1.0, 2.0, 5.0];

/// Steps of ticks in powers of ten, each with the wanted step up to which it is the nearest on a logarithmic scale.
const STEP_FACTORS: [(f64, f64); 3] = [(1.0, 1.414), (2.0, 3.162), (5.0, 7.071)];

/// Decimal exponents of ticks that are plain decimals.
const PLAIN_EXPONENTS: std::ops::Range<i32> = -4..6;

/// Which of the two axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Direction {
    /// From left to right.
    X,
    /// From bottom to top; names from top to bottom.
    Y,
}

/// A linear or logarithmic scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Value at the left or upper end, as its decimal logarithm on a logarithmic axis.
    first: f64,
    /// Value at the right or lower end.
    last: f64,
    is_log: bool,
}

/// A tick of an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// Place along the axis, 0 to 1 from the left or upper end.
    pub place: f64,
    /// The value in words.
    pub label: String,
}

impl Scale {
    /// Returns the scale of an axis; `None` if a chart has no finite value.
    pub fn of(chart: &Chart, direction: Direction) -> Option<Self> {
        let (axis, is_y) = match direction {
            Direction::X => (&chart.x, false),
            Direction::Y => (&chart.y, true),
        };
        if !axis.categories.is_empty() {
            let last = axis.categories.len() as f64 - 0.5;
            return Some(Self { first: -0.5, last, is_log: false });
        }
        let convert = |value: f64| if axis.log { value.log10() } else { value };
        let given = axis.range.map(|(low, high)| (convert(low), convert(high)));
        let given = given.filter(|(low, high)| low.is_finite() && high.is_finite() && high > low);
        let (low, high) = match given {
            Some(ends) => ends,
            None => extent(chart, axis, direction, convert)?,
        };
        let (first, last) = if is_y { (high, low) } else { (low, high) };
        Some(Self { first, last, is_log: axis.log })
    }

    /// Returns the coordinate of a value; `None` if the value is not finite, or not positive on a logarithmic axis.
    pub fn place(&self, value: f64) -> Option<i64> {
        let value = if self.is_log { value.log10() } else { value };
        let place = LENGTH * ((value - self.first) / (self.last - self.first));
        (value.is_finite() && place.is_finite())
            .then(|| place.clamp(-FARTHEST, FARTHEST).round() as i64)
    }

    /// Returns the coordinate at which bars start: that of zero, or the lower end.
    pub fn base(&self) -> i64 {
        match self.is_log {
            true if self.first > self.last => LENGTH as i64,
            true => 0,
            false => self.place(0.0).unwrap_or_default(),
        }
    }

    /// Returns the ends for the script: both values, and `log`.
    pub fn in_words(&self) -> String {
        format!("{} {}{}", self.first, self.last, if self.is_log { " log" } else { "" })
    }

    /// Returns at most about `count` ticks at round values.
    pub fn ticks(&self, count: usize) -> Vec<Tick> {
        let (low, high) = (self.first.min(self.last), self.first.max(self.last));
        let marks = if self.is_log { log_marks(low, high, count) } else { marks(low, high, count) };
        let tick = |(value, label): (f64, String)| {
            let at = if self.is_log { value.log10() } else { value };
            Tick { place: (at - self.first) / (self.last - self.first), label }
        };
        marks
            .into_iter()
            .map(tick)
            .filter(|tick| (-1e-9..=1.0 + 1e-9).contains(&tick.place))
            .collect()
    }
}

/// Returns the ends of an axis that follow from the data, with margins. Bars start at zero.
fn extent(
    chart: &Chart,
    axis: &Axis,
    direction: Direction,
    convert: impl Fn(f64) -> f64,
) -> Option<(f64, f64)> {
    let is_y = direction == Direction::Y;
    let mut ends: Option<(f64, f64)> = None;
    let mut include = |value: f64| {
        let value = convert(value);
        if value.is_finite() {
            ends = ends.map_or(Some((value, value)), |(low, high)| {
                Some((low.min(value), high.max(value)))
            });
        }
    };
    let lies = !chart.y.categories.is_empty();
    let mut has_bars = false;
    for series in &chart.series {
        let along_bars = series.style == Style::Bars && is_y != lies;
        let has_error = if series.style == Style::Bars { along_bars } else { is_y };
        has_bars |= along_bars;
        for (index, (x, y)) in series.x.iter().zip(&series.y).enumerate() {
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            let value = if is_y { *y } else { *x };
            include(value);
            if has_error && let Some(error) = error_of(series, index) {
                include(value - error);
                include(value + error);
            }
            if let (Style::Band { upper }, true) = (&series.style, is_y) {
                include(upper.get(index).copied().unwrap_or(f64::NAN));
            }
        }
    }
    if has_bars && !axis.log {
        include(0.0);
    }
    let (low, high) = ends?;
    if high <= low {
        let half = if axis.log { 0.5 } else { 0.5 * low.abs() };
        let half = if half > 0.0 { half } else { 1.0 };
        return Some((low - half, low + half));
    }
    let only_curves =
        chart.series.iter().all(|series| !matches!(series.style, Style::Points | Style::Bars));
    let margin = if !is_y && only_curves { 0.0 } else { MARGIN * (high - low) };
    let margin_at = |end: f64| if has_bars && end == 0.0 { 0.0 } else { margin };
    Some((low - margin_at(low), high + margin_at(high)))
}

/// Returns the half length of a value's error bar; `None` without one.
pub(super) fn error_of(series: &Series, index: usize) -> Option<f64> {
    let error = series.error.as_ref()?.get(index).copied()?;
    (error.is_finite() && error > 0.0).then_some(error)
}

/// Returns values and labels of the ticks of a linear axis. Steps are 1, 2 or 5 times a power of ten.
fn marks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let raw = (high - low) / count.max(1) as f64;
    if !(raw.is_finite() && raw > 0.0) {
        return Vec::new();
    }
    let exponent = raw.log10().floor() as i32;
    let power = 10f64.powi(exponent);
    let factor = STEP_FACTORS.into_iter().find(|factor| raw < factor.1 * power);
    let factor = factor.map_or(10.0, |(factor, _)| factor);
    let step = factor * power;
    let exponent = if factor == 10.0 { exponent + 1 } else { exponent };
    let largest = low.abs().max(high.abs()).log10().floor() as i32;
    let indices = (low / step - 1e-9).ceil() as i64..=(high / step + 1e-9).floor() as i64;
    let label = |index: i64| {
        if PLAIN_EXPONENTS.contains(&largest) || index == 0 {
            let decimals =
                if index == 0 && !PLAIN_EXPONENTS.contains(&largest) { 0 } else { -exponent };
            return fixed(index as f64 * step, decimals);
        }
        let mantissa = fixed(index as f64 * step / 10f64.powi(largest), largest - exponent);
        format!("{mantissa}×10{}", raised(largest))
    };
    indices.map(|index| (index as f64 * step, label(index))).collect()
}

/// Returns values and labels of the ticks of a logarithmic axis from `10^low` to `10^high`: its decades, or their parts if
/// there are few.
fn log_marks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let decades = (low - 1e-9).floor() as i32..=(high + 1e-9).floor() as i32;
    let inside = |value: &f64| (low - 1e-9..=high + 1e-9).contains(&value.log10());
    let label = |value: f64| (value, tick_label(value));
    if high - low >= 2.0 {
        let every = ((high - low) / count.max(1) as f64).ceil().max(1.0) as i32;
        let whole = decades.filter(|decade| decade.rem_euclid(every) == 0);
        return whole.map(|decade| 10f64.powi(decade)).filter(inside).map(label).collect();
    }
    let parts = decades.flat_map(|decade| PARTS_OF_DECADE.map(|part| part * 10f64.powi(decade)));
    let parts: Vec<(f64, String)> = parts.filter(inside).map(label).collect();
    if parts.len() > 1 { parts } else { marks(10f64.powf(low), 10f64.powf(high), count) }
}

fn tick_label(value: f64) -> String {
    let exponent = (value.log10() + 1e-9).floor() as i32;
    if PLAIN_EXPONENTS.contains(&exponent) {
        return fixed(value, -exponent);
    }
    let mantissa = (value / 10f64.powi(exponent)).round();
    match mantissa as i64 {
        1 => format!("10{}", raised(exponent)),
        mantissa => format!("{mantissa}×10{}", raised(exponent)),
    }
}
