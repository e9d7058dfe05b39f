//! The residual over time, in the band that no model can leave.
//!
//! Two things no law explains: the noise of the torque's reading, the same everywhere, and what the uncertainty
//! of the motion does to the law, row by row ([`Track::motion_error`]): most at reversals and rests of stiff joints. Their sum
//! is drawn as a band of two standard deviations. About one row in twenty lies outside where the model is
//! right; a mean of many rows that leaves zero is structure, band or not.
//!
//! [`Track::motion_error`]: friction_identification::fit::Track::motion_error

use super::Scene;
use super::figures::{AFTER, CORNERS};
use crate::report::{Axis, Chart, Series, rounded, thin_series};
use crate::results::page::words::quantity;

/// Stretches all unseen time is cut into.
const STRETCHES: usize = 300;

/// What the torque's noise and the uncertain motion make of the floor, RMS over the rows as they are weighed.
pub(super) struct Floor {
    /// The torque's noise.
    pub noise: f64,
    /// What the uncertain motion does.
    pub motion: f64,
}

impl Floor {
    /// Of a diagnosis: its floor is both together.
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

/// Both residuals over the unseen time, pauses cut: means of short stretches over the single rows.
pub(super) fn over_time(scene: &Scene) -> Chart {
    let held_out = &scene.view.held_out;
    let time = held_out.at_judged(&held_out.time);
    let length = (time.len() / STRETCHES).max(1);
    // Rows that do not count are holes, as the pauses between runs are.
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
            // Over a pause no line is drawn.
            if rows.contains(&None) {
                return f64::NAN;
            }
            let finite = part.iter().filter(|value| value.is_finite());
            finite.clone().sum::<f64>() / finite.count() as f64
        };
        values.chunks(length).zip(held_out.judged.chunks(length)).map(mean).collect()
    };
    let at = rounded(&means(&time));
    let floor = Floor::of(scene);
    let variance = scene.held.column(|stretch| {
        let motion = &stretch.track.motion_error;
        let of_row = |row: usize| motion.get(row).copied().unwrap_or_default().powi(2);
        (0..stretch.track.len()).map(|row| floor.noise.powi(2) + of_row(row)).collect()
    });
    let edge: Vec<f64> =
        means(&with_holes(&variance)).iter().map(|variance| 2.0 * variance.sqrt()).collect();
    let below: Vec<f64> = edge.iter().map(|edge| -edge).collect();
    let last = if scene.is_extended() { &scene.held.after } else { &scene.held.before };
    let (x, y) = thin_series(&time, &with_holes(last), CORNERS);
    let mut series = vec![
        Series::line("single rows", rounded(&x), rounded(&y)).muted(),
        Series::band("floor, two standard deviations", at.clone(), rounded(&below), rounded(&edge)),
        Series::line(scene.base(), at.clone(), rounded(&means(&with_holes(&scene.held.before)))),
    ];
    if scene.is_extended() {
        let after = means(&with_holes(&scene.held.after));
        series.push(Series::line(AFTER, at, rounded(&after)));
    }
    let motion = match floor.motion > 0.0 {
        true => format!(
            " and what the uncertain motion does to the law ({} RMS, most at reversals and rests)",
            quantity(floor.motion, scene.unit())
        ),
        false => String::new(),
    };
    Chart {
        title: "Over the time of all rows left out of the fit".into(),
        caption: format!(
            "Means of {length} rows each, over the single rows of the {} model; runs stand one after another. The band is two \
             standard deviations of what no model can explain: the noise of the reading ({}){motion}. What leaves it, or has a \
             shape, is something the model lacks.",
            if scene.is_extended() { "extended" } else { "base" },
            quantity(floor.noise, scene.unit())
        ),
        x: Axis::new("time, pauses cut (s)"),
        y: Axis::new(format!("logged − simulated ({})", scene.unit())),
        series,
    }
}
