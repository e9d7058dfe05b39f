//! Charts of the residual over the quantity that a cause depends on.
//!
//! Each cause defines the axes in which it is visible ([`evidence`]). In them, the residual of the base model must have a
//! pattern and that of the extended model must not. A [`Plane`] holds the axes and their values; [`chart`] draws the means
//! of both residuals. With several findings, the base model lacks all of them. A third line, the extended model without
//! this cause, then shows the effect of this cause alone.

use super::Scene;
use super::bins::{Bins, Mean};
use super::figures::{AFTER, fitting_range};
use super::rows::{REST_SPEED_SHARE, Rows, rate, rest_before, since_reversal};
use crate::report::{Axis, Chart, Series, Style, rounded};
use friction_diagnose::{Evidence, Finding, PlaneAxis, ResidualView, Spacing};
use friction_fit::predict;
use joint_log::number::significant;
use joint_log::{Quantity, contract};
use std::f64::consts::TAU;

/// Number of bins of a chart over the whole width and of one over half the width.
const BINS: [usize; 2] = [40, 30];

/// Maximum number of single residuals drawn under the means.
const CLOUD_POINTS: usize = 900;

/// Legend of the extended model without one cause.
const WITHOUT: &str = "after, without this cause";

/// Length of an error bar, in standard errors.
const ERROR_BAR_STD_ERRORS: f64 = 2.0;

/// The axes of a chart of the residual, and their values.
struct Plane {
    title: String,
    x: Vec<f64>,
    label: String,
    /// Range of the axis; `None` if it follows from the rows.
    range: Option<(f64, f64)>,
    /// Factor on the residual of each row; rows with factor 0 are left out.
    scale: Vec<f64>,
    /// Weight of each row; `None` for equal weights.
    weight: Option<Vec<f64>>,
    y_label: String,
    spacing: Spacing,
    /// Describes the pattern of the cause, in one sentence.
    says: String,
    /// Residual of the extended model without the cause.
    without: Option<Vec<f64>>,
}

impl Plane {
    /// Creates a plane of a residual over `x`, which has a label with its unit.
    fn new(scene: &Scene, rows: &Rows, view: ResidualView, label: &str, x: Vec<f64>) -> Self {
        let unit = scene.unit();
        let (scale, weight, y_label) = match view {
            ResidualView::Plain => {
                (vec![1.0; rows.len()], None, format!("logged − simulated ({unit})"))
            }
            // Positive where the joint resists more than the model.
            ResidualView::Along => {
                (rows.direction(), None, format!("residual along the motion ({unit})"))
            }
            ResidualView::PerVelocity => {
                // Slow rows contain little information about viscous friction and much noise.
                let slow = 0.1 * rows.fastest;
                let inverse = |v: &f64| if v.abs() < slow { 0.0 } else { 1.0 / v };
                (
                    rows.velocity.iter().map(inverse).collect(),
                    Some(rows.velocity.iter().map(|v| v * v).collect()),
                    format!("missing viscous coefficient ({unit} s/{})", scene.position_unit()),
                )
            }
        };
        Self {
            title: String::new(),
            x,
            label: label.to_owned(),
            range: None,
            scale,
            weight,
            y_label,
            spacing: Spacing::Even,
            says: String::new(),
            without: None,
        }
    }

    /// Returns the scaled residual; NaN for rows that are left out.
    fn seen(&self, rows: &Rows, residual: &[f64]) -> Vec<f64> {
        let scaled = residual.iter().zip(&self.scale).zip(&rows.judged);
        scaled.map(|((r, s), judged)| if *judged && *s != 0.0 { r * s } else { f64::NAN }).collect()
    }

    /// Leaves out the lowest and highest percent, where bins contain few rows.
    fn leave_out_ends(&mut self) {
        let mut sorted: Vec<f64> = self.x.iter().copied().filter(|x| x.is_finite()).collect();
        if sorted.is_empty() {
            return;
        }
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
        let inside = at(0.01)..=at(0.99);
        self.x.iter_mut().filter(|x| !inside.contains(*x)).for_each(|x| *x = f64::NAN);
    }
}

