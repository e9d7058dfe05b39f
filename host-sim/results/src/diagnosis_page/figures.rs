//! The charts that do not belong to a single cause.

use super::Scene;
use super::bins::{Bins, Mean};
use super::rows::Stretch;
use super::rows::times;
use crate::budget::{BudgetStep, budget as budget_of};
use crate::page::words::quantity;
use crate::ranking::RankedCandidate;
use crate::report::{Axis, Chart, Series, rounded};
use friction_diagnose::Share;
use friction_diagnose::Spacing;
use joint_log::number::significant;

/// Legend of the base model.
pub(super) const BEFORE: &str = "before";

/// Legend of the extended model.
pub(super) const AFTER: &str = "after";

/// Legend of the data.
pub(super) const LOGGED: &str = "logged";

/// Maximum number of points of a curve.
pub(super) const CURVE_POINTS: usize = 2500;
/// Maximum number of points of a cloud.
const CLOUD_POINTS: usize = 1200;

/// Maximum number of runs in the chart of errors.
const MAX_RUNS: usize = 16;

/// Returns the range of an axis that shows the means with their errors, and optionally the quartiles.
pub(super) fn fitting_range(before: &[Mean], after: &[Mean], quarters: bool) -> Option<(f64, f64)> {
    let (mut low, mut high) = (0.0f64, 0.0f64);
    for mean in before.iter().chain(after) {
        let error = if mean.error.is_finite() { 2.0 * mean.error } else { 0.0 };
        (low, high) = (low.min(mean.y - error), high.max(mean.y + error));
    }
    if quarters {
        for mean in before {
            (low, high) = (low.min(1.4 * mean.low), high.max(1.4 * mean.high));
        }
    }
    let margin = 0.06 * (high - low);
    (high > low).then_some((low - margin, high + margin))
}

/// Returns the chart of the error budget: from plain friction, step by step, to what a flexible model and the noise leave.
pub(super) fn budget(scene: &Scene) -> Chart {
    let steps = budget_of(scene.about.found);
    let places = (0..).map(f64::from);
    let name = |step: &BudgetStep| match step.deployable || step.is_limit {
        true => step.name.to_owned(),
        false => format!("{} (PC)", step.name),
    };
    let bars = |series: &str, is_limit: bool| {
        let drawn = steps.iter().zip(places.clone()).filter(|(step, _)| step.is_limit == is_limit);
        let (x, y) = drawn.map(|(step, place)| (step.rmse, place)).unzip();
        Series::bars(series, x, y)
    };
    Chart {
        title: "Error budget".into(),
        caption: "The held-out error of plain friction, then of a law with one cause more in each row, the one that takes most \
                  first. The ceiling is what boosted trees with all logged columns leave on rows that they have not seen, the noise what no model can take. \
                  A step with (PC) has no term in a driver."
            .into(),
        x: Axis::new(format!("RMSE ({})", scene.unit())),
        y: Axis::of_names("", steps.iter().map(name).collect::<Vec<_>>()),
        series: vec![bars("model", false), bars("limit", true)],
    }
}

