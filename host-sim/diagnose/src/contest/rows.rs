//! The rows of a log on which every hypothesis is judged: fixed before any model.
//!
//! Two hypotheses compare only on the same rows, weights, folds and target. [`Rows`] therefore holds all of them, and no
//! correction or law changes them: a correction changes the inputs of the model or filters the model's torque, never the
//! measured torque. A block is a stretch of time within a run, the unit of the bootstrap. A fold is a set of blocks that is
//! left out at once: whole runs if there are enough, else contiguous parts of runs, so that a column which is constant in
//! each run can still be judged.

use super::covariate::{Covariate, covariates};
use compensator_core::TermKind;
use friction_fit::linear::{Inputs, Motion, Regressor};
use friction_fit::{Track, white_noise};
use joint_log::statistics::{extent, quantile_by_count};
use joint_log::{Dataset, Quantity, segments};
use std::ops::{Deref, Range};

/// Fewest runs that are left out whole.
const MIN_RUNS_FOR_FOLDS: usize = 3;

/// Fewest runs that are left out whole if a covariate is constant in each of them.
const MIN_RUNS_OF_LEVELS: usize = 8;

/// Share of a covariate's variance within runs below which it is constant in each run.
pub(crate) const MAX_CONSTANT_SHARE: f64 = 0.05;

/// Number of folds, or of runs if there are fewer and each is left out whole.
const FOLDS: usize = 12;

/// Fewest blocks of a log.
const MIN_BLOCKS: usize = 60;

/// Most rows that are judged; of a longer log, one row in several.
const MOST_JUDGED: usize = 40_000;

/// Speed quantile that stands for the usual fast motion.
const TOP_SPEED: f64 = 0.95;

/// Rigid-body parts that the torque column holds besides friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RigidBody {
    /// Inertia times acceleration.
    pub inertia: bool,
    /// Sine and cosine of the position.
    pub gravity: bool,
    /// A gain on the load torque.
    pub load: bool,
    /// A constant.
    pub offset: bool,
}

impl RigidBody {
    /// Returns the parts among terms of the core.
    pub fn of(terms: &[TermKind]) -> Self {
        let has = |term| terms.contains(&term);
        Self {
            inertia: has(TermKind::UnmodelledInertia),
            gravity: has(TermKind::GravityImbalance),
            load: has(TermKind::LoadGain),
            offset: has(TermKind::TorqueOffset),
        }
    }

    /// Returns the parts as terms of the core.
    pub fn terms(self) -> Vec<TermKind> {
        let parts = [
            (self.inertia, TermKind::UnmodelledInertia),
            (self.gravity, TermKind::GravityImbalance),
            (self.load, TermKind::LoadGain),
            (self.offset, TermKind::TorqueOffset),
        ];
        parts.into_iter().filter(|(has, _)| *has).map(|(_, term)| term).collect()
    }
}

/// A log in long columns, with what every hypothesis shares. Units are those of the log; a linear joint has N for Nm.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Time and motion.
    pub motion: Motion,
    /// Rigid-body parts of the base law.
    pub rigid_body: RigidBody,
    /// Measured torque: the target.
    pub torque: Vec<f64>,
    /// Other columns that may explain the torque.
    pub covariates: Vec<Covariate>,
    /// Usual high speed: the 95th percentile.
    pub top_speed: f64,
    /// Least displacement between rows in motion.
    pub least_step: f64,
    /// Median over the runs of the range of positions.
    pub swing: f64,
    /// Range of the positions of all runs.
    pub span: f64,
    /// Weight of each row.
    pub weights: Vec<f64>,
    /// Judged rows, in order.
    pub judged: Vec<usize>,
    /// Number of rows whose mean is judged at once, from each judged row on.
    pub averaged: usize,
    /// Blocks, as ranges of `judged`.
    pub blocks: Vec<Range<usize>>,
    /// Run of each block.
    pub run_of_block: Vec<usize>,
    /// Fold of each block.
    pub fold_of_block: Vec<usize>,
    /// Error that the torque's noise alone leaves on the judged rows.
    pub noise_floor: f64,
    /// True if the sign of the logged torque was reversed.
    pub is_reversed: bool,
    /// The unbroken stretches of the runs, for a simulation.
    pub tracks: Vec<Track>,
}

