//! The log as the diagnosis looks at it: runs to learn from, runs to judge by, and the columns that
//! may be blamed.
//!
//! A column can explain a residual without being a cause of it: a motor current *is* the torque in other
//! units, and knows of every error the model makes. Such columns are kept out, and named. What tells
//! them is that they follow the torque from sample to sample, which pressure or temperature cannot.

use super::judge::noise_floor;
use crate::data::{Dataset, Quantity, Run, Split, contract};
use crate::fit::channel::TorqueLowPass;
use crate::fit::scales::Scales;
use crate::fit::{Rows, Track, track, warmth};
use compensator_core::TermKind;
use compensator_core::term::LookupFormula;
use std::borrow::Cow;
use std::sync::Arc;

/// A column whose steps from sample to sample correlate with the torque's by more than this is
/// taken for another reading of the torque.
const SAME_STEPS: f64 = 0.5;

/// Likewise for the values themselves.
const SAME_VALUES: f64 = 0.95;

/// Two columns this much alike are one column under two names.
const SAME_COLUMN: f64 = 0.9999;

/// Share of the 95th percentile of the speed below which a joint rests.
const REST: f64 = 0.04;

/// Rows at rest are left out where their mean squared error is more than so many times that in motion.
const WORSE_AT_REST: f64 = 1.0;

/// Training rows a search through all causes looks at, at most, if there are runs enough to choose from.
const MOST_SEARCHED: usize = 150_000;

/// Runs a search looks at at least.
const FEWEST_RUNS: usize = 12;

/// A column with less than this share of its variance within runs is constant in each of them.
const CONSTANT: f64 = 0.05;

/// So many runs can show whether a column that is constant in each of them extrapolates.
const MANY_RUNS: usize = 8;

/// The column a cause that may follow any has followed, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Follows {
    /// Name of the column.
    pub column: String,
    /// Whether it is one of the log's extra covariates.
    pub extra: bool,
    /// A share of the friction level; else a torque of its own.
    pub level: bool,
    /// A torque of its own, proportional to the column: a gain that is off.
    pub proportional: bool,
    /// The level's formula over the column, if it follows one.
    pub formula: LookupFormula,
}

impl Follows {
    /// Whether it is a curve of any shape, which comes after named causes.
    pub fn is_any_shape(&self) -> bool {
        !self.proportional && self.formula == LookupFormula::None
    }
}

/// What is diagnosed. A value: what is left out or followed makes another one.
#[derive(Clone, Debug)]
pub struct TrainTest {
    /// Runs to fit on.
    pub train: Arc<Dataset>,
    /// Runs no fit sees.
    pub test: Arc<Dataset>,
    /// Tracks of `train`.
    pub train_tracks: Vec<Track>,
    /// Tracks of `test`.
    pub test_tracks: Vec<Track>,
    /// Keep one residual in this many, anti-aliased.
    pub decimate: usize,
    /// Parts of the torque column that are not friction.
    pub rigid_body: Vec<TermKind>,
    /// Extra covariates that may be blamed, as indices of [`Run::extra`].
    pub extras: Vec<usize>,
    /// Where the campaign's clock begins, s.
    pub campaign_start_s: f64,
    /// What a careful reader should know, a sentence each.
    pub notes: Vec<String>,
    /// Whether nothing is set apart, and each run is judged by a fit on the others.
    pub leaves_each_out: bool,
    /// Error the best possible model would make on the training rows, Nm RMS.
    pub floor_nm: f64,
    /// Where runs were shifted to a common phase of a ripple, its order ([`super::unknown_zero`]).
    pub aligned_order: Option<u32>,
}

/// Rows at rest that do not count.
#[derive(Clone, Debug)]
pub struct AtRest {
    /// Speed below which a joint rests, rad/s.
    slowest: f64,
    /// How many training rows that is.
    rows: usize,
}

