//! A residual against what a cause acts through.
//!
//! Each cause has a plane in which it shows, and says which ([`evidence`]). There the base model's
//! residual must have a shape and the extended model's none. A [`Plane`] holds what is drawn along the axes;
//! [`chart`] draws both residuals' means in it.
//! Where there are several findings, what the base model misses is all of them at once; a third line,
//! the extended model with this one cause taken out, shows it alone.

use super::Scene;
use super::bins::{Bins, Mean, Spacing};
use super::figures::{AFTER, fitting_range};
use super::rows::{AT_REST, Rows, rate, rest_before, since_reversal};
use crate::report::{Axis, Chart, Series, Style, rounded, thin_scatter};
use friction_identification::data::{Quantity, contract};
use friction_identification::diagnose::Finding;
use friction_identification::diagnose::evidence::{self, Evidence, Over, Seen};
use friction_identification::fit::predict::predict;
use friction_identification::number::significant;
use std::f64::consts::TAU;

/// Bins of a chart over the whole width, and of one of two.
const BINS: [usize; 2] = [40, 30];

/// Residuals drawn under the means.
const CLOUD: usize = 900;

/// The extended model with one cause taken out, in every legend.
const WITHOUT: &str = "after, without it";

/// Standard errors an error bar reaches.
const BAR: f64 = 2.0;

/// Which rows.
#[derive(Clone, Copy, PartialEq)]
enum Which {
    All,
    HeldOut,
}

/// What a residual is looked at over, and as what.
struct Plane {
    title: String,
    x: Vec<f64>,
    label: String,
    /// Ends of the axis, if the rows are not to decide.
    range: Option<(f64, f64)>,
    /// What the residual is multiplied by; rows where it is 0 are left out.
    scale: Vec<f64>,
    /// How much rows count, if not all the same.
    weight: Option<Vec<f64>>,
    y_label: String,
    spacing: Spacing,
    /// One sentence on what the cause looks like here.
    says: String,
    /// Residual of the extended model with the cause taken out.
    without: Option<Vec<f64>>,
}

impl Plane {
    /// The residual as it is.
    fn plain(scene: &Scene, rows: &Rows, title: &str, label: &str, x: Vec<f64>) -> Self {
        Self {
            title: title.to_owned(),
            x,
            label: label.to_owned(),
            range: None,
            scale: vec![1.0; rows.len()],
            weight: None,
            y_label: format!("logged − simulated ({})", scene.unit()),
            spacing: Spacing::Even,
            says: String::new(),
            without: None,
        }
    }

    /// The residual along the motion: positive where the log resists more than the model.
    fn along(scene: &Scene, rows: &Rows, title: &str, label: &str, x: Vec<f64>) -> Self {
        Self {
            scale: rows.direction(),
            y_label: format!("resists more than simulated ({})", scene.unit()),
            ..Self::plain(scene, rows, title, label, x)
        }
    }

    /// The residual over velocity, each row counting by the square of its speed.
    fn per_velocity(scene: &Scene, rows: &Rows, title: &str, label: &str, x: Vec<f64>) -> Self {
        // Slow rows say next to nothing of a viscous part, and would fill bins with noise.
        let slow = 0.1 * rows.fastest;
        let inverse = |v: &f64| if v.abs() < slow { 0.0 } else { 1.0 / v };
        Self {
            scale: rows.velocity.iter().map(inverse).collect(),
            weight: Some(rows.velocity.iter().map(|v| v * v).collect()),
            y_label: format!(
                "viscous coefficient missed ({} s/{})",
                scene.unit(),
                scene.position_unit()
            ),
            ..Self::plain(scene, rows, title, label, x)
        }
    }

    /// Over one whole wave.
    fn folded(self) -> Self {
        Self { range: Some((0.0, 360.0)), ..self }
    }

    fn spaced(self, spacing: Spacing) -> Self {
        Self { spacing, ..self }
    }

