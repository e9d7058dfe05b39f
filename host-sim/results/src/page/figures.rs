//! The charts of the page.
//!
//! Charts for comparison have the same axes. Points of several models in one chart would cover each other, so each model
//! has its own chart. Only one motion cycle is drawn with all models, as lines; it distinguishes a hysteresis loop from a
//! jump.

use super::View;
use super::words::quantity;
use crate::report::{Axis, Chart, Series, rounded};
use joint_log::number::significant;

/// Maximum number of points of a cloud.
const CLOUD_POINTS: usize = 1500;

/// Maximum number of points of a residual's curve.
const CURVE_POINTS: usize = 2500;

/// Legend of the data.
const LOGGED: &str = "logged";

/// Returns the chart of the RMSE of every model on held-out and training rows.
pub(super) fn errors(view: &View) -> Chart {
    let names = view.ranking.iter().map(|&fit| view.name(fit));
    let places = || (0..view.ranking.len()).map(|place| place as f64).collect();
    let of = |rmse: fn(&friction_fit::Outcome) -> f64| {
        view.ranking.iter().map(|&fit| rmse(view.fit(fit))).collect()
    };
    Chart {
        title: "Error on held-out rows and on training rows".into(),
        caption: "Shorter bars are better; compare the models by their held-out bars. If the held-out bar is much longer than \
                  the grey one, the model does not generalise."
            .into(),
        x: Axis::new(format!("RMSE ({})", view.unit())),
        y: Axis::of_names("", names),
        series: vec![
            Series::bars("held out", of(|fit| fit.test.rmse), places()),
            Series::bars("training", of(|fit| fit.train.rmse), places()).muted(),
        ],
    }
}

/// Returns the torque of each model over velocity, with the logged torque.
pub(super) fn over_velocity(view: &View, fits: &[usize]) -> Vec<Chart> {
    let rows = &view.held_out;
    let range = torque_range(view);
    let cloud = |name: &str, torque: &[f64]| {
        Series::thin_points(name, &rows.velocity, torque, CLOUD_POINTS)
    };
    let logged = cloud(LOGGED, &rows.logged).muted();
    let chart = |&fit: &usize| {
        let name = view.name(fit);
        let error = quantity(view.fit(fit).test.rmse, view.unit());
        Chart {
            title: name.clone(),
            caption: format!(
                "Grey: logged. Colour: simulated along the same motion. RMSE {error}."
            ),
            x: velocity_axis(view),
            y: Axis { range, ..torque_axis(view) },
            series: vec![logged.clone(), cloud(&name, &rows.simulated[fit].torque)],
        }
    };
    fits.iter().map(chart).collect()
}

/// Returns the charts of one motion cycle over time and over velocity; empty if there is no cycle.
pub(super) fn cycle(view: &View, fits: &[usize]) -> Vec<Chart> {
    let rows = &view.held_out;
    let Some(cycle) = rows.cycle() else { return Vec::new() };
    let begin = rows.time[cycle.start];
    let seconds: Vec<f64> = rows.time[cycle.clone()].iter().map(|time| time - begin).collect();
    let curves = |x: &[f64]| {
        let line = |name: String, torque: &[f64]| {
            Series::thin_line(name, x, &torque[cycle.clone()], CLOUD_POINTS)
        };
        let logged = line(LOGGED.into(), &rows.logged).muted();
        let model = |&fit: &usize| line(view.name(fit), &rows.simulated[fit].torque);
        // The best model is drawn last, on top.
        std::iter::once(logged).chain(fits.iter().rev().map(model)).collect()
    };
    vec![
        Chart {
            title: "One motion cycle over time".into(),
            caption: "The held-out motion cycle (two strokes, from reversal to reversal) of median length.".into(),
            x: Axis::new("time since the reversal (s)"),
            y: torque_axis(view),
            series: curves(&seconds),
        },
        Chart {
            title: "The same motion cycle over velocity".into(),
            caption: format!(
                "If the {0} differs between rising and falling velocity, the curve is a loop. A model without bristles gives \
                 a line with a jump, unless other inputs cause the loop.",
                view.torque()
            ),
            x: velocity_axis(view),
            y: torque_axis(view),
            series: curves(&rows.velocity[cycle.clone()]),
        },
    ]
}

