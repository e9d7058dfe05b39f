//! The residual over time, with a band for the noise floor.
//!
//! The noise floor has two parts: the noise of the torque sensor, which is constant, and the effect of the uncertain
//! motion on the law, which differs from row to row ([`Track::motion_error`]) and is largest at reversals and rests of
//! stiff joints. The band is two standard deviations of their sum. With a right model, about one row in twenty is outside
//! the band. A mean of many rows that differs from zero is a model error, even inside the band.
//!
//! [`Track::motion_error`]: friction_fit::Track::motion_error

use super::Scene;
use super::figures::{AFTER, CURVE_POINTS};
use crate::page::words::quantity;
use crate::report::{Axis, Chart, Series, rounded};

/// Number of segments of the held-out time; each has one mean.
const SEGMENTS: usize = 300;

/// The two parts of the noise floor, weighted RMS over the held-out rows.
pub(super) struct NoiseFloor {
    /// Noise of the torque sensor.
    pub noise: f64,
    /// Effect of the uncertain motion.
    pub motion: f64,
}

impl NoiseFloor {
    /// Splits the noise floor of a diagnosis into its parts.
    pub fn of(scene: &Scene) -> Self {
        let (mut squares, mut weights) = (0.0, 0.0);
        for track in &scene.about.found.log.test_tracks {
            for row in 0..track.len() {
                let error = track.motion_error.get(row).copied().unwrap_or_default();
                squares += track.weight(row) * error * error;
                weights += track.weight(row);
            }
        }
        let motion = if weights > 0.0 { squares / weights } else { 0.0 };
        let floor = scene.about.found.noise_floor.powi(2);
        Self { noise: (floor - motion).max(0.0).sqrt(), motion: motion.sqrt() }
    }
}

/// Returns the chart of both residuals over the held-out time without pauses: means of short segments over single rows.
pub(super) fn over_time(scene: &Scene) -> Chart {
    let held_out = &scene.view.held_out;
    let time = held_out.at_judged(&held_out.time);
    let length = (time.len() / SEGMENTS).max(1);
    // Excluded rows are gaps in the curve, like the pauses between runs.
    let with_holes = |values: &[f64]| -> Vec<f64> {
        let mut rows = values.iter().zip(&scene.held.judged);
        let value = |(value, judged): (&f64, &bool)| if *judged { *value } else { f64::NAN };
        held_out
            .judged
            .iter()
            .map(|row| row.and_then(|_| rows.next()).map_or(f64::NAN, value))
            .collect()
    };
    let means = |values: &[f64]| -> Vec<f64> {
        let mean = |(part, rows): (&[f64], &[Option<usize>])| {
            // No line is drawn over a pause.
            if rows.contains(&None) {
                return f64::NAN;
            }
            let finite = part.iter().filter(|value| value.is_finite());
            finite.clone().sum::<f64>() / finite.count() as f64
        };
        values.chunks(length).zip(held_out.judged.chunks(length)).map(mean).collect()
    };
    let at = rounded(&means(&time));
    let floor = NoiseFloor::of(scene);
    let variance = scene.held.column(|stretch| {
        let motion = &stretch.track.motion_error;
        let of_row = |row: usize| motion.get(row).copied().unwrap_or_default().powi(2);
        (0..stretch.track.len()).map(|row| floor.noise.powi(2) + of_row(row)).collect()
    });
    let edge: Vec<f64> =
        means(&with_holes(&variance)).iter().map(|variance| 2.0 * variance.sqrt()).collect();
    let below: Vec<f64> = edge.iter().map(|edge| -edge).collect();
    let last = if scene.is_extended() { &scene.held.after } else { &scene.held.before };
    let mut series = vec![
        Series::thin_line("single rows", &time, &with_holes(last), CURVE_POINTS).muted(),
        Series::band(
            "noise floor, ±2 standard deviations",
            at.clone(),
            rounded(&below),
            rounded(&edge),
        ),
        Series::line(scene.base(), at.clone(), rounded(&means(&with_holes(&scene.held.before)))),
    ];
    if scene.is_extended() {
        let after = means(&with_holes(&scene.held.after));
        series.push(Series::line(AFTER, at, rounded(&after)));
    }
    Chart {
        title: "Residual over the time of all held-out rows".into(),
        caption: caption(scene, &floor, length),
        x: Axis::new("time without pauses (s)"),
        y: Axis::new(format!("logged − simulated ({})", scene.unit())),
        series,
    }
}

/// Returns the caption of the chart, whose means are over `length` rows.
fn caption(scene: &Scene, floor: &NoiseFloor, length: usize) -> String {
    let motion = match floor.motion > 0.0 {
        true => format!(
            " and the effect of the uncertain motion ({} RMS, largest at reversals and rests)",
            quantity(floor.motion, scene.unit())
        ),
        false => String::new(),
    };
    format!(
        "Means of {length} rows each, over the single rows of the {} model; the runs follow one another. The band is two \
         standard deviations of the noise floor: sensor noise ({}){motion}. Means outside the band, or with a visible \
         pattern, show an effect that the model does not contain.",
        if scene.is_extended() { "extended" } else { "base" },
        quantity(floor.noise, scene.unit())
    )
}
