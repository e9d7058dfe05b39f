//! Runs as the core sees them: unbroken tracks of samples.
//!
//! A track is one segment of a run (no gap inside), converted to the core's units, with its own
//! sample period and the log's other covariates, one of which a model may follow
//! ([`Track::following`]). The bristle state starts anew on each track. Where the log's spacing is even
//! to `EVEN`, the period is one number and a model is built once; else each sample carries its own.

use super::channel::TorqueLowPass;
use super::warmth::{self, Earlier};
use crate::data::{Dataset, Quantity, Run, contract, segments};
use compensator_core::Sample;
use std::ops::Range;
use std::sync::Arc;

/// Spacing that varies by less than this share of the median counts as even. A logger's clock
/// rounds; a model need not be built anew for that.
const EVEN: f64 = 0.02;

/// One unbroken stretch of a run.
#[derive(Clone, Debug)]
pub struct Track {
    /// Index of the run in the data set.
    pub run: usize,
    /// Row of the run the track begins at.
    pub first_row: usize,
    /// The core's inputs, one per row.
    pub samples: Vec<Sample<f64>>,
    /// What is to be explained, Nm or N.
    pub torque: Vec<f64>,
    /// Median sample period, s.
    pub period_s: f64,
    /// Each sample's own period over the median one, where the spacing is uneven.
    pub period_ratio: Option<Vec<f64>>,
    /// What each row counts for in squared errors, 0 to 1: one of weight 0 is simulated and not judged. Empty
    /// where all count alike.
    pub weights: Vec<f64>,
    /// The log's extra covariates along the track, in the order of [`Dataset::covariates`].
    pub covariates: Arc<[Vec<f64>]>,
    /// Draws of the true velocity minus that of the samples, rad/s or m/s, a value per row
    /// ([`Run::velocity_draws`]); empty where the motion is taken as exact.
    pub velocity_draws: Vec<Vec<f64>>,
    /// Torque error that the uncertain motion makes in each row, Nm or N RMS; empty where it is taken as exact.
    pub motion_error: Vec<f64>,
    /// What the torque went through before it was logged ([`super::channel`]).
    pub torque_low_pass: TorqueLowPass,
    /// What rubbed before the track; see [`super::warmth`].
    pub earlier: Arc<[Earlier]>,
}

impl Track {
    /// A track of evenly spaced rows, all of which count.
    pub fn even(samples: Vec<Sample<f64>>, torque: Vec<f64>, period_s: f64) -> Self {
        Self {
            run: 0,
            first_row: 0,
            samples,
            torque,
            period_s,
            period_ratio: None,
            weights: Vec::new(),
            covariates: Arc::default(),
            velocity_draws: Vec::new(),
            motion_error: Vec::new(),
            torque_low_pass: TorqueLowPass::default(),
            earlier: Arc::default(),
        }
    }

    /// Some of its rows.
    #[must_use]
    pub fn part(&self, rows: Range<usize>) -> Self {
        Self {
            run: self.run,
            first_row: self.first_row + rows.start,
            samples: self.samples[rows.clone()].to_vec(),
            torque: self.torque[rows.clone()].to_vec(),
            period_s: self.period_s,
            period_ratio: self.period_ratio.as_ref().map(|ratios| ratios[rows.clone()].to_vec()),
            weights: self.weights.iter().take(rows.end).skip(rows.start).copied().collect(),
            covariates: self
                .covariates
                .iter()
                .map(|column| column[rows.clone()].to_vec())
                .collect(),
            velocity_draws: cut(&self.velocity_draws, &rows),
            motion_error: self
                .motion_error
                .iter()
                .take(rows.end)
                .skip(rows.start)
                .copied()
                .collect(),
            torque_low_pass: self.torque_low_pass,
            earlier: Arc::clone(&self.earlier),
        }
    }