    fn saying(self, says: &str) -> Self {
        Self { says: says.to_owned(), ..self }
    }

    /// A residual as it is looked at; NaN where it is not.
    fn seen(&self, rows: &Rows, residual: &[f64]) -> Vec<f64> {
        let scaled = residual.iter().zip(&self.scale).zip(&rows.judged);
        scaled.map(|((r, s), judged)| if *judged && *s != 0.0 { r * s } else { f64::NAN }).collect()
    }

    /// Leaves out the rows that are not `kept`.
    fn only(mut self, kept: impl Fn(usize) -> bool) -> Self {
        for (row, x) in self.x.iter_mut().enumerate() {
            if !kept(row) {
                *x = f64::NAN;
            }
        }
        self
    }

    /// Leaves out the outermost hundredth on either side, where one row stands for many.
    fn without_ends(self) -> Self {
        let mut sorted: Vec<f64> = self.x.iter().copied().filter(|x| x.is_finite()).collect();
        if sorted.is_empty() {
            return self;
        }
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
        let (low, high) = (at(0.01), at(0.99));
        let x = self.x.clone();
        self.only(|row| (low..=high).contains(&x[row]))
    }
}

/// A column's name for an axis.
fn label(name: &str) -> String {
    let Some((quantity, of)) = Quantity::parse(name) else { return name.to_owned() };
    let unit = quantity.unit(of.unwrap_or_default());
    format!("{} ({unit})", quantity.info().label)
}

/// The charts of a finding.
pub(super) fn of(scene: &Scene, finding: &Finding) -> Vec<Chart> {
    let without = without(scene, finding);
    match &finding.evidence {
        None => Vec::new(),
        Some(Evidence::ByDirection { seen, says }) => directions(scene, without, *seen, says),
        Some(Evidence::Plane(evidence)) => plane(scene, evidence)
            .and_then(|plane| chart(scene, &scene.all, &Plane { without, ..plane }, true))
            .into_iter()
            .collect(),
    }
}

/// Residual of all rows by the extended model with one cause taken out and nothing fitted anew; where
/// that is the only cause, the base model says it better.
fn without(scene: &Scene, finding: &Finding) -> Option<Vec<f64>> {
    let found = scene.about.found;
    let term = finding.cause.remedy().term()?;
    let mut parameters = found.extended.parameters.clone();
    if found.findings.len() < 2 || !parameters.terms.contains(&term) {
        return None;
    }
    parameters.terms.retain(|own| *own != term);
    let residuals = |rows| predict(&parameters, rows, found.extended.resolution).residuals.concat();
    Some([residuals(found.log.train_rows()), residuals(found.log.test_rows())].concat())
}

/// The rows in the plane a cause shows in; none where its column is not there.
fn plane(scene: &Scene, evidence: &evidence::Plane) -> Option<Plane> {
    let rows = &scene.all;
    let (label, x) = axis(scene, &evidence.over)?;
    let title = &evidence.title;
    let mut plane = match evidence.seen {
        Seen::Plain => Plane::plain(scene, rows, title, &label, x),
        Seen::Along => Plane::along(scene, rows, title, &label, x),
        Seen::PerVelocity => Plane::per_velocity(scene, rows, title, &label, x),
    };
    if matches!(evidence.over, Over::Turn | Over::Folded(_)) {
        plane = plane.folded();
    }
    if evidence.trimmed {
        plane = plane.without_ends();
    }
    let spacing = match evidence.spacing {
        evidence::Spacing::Even => Spacing::Even,
        evidence::Spacing::NarrowAtZero => Spacing::NarrowAtZero,
        evidence::Spacing::Logarithmic => Spacing::Log,
        evidence::Spacing::Runs if scene.about.data.runs.len() > 1 => Spacing::Runs,
        evidence::Spacing::Runs => Spacing::Even,
    };
    Some(plane.spaced(spacing).saying(&evidence.says))
}