/// Returns the residual of each model over the held-out time.
pub(super) fn residuals(view: &View, fits: &[usize]) -> Vec<Chart> {
    let rows = &view.held_out;
    let time = rows.at_judged(&rows.time);
    let range = residual_range(view);
    let chart = |&fit: &usize| {
        let name = view.name(fit);
        Chart {
            title: name.clone(),
            caption: format!(
                "RMSE {}, autocorrelation time {} rows.",
                quantity(view.fit(fit).test.rmse, view.unit()),
                neighbours(rows.autocorrelation_time(fit))
            ),
            x: Axis::new("held-out time without pauses (s)"),
            y: Axis { range, ..residual_axis(view) },
            series: vec![Series::thin_line(
                name,
                &time,
                &rows.simulated[fit].residual,
                CURVE_POINTS,
            )],
        }
    };
    fits.iter().map(chart).collect()
}

/// Returns the residual of the best model over velocity, with its mean.
pub(super) fn residual_over_velocity(view: &View) -> Chart {
    let rows = &view.held_out;
    let fit = view.best();
    let (velocity, residual) = (rows.at_judged(&rows.velocity), &rows.simulated[fit].residual);
    let (at, mean) = means(&velocity, residual);
    let name = view.name(fit);
    Chart {
        title: format!("{name}: residual over velocity, held-out rows"),
        caption: "If the mean differs from zero at some velocity, the friction curve is wrong there, or a condition occurred \
                  only at that velocity. Scatter around a zero mean is noise, or an effect that does not depend on velocity."
            .into(),
        x: velocity_axis(view),
        y: residual_axis(view),
        series: vec![
            Series::thin_points("single rows", &velocity, residual, 2 * CLOUD_POINTS).muted(),
            Series::line("mean at this velocity", rounded(&at), rounded(&mean)).coloured_as(name),
        ],
    }
}

/// Formats an autocorrelation time in rows.
pub(super) fn neighbours(time: f64) -> String {
    if time < 9.5 { significant(time, 2) } else { significant(time.round(), 2) }
}

fn velocity_axis(view: &View) -> Axis {
    Axis::new(format!("velocity ({})", view.study.input.data.joint.velocity_unit()))
}

fn torque_axis(view: &View) -> Axis {
    Axis::new(format!("{} ({})", view.torque(), view.unit()))
}

fn residual_axis(view: &View) -> Axis {
    Axis::new(format!("logged − simulated ({})", view.unit()))
}

/// Returns the range of the logged torque, extended to the models by at most half of it on either side.
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

/// Returns a symmetrical range for the residuals of the visible models, extended to the others by at most a factor of 2.
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

/// Returns the means of `y` in equal steps of `x`; steps with few rows are left out.
fn means(x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    const STEPS: usize = 60;
    const MIN_ROWS: usize = 10;
    let Some((low, high)) = extent(x) else { return Default::default() };
    let width = (high - low).max(f64::MIN_POSITIVE) / STEPS as f64;
    let mut sums = [(0usize, 0.0, 0.0); STEPS];
    for (x, y) in x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let (count, x_sum, y_sum) = &mut sums[(((x - low) / width) as usize).min(STEPS - 1)];
        *count += 1;
        *x_sum += x;
        *y_sum += y;
    }
    let filled = sums.iter().filter(|(count, ..)| *count >= MIN_ROWS);
    filled.map(|&(count, x, y)| (x / count as f64, y / count as f64)).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_a_line_lie_on_the_line() {
        let x: Vec<f64> = (0..600).map(|i| f64::from(i % 60)).collect();
        let y: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
        let (at, mean) = means(&x, &y);
        assert!(
            at.len() > 50 && at.iter().zip(&mean).all(|(at, mean)| (2.0 * at - mean).abs() < 1e-9)
        );
    }
}
