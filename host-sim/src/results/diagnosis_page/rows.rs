//! The judged rows with both models' residuals, laid out as columns.
//!
//! A chart of a residual over *something* needs that something at the very rows the residual is given
//! at. Residuals are given at one row in a few where the user asked for decimation, while what a joint
//! did before a row (how long it rested, how far it went since it turned round) must be followed at
//! every row. So a column is made at the full rate, stretch by stretch, and thinned afterwards as the
//! residual was ([`Rows::column`]).

use compensator_core::{Quantity, Sample};
use friction_identification::data::{Dataset, Part};
use friction_identification::diagnose::TrainTest;
use friction_identification::fit::Track;
use friction_identification::fit::predict::Predicted;
use std::ops::Range;

/// Below this share of the fastest speed a joint rests.
pub(super) const AT_REST: f64 = 1e-3;

/// An unbroken stretch of a run.
pub(super) struct Stretch<'a> {
    /// The samples, at the full rate.
    pub track: &'a Track,
    /// What the base model makes of them.
    pub before: &'a [f64],
    /// What the extended one makes of them.
    pub after: &'a [f64],
    /// Where the run it is of lies in the data set.
    pub run: usize,
    /// The row of that run it begins at.
    pub first_row: usize,
    /// Seconds from the begin of that run to there.
    pub since_start_s: f64,
    /// Its entries in the columns of [`Rows`].
    pub rows: Range<usize>,
}

/// Rows as columns, one stretch after another.
pub(super) struct Rows<'a> {
    /// The stretches.
    pub stretches: Vec<Stretch<'a>>,
    /// Residual of the base model.
    pub before: Vec<f64>,
    /// Residual of the extended model.
    pub after: Vec<f64>,
    /// Whether a row counts in the errors.
    pub judged: Vec<bool>,
    /// What it counts for.
    pub weight: Vec<f64>,
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Fastest speed.
    pub fastest: f64,
    /// One residual in this many rows.
    pub decimate: usize,
}

impl<'a> Rows<'a> {
    /// Lays out some parts of a data set, with what both models make of them.
    pub fn new(
        data: &Dataset,
        parts: &[Part],
        tracks: &'a [Track],
        [before, after]: [&'a Predicted; 2],
        decimate: usize,
    ) -> Self {
        let mut rows = Self {
            stretches: Vec::with_capacity(tracks.len()),
            before: before.residuals.concat(),
            after: after.residuals.concat(),
            judged: Vec::new(),
            weight: Vec::new(),
            velocity: Vec::new(),
            fastest: 0.0,
            decimate: decimate.max(1),
        };
        let mut begin = 0;
        for (index, track) in tracks.iter().enumerate() {
            let part = &parts[track.run];
            let clock = &data.runs[part.run].time_s;
            let first_row = part.rows.start + track.first_row;
            let end = begin + before.residuals[index].len();
            rows.stretches.push(Stretch {
                track,
                before: &before.torque[index],
                after: &after.torque[index],
                run: part.run,
                first_row,
                since_start_s: clock[first_row] - clock[0],
                rows: begin..end,
            });
            begin = end;
        }
        let weight = |stretch: &Stretch| {
            (0..stretch.track.len()).map(|row| stretch.track.weight(row)).collect()
        };
        rows.weight = rows.column(weight);
        rows.judged = rows.weight.iter().map(|weight| *weight > 0.0).collect();
        rows.velocity = rows.sampled(|sample| sample.velocity_rad_s);
        rows.fastest = rows.velocity.iter().fold(0.0, |fastest, v| v.abs().max(fastest));
        rows
    }

    /// Two sets of rows as one, one behind the other.
    pub fn joined(mut self, mut other: Self) -> Self {
        let offset = self.before.len();
        for stretch in &mut other.stretches {
            stretch.rows = stretch.rows.start + offset..stretch.rows.end + offset;
        }
        self.stretches.append(&mut other.stretches);
        self.before.append(&mut other.before);
        self.after.append(&mut other.after);
        self.judged.append(&mut other.judged);
        self.weight.append(&mut other.weight);
        self.velocity.append(&mut other.velocity);
        self.fastest = self.fastest.max(other.fastest);
        self
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.before.len()
    }

    /// A column from what `of` makes of each stretch at the full rate.
    pub fn column(&self, of: impl Fn(&Stretch) -> Vec<f64>) -> Vec<f64> {
        let mut column = Vec::with_capacity(self.len());
        for stretch in &self.stretches {
            let full = of(stretch);
            let thinned = full.into_iter().skip(self.decimate - 1).step_by(self.decimate);
            column.extend(thinned.take(stretch.rows.len()));
        }
        column
    }

    /// A column of the samples.
    pub fn sampled(&self, of: impl Fn(&Sample<f64>) -> f64) -> Vec<f64> {
        self.column(|stretch| stretch.track.samples.iter().map(&of).collect())
    }

    /// Seconds since the run began.
    pub fn time_in_run(&self) -> Vec<f64> {
        self.column(|stretch| times(stretch).collect())
    }

    /// The direction each row moves in, 0 at rest.
    pub fn direction(&self) -> Vec<f64> {
        let rest = AT_REST * self.fastest;
        let sign = |v: &f64| if v.abs() > rest { v.signum() } else { 0.0 };
        self.velocity.iter().map(sign).collect()
    }

    /// A column of the log by its name, where all rows have it.
    pub fn named(&self, log: &TrainTest, data: &Dataset, name: &str) -> Option<Vec<f64>> {
        let values = values(log, data, name)?;
        Some(self.column(|stretch| values(stretch)))
    }

    /// The rate of a column of the log, per second.
    pub fn rate_of(&self, log: &TrainTest, data: &Dataset, name: &str) -> Option<Vec<f64>> {
        let values = values(log, data, name)?;
        Some(self.column(|stretch| rate(stretch.track, &values(stretch))))
    }

    /// Autocorrelation of a residual over lags in rows, up to `most`.
    pub fn autocorrelation(&self, residual: &[f64], most: usize) -> Vec<f64> {
        let tracks = || self.stretches.iter().map(|stretch| &residual[stretch.rows.clone()]);
        let squares: f64 = residual.iter().map(|r| r * r).sum::<f64>().max(f64::MIN_POSITIVE);
        let product = |lag: usize| -> f64 {
            tracks()
                .map(|r| r.iter().zip(r.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>())
                .sum()
        };
        (0..=most).map(|lag| product(lag) / squares).collect()
    }

    /// Usual time from one row to the next, s.
    pub fn period_s(&self) -> f64 {
        let period = self.stretches.first().map_or(1e-3, |stretch| stretch.track.period_s);
        period * self.decimate as f64
    }
}

/// Reads a column along a stretch at the full rate.
type Read<'a> = Box<dyn Fn(&Stretch) -> Vec<f64> + 'a>;

/// How a column of the log is read, by its name.
fn values<'a>(log: &TrainTest, data: &'a Dataset, name: &str) -> Option<Read<'a>> {
    let known = Quantity::parse(name).map(|(quantity, _)| quantity);
    if let Some(quantity) = known.filter(|known| known.name(log.train.joint) == name) {
        let scale = quantity.info().outside_scale;
        let of = move |sample: &Sample<f64>| quantity.of_sample(sample).unwrap_or_default() * scale;
        return Some(Box::new(move |stretch| stretch.track.samples.iter().map(of).collect()));
    }
    let index = data.covariates.iter().position(|covariate| covariate == name)?;
    Some(Box::new(move |stretch| {
        let rows = stretch.first_row..stretch.first_row + stretch.track.len();
        data.runs[stretch.run].extra[index][rows].to_vec()
    }))
}