/// Returns the axis label of a column.
fn label(name: &str) -> String {
    let Some((quantity, of)) = Quantity::parse(name) else { return name.to_owned() };
    let unit = quantity.unit(of.unwrap_or_default());
    format!("{} ({unit})", quantity.info().label)
}

/// Returns the charts of a finding.
pub(super) fn of(scene: &Scene, finding: &Finding) -> Vec<Chart> {
    let without = without(scene, finding);
    match &finding.evidence {
        None => Vec::new(),
        Some(Evidence::ByDirection { view, description }) => {
            directions(scene, without, *view, description)
        }
        Some(Evidence::Plane(evidence)) => plane(scene, evidence)
            .and_then(|plane| chart(scene, &scene.all, &Plane { without, ..plane }, true))
            .into_iter()
            .collect(),
    }
}

/// Returns the residual of all rows with the extended model without one cause, not refitted. Returns `None` if it is the
/// only cause, because the base model then shows the same.
fn without(scene: &Scene, finding: &Finding) -> Option<Vec<f64>> {
    let found = scene.about.found;
    let term = finding.cause.remedy().term()?;
    let mut parameters = found.extended.parameters.clone();
    if found.findings.len() < 2 || !parameters.terms.contains(&term) {
        return None;
    }
    parameters.terms.retain(|kept| *kept != term);
    let residuals = |rows| predict(&parameters, rows, found.extended.resolution).residuals.concat();
    Some([residuals(found.log.train_rows()), residuals(found.log.test_rows())].concat())
}

/// Returns the plane of a cause; `None` if its column is missing.
fn plane(scene: &Scene, evidence: &friction_diagnose::Plane) -> Option<Plane> {
    let (label, x) = axis(scene, &evidence.axis)?;
    let mut plane = Plane::new(scene, &scene.all, evidence.view, &label, x);
    plane.title.clone_from(&evidence.title);
    plane.says.clone_from(&evidence.description);
    if matches!(evidence.axis, PlaneAxis::Turn | PlaneAxis::Folded(_)) {
        plane.range = Some((0.0, 360.0));
    }
    if evidence.trimmed {
        plane.leave_out_ends();
    }
    plane.spacing = match evidence.spacing {
        Spacing::Runs if scene.about.input.data.runs.len() <= 1 => Spacing::Even,
        spacing => spacing,
    };
    Some(plane)
}

/// Returns label and values of the horizontal axis; `None` if a column is missing.
fn axis(scene: &Scene, over: &PlaneAxis) -> Option<(String, Vec<f64>)> {
    let (rows, log, data) = (&scene.all, &scene.about.found.log, &scene.about.input.data);
    let (turn, speed) = (scene.position_unit(), scene.velocity_unit());
    let column = |name: &str| rows.named(log, data, name);
    let folded = |order: f64| -> Option<Vec<f64>> {
        let position = column(log.position_name())?;
        Some(position.iter().map(|q| (order * q).rem_euclid(TAU).to_degrees()).collect())
    };
    Some(match over {
        PlaneAxis::Column(name) => (label(name), column(name)?),
        PlaneAxis::SizeOf(name) => {
            let sizes = column(name)?.iter().map(|value| value.abs()).collect();
            (format!("magnitude of {}", label(name)), sizes)
        }
        PlaneAxis::ChangePerTravel(name) => {
            let change = rows.rate_of(log, data, name)?;
            let rest = REST_SPEED_SHARE * rows.fastest;
            let moving = |v: &f64| if v.abs() > rest { v.abs() } else { f64::NAN };
            let x = change.iter().zip(&rows.velocity).map(|(rate, v)| rate / moving(v)).collect();
            let label = label(name);
            let (quantity, unit) = label.split_once(" (").unwrap_or((&label, ")"));
            let unit = unit.trim_end_matches(')');
            (format!("change of {quantity} per {turn} of travel ({unit}/{turn})"), x)
        }
        PlaneAxis::Turn => ("position within one revolution (°)".into(), folded(1.0)?),
        PlaneAxis::Folded(order) => {
            let per = significant(*order, 4);
            (format!("{per} × position, folded to one period (°)"), folded(*order)?)
        }
        PlaneAxis::Speed => {
            let speeds = rows.velocity.iter().map(|v| v.abs()).collect();
            (format!("speed ({speed})"), speeds)
        }
        PlaneAxis::Acceleration => {
            let acceleration = rows.sampled(|sample| sample.acceleration_rad_s2);
            (format!("acceleration ({turn}/s²)"), acceleration)
        }
        PlaneAxis::RestBefore(travel) => {
            let rested = rows.column(|stretch| rest_before(stretch.track, rows.fastest, *travel));
            ("preceding time at rest (s)".into(), rested)
        }
        PlaneAxis::SinceReversal(most) => {
            let gone = rows.column(|stretch| since_reversal(stretch.track, rows.fastest, *most));
            (format!("travel since the last reversal ({turn})"), gone)
        }
        PlaneAxis::CampaignTime => {
            ("campaign time (h)".into(), rows.sampled(|sample| sample.campaign_time_h))
        }
        PlaneAxis::TorqueRate => {
            let slope = rows.column(|stretch| rate(stretch.track, stretch.before));
            (format!("rate of the simulated {} ({}/s)", scene.torque(), scene.unit()), slope)
        }
    })
}