impl Rows {
    /// Collects the rows of a log. `decimate` is the number of rows that are averaged to one.
    pub fn new(data: &Dataset, rigid_body: RigidBody, decimate: usize) -> Self {
        let motion = Motion::new(data);
        let Motion { velocity, position, runs, .. } = &motion;
        let of_runs = data.runs.iter();
        let weights = of_runs
            .clone()
            .flat_map(|run| (0..run.len()).map(|row| f64::from(u8::from(!run.is_spike(row)))));
        let mut rows = Self {
            rigid_body,
            torque: of_runs.flat_map(|run| run.torque.iter().copied()).collect(),
            covariates: covariates(data),
            top_speed: quantile_by_count(velocity.iter().map(|v| v.abs()).collect(), TOP_SPEED)
                .unwrap_or_default()
                .max(1e-12),
            least_step: least_step(position, runs),
            swing: swing(position, runs),
            span: range(position),
            weights: weights.collect(),
            judged: Vec::new(),
            averaged: decimate.max(1),
            blocks: Vec::new(),
            run_of_block: Vec::new(),
            fold_of_block: Vec::new(),
            noise_floor: noise(data, decimate.max(1)),
            is_reversed: false,
            tracks: friction_fit::tracks(data),
            motion,
        };
        rows.divide();
        rows
    }

    /// Divides the rows into blocks and folds.
    fn divide(&mut self) {
        let count = self.runs.len().max(1);
        let stride =
            (self.time_s.len() / self.averaged).div_ceil(MOST_JUDGED).max(1) * self.averaged;
        let is_level =
            |covariate: &Covariate| within_runs(&covariate.scaled, &self.runs) < MAX_CONSTANT_SHARE;
        let has_levels = self.covariates.iter().any(is_level);
        let fewest = if has_levels { MIN_RUNS_OF_LEVELS } else { MIN_RUNS_FOR_FOLDS };
        let whole = count >= fewest;
        let parts = if whole { 1 } else { FOLDS.div_ceil(count) };
        let blocks = parts * MIN_BLOCKS.div_ceil(count * parts);
        for (run, range) in self.motion.runs.iter().enumerate() {
            let first = self.judged.len();
            let last = (range.end + 1).saturating_sub(self.averaged);
            self.judged
                .extend((range.start..last.max(range.start + 1).min(range.end)).step_by(stride));
            let judged = self.judged.len() - first;
            for block in 0..blocks {
                let edge = |block: usize| first + block * judged / blocks;
                if edge(block + 1) > edge(block) {
                    self.blocks.push(edge(block)..edge(block + 1));
                    self.run_of_block.push(run);
                    let fold =
                        if whole { run % FOLDS } else { run * parts + block * parts / blocks };
                    self.fold_of_block.push(fold);
                }
            }
        }
    }

    /// Returns the row at which a track begins.
    pub fn first_row(&self, track: &Track) -> usize {
        self.runs[track.run].start + track.first_row
    }

    /// Returns a column in all rows from its values along tracks; 0 in rows of no track.
    pub(crate) fn along_tracks<'a>(
        &self,
        tracks: impl Iterator<Item = (&'a Track, &'a [f64])>,
    ) -> Vec<f64> {
        let mut column = vec![0.0; self.len()];
        for (track, values) in tracks {
            let first = self.first_row(track);
            column[first..first + values.len()].copy_from_slice(values);
        }
        column
    }

    /// Reverses the sign of the torque.
    pub fn reverse_torque(&mut self) {
        self.is_reversed = !self.is_reversed;
        self.torque.iter_mut().for_each(|torque| *torque = -*torque);
    }

    /// Returns the number of folds.
    pub fn fold_count(&self) -> usize {
        self.fold_of_block.iter().max().map_or(0, |most| most + 1)
    }

    /// Returns the value of a column that is judged from this row on.
    pub fn judged_value(&self, column: &[f64], row: usize) -> f64 {
        if self.averaged == 1 {
            return column[row];
        }
        let values = &column[row..(row + self.averaged).min(column.len())];
        values.iter().sum::<f64>() / values.len() as f64
    }

    /// Returns the rows of some judged ones, if each of them is judged by itself and none is left out between them.
    pub fn judged_range(&self, judged: Range<usize>) -> Option<Range<usize>> {
        let rows = &self.judged[judged];
        let (first, last) = (*rows.first()?, *rows.last()?);
        (self.averaged == 1 && last - first + 1 == rows.len()).then_some(first..last + 1)
    }

    /// Returns a function of each row's index.
    pub fn map(&self, of: impl FnMut(usize) -> f64) -> Vec<f64> {
        (0..self.len()).map(of).collect()
    }

    /// Returns a covariate by its quantity.
    pub fn quantity(&self, quantity: Quantity) -> Option<&Covariate> {
        self.covariates.iter().find(|covariate| covariate.quantity == Some(quantity))
    }

    /// Returns the values of a covariate by its name.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        let found = self.covariates.iter().find(|covariate| covariate.name == name)?;
        Some(&found.values)
    }

    /// Returns the values of a regressor in all rows, for a friction level; `None` if the log lacks one of its columns.
    pub(crate) fn values(&self, regressor: &Regressor, level: &[f64]) -> Option<Vec<f64>> {
        let find = |name: &str| self.column(name);
        regressor.values(&Inputs { motion: &self.motion, level, column: &find })
    }

    /// Returns what columns with these coefficients leave of the torque, in all rows.
    pub(crate) fn residual(&self, columns: &[impl AsRef<[f64]>], sizes: &[f64]) -> Vec<f64> {
        let model = |row: usize| -> f64 {
            columns.iter().zip(sizes).map(|(column, size)| column.as_ref()[row] * size).sum()
        };
        self.map(|row| self.torque[row] - model(row))
    }

    /// Returns the sum of the squared weights of the judged rows.
    pub fn weight(&self) -> f64 {
        self.judged.iter().map(|row| self.weights[*row].powi(2)).sum()
    }
}

