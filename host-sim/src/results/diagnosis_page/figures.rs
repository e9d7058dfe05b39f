//! The charts that are not of one cause.

use super::Scene;
use super::bins::{Bins, Mean, Spacing};
use super::rows::Stretch;
use super::rows::times;
use crate::report::{Axis, Chart, Series, rounded, thin_scatter, thin_series};
use crate::results::page::words::quantity;
use crate::results::ranking::Ranked;
use friction_identification::diagnose::Share;
use friction_identification::number::significant;

/// The base model in every legend.
pub(super) const BEFORE: &str = "before";

/// The extended model in every legend.
pub(super) const AFTER: &str = "after";

/// The data in every legend.
const LOGGED: &str = "as logged";

/// Corners of a curve, points of a cloud.
pub(super) const CORNERS: usize = 2500;
const CLOUD: usize = 1200;

/// Most runs whose errors are drawn one by one.
const MOST_RUNS: usize = 16;

/// The axis that shows these means with their errors, and the quarter lines if asked.
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

/// The errors on rows left out, with the floor.
pub(super) fn errors(scene: &Scene) -> Chart {
    let found = scene.about.found;
    let held = &scene.held;
    let mut runs: Vec<usize> = held.stretches.iter().map(|stretch| stretch.run).collect();
    runs.dedup();
    let rmse = |residual: &[f64], run: usize| {
        let own = held.stretches.iter().filter(|stretch| stretch.run == run);
        let rows = own.flat_map(|stretch| stretch.rows.clone());
        let (squares, weights) = rows.fold((0.0, 0.0), |(squares, weights), row| {
            (squares + held.weight[row] * residual[row].powi(2), weights + held.weight[row])
        });
        if weights > 0.0 { (squares / weights).sqrt() } else { 0.0 }
    };
    let all = runs.len();
    runs.sort_by(|a, b| rmse(&held.before, *b).total_cmp(&rmse(&held.before, *a)));
    runs.truncate(if all > 1 { MOST_RUNS } else { 0 });
    let mut names = vec!["all unseen rows".to_owned()];
    names.extend(runs.iter().map(|run| format!("run {}", scene.about.data.runs[*run].name)));
    let places: Vec<f64> = (0..names.len()).map(|place| place as f64).collect();
    let bars = |total: f64, residual: &[f64]| {
        std::iter::once(total).chain(runs.iter().map(|run| rmse(residual, *run))).collect()
    };
    let before: Vec<f64> = bars(found.before.metrics.rmse, &held.before);
    let mut series = vec![Series::bars(scene.base(), before, places.clone())];
    if scene.is_extended() {
        // The interval of the gain, as one of the error that is left.
        let [low, high] = found.gain.ci95;
        let reach = found.before.metrics.rmse * (high - low) / 2.0;
        let mut error = vec![f64::NAN; places.len()];
        error[0] = reach;
        let after = bars(found.after.metrics.rmse, &held.after);
        series.push(Series::bars(AFTER, after, places.clone()).with_error(error));
    }
    let ends = vec![-0.5, places.len() as f64 - 0.5];
    series.push(Series::line("floor", vec![found.noise_floor; 2], ends).muted());
    let shown = match all.saturating_sub(MOST_RUNS) {
        0 => String::new(),
        more => format!(
            " Shown are the {MOST_RUNS} runs the base model does worst in; {more} more are not."
        ),
    };
    Chart {
        title: format!(
            "Error on rows left out of the fit, {}",
            if scene.is_extended() { "before and after" } else { "base model" }
        ),
        caption: format!(
            "Shorter is better; the grey line is the floor, what the best possible model would leave ({}).{}{shown}",
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

/// The unseen stretch that tells most: where the extension gains most, or else where the base model
/// is most wrong.
fn telling<'a>(scene: &'a Scene) -> Option<&'a Stretch<'a>> {
    let held = &scene.held;
    let squares = |residual: &[f64]| residual.iter().map(|r| r * r).sum::<f64>();
    let tells = |stretch: &&Stretch| {
        let rows = stretch.rows.clone();
        let before = squares(&held.before[rows.clone()]);
        if scene.is_extended() {
            before - squares(&held.after[rows])
        } else {
            before / rows.len().max(1) as f64
        }
    };
    held.stretches.iter().max_by(|a, b| tells(a).total_cmp(&tells(b)))
}

/// The rows of a stretch in which the extension gains most within a short time.
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

/// Logged and simulated torque in the most telling stretch: over time, close up, over velocity.
pub(super) fn predictions(scene: &Scene) -> Option<[Chart; 3]> {
    let stretch = telling(scene)?;
    let time: Vec<f64> = times(stretch).collect();
    let velocity: Vec<f64> = stretch.track.samples.iter().map(|s| s.velocity_rad_s).collect();
    let logged = &stretch.track.torque;
    let curve = |name: &str, rows: std::ops::Range<usize>, torque: &[f64]| {
        let (x, y) = thin_series(&time[rows.clone()], &torque[rows], CORNERS);
        Series::line(name, rounded(&x), rounded(&y))
    };
    let curves = |rows: std::ops::Range<usize>| {
        let mut series = vec![curve(LOGGED, rows.clone(), logged).muted()];
        series.push(curve(scene.base(), rows.clone(), stretch.before));
        if scene.is_extended() {
            series.push(curve(AFTER, rows, stretch.after));
        }
        series
    };
    let cloud = |name: &str, torque: &[f64]| {
        let (x, y) = thin_scatter(&velocity, torque, CLOUD);
        Series::points(name, rounded(&x), rounded(&y))
    };
    let mut clouds = vec![cloud(LOGGED, logged).muted(), cloud(scene.base(), stretch.before)];
    if scene.is_extended() {
        clouds.push(cloud(AFTER, stretch.after));
    }
    let window = close_up(scene, stretch);
    let name = &scene.about.data.runs[stretch.run].name;
    let seconds = || Axis::new("time since the run began (s)");
    let torque = || Axis::new(format!("{} ({})", scene.torque(), scene.unit()));
    let whole = match stretch.since_start_s {
        start if start > 0.0 => format!("Run {name} from {} s", significant(start, 3)),
        _ => format!("Run {name}"),
    };
    Some([
        Chart {
            title: format!("{whole}, left out of the fit"),
            caption: "Models are driven by the logged motion alone. Thinned curves keep the lowest and the highest value of \
                      every few rows."
                .into(),
            x: seconds(),
            y: torque(),
            series: curves(0..logged.len()),
        },
        Chart {
            title: "Close up".into(),
            caption: if scene.is_extended() {
                "The part of it in which the extension gains most.".into()
            } else {
                "The part of it in which the model is most wrong.".into()
            },
            x: seconds(),
            y: torque(),
            series: curves(window),
        },
        Chart {
            title: "The whole of it over velocity".into(),
            caption: "Clouds are thinned in proportion to their density, with every outlying place kept.".into(),
            x: Axis::new(format!("velocity ({})", scene.velocity_unit())),
            y: torque(),
            series: clouds,
        },
    ])
}

/// The range these means lie in, and zero.
fn with_zero(means: &[Mean]) -> Option<(f64, f64)> {
    let low = means.iter().fold(0.0f64, |low, mean| low.min(mean.x));
    let high = means.iter().fold(0.0f64, |high, mean| high.max(mean.x));
    let margin = 0.05 * (high - low);
    (high > low).then_some((low - margin, high + margin))
}

/// What the extension adds against what the base model misses, on unseen rows.
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
    let (x, y) = thin_scatter(&added, &held.before, CLOUD);
    let ends: Vec<f64> = [means.first(), means.last()].into_iter().flatten().map(|m| m.x).collect();
    let ends = rounded(&ends);
    let line = Series::line(BEFORE, column(&|m| m.x), column(&|m| m.y));
    Chart {
        title: "What the extension adds, against what the base model misses".into(),
        caption: "Rows left out of the fit. An extension that is right lies on the diagonal: where it adds \
                  something, just that was missing. A flat line would be an extension that only follows noise."
            .into(),
        x: Axis { range: with_zero(&means), ..Axis::new(format!("extended − base model ({})", scene.unit())) },
        y: Axis {
            range: fitting_range(&means, &[], true),
            ..Axis::new(format!("logged − base model ({})", scene.unit()))
        },
        series: vec![
            Series::points("single rows", rounded(&x), rounded(&y)).muted(),
            Series::line("as much as is missing", ends.clone(), ends).coloured_as(AFTER),
            line.with_error(column(&|m| 2.0 * m.error)),
        ],
    }
}

/// How far residuals remember.
pub(super) fn autocorrelation(scene: &Scene) -> Chart {
    let held = &scene.held;
    let memory = super::memory(&scene.about.found.before).max(scene.memory);
    let most = (held.len() / 8).min((8.0 * memory) as usize).clamp(20, 1500);
    let period = held.period_s();
    let lags: Vec<f64> = (0..=most).map(|lag| lag as f64 * period).collect();
    let curve = |name: &str, residual: &[f64]| {
        let (x, y) = thin_series(&lags, &held.autocorrelation(residual, most), 400);
        Series::line(name, rounded(&x), rounded(&y))
    };
    let mut series = vec![curve(scene.base(), &held.before)];
    if scene.is_extended() {
        series.push(curve(AFTER, &held.after));
    }
    Chart {
        title: "How long the residual remembers".into(),
        caption: "Correlation of the residual with itself a while later, rows left out of the fit. Noise falls from 1 to 0 within a row; \
                  what stays above 0 is structure that hangs together over time."
            .into(),
        x: Axis::new("later by (s)"),
        y: Axis::new("correlation"),
        series,
    }
}

/// Shares of the rows and of the squared error.
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
                format!("of the squared error, {}", scene.base()),
                percent(|s| s.of_error),
                places.clone(),
            )
            .with_error(percent(|s| 2.0 * s.uncertainty))
            .coloured_as(scene.base()),
            Series::bars("of the rows", percent(|s| s.of_rows), places).muted(),
        ],
    }
}