impl TrainTest {
    /// Cuts a data set as `split` says.
    pub fn new(data: &Dataset, split: &Split, decimate: usize, rigid_body: &[TermKind]) -> Self {
        let (train, test) = (data.select(&split.train), data.select(&split.test));
        let decimate = decimate.max(1);
        let campaign_start_s = track::campaign_start(data);
        let tracks = |data: &Dataset| track::tracks_since(data, None, campaign_start_s);
        let train_tracks = tracks(&train);
        let mut log = Self {
            leaves_each_out: split.leaves_each_out(),
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
        // What the runs left out rubbed warms those that come after them. Where each run is left out once, both are all
        // runs, and know it of themselves; together each would lie over itself, and no clock would be common.
        if !log.leaves_each_out {
            warmth::remember(log.train_tracks.iter_mut().chain(&mut log.test_tracks));
        }
        (log.extras, log.notes) = log.choose_extras();
        log
    }

    /// The log with a torque that went through this low-pass.
    #[must_use]
    pub fn through_low_pass(mut self, low_pass: TorqueLowPass) -> Self {
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            track.torque_low_pass = low_pass;
        }
        self
    }

    /// The log with the velocity and acceleration of so much later in each row, s.
    #[must_use]
    pub fn with_later_velocity(mut self, delay_s: f64) -> Self {
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            track.take_velocity_later(delay_s);
        }
        self
    }

    /// The log with its floor found anew, after rows have been weighed.
    #[must_use]
    pub fn with_floor(mut self) -> Self {
        self.floor_nm = noise_floor(&self.train_tracks, self.decimate);
        self
    }

    /// How far a sum of squared errors on the training rows is above what the best possible model would leave, Nm^2.
    pub fn beyond_floor(&self, sse: f64) -> f64 {
        let weights = |track: &Track| (0..track.len()).map(|row| track.weight(row)).sum::<f64>();
        let rows = self.train_tracks.iter().map(weights).sum::<f64>() / self.decimate as f64;
        // A floor is an estimate: what is left beside it is not counted as nothing.
        (sse - rows * self.floor_nm * self.floor_nm).max(0.01 * sse)
    }

    /// The same as a share of it, of a mean square on any rows of the log.
    pub fn share_beyond_floor(&self, mean_square: f64) -> f64 {
        (1.0 - self.floor_nm * self.floor_nm / mean_square.max(f64::MIN_POSITIVE)).max(0.01)
    }

    /// Whether one of these columns hardly changes within a run, and there are few runs: then leaving runs out
    /// asks what nobody can know.
    pub fn can_only_describe(&self, columns: &[String]) -> bool {
        let runs = &self.train.runs;
        let between = |name: &String| {
            let of = |run: &Run| self.train.column(run, name).map(<[f64]>::to_vec);
            let columns: Option<Vec<Vec<f64>>> = runs.iter().map(of).collect();
            columns.is_some_and(|columns| within_runs(&columns) < CONSTANT)
        };
        runs.len() < MANY_RUNS && columns.iter().any(between)
    }

    /// The log as a model sees it: with the covariate that one of its terms follows, if it follows one, as
    /// the auxiliary column.
    pub fn following(&self, follows: Option<&Follows>) -> Cow<'_, Self> {
        let Some(follows) = follows.filter(|follows| follows.extra) else {
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

    /// Rows at rest, where a law does worse there than in motion: at rest the joint holds whatever it was left with, of which
    /// a law without bristles knows nothing, and one with bristles only what the angle tells. `squares` gives the law's
    /// squared error on the training rows that count and their number.
    pub fn worse_at_rest(&self, squares: impl Fn(&Self) -> (f64, usize)) -> Option<AtRest> {
        let slowest = REST * Scales::of(&self.train_tracks).speed;
        let (moving, count) = squares(&self.clone().excluding(slowest));
        let (all, rows) = squares(self);
        let at_rest = (all - moving) / rows.saturating_sub(count).max(1) as f64;
        let as_good = rows == count || at_rest < WORSE_AT_REST * moving / count.max(1) as f64;
        (!as_good).then(|| AtRest { slowest, rows: rows - count })
    }

    /// Leaves rows at rest out of all judgement, and says so.
    #[must_use]
    pub fn without(self, at_rest: &AtRest) -> Self {
        let mut log = self.excluding(at_rest.slowest);
        log.notes.push(format!(
            "{} rows at rest are not judged: what a joint at rest holds, between nothing and all of its stiction, this log's \
             motion does not tell",
            at_rest.rows
        ));
        log
    }

    fn excluding(mut self, slowest: f64) -> Self {
        for track in self.train_tracks.iter_mut().chain(&mut self.test_tracks) {
            let moves: Vec<bool> =
                track.samples.iter().map(|s| s.velocity_rad_s.abs() >= slowest).collect();
            track.weigh(|row| f64::from(u8::from(moves[row])));
        }
        self
    }

    /// Only so many training runs, evenly spread, that a search through all causes stays short; what is
    /// found is fitted on all of them.
    pub fn thinned(&self) -> Cow<'_, Self> {
        let rows: usize = self.train_tracks.iter().map(Track::len).sum();
        let most = self.train.runs.len() / FEWEST_RUNS;
        let stride = rows.div_ceil(MOST_SEARCHED).min(most).max(1);
        if stride == 1 {
            return Cow::Borrowed(self);
        }
        let mut log = self.clone();
        log.train_tracks.retain(|track| track.run.is_multiple_of(stride));
        Cow::Owned(log)
    }

    /// Rows to fit on.
    pub fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train_tracks, decimate: self.decimate }
    }

    /// Rows to judge by.
    pub fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test_tracks, decimate: self.decimate }
    }

    /// Whether the runs have a column of the contract and it is not constant.
    pub fn varies(&self, name: &str) -> bool {
        let column = |run| self.train.column(run, name).unwrap_or_default();
        let mut values = self.train.runs.iter().flat_map(column).copied();
        let Some(first) = values.next() else { return false };
        values.any(|value| value != first)
    }

    /// Whether time goes on from run to run, as on a campaign's clock. Where every run begins at the same time
    /// nothing is known of what came before which.
    pub fn has_campaign_clock(&self) -> bool {
        let ends = |run: &Run| Some((*run.time_s.first()?, *run.time_s.last()?));
        let apart = self.test.runs.iter().filter(|_| !self.leaves_each_out);
        let mut runs: Vec<(f64, f64)> =
            self.train.runs.iter().chain(apart).filter_map(ends).collect();
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        runs.windows(2).all(|pair| pair[0].1 <= pair[1].0)
    }

    /// Name of the position column, for findings.
    pub fn position_name(&self) -> &'static str {
        Quantity::Position.name(self.train.joint)
    }

    /// Name of the velocity column, for findings.
    pub fn velocity_name(&self) -> &'static str {
        Quantity::Velocity.name(self.train.joint)
    }

    /// Mean temperature over the training rows, deg C.
    pub fn mean_temperature_c(&self) -> f64 {
        let samples = || self.train_tracks.iter().flat_map(|track| &track.samples);
        let rows = samples().count().max(1) as f64;
        samples().map(|sample| sample.temperature_c).sum::<f64>() / rows
    }

    /// Seconds from the first row of the campaign to its last.
    pub fn campaign_s(&self) -> f64 {
        let runs = self.train.runs.iter().chain(&self.test.runs);
        let ends = runs.flat_map(|run| run.time_s.last()).copied();
        (ends.fold(f64::NEG_INFINITY, f64::max) - self.campaign_start_s).max(1e-9)
    }

    /// The covariates that may be blamed, and why others may not.
    fn choose_extras(&self) -> (Vec<usize>, Vec<String>) {
        let known: Vec<&str> = contract::covariates()
            .chain([Quantity::Velocity, Quantity::Position])
            .map(|quantity| quantity.name(self.train.joint))
            .collect();
        let runs = &self.train.runs;
        let (mut extras, mut notes) = (Vec::new(), Vec::new());
        for (index, name) in self.train.covariates.iter().enumerate() {
            let of = |run: &Run| run.extra[index].clone();
            let torque = |run: &Run| run.torque.clone();
            if self.varies(name) {
                let steps = |run: &Run, column: &dyn Fn(&Run) -> Vec<f64>| -> Vec<f64> {
                    column(run).windows(2).map(|w| w[1] - w[0]).collect()
                };
                let alike = correlation(runs, of, torque).abs();
                let in_step =
                    correlation(runs, |run| steps(run, &of), |run| steps(run, &torque)).abs();
                if alike > SAME_VALUES || in_step > SAME_STEPS {
                    notes.push(format!(
                        "{name} follows the torque itself (correlation {alike:.3}, of its steps {in_step:.3}): it \
                         is another reading of it and is not blamed"
                    ));
                    continue;
                }
                let copy = |other: &str| {
                    let other = |run: &Run| self.train.column(run, other).map(<[f64]>::to_vec);
                    let has = runs.iter().all(|run| other(run).is_some());
                    has && correlation(runs, of, |run| other(run).unwrap_or_default()).abs()
                        > SAME_COLUMN
                };
                if let Some(known) = known.iter().find(|other| copy(other)) {
                    notes.push(format!("{name} is {known} under another name and is left out"));
                    continue;
                }
                extras.push(index);
            }
        }
        (extras, notes)
    }
}

