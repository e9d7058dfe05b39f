//! A residual against what a cause acts through.
//!
//! Each cause has a plane in which it shows: pressure raises the level, so what the base model misses
//! *along the motion* rises with pressure; a ripple is a wave over the angle folded `n` times a turn; a
//! delay follows the rate of the torque. There the base model's residual must have a shape and the
//! extended model's none. A [`Plane`] says what the axes are; [`chart`] draws both residuals' means in it.
//! Where there are several findings, what the base model misses is all of them at once; a third line,
//! the extended model with this one cause taken out, shows it alone.

use super::Scene;
use super::bins::{Bins, Mean, Spacing};
use super::figures::{AFTER, fitting_range};
use super::rows::{AT_REST, Rows, rate, rest_before, since_reversal};
use crate::report::{Axis, Chart, Series, Style, rounded, thin_scatter};
use ParameterId as Id;
use compensator_core::{ParameterId, TermKind};
use friction_identification::diagnose::Finding;
use friction_identification::fit::outcome::predict;
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
    match name {
        "radial_force_n" => "side load (N)".into(),
        "pressure_diff_pa" => "pressure difference (Pa)".into(),
        "temperature_c" => "temperature (°C)".into(),
        "load_torque_nm" => "load torque (Nm)".into(),
        "position_rad" => "position (rad)".into(),
        "position_m" => "position (m)".into(),
        "velocity_rad_s" => "velocity (rad/s)".into(),
        "velocity_m_s" => "velocity (m/s)".into(),
        "time_s" => "campaign time (s)".into(),
        other => other.to_owned(),
    }
}

/// The charts of a finding.
pub(super) fn of(scene: &Scene, finding: &Finding) -> Vec<Chart> {
    let without = without(scene, finding.kind);
    match finding.kind {
        TermKind::DirectionAsymmetry => directions(scene, without, false),
        TermKind::TorqueOffset => directions(scene, without, true),
        kind => plane(scene, finding, kind)
            .and_then(|plane| chart(scene, &scene.all, &Plane { without, ..plane }, true))
            .into_iter()
            .collect(),
    }
}

/// Residual of all rows by the extended model with one cause taken out and nothing fitted anew; where
/// that is the only cause, the base model says it better.
fn without(scene: &Scene, kind: TermKind) -> Option<Vec<f64>> {
    let found = scene.about.found;
    let mut parameters = found.extended.parameters.clone();
    if found.findings.len() < 2 || !parameters.terms.contains(&kind) {
        return None;
    }
    parameters.terms.retain(|term| *term != kind);
    let residuals = |rows| predict(&parameters, rows, found.extended.resolution).residuals.concat();
    Some([residuals(found.log.train_rows()), residuals(found.log.test_rows())].concat())
}

