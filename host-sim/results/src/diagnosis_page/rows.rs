//! Rows with the residuals of both models, as columns.
//!
//! A chart of a residual over a quantity needs both at the same rows. With decimation, residuals exist only at every N-th
//! row. Quantities that depend on the past (time at rest, travel since a reversal) must be computed at the full rate. A
//! column is therefore computed at the full rate and decimated afterwards ([`Rows::column`]).

use compensator_core::{Quantity, Sample};
use friction_diagnose::TrainTest;
use friction_fit::{Predicted, Track};
use joint_log::{Dataset, Part};
use std::ops::Range;

/// Speed below which a joint is at rest, as a share of its maximum speed.
pub(super) const REST_SPEED_SHARE: f64 = 1e-3;

/// A continuous segment of a run.
pub(super) struct Stretch<'a> {
    /// The samples, at the full rate.
    pub track: &'a Track,
    /// Torque of the base model.
    pub before: &'a [f64],
    /// Torque of the extended model.
    pub after: &'a [f64],
    /// Index of the run in the data set.
    pub run: usize,
    /// First row within the run.
    pub first_row: usize,
    /// Time from the start of the run to the first row, s.
    pub since_start_s: f64,
    /// Entries in the columns of [`Rows`].
    pub rows: Range<usize>,
}

/// Rows as columns, one segment after another.
pub(super) struct Rows<'a> {
    /// The segments.
    pub stretches: Vec<Stretch<'a>>,
    /// Residual of the base model.
    pub before: Vec<f64>,
    /// Residual of the extended model.
    pub after: Vec<f64>,
    /// True if the row is included in the errors.
    pub judged: Vec<bool>,
    /// Weight of the row in the errors.
    pub weight: Vec<f64>,
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Maximum speed.
    pub fastest: f64,
    /// Decimation: one residual in this many rows.
    pub decimate: usize,
}

impl<'a> Rows<'a> {
    /// Creates the columns for parts of a data set and the predictions of both models.
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

    /// Appends other rows.
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

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.before.len()
    }

    /// Returns a column that `of` computes for each segment at the full rate.
    pub fn column(&self, of: impl Fn(&Stretch) -> Vec<f64>) -> Vec<f64> {
        let mut column = Vec::with_capacity(self.len());
        for stretch in &self.stretches {
            let full = of(stretch);
            let thinned = full.into_iter().skip(self.decimate - 1).step_by(self.decimate);
            column.extend(thinned.take(stretch.rows.len()));
        }
        column
    }

    /// Returns a column that `of` computes from each sample.
    pub fn sampled(&self, of: impl Fn(&Sample<f64>) -> f64) -> Vec<f64> {
        self.column(|stretch| stretch.track.samples.iter().map(&of).collect())
    }

    /// Returns the time since the start of the run, s.
    pub fn time_in_run(&self) -> Vec<f64> {
        self.column(|stretch| times(stretch).collect())
    }

    /// Returns the direction of motion of each row; 0 at rest.
    pub fn direction(&self) -> Vec<f64> {
        let rest = REST_SPEED_SHARE * self.fastest;
        let sign = |v: &f64| if v.abs() > rest { v.signum() } else { 0.0 };
        self.velocity.iter().map(sign).collect()
    }

    /// Returns a column of the log by its name; `None` if the log does not have it.
    pub fn named(&self, log: &TrainTest, data: &Dataset, name: &str) -> Option<Vec<f64>> {
        let values = values(log, data, name)?;
        Some(self.column(|stretch| values(stretch)))
    }

    /// Returns the rate of a column of the log, per second.
    pub fn rate_of(&self, log: &TrainTest, data: &Dataset, name: &str) -> Option<Vec<f64>> {
        let values = values(log, data, name)?;
        Some(self.column(|stretch| rate(stretch.track, &values(stretch))))
    }

    /// Returns the autocorrelation of a residual for lags of 0 to `most` rows.
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

    /// Returns the nominal time between two rows, s.
    pub fn period_s(&self) -> f64 {
        let period = self.stretches.first().map_or(1e-3, |stretch| stretch.track.period_s);
        period * self.decimate as f64
    }
}

/// Reads a column of a segment at the full rate.
type ColumnReader<'a> = Box<dyn Fn(&Stretch) -> Vec<f64> + 'a>;

/// Returns the reader of a column of the log by its name.
fn values<'a>(log: &TrainTest, data: &'a Dataset, name: &str) -> Option<ColumnReader<'a>> {
    let known = Quantity::parse(name).map(|(quantity, _)| quantity);
    if let Some(quantity) = known.filter(|known| known.name(log.train.joint) == name) {
        let scale = quantity.info().outside_scale;
        let of = move |sample: &Sample<f64>| quantity.value_in(sample).unwrap_or_default() * scale;
        return Some(Box::new(move |stretch| stretch.track.samples.iter().map(of).collect()));
    }
    let index = data.covariates.iter().position(|covariate| covariate == name)?;
    Some(Box::new(move |stretch| {
        let rows = stretch.first_row..stretch.first_row + stretch.track.len();
        data.runs[stretch.run].extra[index][rows].to_vec()
    }))
}

/// Returns the time of each row since the start of the run, s.
pub(super) fn times<'a>(stretch: &'a Stretch) -> impl Iterator<Item = f64> + 'a {
    let mut now = stretch.since_start_s;
    (0..stretch.track.len()).map(move |row| {
        if row > 0 {
            now += step_s(stretch.track, row);
        }
        now
    })
}

/// Returns the time between the previous row and this row, s.
pub(super) fn step_s(track: &Track, row: usize) -> f64 {
    track.period_ratio_of(row) * track.period_s
}

/// Returns the time at rest before the last breakaway, s, until the joint has moved by `travel`; NaN elsewhere.
pub(super) fn rest_before(track: &Track, fastest: f64, travel: f64) -> Vec<f64> {
    let (mut rested, mut gone) = (f64::NAN, f64::INFINITY);
    let mut resting = false;
    (0..track.len())
        .map(|row| {
            let speed = track.samples[row].velocity_rad_s.abs();
            let step = step_s(track, row);
            if speed < REST_SPEED_SHARE * fastest {
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

/// Returns the travel since the last reversal, up to `most`; NaN elsewhere.
pub(super) fn since_reversal(track: &Track, fastest: f64, most: f64) -> Vec<f64> {
    let (mut direction, mut gone) = (0.0, f64::INFINITY);
    (0..track.len())
        .map(|row| {
            let velocity = track.samples[row].velocity_rad_s;
            if velocity.abs() >= REST_SPEED_SHARE * fastest {
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

/// Returns the rate of a column from central differences, per second.
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