/// Returns the chart of both residuals' means in a plane; `None` if there are fewer than two means.
fn chart(scene: &Scene, rows: &Rows, plane: &Plane, wide: bool) -> Option<Chart> {
    let bins = Bins::new(rows, &plane.x, plane.spacing, BINS[usize::from(!wide)], scene.memory);
    let before = plane.seen(rows, &rows.before);
    let weight = plane.weight.as_deref();
    let base = bins.means(&plane.x, &before, weight);
    if base.len() < 2 {
        return None;
    }
    let extended = match scene.is_extended() {
        true => bins.means(&plane.x, &plane.seen(rows, &rows.after), weight),
        false => Vec::new(),
    };
    let column = |of: fn(&Mean) -> f64| rounded(&base.iter().map(of).collect::<Vec<_>>());
    let mut series = Vec::new();
    if wide && weight.is_none() {
        series.push(Series::thin_points("single rows", &plane.x, &before, CLOUD_POINTS).muted());
    } else if weight.is_none() {
        let name = "middle half of the rows";
        series.push(
            Series::band(name, column(|m| m.x), column(|m| m.low), column(|m| m.high)).muted(),
        );
    }
    // A line between runs would only show their order in time.
    let apart = plane.spacing == Spacing::Runs;
    let means = |name: &str, means: &[Mean]| match mean_line(name, means) {
        line if apart => Series { style: Style::Points, ..line },
        line => line,
    };
    series.push(means(scene.base(), &base));
    if scene.is_extended() {
        series.push(means(AFTER, &extended));
    }
    let mut drawn = extended.clone();
    if let Some(without) = &plane.without {
        let alone = bins.means(&plane.x, &plane.seen(rows, without), weight);
        series.push(means(WITHOUT, &alone));
        drawn.extend(alone);
    }
    let range = fitting_range(&base, &drawn, weight.is_none());
    let log = plane.spacing == Spacing::Logarithmic;
    Some(Chart {
        title: plane.title.clone(),
        caption: format!("{} {}", plane.says, off_zero(&base, &extended)).trim().to_owned(),
        x: Axis { log, range: plane.range, ..Axis::new(plane.label.clone()) },
        y: Axis { range, ..Axis::new(plane.y_label.clone()) },
        series,
    })
}

/// Returns the line of means with error bars.
fn mean_line(name: &str, means: &[Mean]) -> Series {
    let column = |of: &dyn Fn(&Mean) -> f64| rounded(&means.iter().map(of).collect::<Vec<_>>());
    Series::line(name, column(&|m| m.x), column(&|m| m.y))
        .with_error(column(&|m| ERROR_BAR_STD_ERRORS * m.error))
}

/// Describes how far the means are from zero, in standard errors.
fn off_zero(before: &[Mean], after: &[Mean]) -> String {
    let off = |means: &[Mean]| {
        let sure = means.iter().filter(|mean| mean.error > 0.0);
        let ratios: Vec<f64> = sure.map(|mean| (mean.y / mean.error).powi(2)).collect();
        let count = ratios.len();
        (count > 1).then(|| (ratios.iter().sum::<f64>() / count as f64).sqrt())
    };
    match (off(before), off(after)) {
        (Some(before), Some(after)) => format!(
            "The means differ from zero by {} standard errors before and {} after (RMS; 1 is expected by chance).",
            significant(before, 2),
            significant(after, 2)
        ),
        (Some(one), None) => {
            format!(
                "The means differ from zero by {} standard errors (RMS; 1 is expected by chance).",
                significant(one, 2)
            )
        }
        _ => String::new(),
    }
}

