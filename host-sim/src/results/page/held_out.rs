//! The held-out rows laid out for drawing, with every model simulated along them.
//!
//! Runs may lie hours apart, and a chart over such a clock is a few spikes in an empty plane. So the
//! time here is that of the held-out rows alone: it starts at 0, and between two unbroken stretches
//! (tracks) it advances by the pause there was, or by a small share of the whole where that is
//! shorter. Between tracks stands a hole ([`HeldOut::judged`] has `None`), so no line is drawn over
//! a pause.
//!
//! Torque is simulated at the full rate. A residual is what the metrics are made of: where they are
//! decimated, so is it here.

use super::Study;
use friction_identification::diagnose::{Gain, judge};
use friction_identification::fit::predict::{Predicted, predict};
use friction_identification::fit::statistics::autocorrelation_time;
use friction_identification::fit::{Metrics, Outcome, Track};
use rayon::prelude::*;
use std::ops::Range;

/// Of the time axis, at most this share is pauses.
const PAUSES: f64 = 0.15;

/// The held-out rows of a study; columns of equal length, one track after another.
pub(in crate::results) struct HeldOut {
    /// Time with long pauses cut short, s.
    pub time: Vec<f64>,
    /// Velocity, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// The torque or force as logged.
    pub logged: Vec<f64>,
    /// The rows of each track.
    pub tracks: Vec<Range<usize>>,
    /// Rows the models are judged by, and `None` between two tracks.
    pub judged: Vec<Option<usize>>,
    /// Where each held-out part of a run begins: its name and its time.
    pub starts: Vec<(String, f64)>,
    /// One per fit, in the order of [`Study::fits`].
    pub simulated: Vec<Simulated>,
}

/// A model along the held-out rows.
pub(in crate::results) struct Simulated {
    /// Torque or force, one per row.
    pub torque: Vec<f64>,
    /// Measured minus simulated, one per entry of [`HeldOut::judged`]; NaN between tracks.
    pub residual: Vec<f64>,
}

impl HeldOut {
    /// Lays the rows out and simulates every fit along them.
    pub fn new(study: &Study) -> Self {
        let tracks = study.test.tracks;
        let factor = study.test.decimate.max(1);
        let (time, starts) = clock(study);
        let mut ranges = Vec::with_capacity(tracks.len());
        let mut judged = Vec::new();
        let mut begin = 0;
        for track in tracks {
            let rows = begin..begin + track.len();
            judged.extend(rows.clone().skip(factor - 1).step_by(factor).map(Some));
            judged.push(None);
            begin = rows.end;
            ranges.push(rows);
        }
        judged.pop();
        let samples = tracks.iter().flat_map(|track| &track.samples);
        Self {
            time,
            velocity: samples.map(|sample| sample.velocity_rad_s).collect(),
            logged: tracks.iter().flat_map(|track| &track.torque).copied().collect(),
            tracks: ranges,
            judged,
            starts,
            simulated: study.fits.par_iter().map(|fit| simulated(fit, study)).collect(),
        }
    }

    /// A column at the rows the models are judged by; NaN between tracks.
    pub fn at_judged(&self, column: &[f64]) -> Vec<f64> {
        self.judged.iter().map(|row| row.map_or(f64::NAN, |row| column[row])).collect()
    }

    /// How many neighbouring rows of a fit's residual are one observation.
    pub fn autocorrelation_time(&self, fit: usize) -> f64 {
        let tracks: Vec<&[f64]> =
            self.simulated[fit].residual.split(|residual| residual.is_nan()).collect();
        autocorrelation_time(tracks.iter().copied())
    }

    /// What one fit (by its index) gains over another, with its interval: the yardstick by which the diagnosis
    /// offers an extension. The lead is clear where the interval's lower end is above 0.
    pub fn gain(&self, better: usize, worse: usize) -> Gain {
        let predicted = |fit: usize| Predicted {
            torque: Vec::new(),
            residuals: self.simulated[fit]
                .residual
                .split(|residual| residual.is_nan())
                .map(<[f64]>::to_vec)
                .collect(),
            metrics: Metrics::default(),
            saturation: 0.0,
            presliding: 0.0,
        };
        judge::gain(&predicted(worse), &predicted(better), 0)
    }

    /// One motion there and back, as rows: of all the held-out ones that of median length. `None`
    /// where nothing moves to and fro.
    pub fn cycle(&self) -> Option<Range<usize>> {
        /// Faster than this share of the largest speed counts as moving.
        const MOVING: f64 = 0.05;
        /// Shorter ones show nothing.
        const FEWEST_ROWS: usize = 20;
        let fastest = self.velocity.iter().fold(0.0f64, |fastest, v| fastest.max(v.abs()));
        let mut cycles = Vec::new();
        for track in &self.tracks {
            let (mut forwards, mut begin) = (None, None);
            for row in track.clone() {
                let velocity = self.velocity[row];
                if velocity.abs() <= MOVING * fastest || forwards == Some(velocity > 0.0) {
                    continue;
                }
                if velocity > 0.0 && forwards == Some(false) {
                    cycles.extend(begin.replace(row).map(|begin| begin..row + 1));
                }
                forwards = Some(velocity > 0.0);
            }
        }
        cycles.retain(|cycle| cycle.len() >= FEWEST_ROWS);
        cycles.sort_by_key(ExactSizeIterator::len);
        (!cycles.is_empty()).then(|| cycles.swap_remove(cycles.len() / 2))
    }
}

fn simulated(fit: &Outcome, study: &Study) -> Simulated {
    let predicted = predict(&fit.parameters, study.test, fit.resolution);
    let mut residual: Vec<f64> = Vec::new();
    for track in &predicted.residuals {
        residual.extend(track);
        residual.push(f64::NAN);
    }
    residual.pop();
    Simulated { torque: predicted.torque.concat(), residual }
}

/// The time of each row, pauses cut short, and where each part of a run begins.
fn clock(study: &Study) -> (Vec<f64>, Vec<(String, f64)>) {
    let tracks = study.test.tracks;
    let logged = |track: &Track| {
        let part = &study.split.test[track.run];
        let run = &study.data.runs[part.run];
        let first = part.rows.start + track.first_row;
        (run.name.clone(), &run.time_s[first..first + track.len()])
    };
    let moving: f64 = tracks.iter().map(|track| span(logged(track).1)).sum();
    let longest_pause = PAUSES * moving / tracks.len().max(1) as f64;
    let (mut time, mut starts) = (Vec::new(), Vec::new());
    let (mut now, mut last): (f64, Option<(usize, f64)>) = (0.0, None);
    for track in tracks {
        let (name, clock) = logged(track);
        now += match last {
            None => 0.0,
            Some((part, ended)) if part == track.run => (clock[0] - ended).min(longest_pause),
            Some(_) => longest_pause,
        };
        if last.is_none_or(|(part, _)| part != track.run) {
            starts.push((name, now));
        }
        time.extend(clock.iter().map(|at| now + (at - clock[0])));
        now += span(clock);
        last = Some((track.run, clock[clock.len() - 1]));
    }
    (time, starts)
}

/// How long a track lasts, s.
fn span(clock: &[f64]) -> f64 {
    clock[clock.len() - 1] - clock[0]
}
