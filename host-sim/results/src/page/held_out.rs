//! The held-out rows for the charts, with the prediction of every model.
//!
//! Runs may be hours apart, so the charts use a time axis without long pauses. It starts at 0. Between two continuous
//! segments (tracks) it advances by the length of the pause, limited to a small share of the total time. Between tracks
//! there is a gap ([`HeldOut::judged`] has `None`), so no line is drawn over a pause.
//!
//! Torque is simulated at the full rate. Residuals are decimated like those of the metrics.

use super::FitReport;
use friction_diagnose::Gain;
use friction_fit::{Metrics, Outcome, Predicted, Track, autocorrelation_time, predict};
use rayon::prelude::*;
use std::ops::Range;

/// Maximum share of pauses on the time axis.
const MAX_PAUSE_SHARE: f64 = 0.15;

/// The held-out rows; columns of equal length, one track after another.
pub(crate) struct HeldOut {
    /// Time with shortened pauses, s.
    pub time: Vec<f64>,
    /// Velocity, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Logged torque or force.
    pub logged: Vec<f64>,
    /// The rows of each track.
    pub tracks: Vec<Range<usize>>,
    /// Rows of the residuals, and `None` between two tracks.
    pub judged: Vec<Option<usize>>,
    /// Name and start time of each held-out part of a run.
    pub starts: Vec<(String, f64)>,
    /// One entry for each fit, in the order of [`FitReport::fits`].
    pub simulated: Vec<Simulated>,
}

/// The prediction of a model on the held-out rows.
pub(crate) struct Simulated {
    /// Torque or force of each row.
    pub torque: Vec<f64>,
    /// Logged minus simulated, one for each entry of [`HeldOut::judged`]; NaN between tracks.
    pub residual: Vec<f64>,
}

impl HeldOut {
    /// Collects the rows and simulates every fit.
    pub fn new(study: &FitReport) -> Self {
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

    /// Returns a column at the rows of the residuals; NaN between tracks.
    pub fn at_judged(&self, column: &[f64]) -> Vec<f64> {
        self.judged.iter().map(|row| row.map_or(f64::NAN, |row| column[row])).collect()
    }

    /// Returns the autocorrelation time of a fit's residual, in rows.
    pub fn autocorrelation_time(&self, fit: usize) -> f64 {
        let tracks: Vec<&[f64]> =
            self.simulated[fit].residual.split(|residual| residual.is_nan()).collect();
        autocorrelation_time(tracks.iter().copied())
    }

    /// Returns the gain of one fit (by its index) over another, with its interval. The diagnosis uses the same measure.
    /// The gain is significant if the lower end of the interval is above 0.
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
        Gain::between(&predicted(worse), &predicted(better), 0)
    }

    /// Returns the rows of one motion cycle, the one of median length among all held-out cycles. Returns `None` if there
    /// is no cycle.
    pub fn cycle(&self) -> Option<Range<usize>> {
        /// Minimum speed of motion, as a share of the maximum speed.
        const MOVING_SPEED_SHARE: f64 = 0.05;
        /// Minimum number of rows of a cycle.
        const MIN_ROWS: usize = 20;
        let fastest = self.velocity.iter().fold(0.0f64, |fastest, v| fastest.max(v.abs()));
        let mut cycles = Vec::new();
        for track in &self.tracks {
            let (mut forwards, mut begin) = (None, None);
            for row in track.clone() {
                let velocity = self.velocity[row];
                if velocity.abs() <= MOVING_SPEED_SHARE * fastest
                    || forwards == Some(velocity > 0.0)
                {
                    continue;
                }
                if velocity > 0.0 && forwards == Some(false) {
                    cycles.extend(begin.replace(row).map(|begin| begin..row + 1));
                }
                forwards = Some(velocity > 0.0);
            }
        }
        cycles.retain(|cycle| cycle.len() >= MIN_ROWS);
        cycles.sort_by_key(ExactSizeIterator::len);
        (!cycles.is_empty()).then(|| cycles.swap_remove(cycles.len() / 2))
    }
}

fn simulated(fit: &Outcome, study: &FitReport) -> Simulated {
    let predicted = predict(&fit.parameters, study.test, fit.resolution);
    let mut residual: Vec<f64> = Vec::new();
    for track in &predicted.residuals {
        residual.extend(track);
        residual.push(f64::NAN);
    }
    residual.pop();
    Simulated { torque: predicted.torque.concat(), residual }
}

/// Returns the time of each row with shortened pauses, and the start of each part of a run.
fn clock(study: &FitReport) -> (Vec<f64>, Vec<(String, f64)>) {
    let tracks = study.test.tracks;
    let logged = |track: &Track| {
        let part = &study.input.split.test[track.run];
        let run = &study.input.data.runs[part.run];
        let first = part.rows.start + track.first_row;
        (run.name.clone(), &run.time_s[first..first + track.len()])
    };
    let moving: f64 = tracks.iter().map(|track| span(logged(track).1)).sum();
    let longest_pause = MAX_PAUSE_SHARE * moving / tracks.len().max(1) as f64;
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

/// Returns the duration of a track, s.
fn span(clock: &[f64]) -> f64 {
    clock[clock.len() - 1] - clock[0]
}