/// Seconds since the run began, row by row.
pub(super) fn times<'a>(stretch: &'a Stretch) -> impl Iterator<Item = f64> + 'a {
    let mut now = stretch.since_start_s;
    (0..stretch.track.len()).map(move |row| {
        if row > 0 {
            now += step_s(stretch.track, row);
        }
        now
    })
}

/// Time from the row before to this one, s.
pub(super) fn step_s(track: &Track, row: usize) -> f64 {
    track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]) * track.period_s
}

/// How long a joint rested before it last broke away, s, as long as it has not gone further than
/// `travel` since; NaN elsewhere.
pub(super) fn rest_before(track: &Track, fastest: f64, travel: f64) -> Vec<f64> {
    let (mut rested, mut gone) = (f64::NAN, f64::INFINITY);
    let mut resting = false;
    (0..track.len())
        .map(|row| {
            let speed = track.samples[row].velocity_rad_s.abs();
            let step = step_s(track, row);
            if speed < AT_REST * fastest {
                rested = if resting { rested + step } else { step };
                (resting, gone) = (true, 0.0);
                return f64::NAN;
            }
            resting = false;
            gone += speed * step;
            if gone <= travel { rested } else { f64::NAN }
        })
        .collect()
}

/// How far a joint has gone since it last turned round, up to `most`; NaN elsewhere.
pub(super) fn since_reversal(track: &Track, fastest: f64, most: f64) -> Vec<f64> {
    let (mut direction, mut gone) = (0.0, f64::INFINITY);
    (0..track.len())
        .map(|row| {
            let velocity = track.samples[row].velocity_rad_s;
            if velocity.abs() >= AT_REST * fastest {
                if direction * velocity < 0.0 {
                    gone = 0.0;
                }
                direction = velocity.signum();
            }
            gone += velocity.abs() * step_s(track, row);
            if gone <= most { gone } else { f64::NAN }
        })
        .collect()
}

/// Rate of a column from its neighbours, per second.
pub(super) fn rate(track: &Track, values: &[f64]) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|row| {
            let (from, to) = (row.saturating_sub(1), (row + 1).min(last));
            let time: f64 = (from + 1..=to).map(|row| step_s(track, row)).sum();
            if time > 0.0 { (values[to] - values[from]) / time } else { 0.0 }
        })
        .collect()
}
