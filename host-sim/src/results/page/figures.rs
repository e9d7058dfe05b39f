//! The charts of the page.
//!
//! Charts that are to be compared have the same axes: every model against the same cloud of logged
//! rows, every residual on the same scale. A cloud of several models in one chart hides all but
//! the last, so each model has its own; only one motion there and back is drawn with all of them,
//! as lines, where a hysteresis loop is told from a jump.

use super::View;
use super::words::quantity;
use crate::report::{Axis, Chart, Series, rounded, thin_scatter, thin_series};
use friction_identification::number::significant;

/// Points of a cloud, of logged rows and of a model each.
const CLOUD: usize = 1500;

/// Corners of a residual's curve.
const CORNERS: usize = 2500;

/// The name of the data in every legend.
const LOGGED: &str = "as logged";

/// RMSE of every model, held-out rows beside those fitted to.
pub(super) fn errors(view: &View) -> Chart {
    let names = view.ranking.iter().map(|&fit| view.name(fit));
    let places = || (0..view.ranking.len()).map(|place| place as f64).collect();
    let of = |rmse: fn(&friction_identification::fit::Outcome) -> f64| {
        view.ranking.iter().map(|&fit| rmse(view.fit(fit))).collect()
    };
    Chart {
        title: "Error on held-out rows and on the rows fitted to".into(),
        caption: "Shorter is better, and only the held-out bar counts. A held-out bar far longer \
                  than the grey one beside it means that the fit does not carry over."
            .into(),
        x: Axis::new(format!("RMSE ({})", view.unit())),
        y: Axis::of_names("", names),
        series: vec![
            Series::bars("held out", of(|fit| fit.test.rmse), places()),
            Series::bars("fitted to", of(|fit| fit.train.rmse), places()).muted(),
        ],
    }
}

/// Each model's cloud over the logged one.
pub(super) fn over_velocity(view: &View, fits: &[usize]) -> Vec<Chart> {
    let rows = &view.held_out;
    let range = torque_range(view);
    let cloud = |torque: &[f64]| {
        let (x, y) = thin_scatter(&rows.velocity, torque, CLOUD);
        (rounded(&x), rounded(&y))
    };
    let logged = cloud(&rows.logged);
    let chart = |&fit: &usize| {
        let name = view.name(fit);
        let (x, y) = cloud(&rows.simulated[fit].torque);
        let error = quantity(view.fit(fit).test.rmse, view.unit());
        Chart {
            title: name.clone(),
            caption: format!(
                "Grey: as logged. Colour: simulated along the same motion, {error} RMS away."
            ),
            x: velocity_axis(view),
            y: Axis { range, ..torque_axis(view) },
            series: vec![
                Series::points(LOGGED, logged.0.clone(), logged.1.clone()).muted(),
                Series::points(name, x, y),
            ],
        }
    };
    fits.iter().map(chart).collect()
}

/// One motion there and back, over time and over velocity; none where there is no such motion.
pub(super) fn cycle(view: &View, fits: &[usize]) -> Vec<Chart> {
    let rows = &view.held_out;
    let Some(cycle) = rows.cycle() else { return Vec::new() };
    let begin = rows.time[cycle.start];
    let seconds: Vec<f64> = rows.time[cycle.clone()].iter().map(|time| time - begin).collect();
    let curves = |x: &[f64]| {
        let line = |name: String, torque: &[f64]| {
            let (x, y) = thin_series(x, &torque[cycle.clone()], CLOUD);
            Series::line(name, rounded(&x), rounded(&y))
        };
        let logged = line(LOGGED.into(), &rows.logged).muted();
        let model = |&fit: &usize| line(view.name(fit), &rows.simulated[fit].torque);
        // The best is drawn last, on top.
        std::iter::once(logged).chain(fits.iter().rev().map(model)).collect()
    };
    vec![
        Chart {
            title: "One motion there and back, over time".into(),
            caption: "Of all held-out motions from one reversal to the next but one, the one of \
                      median length."
                .into(),
            x: Axis::new("time since the reversal (s)"),
            y: torque_axis(view),
            series: curves(&seconds),
        },
        Chart {
            title: "The same over velocity".into(),
            caption: format!(
                "Where the {0} at a velocity differs on the way up and on the way down, the curve \
                 is a loop. A model without bristles can only draw a line with a jump, unless the \
                 loop comes from other inputs.",
                view.torque()
            ),
            x: velocity_axis(view),
            y: torque_axis(view),
            series: curves(&rows.velocity[cycle.clone()]),
        },
    ]
}