/// Where a cause shows.
fn plane(scene: &Scene, finding: &Finding, kind: TermKind) -> Option<Plane> {
    use TermKind as Kind;
    let found = scene.about.found;
    let (rows, log, data) = (&scene.all, &found.log, scene.about.data);
    let parameter = |id: Id| found.extended.parameters.get(id);
    let column = |name: &str| rows.named(log, data, name);
    let along = |title: &str, name: &str, x| Plane::along(scene, rows, title, &label(name), x);
    let plain = |title: &str, name: &str, x| Plane::plain(scene, rows, title, &label(name), x);
    let velocity = log.velocity_name();
    let (turn, speed) = (scene.position_unit(), scene.velocity_unit());
    Some(match kind {
        Kind::RadialForceCoulomb => along("Friction and side load", "radial_force_n", column("radial_force_n")?)
            .saying("Where side load presses the seal, what the base model misses rises with it, in both directions alike."),
        Kind::PressureCoulomb => along("Friction and pressure", "pressure_diff_pa", column("pressure_diff_pa")?)
            .saying("Where pressure presses the seal, what the base model misses rises with it, in both directions alike."),
        Kind::LoadTorqueCoulomb => {
            let load = column("load_torque_nm")?.iter().map(|load| load.abs()).collect();
            along("Friction and transmitted torque", "size of the load torque (Nm)", load)
                .saying("Where the load presses the gear, what the base model misses rises with its size, whatever its sign.")
        }
        Kind::RadialForceRate => {
            let force = rows.column(|stretch| {
                let force: Vec<f64> =
                    stretch.track.samples.iter().map(|sample| sample.radial_force_n).collect();
                rate(stretch.track, &force)
            });
            let rest = AT_REST * rows.fastest;
            let moving = |v: &f64| if v.abs() > rest { v.abs() } else { f64::NAN };
            let x = force.iter().zip(&rows.velocity).map(|(rate, v)| rate / moving(v)).collect();
            plain("The changing side load", &format!("change of side load per {turn} travelled (N/{turn})"), x)
                .without_ends()
                .spaced(Spacing::NarrowAtZero)
                .saying("A side load that changes while the joint hardly moves bends the bristles: the torque is off in \
                         proportion, whichever way it moves.")
        }
        Kind::TemperatureViscous => {
            let temperature = column("temperature_c")?;
            let mut plane = plain("Viscous part and temperature", "temperature_c", temperature);
            plane.y_label = format!("viscous coefficient missed ({} s/{turn})", scene.unit());
            // Slow rows say next to nothing of a viscous part, and would fill bins with noise.
            let slow = 0.1 * rows.fastest;
            plane.scale = rows.velocity.iter().map(|v| if v.abs() < slow { 0.0 } else { 1.0 / v }).collect();
            plane.weight = Some(rows.velocity.iter().map(|v| v * v).collect());
            plane.saying("Residual over velocity, each row counting by the square of its speed. Where the film thins as \
                          it warms, the coefficient that is missed falls with temperature.")
        }
        Kind::PositionRipple => {
            let order = finding.order.map_or_else(|| parameter(Id::RippleOrder), |(order, _)| order);
            let phase = column(log.position_name())?;
            let phase = phase.iter().map(|q| (order * q).rem_euclid(TAU).to_degrees()).collect();
            let per = significant(order, 4);
            along("The position, folded by the order", &format!("{per} × position, folded to one wave (°)"), phase)
                .folded()
                .saying(&format!(
                    "The position times {per} per {turn}, all waves laid over each other. A ripple of that order is one \
                     wave here, and anything of another order averages out."
                ))
        }
        Kind::GravityImbalance => {
            let angle = column(log.position_name())?;
            let angle = angle.iter().map(|q| q.rem_euclid(TAU).to_degrees()).collect();
            plain("The shaft's angle", "position within the turn (°)", angle)
                .folded()
                .saying("An imbalance is one wave over the turn, whichever way the joint moves.")
        }
        Kind::QuadraticDrag => {
            let speeds = rows.velocity.iter().map(|v| v.abs()).collect();
            along("Friction and speed", &format!("speed ({speed})"), speeds)
                .saying("Drag of water grows with the square of the speed; what a base model without it misses bends upwards.")
        }
        Kind::StribeckShape => {
            let speeds = rows.velocity.iter().map(|v| v.abs()).collect();
            along("Friction and speed, slow to fast", &format!("speed ({speed})"), speeds)
                .spaced(Spacing::Log)
                .saying("A Stribeck curve of the wrong exponent is above the log at some slow speeds and below it at others.")
        }
        Kind::DwellTimeStatic => {
            let travel = parameter(Id::DwellTravel);
            let x = rows.column(|stretch| rest_before(stretch.track, rows.fastest, travel));
            along("Just after breaking away", "time at rest before (s)", x).spaced(Spacing::Log).saying(&format!(
                "Rows within {} {turn} after the joint has left rest. Where contacts age, the longer it rested the more it resists.",
                significant(travel, 2)
            ))
        }
        Kind::Backlash => {
            let most = 8.0 * parameter(Id::BacklashTravel);
            let x = rows.column(|stretch| since_reversal(stretch.track, rows.fastest, most));
            along("Just after a reversal", &format!("travel since the reversal ({turn})"), x)
                .saying("Where there is play, the joint resists less than a bristle model until the play is crossed.")
        }
        Kind::TimeDrift => {
            let x = rows.sampled(|sample| sample.campaign_time_h);
            let runs = if data.runs.len() > 1 { Spacing::Runs } else { Spacing::Even };
            along("Friction over the campaign", "campaign time (h)", x).spaced(runs).saying(
                "One point for each run, or stretch of a single one. Where friction runs in or wears, they drift over the campaign.",
            )
        }
        Kind::UnmodelledInertia => {
            let acceleration = rows.sampled(|sample| sample.acceleration_rad_s2);
            plain("Torque and acceleration", &format!("acceleration ({turn}/s²)"), acceleration)
                .without_ends()
                .saying("A torque in proportion to acceleration is a rigid body, not friction.")
        }
        Kind::ChannelDelay => {
            let slope = rows.column(|stretch| rate(stretch.track, stretch.before));
            plain("The rate of the torque", &format!("rate of the simulated {} ({}/s)", scene.torque(), scene.unit()), slope)
                .spaced(Spacing::NarrowAtZero)
                .saying("Where the channels are logged at different times, the residual is the rate of the torque times the \
                         delay: a line that falls.")
        }
        Kind::LoadGain => plain("The load", "load_torque_nm", column("load_torque_nm")?)
            .saying("A part of the load in the reading is a line through zero, whichever way the joint moves."),
        Kind::DirectionAsymmetry | Kind::TorqueOffset => return None,
        Kind::LookupTable => {
            let name = finding.columns.first()?;
            let x = column(name)?;
            let level = super::words::follows_level(found);
            let title = format!("What follows {name}");
            if level { along(&title, name, x) } else { plain(&title, name, x) }
                .spaced(if name == velocity { Spacing::NarrowAtZero } else { Spacing::Even })
                .saying("No named cause has this shape; the extension is a curve drawn through it.")
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
fn directions(scene: &Scene, without: Option<Vec<f64>>, offset: bool) -> Vec<Chart> {
    let rows = &scene.all;
    let speeds: Vec<f64> = rows.velocity.iter().map(|v| v.abs()).collect();
    let direction = rows.direction();
    let named = format!("speed ({})", scene.velocity_unit());
    let plane = match offset {
        true => Plane::plain(scene, rows, "", &named, speeds),
        false => Plane::along(scene, rows, "", &named, speeds),
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
    let says = match offset {
        true => "A zero error of the reading lifts both directions alike, at every speed.",
        false => {
            "Where one direction rubs harder, the two lines part; a model that knows it brings them together."
        }
    };
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
    let contract = [
        log.position_name(),
        "radial_force_n",
        "pressure_diff_pa",
        "temperature_c",
        "load_torque_nm",
    ];
    let contract = contract.into_iter().filter(|name| log.varies(name)).map(str::to_owned);
    let extras = log.extras.iter().map(|index| scene.about.data.covariates[*index].clone());
    for name in contract.chain(extras) {
        if let Some(x) = held.named(log, scene.about.data, &name) {
            let title = label(&name);
            let quantity = title.split(" (").next().unwrap_or(&title);
            look(Which::HeldOut, &format!("Over {quantity}"), &title, Spacing::Even, x);
        }
    }
    (along, plain)
}
