//! The motion as it was, from all columns that speak of it.
//!
//! A bristle integrates the velocity it is given, so an error there does harm far beyond its size: with a
//! noise of 2 mrad/s also at rest, plain LuGre with its true parameters misses by 0.37 Nm where the torque's
//! noise is 0.020 (simulated, 250 to 1000 Hz); driven by the motion found here, by 0.028 without a position
//! column and by 0.020 with one. What is found is the mean of a fixed-interval smoother ([`filter`]) over
//! position and velocity, with levels of noise found from the log ([`levels`]), rest as rest ([`rest`]), and
//! a velocity that lags its position ([`agreement`]) left out. What stays open is handed on as draws
//! ([`Run::velocity_draws`](crate::data::Run)): a fit can ask what the open part of the motion does to its law.
//!
//! Each unbroken stretch of a run is smoothed for itself; the levels are the log's. An exact velocity is handed back
//! as it is, to the bit. Position is replaced with velocity; a measured acceleration stays as it is. Where a velocity is
//! clean and merely late, as a drive's own is, the position is moved to its clock: a ripple of the angle must not run
//! ahead of the torque.

pub mod agreement;
pub mod columns;
pub mod filter;
pub mod levels;
pub mod quantum;
pub mod rest;

pub use columns::{DRAWS, Sensors};

use crate::data::{Dataset, Quantity, Run, segments};
use columns::{Stretch, Study};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::ops::Range;

/// Where the draws begin: the same log, the same draws.
const SEED: u64 = 0x6d6f_7469_6f6e;

/// The unbroken stretches of all runs: index of the run, rows.
fn stretches(data: &Dataset) -> Vec<(usize, Range<usize>)> {
    let runs = data.runs.iter().enumerate();
    runs.flat_map(|(index, run)| segments(run).into_iter().map(move |rows| (index, rows))).collect()
}

fn stretch<'a>(run: &'a Run, rows: &Range<usize>) -> Stretch<'a> {
    Stretch {
        time_s: &run.time_s[rows.clone()],
        position: run.get(Quantity::Position).map(|q| &q[rows.clone()]),
        velocity: &run.velocity[rows.clone()],
    }
}

/// What the log says of its motion sensors.
pub fn sensors(data: &Dataset) -> Sensors {
    let places = stretches(data);
    let all: Vec<Stretch> =
        places.iter().map(|(run, rows)| stretch(&data.runs[*run], rows)).collect();
    Study::new(&all).sensors
}

/// The log with the motion as it was instead of the motion as it was logged, and what was found about the
/// sensors. Without a position column it is the velocity alone that is smoothed, which is worse: what is
/// lost in its noise stays lost, and the draws are wider.
pub fn reconstruct(data: &Dataset) -> (Dataset, Sensors) {
    let places = stretches(data);
    let all: Vec<Stretch> =
        places.iter().map(|(run, rows)| stretch(&data.runs[*run], rows)).collect();
    let study = Study::new(&all);
    let mut found = data.clone();
    if let Some(late_s) = study.sensors.velocity_late_s() {
        for (index, rows) in &places {
            put_by_the_velocitys_clock(&mut found.runs[*index], rows.clone(), late_s);
        }
    }
    for run in &mut found.runs {
        run.velocity_is_smooth = !study.sensors.is_as_logged() || study.sensors.exact;
    }
    if study.sensors.is_as_logged() {
        return (found, study.sensors);
    }
    let motion = |(index, stretch): (usize, &Stretch)| {
        let mut random = Pcg64::seed_from_u64(SEED + index as u64);
        study.motion(index, stretch, &mut || StandardNormal.sample(&mut random))
    };
    let motions: Vec<_> = all.par_iter().enumerate().map(motion).collect();
    for run in &mut found.runs {
        run.velocity_draws = vec![vec![0.0; run.len()]; DRAWS];
    }
    for ((run, rows), motion) in places.iter().zip(motions) {
        let run = &mut found.runs[*run];
        // A stretch whose smoothing ends in no number keeps its motion as logged.
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

/// Reads the position of a stretch where it stood `late_s` before each stamp, by straight lines between rows.
fn put_by_the_velocitys_clock(run: &mut Run, rows: Range<usize>, late_s: f64) {
    let Some(logged) = run.get(Quantity::Position).map(<[f64]>::to_vec) else { return };
    let (time, position) = (&run.time_s[rows.clone()], &logged[rows.clone()]);
    let last = time.len() - 1;
    let mut moved = logged.clone();
    for (at, moved) in moved[rows].iter_mut().enumerate().filter(|_| last > 0) {
        let then = time[at] - late_s;
        // Beyond the ends the outermost line goes on.
        let from = time.partition_point(|t| *t <= then).saturating_sub(1).min(last - 1);
        let step = time[from + 1] - time[from];
        if step > 0.0 {
            *moved =
                position[from] + (position[from + 1] - position[from]) * (then - time[from]) / step;
        }
    }
    run.set(Quantity::Position, moved);
}