/// Returns two charts, before and after, each with one line for each direction.
fn directions(
    scene: &Scene,
    without: Option<Vec<f64>>,
    seen: ResidualView,
    says: &str,
) -> Vec<Chart> {
    let rows = &scene.all;
    let speeds: Vec<f64> = rows.velocity.iter().map(|v| v.abs()).collect();
    let direction = rows.direction();
    let named = format!("speed ({})", scene.velocity_unit());
    let plane = Plane::new(scene, rows, seen, &named, speeds);
    let means = |residual: &[f64], sign: f64| {
        let mut x = plane.x.clone();
        x.iter_mut().zip(&direction).filter(|(_, d)| **d != sign).for_each(|(x, _)| *x = f64::NAN);
        let bins = Bins::new(rows, &x, Spacing::NarrowAtZero, BINS[1], scene.memory);
        bins.means(&x, &plane.seen(rows, residual), None)
    };
    let both = |residual: &[f64]| [means(residual, 1.0), means(residual, -1.0)];
    let (before, after) = (both(without.as_ref().unwrap_or(&rows.before)), both(&rows.after));
    let all: Vec<Mean> = before.iter().chain(&after).flatten().copied().collect();
    let range = fitting_range(&all, &[], false);
    let chart = |title: &str, [forwards, backwards]: &[Vec<Mean>; 2], says: &str| Chart {
        title: title.to_owned(),
        caption: says.to_owned(),
        x: Axis::new(plane.label.clone()),
        y: Axis { range, ..Axis::new(plane.y_label.clone()) },
        series: vec![
            mean_line("positive direction", forwards),
            mean_line("negative direction", backwards),
        ],
    };
    let title = format!("By direction, {}", if without.is_some() { WITHOUT } else { scene.base() });
    let mut charts = vec![chart(&title, &before, says)];
    if scene.is_extended() {
        charts.push(chart("By direction, after", &after, "The same with the extended model."));
    }
    charts
}

/// Returns the charts of the residual over all available quantities: along the motion, and with its own sign.
pub(super) fn survey(scene: &Scene) -> (Vec<Chart>, Vec<Chart>) {
    let (log, held) = (&scene.about.found.log, &scene.held);
    let (mut along, mut plain) = (Vec::new(), Vec::new());
    let mut add = |rows: &Rows, title: &str, label: &str, spacing: Spacing, x: Vec<f64>| {
        for (view, charts) in [(ResidualView::Along, &mut along), (ResidualView::Plain, &mut plain)]
        {
            let plane = Plane::new(scene, rows, view, label, x.clone());
            charts.extend(chart(
                scene,
                rows,
                &Plane { title: title.into(), spacing, ..plane },
                false,
            ));
        }
    };
    let velocity = label(log.velocity_name());
    add(held, "Over velocity", &velocity, Spacing::NarrowAtZero, held.velocity.clone());
    let seconds = "time since the start of the run (s)";
    add(held, "Over the time of a run", seconds, Spacing::Even, held.time_in_run());
    let campaign = scene.all.sampled(|sample| sample.campaign_time_h);
    let runs = if scene.about.input.data.runs.len() > 2 { Spacing::Runs } else { Spacing::Even };
    add(&scene.all, "Over the campaign", "campaign time (h)", runs, campaign);
    let measured = std::iter::once(Quantity::Position).chain(contract::covariates());
    let measured = measured.map(|quantity| quantity.name(log.train.joint));
    let measured = measured.filter(|name| log.varies(name)).map(str::to_owned);
    let extras = log.extras.iter().map(|index| scene.about.input.data.covariates[*index].clone());
    for name in measured.chain(extras) {
        if let Some(x) = held.named(log, &scene.about.input.data, &name) {
            let title = label(&name);
            let quantity = title.split(" (").next().unwrap_or(&title);
            add(held, &format!("Over {quantity}"), &title, Spacing::Even, x);
        }
    }
    (along, plain)
}
