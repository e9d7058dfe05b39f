//! Tracks: unbroken stretches of a run, in the core's units.
//!
//! A track is one segment of a run without a gap. It holds the core's input samples, the measured torque, its
//! sample period and the log's other covariates, one of which a model may use ([`Track::following`]). Each
//! track has its own initial bristle state. [`super::dataset_tracks`] builds the tracks of a data set.

use super::metrics::WeighedRow;
use super::torque_low_pass::TorqueLowPass;
use compensator_core::Sample;
use std::ops::Range;
use std::sync::Arc;

/// Unbroken stretch of a run.
#[derive(Clone, Debug)]
pub struct Track {
    /// Index of the run in the data set.
    pub run: usize,
    /// Index of the track's first row in the run.
    pub first_row: usize,
    /// The core's inputs, one per row.
    pub samples: Vec<Sample<f64>>,
    /// Measured torque or force, Nm or N.
    pub torque: Vec<f64>,
    /// Median sample period, s.
    pub period_s: f64,
    /// Ratio of each sample's period to the median; `None` if the spacing is even.
    pub period_ratio: Option<Vec<f64>>,
    /// Weight of each row in squared errors, 0 to 1. A row of weight 0 is simulated but not evaluated. Empty if all
    /// weights are 1.
    pub weights: Vec<f64>,
    /// True in rows whose torque was a spike and is replaced ([`joint_log::Run::torque_spikes`]). Their weight is 0.
    /// Empty if there is none.
    pub torque_spikes: Vec<bool>,
    /// True if the samples' velocity is exact. It is then interpolated smoothly between rows; a velocity that was
    /// reconstructed is a polygon.
    pub velocity_is_exact: bool,
    /// The log's extra covariates along the track, in the order of [`joint_log::Dataset::covariates`].
    pub covariates: Arc<[Vec<f64>]>,
    /// Random draws of the true velocity minus the samples' velocity, rad/s or m/s, one value per row
    /// ([`joint_log::Run::velocity_draws`]). Empty if the motion is taken as exact.
    pub velocity_draws: Vec<Vec<f64>>,
    /// Torque error caused by the uncertain motion in each row, Nm or N RMS. Empty if the motion is taken as exact.
    pub motion_error: Vec<f64>,
    /// Filter that the torque passed before it was logged (`channel`).
    pub torque_low_pass: TorqueLowPass,
    /// Stretches of motion before the track, which warmed the joint (`initial_heat`).
    pub earlier_stretches: Arc<[EarlierStretch]>,
}

impl Track {
    /// Creates a track of evenly spaced rows of weight 1.
    pub fn even(samples: Vec<Sample<f64>>, torque: Vec<f64>, period_s: f64) -> Self {
        Self {
            run: 0,
            first_row: 0,
            samples,
            torque,
            period_s,
            period_ratio: None,
            weights: Vec::new(),
            torque_spikes: Vec::new(),
            velocity_is_exact: false,
            covariates: Arc::default(),
            velocity_draws: Vec::new(),
            motion_error: Vec::new(),
            torque_low_pass: TorqueLowPass::default(),
            earlier_stretches: Arc::default(),
        }
    }

    /// Returns the track of a range of rows.
    #[must_use]
    pub fn part(&self, rows: Range<usize>) -> Self {
        Self {
            run: self.run,
            first_row: self.first_row + rows.start,
            samples: self.samples[rows.clone()].to_vec(),
            torque: self.torque[rows.clone()].to_vec(),
            period_s: self.period_s,
            period_ratio: self.period_ratio.as_ref().map(|ratios| ratios[rows.clone()].to_vec()),
            weights: part_of(&self.weights, &rows),
            torque_spikes: part_of(&self.torque_spikes, &rows),
            velocity_is_exact: self.velocity_is_exact,
            covariates: row_range(&self.covariates, &rows).into(),
            velocity_draws: row_range(&self.velocity_draws, &rows),
            motion_error: part_of(&self.motion_error, &rows),
            torque_low_pass: self.torque_low_pass,
            earlier_stretches: Arc::clone(&self.earlier_stretches),
        }
    }

    /// Returns the track with this covariate as the samples' auxiliary column, or with 0 for `None`.
    #[must_use]
    pub fn following(&self, covariate: Option<usize>) -> Self {
        let column = covariate.and_then(|index| self.covariates.get(index));
        let mut track = self.clone();
        for (row, sample) in track.samples.iter_mut().enumerate() {
            sample.auxiliary = column.map_or(0.0, |column| column[row]);
        }
        track
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.torque.len()
    }

    /// Returns the weight of a row in squared errors, 0 to 1.
    #[inline]
    pub fn weight(&self, row: usize) -> f64 {
        let is_spike = self.torque_spikes.get(row).copied().unwrap_or_default();
        if is_spike { 0.0 } else { self.weight_without_spike(row) }
    }

    /// Returns a row with a simulated torque, to be compared.
    pub fn compared(&self, row: usize, simulated: f64) -> WeighedRow {
        WeighedRow { measured: self.torque[row], simulated, weight: self.weight(row) }
    }