/// Candidates, with what each gains.
pub(super) fn ranking(shown: &[&Ranked]) -> Chart {
    let bars = |name: &str, own: &dyn Fn(&Ranked) -> bool| {
        let (mut x, mut y, mut error) = (Vec::new(), Vec::new(), Vec::new());
        for (place, ranked) in shown.iter().enumerate().filter(|(_, ranked)| own(ranked)) {
            x.push(100.0 * ranked.score.share);
            y.push(place as f64);
            error.push(200.0 * ranked.score.share_error);
        }
        Series::bars(name, x, y).with_error(error)
    };
    let series = [
        bars("in the answer", &|ranked| ranked.named).coloured_as(AFTER),
        bars("passed alone", &|ranked| !ranked.named && ranked.score.passed),
        bars("did not pass", &|ranked| !ranked.named && !ranked.score.passed).muted(),
    ];
    Chart {
        title: "Candidates beside the base model, each alone".into(),
        caption: "How much of the squared error on rows left out of the fit each would take, in its best setting, before any is \
                  chosen; bars are two standard errors over blocks of rows. What only goes along with a cause falls away once \
                  that cause is in, when all are heard again."
            .into(),
        x: Axis::new("gain on unseen rows (% of the squared error)"),
        y: Axis::of_names("", shown.iter().map(|ranked| ranked.name.clone())),
        series: series.into_iter().filter(|series| !series.x.is_empty()).collect(),
    }
}