    /// The same with one of its covariates as the auxiliary column, or without one.
    #[must_use]
    pub fn following(&self, covariate: Option<usize>) -> Self {
        let column = covariate.and_then(|index| self.covariates.get(index));
        let mut track = self.clone();
        for (row, sample) in track.samples.iter_mut().enumerate() {
            sample.auxiliary = column.map_or(0.0, |column| column[row]);
        }
        track
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.torque.len()
    }

    /// What a row counts for in squared errors.
    #[inline]
    pub fn weight(&self, row: usize) -> f64 {
        self.weights.get(row).copied().unwrap_or(1.0)
    }

    /// Whether a row counts in a fit and in its errors.
    #[inline]
    pub fn is_included(&self, row: usize) -> bool {
        self.weight(row) > 0.0
    }

    /// Scales what each row counts for.
    pub fn weigh(&mut self, by: impl Fn(usize) -> f64) {
        self.weights = (0..self.len()).map(|row| self.weight(row) * by(row)).collect();
    }

    /// Gives each row the velocity and acceleration of so much later, s, on straight lines between rows; rows with nothing
    /// so late do not count.
    pub fn take_velocity_later(&mut self, delay_s: f64) {
        let ratio = |row: usize| self.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
        let mut time = 0.0;
        let times: Vec<f64> = (0..self.len())
            .map(|row| {
                time += if row > 0 { self.period_s * ratio(row) } else { 0.0 };
                time
            })
            .collect();
        let last = self.len() - 1;
        let mut later = 0;
        let mut all_there = self.len();
        let as_logged = self.samples.clone();
        for (row, sample) in self.samples.iter_mut().enumerate() {
            let then = times[row] + delay_s;
            while later < last && times[later + 1] <= then {
                later += 1;
            }
            if later == last {
                all_there = all_there.min(row);
            }
            let next = (later + 1).min(last);
            let step = times[next] - times[later];
            let share = if step > 0.0 { (then - times[later]) / step } else { 0.0 };
            let (from, to) = (&as_logged[later], &as_logged[next]);
            let between = |a: f64, b: f64| a + (b - a) * share;
            sample.velocity_rad_s = between(from.velocity_rad_s, to.velocity_rad_s);
            sample.acceleration_rad_s2 = between(from.acceleration_rad_s2, to.acceleration_rad_s2);
        }
        self.weigh(|row| if row < all_there { 1.0 } else { 0.0 });
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.torque.is_empty()
    }
}

/// The rows a model is fitted on or judged by.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The tracks.
    pub tracks: &'a [Track],
    /// Keep one residual in this many, anti-aliased; 0 and 1 keep all.
    pub decimate: usize,
}

/// Cuts every run into tracks. Segments of a single row tell nothing of a motion and are left out.
pub fn tracks(data: &Dataset) -> Vec<Track> {
    tracks_with(data, None)
}

/// As [`tracks`], with one of [`Dataset::covariates`] as the auxiliary column of the samples. A
/// covariate the data set does not have is 0 throughout, as any column that is not there.
pub fn tracks_with(data: &Dataset, auxiliary: Option<&str>) -> Vec<Track> {
    tracks_since(data, auxiliary, campaign_start(data))
}

/// Where a campaign's clock begins, s.
pub fn campaign_start(data: &Dataset) -> f64 {
    let all_times = data.runs.iter().flat_map(|run| run.time_s.first());
    all_times.copied().fold(f64::INFINITY, f64::min)
}

/// As [`tracks_with`], for some runs of a campaign that began at `campaign_start` (s): runs to fit on
/// and runs to judge by share one clock.
pub fn tracks_since(data: &Dataset, auxiliary: Option<&str>, campaign_start: f64) -> Vec<Track> {
    let auxiliary =
        auxiliary.and_then(|name| data.covariates.iter().position(|covariate| covariate == name));
    let mut tracks = Vec::new();
    for (index, run) in data.runs.iter().enumerate() {
        let acceleration = run.acceleration_or_derived();
        for rows in segments(run) {
            if rows.len() > 1 {
                let track = track(run, index, rows, &acceleration, campaign_start);
                tracks.push(if auxiliary.is_some() { track.following(auxiliary) } else { track });
            }
        }
    }
    warmth::remember(tracks.iter_mut());
    tracks
}