    /// Returns the weight that a row would have if its torque were measured.
    fn weight_without_spike(&self, row: usize) -> f64 {
        self.weights.get(row).copied().unwrap_or(1.0)
    }

    /// Returns true if all rows have weight 1.
    pub fn is_evenly_weighted(&self) -> bool {
        self.weights.is_empty() && self.torque_spikes.is_empty()
    }

    /// Returns true if a row counts in a fit and in its errors.
    #[inline]
    pub fn is_included(&self, row: usize) -> bool {
        self.weight(row) > 0.0
    }

    /// Multiplies the weight of each row.
    pub fn scale_weights(&mut self, by: impl Fn(usize) -> f64) {
        self.weights =
            (0..self.len()).map(|row| self.weight_without_spike(row) * by(row)).collect();
    }

    /// Moves velocity and acceleration in time, interpolating linearly between rows: a row takes the values of `by_s`, s, later,
    /// or earlier if it is negative. Rows for which the track has no such values get weight 0.
    pub fn shift_velocity(&mut self, by_s: f64) {
        let Some(last) = self.len().checked_sub(1) else { return };
        let times = self.times_s();
        let logged = self.samples.clone();
        let mut before = 0;
        for (sample, time) in self.samples.iter_mut().zip(&times) {
            let then = time + by_s;
            while before + 1 < last && times[before + 1] <= then {
                before += 1;
            }
            let after = (before + 1).min(last);
            let step = times[after] - times[before];
            let share =
                if step > 0.0 { ((then - times[before]) / step).clamp(0.0, 1.0) } else { 0.0 };
            let (from, to) = (&logged[before], &logged[after]);
            let between = |a: f64, b: f64| a + (b - a) * share;
            sample.velocity_rad_s = between(from.velocity_rad_s, to.velocity_rad_s);
            sample.acceleration_rad_s2 = between(from.acceleration_rad_s2, to.acceleration_rad_s2);
        }
        let logged_s = times[0]..=times[last];
        self.scale_weights(|row| f64::from(u8::from(logged_s.contains(&(times[row] + by_s)))));
    }

    /// Returns the ratio of a row's period to the median.
    pub fn period_ratio_of(&self, row: usize) -> f64 {
        self.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row])
    }

    /// Returns the time of each row since the first one, s.
    pub(super) fn times_s(&self) -> Vec<f64> {
        let mut time = 0.0;
        let step = |row: usize| {
            time += if row > 0 { self.period_s * self.period_ratio_of(row) } else { 0.0 };
            time
        };
        (0..self.len()).map(step).collect()
    }

    /// Returns true if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.torque.is_empty()
    }
}

/// Stretch of motion before a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarlierStretch {
    /// Energy dissipated in it, J.
    pub energy_j: f64,
    /// Its duration, s.
    pub length_s: f64,
    /// Time from its end to the start of the track, s.
    pub since_s: f64,
}

/// Rows that a model is fitted to or evaluated on.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The tracks.
    pub tracks: &'a [Track],
    /// Decimation factor of the anti-aliased residual; 0 and 1 keep all rows.
    pub decimate: usize,
}

/// Returns the number of runs that the tracks belong to.
pub fn run_count(tracks: &[Track]) -> usize {
    tracks.iter().map(|track| track.run).collect::<std::collections::BTreeSet<_>>().len()
}

/// Returns a range of rows of a column, which may be empty.
fn part_of<T: Copy>(column: &[T], rows: &Range<usize>) -> Vec<T> {
    column.get(rows.clone()).unwrap_or_default().to_vec()
}

/// Returns a range of rows of each column.
pub(super) fn row_range(columns: &[Vec<f64>], rows: &Range<usize>) -> Vec<Vec<f64>> {
    columns.iter().map(|column| column[rows.clone()].to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A velocity of 10 rad/s per s, in rows of 0.1 s.
    fn ramp() -> Track {
        let samples =
            (0..5).map(|row| Sample { velocity_rad_s: row as f64, ..Sample::default() }).collect();
        Track::even(samples, vec![0.0; 5], 0.1)
    }

    fn shifted(by_s: f64) -> (Vec<f64>, Vec<f64>) {
        let mut track = ramp();
        track.shift_velocity(by_s);
        let velocity = track.samples.iter().map(|sample| sample.velocity_rad_s).collect();
        (velocity, (0..5).map(|row| track.weight(row)).collect())
    }

    #[test]
    fn shift_velocity_gives_rows_without_values_weight_0() {
        let (later, weights) = shifted(0.15);
        assert!((later[0] - 1.5).abs() < 1e-9 && (later[2] - 3.5).abs() < 1e-9, "{later:?}");
        assert_eq!(weights, [1.0, 1.0, 1.0, 0.0, 0.0]);
        let (earlier, weights) = shifted(-0.15);
        assert_eq!(earlier[..2], [0.0, 0.0], "no value is extrapolated");
        assert!((earlier[2] - 0.5).abs() < 1e-9 && (earlier[4] - 2.5).abs() < 1e-9, "{earlier:?}");
        assert_eq!(weights, [0.0, 0.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn shift_velocity_without_rows_does_nothing() {
        Track::even(Vec::new(), Vec::new(), 0.1).shift_velocity(0.1);
    }
}