/// Share of a column's variance that lies within runs.
fn within_runs(runs: &[Vec<f64>]) -> f64 {
    let (mut within, mut all) = (0.0, 0.0);
    let rows: usize = runs.iter().map(Vec::len).sum();
    let mean = runs.iter().flatten().sum::<f64>() / rows.max(1) as f64;
    for run in runs {
        let own = run.iter().sum::<f64>() / run.len().max(1) as f64;
        within += run.iter().map(|value| (value - own).powi(2)).sum::<f64>();
        all += run.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    }
    if all > 0.0 { within / all } else { 1.0 }
}

/// Correlation of two columns over all rows of all runs; 0 where one does not vary.
pub fn correlation(
    runs: &[Run],
    a: impl Fn(&Run) -> Vec<f64>,
    b: impl Fn(&Run) -> Vec<f64>,
) -> f64 {
    let (mut n, mut sum, mut squares, mut product) = (0.0, [0.0; 2], [0.0; 2], 0.0);
    // Shifted by the first value: the variance of a pressure of 1e5 must not drown in its square.
    let mut shift = None;
    for run in runs {
        for (x, y) in a(run).into_iter().zip(b(run)) {
            let (sx, sy) = *shift.get_or_insert((x, y));
            let (x, y) = (x - sx, y - sy);
            n += 1.0;
            sum[0] += x;
            sum[1] += y;
            squares[0] += x * x;
            squares[1] += y * y;
            product += x * y;
        }
    }
    let variance = |i: usize| squares[i] / n - (sum[i] / n) * (sum[i] / n);
    let covariance = product / n - sum[0] / n * (sum[1] / n);
    let spread = (variance(0) * variance(1)).sqrt();
    if n > 0.0 && spread > 0.0 { covariance / spread } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{BadRows, JointKind, Part};

    /// Runs of ten seconds, a minute apart, on one clock.
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
            sources: vec![],
        }
    }

    #[test]
    fn runs_remember_what_rubbed_before_them_whichever_way_they_are_judged() {
        let data = campaign(4);
        let part = |run: usize| Part { run, rows: 0..1000 };
        let all: Vec<Part> = (0..4).map(part).collect();
        let each_once = Split { train: all.clone(), test: all };
        let apart = Split { train: vec![part(0), part(1), part(3)], test: vec![part(2)] };
        let before = |split: &Split| -> Vec<usize> {
            let log = TrainTest::new(&data, split, 1, &[]);
            log.train_tracks.iter().map(|track| track.earlier.len()).collect()
        };
        assert_eq!(before(&each_once), [0, 1, 2, 3]);
        assert_eq!(before(&apart), [0, 1, 3]);
    }
}