/// Returns the chart of the held-out errors with the noise floor.
pub(super) fn errors(scene: &Scene) -> Chart {
    let found = scene.about.found;
    let held = &scene.held;
    let mut runs: Vec<usize> = held.stretches.iter().map(|stretch| stretch.run).collect();
    runs.dedup();
    let rmse = |residual: &[f64], run: usize| {
        let of_run = held.stretches.iter().filter(|stretch| stretch.run == run);
        let rows = of_run.flat_map(|stretch| stretch.rows.clone());
        let (squares, weights) = rows.fold((0.0, 0.0), |(squares, weights), row| {
            (squares + held.weight[row] * residual[row].powi(2), weights + held.weight[row])
        });
        if weights > 0.0 { (squares / weights).sqrt() } else { 0.0 }
    };
    let all = runs.len();
    runs.sort_by(|a, b| rmse(&held.before, *b).total_cmp(&rmse(&held.before, *a)));
    runs.truncate(if all > 1 { MAX_RUNS } else { 0 });
    let mut names = vec!["all held-out rows".to_owned()];
    names.extend(runs.iter().map(|run| format!("run {}", scene.about.input.data.runs[*run].name)));
    let places: Vec<f64> = (0..names.len()).map(|place| place as f64).collect();
    let bars = |total: f64, residual: &[f64]| {
        std::iter::once(total).chain(runs.iter().map(|run| rmse(residual, *run))).collect()
    };
    let before: Vec<f64> = bars(found.before.metrics.rmse, &held.before);
    let mut series = vec![Series::bars(scene.base(), before, places.clone())];
    if scene.is_extended() {
        // Convert the interval of the gain into one of the remaining error.
        let [low, high] = found.gain.ci95;
        let reach = found.before.metrics.rmse * (high - low) / 2.0;
        let mut error = vec![f64::NAN; places.len()];
        error[0] = reach;
        let after = bars(found.after.metrics.rmse, &held.after);
        series.push(Series::bars(AFTER, after, places.clone()).with_error(error));
    }
    let ends = vec![-0.5, places.len() as f64 - 0.5];
    series.push(Series::line("noise floor", vec![found.noise_floor; 2], ends).muted());
    let shown = match all.saturating_sub(MAX_RUNS) {
        0 => String::new(),
        more => format!(
            " The chart shows the {MAX_RUNS} runs with the largest error of the base model; {more} more are not shown."
        ),
    };
    Chart {
        title: format!(
            "Error on held-out rows, {}",
            if scene.is_extended() { "before and after" } else { "base model" }
        ),
        caption: format!(
            "Shorter bars are better. The grey line is the noise floor, the error of the best possible model ({}).{}{shown}",
            quantity(found.noise_floor, scene.unit()),
            if scene.is_extended() {
                " The error bar is the 95 % interval of the gain."
            } else {
                ""
            }
        ),
        x: Axis::new(format!("RMSE ({})", scene.unit())),
        y: Axis::of_names("", names),
        series,
    }
}

/// Returns the held-out segment with the largest gain, or without an extension that with the largest error.
fn most_informative<'a>(scene: &'a Scene) -> Option<&'a Stretch<'a>> {
    let held = &scene.held;
    let squares = |residual: &[f64]| residual.iter().map(|r| r * r).sum::<f64>();
    let information = |stretch: &&Stretch| {
        let rows = stretch.rows.clone();
        let before = squares(&held.before[rows.clone()]);
        if scene.is_extended() {
            before - squares(&held.after[rows])
        } else {
            before / rows.len().max(1) as f64
        }
    };
    held.stretches.iter().max_by(|a, b| information(a).total_cmp(&information(b)))
}

/// Returns the short window of a segment with the largest gain of the extension.
fn close_up(scene: &Scene, stretch: &Stretch) -> std::ops::Range<usize> {
    let rows = stretch.track.len();
    let length = (rows / 12).max(160).min(rows);
    let gain = |row: usize| {
        if !stretch.track.is_included(row) {
            return 0.0;
        }
        let (logged, base, extended) =
            (stretch.track.torque[row], stretch.before[row], stretch.after[row]);
        let extended = if scene.is_extended() { (logged - extended).powi(2) } else { 0.0 };
        (logged - base).powi(2) - extended
    };
    let mut sum: f64 = (0..length).map(gain).sum();
    let (mut best, mut begin) = (sum, 0);
    for row in length..rows {
        sum += gain(row) - gain(row - length);
        if sum > best {
            (best, begin) = (sum, row + 1 - length);
        }
    }
    begin..begin + length
}