fn track(
    run: &Run,
    index: usize,
    rows: Range<usize>,
    acceleration: &[f64],
    campaign_start: f64,
) -> Track {
    let columns: Vec<(Quantity, &[f64])> = contract::optional()
        .filter_map(|quantity| run.get(quantity).map(|column| (quantity, column)))
        .collect();
    let force = run.get(Quantity::RadialForce);
    let samples = rows
        .clone()
        .map(|row| {
            let mut sample = Sample::default();
            for (quantity, column) in &columns {
                let inside = column[row] * quantity.info().inside_scale;
                quantity.set_in_sample(&mut sample, inside);
            }
            let before = row.saturating_sub(1).max(rows.start);
            Sample {
                velocity_rad_s: run.velocity[row],
                acceleration_rad_s2: acceleration[row],
                radial_force_change_n: force.map_or(0.0, |force| force[row] - force[before]),
                campaign_time_h: (run.time_s[row] - campaign_start) / 3600.0,
                ..sample
            }
        })
        .collect();
    let mut steps: Vec<f64> =
        run.time_s[rows.clone()].windows(2).map(|pair| pair[1] - pair[0]).collect();
    let period_s = median(&steps).max(1e-9);
    let uneven = steps.iter().any(|step| (step / period_s - 1.0).abs() > EVEN);
    let period_ratio = uneven.then(|| {
        // A repeated time stamp is a coarse clock: the step is small, not nothing.
        steps.insert(0, period_s);
        steps.iter().map(|step| (step / period_s).max(0.01)).collect()
    });
    Track {
        run: index,
        first_row: rows.start,
        samples,
        torque: run.torque[rows.clone()].to_vec(),
        period_s,
        period_ratio,
        weights: Vec::new(),
        covariates: run.extra.iter().map(|column| column[rows.clone()].to_vec()).collect(),
        velocity_draws: cut(&run.velocity_draws, &rows),
        motion_error: Vec::new(),
        torque_low_pass: TorqueLowPass::default(),
        earlier: Arc::default(),
    }
}

/// How many runs some tracks are of.
pub fn runs(tracks: &[Track]) -> usize {
    tracks.iter().map(|track| track.run).collect::<std::collections::BTreeSet<_>>().len()
}

/// Some rows of each column.
fn cut(columns: &[Vec<f64>], rows: &Range<usize>) -> Vec<Vec<f64>> {
    columns.iter().map(|column| column[rows.clone()].to_vec()).collect()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{BadRows, JointKind};

    #[test]
    fn a_covariate_is_carried_as_the_auxiliary_column() {
        let run = Run {
            time_s: vec![0.0, 1.0, 2.0],
            velocity: vec![1.0; 3],
            torque: vec![2.0; 3],
            extra: vec![vec![0.0; 3], vec![7.0, 8.0, 9.0]],
            ..Run::default()
        };
        let data = Dataset {
            joint: JointKind::Revolute,
            runs: vec![run],
            files: vec![],
            rows: 3,
            rows_read: 3,
            bad_rows: BadRows::default(),
            covariates: vec!["kp".into(), "gap".into()],
            left_out_columns: vec![],
            notes: vec![],
            sources: vec![],
        };
        let carried = |name| -> Vec<f64> {
            tracks_with(&data, name)[0].samples.iter().map(|sample| sample.auxiliary).collect()
        };
        assert_eq!(carried(Some("gap")), [7.0, 8.0, 9.0]);
        assert_eq!(carried(Some("humidity")), [0.0; 3]);
        assert_eq!(carried(None), [0.0; 3]);
    }
}
