//! The log of a diagnosis: training runs, held-out runs, and the covariates that may be a cause.
//!
//! A column that is another reading of the torque explains a residual without being its cause
//! ([`TorqueLikeness`]). Such columns are excluded, and a note lists them.

use super::column_likeness::{TorqueLikeness, is_same_column};
use super::evaluation::noise_floor;
use compensator_core::TermKind;
use compensator_core::term::LookupFormula;
use friction_fit::linear::has_campaign_clock;
use friction_fit::{
    ChannelGain, Metrics, Rows, Scales, TorqueLowPass, Track, campaign_start,
    record_earlier_stretches, tracks_since,
};
use joint_log::{Dataset, Quantity, Split, contract};
use std::borrow::Cow;
use std::sync::Arc;

/// Speed below which a joint is at rest, as a share of the 95th percentile of the speed.
const REST: f64 = 0.04;

/// Ratio of the mean squared errors at rest and in motion above which rows at rest are excluded.
const WORSE_AT_REST: f64 = 1.0;

/// Column that a cause follows which may follow any, and how it follows it.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowedColumn {
    /// Name of the column.
    pub column: String,
    /// Index among the log's extra covariates, if it is one.
    pub covariate: Option<usize>,
    /// True for a share of the friction level; false for a separate torque.
    pub level: bool,
    /// True for a separate torque proportional to the column, as for a gain error.
    pub proportional: bool,
    /// Formula of the level over the column, if it follows one.
    pub formula: LookupFormula,
}

/// The log of a diagnosis. Excluding rows or following a column creates another value.
#[derive(Clone, Debug)]
pub struct TrainTest {
    /// Training runs.
    pub train: Arc<Dataset>,
    /// Held-out runs.
    pub test: Arc<Dataset>,
    /// Tracks of `train`.
    pub train_tracks: Vec<Track>,
    /// Tracks of `test`.
    pub test_tracks: Vec<Track>,
    /// Decimation: one residual in this many is kept, after an anti-alias filter.
    pub decimate: usize,
    /// Parts of the torque column that are not friction.
    pub rigid_body: Vec<TermKind>,
    /// Extra covariates that may be a cause, as indices of [`extra`](joint_log::Run::extra).
    pub extras: Vec<usize>,
    /// Start of the campaign's clock, s.
    pub campaign_start_s: f64,
    /// Notes on the log, one sentence each.
    pub notes: Vec<String>,
    /// True if no run is set apart and each run is evaluated with a fit to the others.
    pub leaves_each_out: bool,
    /// Noise floor on the training rows: the error of the best possible model, Nm RMS.
    pub floor_nm: f64,
    /// Order of the ripple to whose phase the runs were shifted, if any (`unknown_zero`).
    pub aligned_order: Option<u32>,
}

/// Rows at rest that are excluded from the evaluation.
#[derive(Clone, Debug)]
pub struct AtRest {
    /// Speed below which a joint is at rest, rad/s.
    slowest: f64,
    /// Number of training rows at rest.
    rows: usize,
}

impl TrainTest {
    /// Creates the log from a data set and its split.
    pub fn new(data: &Dataset, split: &Split, decimate: usize, rigid_body: &[TermKind]) -> Self {
        let (train, test) = (data.select(&split.train), data.select(&split.test));
        let decimate = decimate.max(1);
        let campaign_start_s = campaign_start(data);
        let tracks = |data: &Dataset| tracks_since(data, None, campaign_start_s);
        let train_tracks = tracks(&train);
        let mut log = Self {
            leaves_each_out: split.is_leave_one_run_out(),
            floor_nm: noise_floor(&train_tracks, decimate),
            test_tracks: tracks(&test),
            train_tracks,
            train: Arc::new(train),
            test: Arc::new(test),
            decimate,
            rigid_body: rigid_body.to_vec(),
            extras: Vec::new(),
            campaign_start_s,
            notes: Vec::new(),
            aligned_order: None,
        };
        // Held-out runs also heat the runs after them, so that both sets share one record. If each
        // run is held out once, both sets contain all runs, and each set has its own record. A
        // common record would then contain every run twice.
        if !log.leaves_each_out {
            record_earlier_stretches(log.train_tracks.iter_mut().chain(&mut log.test_tracks));
        }
        log.choose_extras();
        log
    }