/// What is drawn along an axis, and its label; none where a column is not there.
fn axis(scene: &Scene, over: &Over) -> Option<(String, Vec<f64>)> {
    let (rows, log, data) = (&scene.all, &scene.about.found.log, scene.about.data);
    let (turn, speed) = (scene.position_unit(), scene.velocity_unit());
    let column = |name: &str| rows.named(log, data, name);
    let folded = |order: f64| -> Option<Vec<f64>> {
        let position = column(log.position_name())?;
        Some(position.iter().map(|q| (order * q).rem_euclid(TAU).to_degrees()).collect())
    };
    Some(match over {
        Over::Column(name) => (label(name), column(name)?),
        Over::SizeOf(name) => {
            let sizes = column(name)?.iter().map(|value| value.abs()).collect();
            (format!("size of the {}", label(name)), sizes)
        }
        Over::ChangePerTravel(name) => {
            let change = rows.rate_of(log, data, name)?;
            let rest = AT_REST * rows.fastest;
            let moving = |v: &f64| if v.abs() > rest { v.abs() } else { f64::NAN };
            let x = change.iter().zip(&rows.velocity).map(|(rate, v)| rate / moving(v)).collect();
            let label = label(name);
            let (quantity, unit) = label.split_once(" (").unwrap_or((&label, ")"));
            let unit = unit.trim_end_matches(')');
            (format!("change of {quantity} per {turn} travelled ({unit}/{turn})"), x)
        }
        Over::Turn => ("position within the turn (°)".into(), folded(1.0)?),
        Over::Folded(order) => {
            let per = significant(*order, 4);
            (format!("{per} × position, folded to one wave (°)"), folded(*order)?)
        }
        Over::Speed => {
            let speeds = rows.velocity.iter().map(|v| v.abs()).collect();
            (format!("speed ({speed})"), speeds)
        }
        Over::Acceleration => {
            let acceleration = rows.sampled(|sample| sample.acceleration_rad_s2);
            (format!("acceleration ({turn}/s²)"), acceleration)
        }
        Over::RestBefore(travel) => {
            let rested = rows.column(|stretch| rest_before(stretch.track, rows.fastest, *travel));
            ("time at rest before (s)".into(), rested)
        }
        Over::SinceReversal(most) => {
            let gone = rows.column(|stretch| since_reversal(stretch.track, rows.fastest, *most));
            (format!("travel since the reversal ({turn})"), gone)
        }
        Over::CampaignTime => {
            ("campaign time (h)".into(), rows.sampled(|sample| sample.campaign_time_h))
        }
        Over::TorqueRate => {
            let slope = rows.column(|stretch| rate(stretch.track, stretch.before));
            (format!("rate of the simulated {} ({}/s)", scene.torque(), scene.unit()), slope)
        }
    })
}

/// Both residuals' means in a plane; none where there is nothing to draw.
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
        let (x, y) = thin_scatter(&plane.x, &before, CLOUD);
        series.push(Series::points("single rows", rounded(&x), rounded(&y)).muted());
    } else if weight.is_none() {
        let name = "middle half";
        series.push(
            Series::band(name, column(|m| m.x), column(|m| m.low), column(|m| m.high)).muted(),
        );
    }
    // A line from run to run would only show the order they were made in.
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
    let log = plane.spacing == Spacing::Log;
    Some(Chart {
        title: plane.title.clone(),
        caption: format!("{} {}", plane.says, off_zero(&base, &extended)).trim().to_owned(),
        x: Axis { log, range: plane.range, ..Axis::new(plane.label.clone()) },
        y: Axis { range, ..Axis::new(plane.y_label.clone()) },
        series,
    })
}

/// Means with their errors.
fn mean_line(name: &str, means: &[Mean]) -> Series {
    let column = |of: &dyn Fn(&Mean) -> f64| rounded(&means.iter().map(of).collect::<Vec<_>>());
    Series::line(name, column(&|m| m.x), column(&|m| m.y)).with_error(column(&|m| BAR * m.error))
}