/// Each model's residual over the time of the held-out rows.
pub(super) fn residuals(view: &View, fits: &[usize]) -> Vec<Chart> {
    let rows = &view.held_out;
    let time = rows.at_judged(&rows.time);
    let range = residual_range(view);
    let chart = |&fit: &usize| {
        let (x, y) = thin_series(&time, &rows.simulated[fit].residual, CORNERS);
        let name = view.name(fit);
        Chart {
            title: name.clone(),
            caption: format!(
                "{} RMS, autocorrelation time {} rows.",
                quantity(view.fit(fit).test.rmse, view.unit()),
                neighbours(rows.autocorrelation_time(fit))
            ),
            x: Axis::new("held-out time, pauses cut (s)"),
            y: Axis { range, ..residual_axis(view) },
            series: vec![Series::line(name, rounded(&x), rounded(&y))],
        }
    };
    fits.iter().map(chart).collect()
}

/// The best model's residual over velocity, with its mean.
pub(super) fn residual_over_velocity(view: &View) -> Chart {
    let rows = &view.held_out;
    let fit = view.best();
    let (velocity, residual) = (rows.at_judged(&rows.velocity), &rows.simulated[fit].residual);
    let (x, y) = thin_scatter(&velocity, residual, 2 * CLOUD);
    let (at, mean) = means(&velocity, residual);
    let name = view.name(fit);
    Chart {
        title: format!("{name}: residual over velocity, held-out rows"),
        caption: "A mean that leaves zero at a velocity is a curve of the wrong shape there, or a \
                  condition that was met at that velocity only. A wide cloud around a mean at zero \
                  is noise, or something that does not follow velocity."
            .into(),
        x: velocity_axis(view),
        y: residual_axis(view),
        series: vec![
            Series::points("each row", rounded(&x), rounded(&y)).muted(),
            Series::line("mean at this velocity", rounded(&at), rounded(&mean)).coloured_as(name),
        ],
    }
}

/// How many rows an autocorrelation time is, for a sentence.
pub(super) fn neighbours(time: f64) -> String {
    if time < 9.5 { significant(time, 2) } else { significant(time.round(), 2) }
}

fn velocity_axis(view: &View) -> Axis {
    Axis::new(format!("velocity ({})", view.study.data.joint.velocity_unit()))
}

fn torque_axis(view: &View) -> Axis {
    Axis::new(format!("{} ({})", view.torque(), view.unit()))
}

fn residual_axis(view: &View) -> Axis {
    Axis::new(format!("logged − simulated ({})", view.unit()))
}

/// What was logged, and the models as far as they go beyond it by less than half.
fn torque_range(view: &View) -> Option<(f64, f64)> {
    let (low, high) = extent(&view.held_out.logged)?;
    let beyond = (high - low) / 2.0;
    let models = view.held_out.simulated.iter().filter_map(|model| extent(&model.torque));
    let (lowest, highest) =
        models.fold((low, high), |(low, high), model| (low.min(model.0), high.max(model.1)));
    let (low, high) = (lowest.max(low - beyond), highest.min(high + beyond));
    let margin = 0.04 * (high - low);
    (high > low).then_some((low - margin, high + margin))
}

/// Symmetrical, and wide enough for the shown models, and for the others within twice that.
fn residual_range(view: &View) -> Option<(f64, f64)> {
    let largest = |fits: Vec<usize>| {
        let sizes = fits.into_iter().flat_map(|fit| &view.held_out.simulated[fit].residual);
        sizes.filter(|size| size.is_finite()).fold(0.0f64, |largest, size| largest.max(size.abs()))
    };
    let (shown, rest) = view.shown_and_rest();
    let shown = largest(shown);
    let size = 1.04 * shown.max(largest(rest).min(2.0 * shown));
    (size > 0.0).then_some((-size, size))
}

fn extent(values: &[f64]) -> Option<(f64, f64)> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    Some((finite().reduce(f64::min)?, finite().reduce(f64::max)?))
}

/// Means of `y` in equal steps of `x`; steps with few rows are left out.
fn means(x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    const STEPS: usize = 60;
    const FEWEST_ROWS: usize = 10;
    let Some((low, high)) = extent(x) else { return Default::default() };
    let width = (high - low).max(f64::MIN_POSITIVE) / STEPS as f64;
    let mut sums = [(0usize, 0.0, 0.0); STEPS];
    for (x, y) in x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let (count, x_sum, y_sum) = &mut sums[(((x - low) / width) as usize).min(STEPS - 1)];
        *count += 1;
        *x_sum += x;
        *y_sum += y;
    }
    let filled = sums.iter().filter(|(count, ..)| *count >= FEWEST_ROWS);
    filled.map(|&(count, x, y)| (x / count as f64, y / count as f64)).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_rows_near_each_other() {
        let x: Vec<f64> = (0..600).map(|i| f64::from(i % 60)).collect();
        let y: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
        let (at, mean) = means(&x, &y);
        assert!(
            at.len() > 50 && at.iter().zip(&mean).all(|(at, mean)| (2.0 * at - mean).abs() < 1e-9)
        );
    }
}