    /// Returns the log with this low-pass in the torque channel.
    #[must_use]
    pub fn through_low_pass(mut self, low_pass: TorqueLowPass) -> Self {
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            track.torque_low_pass = low_pass;
        }
        self
    }

    /// Returns the log with the velocity and acceleration of `delay_s` later in each row.
    #[must_use]
    pub fn with_later_velocity(mut self, delay_s: f64) -> Self {
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            track.shift_velocity(delay_s);
        }
        self
    }

    /// Returns the log with the other sign of the torque.
    #[must_use]
    pub fn with_reversed_torque(mut self) -> Self {
        let reverse = |torque: &mut Vec<f64>| torque.iter_mut().for_each(|value| *value = -*value);
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            reverse(&mut track.torque);
        }
        for data in [&mut self.train, &mut self.test] {
            Arc::make_mut(data).runs.iter_mut().for_each(|run| reverse(&mut run.torque));
        }
        self
    }

    /// Returns the log without the share of a channel in its torque.
    #[must_use]
    pub fn without_share(mut self, share: &ChannelGain) -> Self {
        let of = |data: &Dataset, run: usize| -> Vec<f64> {
            let values = data.column(&data.runs[run], &share.column).unwrap_or_default();
            values.iter().map(|value| share.gain * (value - share.mean)).collect()
        };
        let remove = |torque: &mut [f64], part: &[f64]| {
            torque.iter_mut().zip(part).for_each(|(torque, part)| *torque -= part);
        };
        for (data, tracks) in
            [(&mut self.train, &mut self.train_tracks), (&mut self.test, &mut self.test_tracks)]
        {
            let parts: Vec<Vec<f64>> = (0..data.runs.len()).map(|run| of(data, run)).collect();
            for track in tracks.iter_mut() {
                let part = parts[track.run].get(track.first_row..).unwrap_or_default();
                remove(&mut track.torque, part);
            }
            let runs = &mut Arc::make_mut(data).runs;
            runs.iter_mut().zip(&parts).for_each(|(run, part)| remove(&mut run.torque, part));
        }
        self
    }

    /// Returns the log with its noise floor recomputed, after its rows have been weighted.
    #[must_use]
    pub fn with_floor(mut self) -> Self {
        self.floor_nm = noise_floor(&self.train_tracks, self.decimate);
        self
    }

    /// Returns the part of a sum of squared errors on the training rows above the noise floor,
    /// Nm^2.
    pub fn beyond_floor(&self, sse: f64) -> f64 {
        let rows = self.weight();
        // The floor is an estimate, so that at least a hundredth of the error remains.
        (sse - rows * self.floor_nm * self.floor_nm).max(0.01 * sse)
    }

    /// Returns the sum of the weights of the training rows.
    fn weight(&self) -> f64 {
        let weights = |track: &Track| (0..track.len()).map(|row| track.weight(row)).sum::<f64>();
        self.train_tracks.iter().map(weights).sum::<f64>() / self.decimate as f64
    }

    /// Returns true if a run has a position column.
    pub fn has_position(&self) -> bool {
        self.train.runs.iter().any(|run| run.get(Quantity::Position).is_some())
    }

    /// Returns the smallest change of the position between two rows, rad: the step of its encoder, or 0 without a position.
    pub fn position_step(&self) -> f64 {
        let positions = self.train.runs.iter().filter_map(|run| run.get(Quantity::Position));
        let steps = positions.flat_map(|column| column.windows(2).map(|w| (w[1] - w[0]).abs()));
        let least = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 0.0 }
    }

    /// Returns the log for a model that follows this column. An extra covariate becomes the
    /// auxiliary column.
    pub fn following(&self, follows: Option<&FollowedColumn>) -> Cow<'_, Self> {
        let Some(follows) = follows.filter(|follows| follows.covariate.is_some()) else {
            return Cow::Borrowed(self);
        };
        let index = self.train.covariates.iter().position(|name| *name == follows.column);
        let tracks = |tracks: &[Track]| tracks.iter().map(|track| track.following(index)).collect();
        Cow::Owned(Self {
            train: Arc::clone(&self.train),
            test: Arc::clone(&self.test),
            train_tracks: tracks(&self.train_tracks),
            test_tracks: tracks(&self.test_tracks),
            rigid_body: self.rigid_body.clone(),
            extras: self.extras.clone(),
            notes: self.notes.clone(),
            leaves_each_out: self.leaves_each_out,
            ..*self
        })
    }

    /// Returns the rows at rest if a law is less accurate there than in motion.
    ///
    /// A joint at rest holds a torque that depends on its past. A law without bristles does not
    /// predict it, and a law with bristles predicts it from the angle only. `errors` returns the
    /// law's errors on the included training rows.
    pub fn worse_at_rest(&self, errors: impl Fn(&Self) -> Metrics) -> Option<AtRest> {
        let slowest = REST * Scales::of(&self.train_tracks).speed;
        let [moving, all] = [errors(&self.clone().excluding(slowest)), errors(self)];
        let rows = all.rows.saturating_sub(moving.rows);
        let at_rest = (all.sse - moving.sse) / rows.max(1) as f64;
        let in_motion = moving.sse / moving.rows.max(1) as f64;
        (rows > 0 && at_rest >= WORSE_AT_REST * in_motion).then_some(AtRest { slowest, rows })
    }

    /// Returns the log without the rows at rest, with a note on them.
    #[must_use]
    pub fn without(self, at_rest: &AtRest) -> Self {
        let mut log = self.excluding(at_rest.slowest);
        log.notes.push(format!(
            "{} rows at rest are not evaluated: a joint at rest may hold any torque up to its stiction, and this log's motion \
             does not determine which",
            at_rest.rows
        ));
        log
    }

    /// Returns the log with the rows in motion only. At rest, the direction of the velocity is noise, and a law of the direction
    /// alone errs.
    #[must_use]
    pub fn of_motion(&self) -> Self {
        let slowest = REST * Scales::of(&self.train_tracks).speed;
        self.clone().excluding(slowest)
    }

    fn excluding(mut self, slowest: f64) -> Self {
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            let moves: Vec<bool> =
                track.samples.iter().map(|s| s.velocity_rad_s.abs() >= slowest).collect();
            track.scale_weights(|row| f64::from(u8::from(moves[row])));
        }
        self
    }

    /// Returns the training rows.
    pub fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train_tracks, decimate: self.decimate }
    }

    /// Returns the held-out rows.
    pub fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test_tracks, decimate: self.decimate }
    }

    /// Returns true if a run has a column with this name, also if it is constant.
    pub fn has_column(&self, name: &str) -> bool {
        self.train.runs.iter().any(|run| self.train.column(run, name).is_some())
    }

    /// Returns the rows that models are compared on: the held-out ones, or all where each is left out once.
    pub fn judged_rows(&self) -> Rows<'_> {
        if self.leaves_each_out { self.train_rows() } else { self.test_rows() }
    }

    /// Returns true if the runs have a column with this name and it is not constant.
    pub fn varies(&self, name: &str) -> bool {
        let column = |run| self.train.column(run, name).unwrap_or_default();
        let mut values = self.train.runs.iter().flat_map(column).copied();
        let Some(first) = values.next() else { return false };
        values.any(|value| value != first)
    }

    /// Returns true if time continues from run to run.
    pub fn has_campaign_clock(&self) -> bool {
        let apart = self.test.runs.iter().filter(|_| !self.leaves_each_out);
        has_campaign_clock(self.train.runs.iter().chain(apart))
    }

    /// Returns the name of the position column, for findings.
    pub fn position_name(&self) -> &'static str {
        Quantity::Position.name(self.train.joint)
    }

    /// Returns the name of the velocity column, for findings.
    pub fn velocity_name(&self) -> &'static str {
        Quantity::Velocity.name(self.train.joint)
    }

    /// Returns the mean temperature over the training rows, deg C.
    pub fn mean_temperature_c(&self) -> f64 {
        let samples = || self.train_tracks.iter().flat_map(|track| &track.samples);
        let rows = samples().count().max(1) as f64;
        samples().map(|sample| sample.temperature_c).sum::<f64>() / rows
    }

    /// Returns the time from the start of the campaign to its last row, s.
    pub fn campaign_s(&self) -> f64 {
        let runs = self.train.runs.iter().chain(&self.test.runs);
        let ends = runs.flat_map(|run| run.time_s.last()).copied();
        (ends.fold(f64::NEG_INFINITY, f64::max) - self.campaign_start_s).max(1e-9)
    }

    /// Chooses the covariates that may be a cause, and adds a note on each that is excluded.
    fn choose_extras(&mut self) {
        let data = &self.train;
        let known = || {
            let quantities = contract::covariates().chain([Quantity::Velocity, Quantity::Position]);
            quantities.map(|quantity| quantity.name(data.joint))
        };
        for (index, name) in data.covariates.iter().enumerate() {
            if contract::is_joint_position(name) || !self.varies(name) {
                continue;
            }
            let likeness = TorqueLikeness::new(data, name);
            if likeness.is_reading_of_torque() {
                self.notes.push(format!(
                    "{name} follows the torque itself (correlation {:.3}, of its differences {:.3}): it is another reading of \
                     the torque and is not used as a covariate",
                    likeness.of_values, likeness.of_steps
                ));
            } else if let Some(known) = known().find(|other| is_same_column(data, name, other)) {
                self.notes.push(format!("{name} is {known} under another name and is left out"));
            } else {
                self.extras.push(index);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_log::{BadRows, JointKind, Part, Run};

    /// Returns runs of ten seconds, a minute apart, on one clock.
    fn campaign(runs: usize) -> Dataset {
        let run = |index: usize| Run {
            name: index.to_string(),
            time_s: (0..1000).map(|row| 60.0 * index as f64 + 0.01 * f64::from(row)).collect(),
            velocity: vec![2.0; 1000],
            torque: vec![1.5; 1000],
            ..Run::default()
        };
        Dataset {
            joint: JointKind::Revolute,
            runs: (0..runs).map(run).collect(),
            files: vec![],
            rows: 1000 * runs,
            rows_read: 1000 * runs,
            bad_rows: BadRows::default(),
            covariates: vec![],
            left_out_columns: vec![],
            notes: vec![],
            torque_law: None,
            torque_constant: None,
            sources: vec![],
        }
    }

    #[test]
    fn new_with_any_split_records_earlier_stretches() {
        let data = campaign(4);
        let part = |run: usize| Part { run, rows: 0..1000 };
        let all: Vec<Part> = (0..4).map(part).collect();
        let each_once = Split { train: all.clone(), test: all };
        let apart = Split { train: vec![part(0), part(1), part(3)], test: vec![part(2)] };
        let before = |split: &Split| -> Vec<usize> {
            let log = TrainTest::new(&data, split, 1, &[]);
            log.train_tracks.iter().map(|track| track.earlier_stretches.len()).collect()
        };
        assert_eq!(before(&each_once), [0, 1, 2, 3]);
        assert_eq!(before(&apart), [0, 1, 3]);
    }
}
