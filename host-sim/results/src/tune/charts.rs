//! Charts of the page of a tuning session: *before* with the former set and *after* with the new one, in the same two colours.

use super::words::shown_unit;
use crate::report::{Axis, Chart, Series};
use crate::tune::{TuneArm, TuneBlock, TuneCourse, TuneLoop, TuneQuantity, TuneReport};

/// Name of the curves with the former set.
pub(super) const BEFORE: &str = "before";
/// Name of the curves with the new set.
pub(super) const AFTER: &str = "after";
/// Name of the values with the former friction model and the new loop gains.
const NEW_LOOP: &str = "new loop gains alone";
/// Name of the demanded position.
const DEMAND: &str = "demanded position";

/// Largest number of points of a curve.
const CURVE_POINTS: usize = 2400;

/// Heights of the charts on the first screen and of the strip charts, px.
const ERROR_PX: usize = 135;
const DEMAND_PX: usize = 80;
const STRIP_PX: usize = 170;
const COURSE_PX: usize = 300;

/// Space above the largest value of a strip chart, as a share of it.
const HEADROOM: f64 = 0.15;

/// Returns the courses that were recorded, with their names.
fn courses(report: &TuneReport) -> impl Iterator<Item = (&'static str, &TuneCourse)> {
    let named = [BEFORE, AFTER].into_iter().zip(&report.courses);
    named.filter(|(_, course)| !course.time_s.is_empty())
}

/// Returns the charts of the first screen: tracking error over time and the demanded position. Empty without a course.
pub(super) fn first_screen(report: &TuneReport) -> Vec<Chart> {
    let Some((_, first)) = courses(report).next() else { return Vec::new() };
    let error = |(name, course): (&str, &TuneCourse)| {
        let pairs = course.demand_rad.iter().zip(&course.position_rad);
        let errors: Vec<f64> = pairs.map(|(demand, is)| 1e3 * (demand - is)).collect();
        Series::thin_line(name, &course.time_s, &errors, CURVE_POINTS)
    };
    let demand = Series::thin_line(DEMAND, &first.time_s, &first.demand_rad, CURVE_POINTS);
    vec![
        Chart {
            title: "Tracking error on the same motion".into(),
            y: Axis { height_px: Some(ERROR_PX), ..Axis::new("error (mrad)") },
            x: Axis::new("time (s)"),
            series: courses(report).map(error).collect(),
            ..Chart::default()
        },
        Chart {
            title: "Demanded position".into(),
            y: Axis { height_px: Some(DEMAND_PX), ..Axis::new("rad") },
            series: vec![demand.muted()],
            ..Chart::default()
        },
    ]
}

/// Returns the charts of position and current over time.
pub(super) fn course(report: &TuneReport) -> Vec<Chart> {
    let Some((_, first)) = courses(report).next() else { return Vec::new() };
    let curves = |values: fn(&TuneCourse) -> &Vec<f64>| {
        let curve = |(name, course): (&str, &TuneCourse)| {
            Series::thin_line(name, &course.time_s, values(course), CURVE_POINTS)
        };
        courses(report).map(curve).collect::<Vec<_>>()
    };
    let demand = Series::thin_line(DEMAND, &first.time_s, &first.demand_rad, CURVE_POINTS);
    let chart = |title: &str, caption: &str, y: &str, series: Vec<Series>| Chart {
        title: title.into(),
        caption: caption.into(),
        x: Axis::new("time (s)"),
        y: Axis { height_px: Some(COURSE_PX), ..Axis::new(y) },
        series,
    };
    vec![
        chart(
            "Position",
            "The demanded position, and the measured one with both sets. Drag to see a reversal.",
            "position (rad)",
            [vec![demand.muted()], curves(|course| &course.position_rad)].concat(),
        ),
        chart(
            "Current",
            "The measured current with both sets.",
            "current (A)",
            curves(|course| &course.current_a),
        ),
    ]
}

/// Returns a strip chart for each quantity with a value above zero: its value in each block, in the order of performance.
pub(super) fn strips(report: &TuneReport) -> Vec<Chart> {
    let blocks = &report.trial.blocks;
    let chart = |(place, quantity): (usize, TuneQuantity)| {
        let values: Vec<f64> = blocks.iter().map(|block| block.values[place]).collect();
        let finite = values.iter().copied().filter(|value| value.is_finite());
        let largest = finite.fold(0.0, f64::max);
        let (unit, factor) = shown_unit(quantity.unit(), &values);
        (largest > 0.0).then(|| Chart {
            title: super::words::name(quantity),
            caption: String::new(),
            x: Axis::of_names("block", blocks.iter().map(|block| block.arm.letter())),
            y: Axis {
                height_px: Some(STRIP_PX),
                range: Some((0.0, factor * largest * (1.0 + HEADROOM))),
                ..Axis::new(unit)
            },
            series: dots(blocks, &values, factor),
        })
    };
    TuneQuantity::ALL.into_iter().enumerate().filter_map(chart).collect()
}

fn dots(blocks: &[TuneBlock], values: &[f64], factor: f64) -> Vec<Series> {
    let of = |(name, arm): (&str, TuneArm)| {
        let of_set = blocks.iter().zip(values).enumerate();
        let of_set = of_set.filter(|(_, (block, _))| block.arm == arm);
        let (x, y): (Vec<f64>, _) =
            of_set.map(|(place, (_, value))| (place as f64, factor * value)).unzip();
        (!x.is_empty()).then(|| Series::points(name, x, y))
    };
    let named = [(BEFORE, TuneArm::Former), (AFTER, TuneArm::New), (NEW_LOOP, TuneArm::NewLoop)];
    named.into_iter().filter_map(of).collect()
}

/// Returns magnitude and phase of the measured frequency response. Empty without a measured frequency.
pub(super) fn response(control: &TuneLoop) -> Vec<Chart> {
    let mut response = control.response.clone();
    response.retain(|[frequency, ..]| frequency.is_finite() && *frequency > 0.0);
    response.sort_by(|one, other| one[0].total_cmp(&other[0]));
    if response.is_empty() {
        return Vec::new();
    }
    let column = |place: usize| response.iter().map(|row| row[place]).collect::<Vec<f64>>();
    let chart = |title: &str, caption: &str, y: Axis, place: usize| Chart {
        title: title.into(),
        caption: caption.into(),
        x: Axis { log: true, ..Axis::new("frequency (Hz)") },
        y,
        series: vec![Series::line("measured", column(0), column(place))],
    };
    vec![
        chart(
            "Magnitude",
            "Velocity per current. An inertia alone falls by a decade for each decade.",
            Axis { log: true, ..Axis::new("magnitude (rad/s per A)") },
            1,
        ),
        chart(
            "Phase",
            "An inertia alone has −90 degrees; a delay adds to it with the frequency.",
            Axis::new("phase (degrees)"),
            2,
        ),
    ]
}