/// Returns the charts of the logged and simulated torque in one segment: over time, a detail, and over velocity.
pub(super) fn predictions(scene: &Scene) -> Option<[Chart; 3]> {
    let stretch = most_informative(scene)?;
    let time: Vec<f64> = times(stretch).collect();
    let velocity: Vec<f64> = stretch.track.samples.iter().map(|s| s.velocity_rad_s).collect();
    let logged = &stretch.track.torque;
    let models = |draw: &dyn Fn(&str, &[f64]) -> Series| {
        let mut series = vec![draw(LOGGED, logged).muted(), draw(scene.base(), stretch.before)];
        if scene.is_extended() {
            series.push(draw(AFTER, stretch.after));
        }
        series
    };
    let curves = |rows: std::ops::Range<usize>| {
        models(&|name, torque| {
            Series::thin_line(name, &time[rows.clone()], &torque[rows.clone()], CURVE_POINTS)
        })
    };
    let clouds = models(&|name, torque| Series::thin_points(name, &velocity, torque, CLOUD_POINTS));
    let window = close_up(scene, stretch);
    let name = &scene.about.input.data.runs[stretch.run].name;
    let seconds = || Axis::new("time since the start of the run (s)");
    let torque = || Axis::new(format!("{} ({})", scene.torque(), scene.unit()));
    let whole = match stretch.since_start_s {
        start if start > 0.0 => format!("Run {name} from {} s", significant(start, 3)),
        _ => format!("Run {name}"),
    };
    Some([
        Chart {
            title: format!("{whole}, held out"),
            caption: "The models use only the logged motion as input. The curves are thinned; the minimum and maximum of each \
                      group of rows are kept."
                .into(),
            x: seconds(),
            y: torque(),
            series: curves(0..logged.len()),
        },
        Chart {
            title: "Detail".into(),
            caption: if scene.is_extended() {
                "The part of the segment with the largest gain of the extension.".into()
            } else {
                "The part of the segment with the largest error of the model.".into()
            },
            x: seconds(),
            y: torque(),
            series: curves(window),
        },
        Chart {
            title: "The whole segment over velocity".into(),
            caption: "The points are thinned in proportion to their density; outliers are kept.".into(),
            x: Axis::new(format!("velocity ({})", scene.velocity_unit())),
            y: torque(),
            series: clouds,
        },
    ])
}

/// Returns the range of the means, including zero.
fn with_zero(means: &[Mean]) -> Option<(f64, f64)> {
    let low = means.iter().fold(0.0f64, |low, mean| low.min(mean.x));
    let high = means.iter().fold(0.0f64, |high, mean| high.max(mean.x));
    let margin = 0.05 * (high - low);
    (high > low).then_some((low - margin, high + margin))
}

/// Returns the chart of the torque that the extension adds, against the torque that the base model misses.
pub(super) fn added(scene: &Scene) -> Chart {
    let held = &scene.held;
    let added = |row: usize| match held.judged[row] {
        true => held.before[row] - held.after[row],
        false => f64::NAN,
    };
    let added: Vec<f64> = (0..held.len()).map(added).collect();
    let bins = Bins::new(held, &added, Spacing::Even, 30, scene.memory);
    let means = bins.means(&added, &held.before, None);
    let column = |of: &dyn Fn(&Mean) -> f64| rounded(&means.iter().map(of).collect::<Vec<_>>());
    let ends: Vec<f64> = [means.first(), means.last()].into_iter().flatten().map(|m| m.x).collect();
    let ends = rounded(&ends);
    let line = Series::line(BEFORE, column(&|m| m.x), column(&|m| m.y));
    Chart {
        title: "Torque added by the extension and torque missed by the base model".into(),
        caption: "Held-out rows. The means of a right extension lie on the diagonal: it adds the torque that the base model \
                  misses. A flat line would mean that the extension only fits noise."
            .into(),
        x: Axis { range: with_zero(&means), ..Axis::new(format!("extended − base model ({})", scene.unit())) },
        y: Axis {
            range: fitting_range(&means, &[], true),
            ..Axis::new(format!("logged − base model ({})", scene.unit()))
        },
        series: vec![
            Series::thin_points("single rows", &added, &held.before, CLOUD_POINTS).muted(),
            Series::line("ideal", ends.clone(), ends).coloured_as(AFTER),
            line.with_error(column(&|m| 2.0 * m.error)),
        ],
    }
}