/// How far the means are from zero, in standard errors.
fn off_zero(before: &[Mean], after: &[Mean]) -> String {
    let off = |means: &[Mean]| {
        let sure = means.iter().filter(|mean| mean.error > 0.0);
        let ratios: Vec<f64> = sure.map(|mean| (mean.y / mean.error).powi(2)).collect();
        let count = ratios.len();
        (count > 1).then(|| (ratios.iter().sum::<f64>() / count as f64).sqrt())
    };
    match (off(before), off(after)) {
        (Some(before), Some(after)) => format!(
            "The means are {} standard errors from zero before and {} after (RMS; 1 is chance).",
            significant(before, 2),
            significant(after, 2)
        ),
        (Some(one), None) => {
            format!(
                "The means are {} standard errors from zero (RMS; 1 is chance).",
                significant(one, 2)
            )
        }
        _ => String::new(),
    }
}

/// Two charts, before and after, each with a line per direction.
fn directions(scene: &Scene, without: Option<Vec<f64>>, seen: Seen, says: &str) -> Vec<Chart> {
    let rows = &scene.all;
    let speeds: Vec<f64> = rows.velocity.iter().map(|v| v.abs()).collect();
    let direction = rows.direction();
    let named = format!("speed ({})", scene.velocity_unit());
    let plane = match seen {
        Seen::Along => Plane::along(scene, rows, "", &named, speeds),
        Seen::Plain => Plane::plain(scene, rows, "", &named, speeds),
        Seen::PerVelocity => Plane::per_velocity(scene, rows, "", &named, speeds),
    };
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
        series: vec![mean_line("forwards", forwards), mean_line("backwards", backwards)],
    };
    let title = format!("By direction, {}", if without.is_some() { WITHOUT } else { scene.base() });
    let mut charts = vec![chart(&title, &before, says)];
    if scene.is_extended() {
        charts.push(chart("By direction, after", &after, "The same with the extended model."));
    }
    charts
}

/// The residual over all there is to look at it over: along the motion, and as it is.
pub(super) fn survey(scene: &Scene) -> (Vec<Chart>, Vec<Chart>) {
    let found = scene.about.found;
    let log = &found.log;
    let mut along = Vec::new();
    let mut plain = Vec::new();
    let mut look = |which: Which, title: &str, label: &str, spacing: Spacing, x: Vec<f64>| {
        let rows = if which == Which::All { &scene.all } else { &scene.held };
        let with = Plane::along(scene, rows, title, label, x.clone()).spaced(spacing);
        let without = Plane::plain(scene, rows, title, label, x).spaced(spacing);
        along.extend(chart(scene, rows, &with, false));
        plain.extend(chart(scene, rows, &without, false));
    };
    let held = &scene.held;
    let velocity = label(log.velocity_name());
    look(Which::HeldOut, "Over velocity", &velocity, Spacing::NarrowAtZero, held.velocity.clone());
    look(
        Which::HeldOut,
        "Over the time of a run",
        "time since the run began (s)",
        Spacing::Even,
        held.time_in_run(),
    );
    let campaign = scene.all.sampled(|sample| sample.campaign_time_h);
    let runs = if scene.about.data.runs.len() > 2 { Spacing::Runs } else { Spacing::Even };
    look(Which::All, "Over the campaign", "campaign time (h)", runs, campaign);
    let measured = std::iter::once(Quantity::Position).chain(contract::covariates());
    let measured = measured.map(|quantity| quantity.name(log.train.joint));
    let measured = measured.filter(|name| log.varies(name)).map(str::to_owned);
    let extras = log.extras.iter().map(|index| scene.about.data.covariates[*index].clone());
    for name in measured.chain(extras) {
        if let Some(x) = held.named(log, scene.about.data, &name) {
            let title = label(&name);
            let quantity = title.split(" (").next().unwrap_or(&title);
            look(Which::HeldOut, &format!("Over {quantity}"), &title, Spacing::Even, x);
        }
    }
    (along, plain)
}
