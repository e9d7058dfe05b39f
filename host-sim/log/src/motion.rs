//! Reconstruction of the motion from the logged position and velocity.
//!
//! A bristle model integrates the velocity, so velocity noise causes errors far beyond its size, above all at rest. The
//! reconstructed motion is the mean of a fixed-interval smoother (`filter`) over position and velocity. Its noise
//! levels are estimated from the log (`levels`), rows at rest are detected (`rest`), and a velocity that lags its
//! position (`agreement`) is not used. The remaining uncertainty is represented by random draws
//! ([`Run::velocity_draws`](crate::Run)), with which a fit can estimate its effect on the law.
//!
//! Each segment of a run is smoothed separately; the noise levels are those of the whole log. An exact velocity is
//! returned bit for bit. The position is reconstructed with the velocity; a measured acceleration is not changed. If the
//! velocity is clean and only delayed, as a drive's own velocity is, the position is shifted to its clock, so that a
//! torque ripple over the angle stays aligned with the torque.

mod agreement;
mod choice;
mod columns;
mod filter;
mod levels;
mod low_pass;
mod quantum;
mod rest;

pub use agreement::Agreement;
pub(crate) use choice::logged_is_better;
pub use columns::{DRAWS, Sensors};
pub(crate) use quantum::quantum;

use crate::{Dataset, Part, Quantity, Run, segments};
use columns::{MotionAnalysis, MotionSegment};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::ops::Range;

/// Seed of the draws. It is constant, so that a log always gives the same draws.
const SEED: u64 = 0x6d6f_7469_6f6e;

/// Returns the segments of all runs.
fn parts(data: &Dataset) -> Vec<Part> {
    let runs = data.runs.iter().enumerate();
    runs.flat_map(|(run, of)| segments(of).into_iter().map(move |rows| Part { run, rows }))
        .collect()
}

fn segment<'a>(data: &'a Dataset, part: &Part) -> MotionSegment<'a> {
    let (run, rows) = (&data.runs[part.run], part.rows.clone());
    MotionSegment {
        time_s: &run.time_s[rows.clone()],
        position: run.get(Quantity::Position).map(|q| &q[rows.clone()]),
        velocity: &run.velocity[rows],
    }
}

/// Replaces the logged motion by the reconstructed one, and returns it with the properties of the sensors. Without a
/// position column only the velocity is smoothed. That is less accurate, and the draws are wider.
pub fn reconstruct(data: &Dataset) -> (Dataset, Sensors) {
    let parts = parts(data);
    let all: Vec<MotionSegment> = parts.iter().map(|part| segment(data, part)).collect();
    let study = MotionAnalysis::new(&all);
    let mut found = data.clone();
    if let Some(late_s) = study.sensors.velocity_late_s() {
        for part in &parts {
            align_position_time(&mut found.runs[part.run], part.rows.clone(), late_s);
        }
    }
    for run in &mut found.runs {
        run.velocity_is_smooth = !study.sensors.is_as_logged() || study.sensors.exact;
    }
    if study.sensors.is_as_logged() {
        return (found, study.sensors);
    }
    let motion = |(index, stretch): (usize, &MotionSegment)| {
        let mut random = Pcg64::seed_from_u64(SEED + index as u64);
        study.motion(index, stretch, &mut || StandardNormal.sample(&mut random))
    };
    let motions: Vec<_> = all.par_iter().enumerate().map(motion).collect();
    for run in &mut found.runs {
        run.velocity_draws = vec![vec![0.0; run.len()]; DRAWS];
    }
    for (Part { run, rows }, motion) in parts.into_iter().zip(motions) {
        let run = &mut found.runs[run];
        // If the result of a segment is not finite, its motion stays as logged.
        if !motion.is_finite() {
            run.velocity_is_smooth = false;
            continue;
        }
        run.velocity[rows.clone()].copy_from_slice(&motion.velocity);
        for (kept, draw) in run.velocity_draws.iter_mut().zip(&motion.draws) {
            kept[rows.clone()].copy_from_slice(draw);
        }
        if let Some(position) = motion.position {
            let mut all = run.get(Quantity::Position).unwrap_or_default().to_vec();
            all[rows.clone()].copy_from_slice(&position);
            run.set(Quantity::Position, all);
        }
    }
    (found, study.sensors)
}

/// Shifts the position of a segment by `late_s`, with linear interpolation between rows.
fn align_position_time(run: &mut Run, rows: Range<usize>, late_s: f64) {
    let Some(logged) = run.get(Quantity::Position).map(<[f64]>::to_vec) else { return };
    let (time, position) = (&run.time_s[rows.clone()], &logged[rows.clone()]);
    let last = time.len() - 1;
    let mut moved = logged.clone();
    for (at, moved) in moved[rows].iter_mut().enumerate().filter(|_| last > 0) {
        let then = time[at] - late_s;
        // Beyond the ends, the first or last line is extrapolated.
        let from = time.partition_point(|t| *t <= then).saturating_sub(1).min(last - 1);
        let step = time[from + 1] - time[from];
        if step > 0.0 {
            *moved =
                position[from] + (position[from + 1] - position[from]) * (then - time[from]) / step;
        }
    }
    run.set(Quantity::Position, moved);
}