/// Returns the chart of the residuals' autocorrelation.
pub(super) fn autocorrelation(scene: &Scene) -> Chart {
    let held = &scene.held;
    let memory = super::memory(&scene.about.found.before).max(scene.memory);
    let most = (held.len() / 8).min((8.0 * memory) as usize).clamp(20, 1500);
    let period = held.period_s();
    let lags: Vec<f64> = (0..=most).map(|lag| lag as f64 * period).collect();
    let curve = |name: &str, residual: &[f64]| {
        Series::thin_line(name, &lags, &held.autocorrelation(residual, most), 400)
    };
    let mut series = vec![curve(scene.base(), &held.before)];
    if scene.is_extended() {
        series.push(curve(AFTER, &held.after));
    }
    Chart {
        title: "Autocorrelation of the residual".into(),
        caption: "Held-out rows. The autocorrelation of white noise falls from 1 to 0 within one row. Values that stay above 0 \
                  show a systematic error."
            .into(),
        x: Axis::new("lag (s)"),
        y: Axis::new("autocorrelation"),
        series,
    }
}

/// Returns the chart of the shares of rows and squared error.
pub(super) fn shares(scene: &Scene, title: &str, shares: &[Share], caption: &str) -> Chart {
    let shown: Vec<&Share> = shares.iter().filter(|share| share.of_rows > 0.0).collect();
    let places: Vec<f64> = (0..shown.len()).map(|place| place as f64).collect();
    let percent = |of: fn(&Share) -> f64| shown.iter().map(|share| 100.0 * of(share)).collect();
    Chart {
        title: title.into(),
        caption: caption.into(),
        x: Axis::new("share (%)"),
        y: Axis::of_names("", shown.iter().map(|share| share.name.clone())),
        series: vec![
            Series::bars(
                format!("share of squared error, {}", scene.base()),
                percent(|s| s.of_error),
                places.clone(),
            )
            .with_error(percent(|s| 2.0 * s.uncertainty))
            .coloured_as(scene.base()),
            Series::bars("share of rows", percent(|s| s.of_rows), places).muted(),
        ],
    }
}

/// Returns the name of a candidate with its probability.
fn label(ranked: &RankedCandidate) -> String {
    format!("{} ({:.0} %)", ranked.name, 100.0 * ranked.probability)
}

/// Returns the chart of the candidates' gains.
pub(super) fn ranking(shown: &[&RankedCandidate]) -> Chart {
    let bars = |name: &str, is_drawn: &dyn Fn(&RankedCandidate) -> bool| {
        let (mut x, mut y, mut error) = (Vec::new(), Vec::new(), Vec::new());
        for (place, ranked) in shown.iter().enumerate().filter(|(_, ranked)| is_drawn(ranked)) {
            x.push(100.0 * ranked.candidate.figures.alone);
            y.push(place as f64);
            error.push(200.0 * ranked.candidate.gain_error());
        }
        Series::bars(name, x, y).with_error(error)
    };
    let series = [
        bars("finding", &|ranked| ranked.is_finding).coloured_as(AFTER),
        bars("not named", &|ranked| !ranked.is_finding).muted(),
    ];
    Chart {
        title: "Gain and probability of each candidate, added alone to the base law".into(),
        caption: "The reduction of the squared error on held-out rows by each candidate alone; error bars are two standard \
                  errors over blocks of rows or over runs. The percentage beside a name is the probability that the cause is \
                  real. A candidate that is only correlated with a cause loses its gain after that cause is added."
            .into(),
        x: Axis::new("gain on held-out rows (% of the squared error)"),
        y: Axis::of_names("", shown.iter().map(|ranked| label(ranked))),
        series: series.into_iter().filter(|series| !series.x.is_empty()).collect(),
    }
}