impl Deref for Rows {
    type Target = Motion;

    fn deref(&self) -> &Motion {
        &self.motion
    }
}

/// Returns the share of the variance of a column of variance one that lies within runs.
pub(crate) fn within_runs(scaled: &[f64], runs: &[Range<usize>]) -> f64 {
    let within = |run: &Range<usize>| {
        let values = &scaled[run.clone()];
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
    };
    runs.iter().map(within).sum::<f64>() / scaled.len().max(1) as f64
}

fn least_step(position: &[f64], runs: &[Range<usize>]) -> f64 {
    let steps =
        runs.iter().flat_map(|run| position[run.clone()].windows(2).map(|w| (w[1] - w[0]).abs()));
    quantile_by_count(steps.filter(|step| *step > 0.0).collect(), 0.2)
        .unwrap_or_default()
        .max(1e-12)
}

fn swing(position: &[f64], runs: &[Range<usize>]) -> f64 {
    quantile_by_count(runs.iter().map(|run| range(&position[run.clone()])).collect(), 0.5)
        .unwrap_or_default()
        .max(1e-12)
}

fn range(values: &[f64]) -> f64 {
    let [low, high] = extent(values.iter().copied());
    (high - low).max(1e-12)
}

/// Returns the noise of the torque after an average of some rows, from its second differences.
fn noise(data: &Dataset, averaged: usize) -> f64 {
    let mean = |values: &[f64]| {
        values.chunks(averaged).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect()
    };
    let stretches: Vec<Vec<f64>> = data
        .runs
        .iter()
        .flat_map(|run| segments(run).into_iter().map(|rows| mean(&run.torque[rows])))
        .collect();
    white_noise(stretches.iter().map(Vec::as_slice)).max(1e-12)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A log of twelve runs: Coulomb and viscous friction with pressure, and noise.
    pub(crate) fn example() -> Rows {
        let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad", "pressure_diff_pa"]
            .map(String::from);
        let run = |index: usize| {
            let pressure = 1e5 * (index % 5) as f64;
            let row = |row: usize| {
                let angle = 0.02 * row as f64 + index as f64;
                let noise = 0.04 * ((row * 7919 % 1000) as f64 / 1000.0 - 0.5);
                let velocity = angle.sin();
                let torque = (1.0 + 1e-6 * pressure) * velocity.signum() + 0.3 * velocity + noise;
                [
                    0.01 * row as f64 + 10.0 * index as f64,
                    velocity,
                    torque,
                    -0.5 * angle.cos(),
                    pressure,
                ]
            };
            (
                format!("run {index}"),
                (0..5).map(|c| (0..600).map(|r| row(r)[c]).collect()).collect(),
            )
        };
        let data = Dataset::from_columns(&names, (0..12).map(run)).unwrap();
        Rows::new(&data, RigidBody::default(), 1)
    }

    #[test]
    fn new_with_many_runs_leaves_out_whole_runs() {
        let rows = example();
        assert_eq!(rows.fold_count(), 12);
        assert_eq!(rows.blocks.len(), 60);
        assert_eq!(rows.judged.len(), 7200);
        assert!(rows.run_of_block.iter().zip(&rows.fold_of_block).all(|(run, fold)| run == fold));
        assert!(rows.has_campaign_clock);
    }

    #[test]
    fn judged_value_of_averaged_rows_is_their_mean() {
        let rows = Rows { averaged: 4, ..example() };
        let column: Vec<f64> = (0..rows.len()).map(|row| row as f64).collect();
        assert_eq!(rows.judged_value(&column, 8), 9.5);
    }
}
